# SPDX-License-Identifier: Apache-2.0
"""The graph of imports, read from the source: `python -m tests.house.graph` prints rooms, circles and lazy imports.

An import is read as "top" (made when its module is), "lazy" (inside a function) or "typing" (under `if TYPE_CHECKING:`).
"""

import ast
import functools
import graphlib
import sys
import tomllib
from collections import Counter, defaultdict
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
SOURCE_ROOTS = {"lgvi_warp": ROOT, "lgvi_kernels": ROOT / "kernels"}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
# The lowest first; those of one floor side by side: the contract of the linter is the only list of rooms.
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
ROOMS = tuple(
    tuple(name.removeprefix("lgvi_warp.") for name in floor.split(" | ")) for floor in reversed(CONTRACTS[0]["layers"])
)


class Import(NamedTuple):
    """One imported name: `lgvi_warp.common.machine` for `from lgvi_warp.common import machine`; kind: top, lazy or typing."""

    name: str
    kind: str


def is_type_checking(node):
    """Whether the node is `if TYPE_CHECKING:`, which never runs."""
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


def names(node, package):
    """Absolute names that an import statement asks for."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
    return [".".join([*base, *filter(None, [node.module]), alias.name]) for alias in node.names]


def imports(node, package="", kind="top"):
    """Every Import below a node."""
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        return [Import(name, kind) for name in names(node, package)]
    if is_type_checking(node):
        typing = [found for child in node.body for found in imports(child, package, "typing")]
        return typing + [found for child in node.orelse for found in imports(child, package, kind)]
    below = "lazy" if isinstance(node, FUNCTIONS) and kind == "top" else kind
    return [found for child in ast.iter_child_nodes(node) for found in imports(child, package, below)]


@functools.cache
def modules():
    """{module name: its imports} of both packages."""
    found = {}
    for package, root in SOURCE_ROOTS.items():
        for path in sorted((root / package).rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            own = parts[:-1] if parts[-1] == "__init__" else parts
            found[".".join(own)] = imports(ast.parse(path.read_text()), ".".join(parts[:-1]))
    return found


def module_of(name):
    """The module that an imported name is, or lies in; None for a foreign one."""
    while name and name not in modules():
        name = name.rpartition(".")[0]
    return name or None


def graph(*kinds):
    """{module: the modules that it imports} by imports of these kinds. The face of the package names everything: left out."""
    return {
        module: {module_of(found.name) for found in all_of_it if found.kind in kinds} - {None, module, "lgvi_warp"}
        for module, all_of_it in modules().items()
        if module != "lgvi_warp"
    }


def circle(*kinds):
    """A circle of modules by imports of these kinds; None if there is none."""
    try:
        tuple(graphlib.TopologicalSorter(graph(*kinds)).static_order())
    except graphlib.CycleError as error:
        return error.args[1]
    return None


def room(module):
    """The number of a module's floor; None outside of the rooms."""
    name = module.split(".")[1] if module.startswith("lgvi_warp.") else None
    return next((floor for floor, rooms in enumerate(ROOMS) if name in rooms), None)


def arrows_up():
    """(module, imported module) that look up, all kinds counted."""
    arrows = ((one, other) for one, others in graph("top", "lazy", "typing").items() for other in others)
    return [arrow for arrow in arrows if None not in map(room, arrow) and room(arrow[0]) < room(arrow[1])]


def circles_of_folders():
    """{room: a circle of its inner folders by any import}; a loose file of a room stands for itself."""
    found = {}
    for one in (name for floor in ROOMS for name in floor):
        below = defaultdict(set)
        for module, others in graph("top", "lazy", "typing").items():
            for other in others:
                folders = [inner_folder(name, one) for name in (module, other)]
                if None not in folders and folders[0] != folders[1]:
                    below[folders[0]].add(folders[1])
        try:
            tuple(graphlib.TopologicalSorter(below).static_order())
        except graphlib.CycleError as error:
            found[one] = error.args[1]
    return found


def inner_folder(module, first):
    """The folder of a room in which a module lies, or a loose file; None outside of the room, and for the room itself."""
    parts = module.split(".")
    if parts[:2] != ["lgvi_warp", first]:
        return None
    return parts[2] if len(parts) > 2 else None


def loaded_by(module):
    """Modules of ours that importing this one names at once, without those named inside functions."""
    return {module_of(found.name) for found in modules()[module] if found.kind == "top"} - {None, module}


def closure(module):
    """A module and all of ours that importing it brings in, parent packages included."""
    seen, waiting = set(), {module}
    while waiting:
        one = waiting.pop()
        seen.add(one)
        waiting |= (loaded_by(one) | ({one.rpartition(".")[0]} & modules().keys())) - seen
    return seen


def reason(module, name):
    """Why a module imports this name inside a function."""
    package = name.split(".")[0]
    if module.startswith("lgvi_warp.cli"):
        return "a verb of the command loads only what it uses"
    if package in sys.stdlib_module_names or package == "numpy":
        return "rarely needed, or not on every system"
    if package not in (*SOURCE_ROOTS, "warp"):
        return "takes long to load, or may be absent"
    below = closure(module_of(name)) if package == "lgvi_warp" else ()
    if package != "lgvi_warp" or any(
        found.name.split(".")[0] == "warp" for lower in below for found in modules()[lower]
    ):
        return "leads to Warp, which takes long to load"
    return "needed by some scenes or runs only"


def report():
    """Lines on the rooms and their imports."""
    sizes = Counter(module.split(".")[1] for module in modules() if room(module) is not None)
    for floor, rooms in enumerate(ROOMS):
        yield f"floor {floor}: " + ", ".join(f"{name} ({sizes[name]} modules)" for name in rooms)
    yield f"circle of modules, all imports counted: {circle('top', 'lazy', 'typing') or 'none'}"
    yield f"arrows up: {arrows_up() or 'none'}"
    yield f"circles of inner folders: {circles_of_folders() or 'none'}"
    late = defaultdict(Counter)
    for module, all_of_it in modules().items():
        for found in all_of_it:
            if found.kind == "lazy":
                late[reason(module, found.name)][module_of(found.name) or found.name.split(".")[0]] += 1
    yield f"imports inside functions: {sum(map(Counter.total, late.values()))}"
    for why, names in sorted(late.items()):
        yield f"  {names.total():3d}  {why}: " + ", ".join(f"{name} ({count})" for name, count in names.most_common())


if __name__ == "__main__":
    print(*report(), sep="\n")
