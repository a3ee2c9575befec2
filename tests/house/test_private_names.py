# SPDX-License-Identifier: Apache-2.0
"""No file uses a private name of another file: `from x import _y`, `x._y`, or object.__setattr__ on another's object."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted(
    path
    for folder in ("lgvi_warp", "kernels", "tests", "benchmarks", "examples")
    for path in (ROOT / folder).rglob("*.py")
)

# Private names of other libraries that a file of ours has as well.
FOREIGN = {("named.py", "_histogram")}


def is_private(name: str) -> bool:
    """One that begins with an underscore, but for those that other programs ask for: __len__, _repr_html_."""
    return name.startswith("_") and not name.startswith("__") and not name.endswith("_")


def own_names(nodes: list[ast.AST]) -> set[str]:
    """Private names that a file defines: functions, classes, variables, attributes and fields."""
    names = set()
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.attr)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):  # object.__setattr__(self, "_name", value)
            names.add(node.value)
    return {name for name in names if is_private(name)}


def sets_an_attribute(node: ast.AST) -> bool:
    """Whether it is a call of object.__setattr__."""
    named = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "__setattr__"
    return named and ast.unparse(node.func) == "object.__setattr__"


def is_private_attribute(node: ast.AST) -> bool:
    """Whether it is the private attribute of an object."""
    return isinstance(node, ast.Attribute) and is_private(node.attr)


def taken(nodes: list[ast.AST], local: set[str], others: set[str]) -> list[str]:
    """Uses of private names that another file defines and this one does not."""
    attributes = [node for node in nodes if is_private_attribute(node)]
    of_self = {node.attr for node in attributes if ast.unparse(node.value) == "self"}
    uses = [f"{node.lineno}: {ast.unparse(node)}" for node in attributes if node.attr in others - local]
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            uses += [f"{node.lineno}: import {alias.name}" for alias in node.names if is_private(alias.name)]
        elif sets_an_attribute(node):
            target, name = ast.unparse(node.args[0]), ast.unparse(node.args[1]).strip("'")
            if is_private(name) and target != "self" and name not in of_self:
                uses.append(f"{node.lineno}: {target}.{name}")
    return uses


def test_the_check_finds_each_form():
    code = "from a import _b\nc._d\nc._e\nc._f = 1\nc._f\nobject.__setattr__(c, '_g', 1)\nobject.__setattr__(self, '_h', 1)"
    nodes = list(ast.walk(ast.parse(code)))
    assert own_names(nodes) == {"_f", "_g", "_h"}
    assert taken(nodes, own_names(nodes), {"_d", "_f"}) == ["2: c._d", "1: import _b", "6: c._g"]


@pytest.fixture(scope="module")
def read() -> dict[Path, tuple[set[str], list[ast.AST]]]:
    """Each file's own private names, and where it may use some; whole trees would fill the memory."""
    files = {}
    for path in FILES:
        nodes = list(ast.walk(ast.parse(path.read_text())))
        uses = (is_private_attribute, sets_an_attribute, lambda node: isinstance(node, ast.ImportFrom))
        files[path] = own_names(nodes), [node for node in nodes if any(use(node) for use in uses)]
    return files


@pytest.mark.ci
def test_no_private_name_is_used_across_files(read):
    everywhere = set().union(*(own for own, _ in read.values()))
    found = []
    for path, (own, nodes) in read.items():
        known = own | {name for file, name in FOREIGN if file == path.name}
        found += [f"{path.relative_to(ROOT)}:{use}" for use in taken(nodes, known, everywhere)]
    assert not found, "\n".join(found)
