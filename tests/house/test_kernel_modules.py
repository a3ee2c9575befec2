# SPDX-License-Identifier: Apache-2.0
"""Formulas in kernel modules use the lanes' operators: a builtin would be silently slower, and looks the same."""

import ast
from pathlib import Path

import pytest

from lgvi_kernels import law
from lgvi_kernels.maps.bounded import ROLES
from lgvi_kernels.maps.in_turn import ROLES as ROLES_OF_PARTS
from lgvi_warp.common.status import Status

KERNELS = Path(__file__).parents[2] / "kernels" / "lgvi_kernels"
OPERATORS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div", ast.USub: "neg"}
WARP = ("wp.", "overloads.")
OFFERED = {name for name in vars(law) if not name.startswith("_")}
OF_EXTENSIONS = (KERNELS.parents[1] / "lgvi_warp" / "extensions").glob("*/device/*.py")
FORMULAS = sorted({*KERNELS.rglob("*.py"), *OF_EXTENSIONS} - {KERNELS / "lanes" / "arithmetic.py"})


def device_functions(tree):
    """Functions that Warp compiles."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any(ast.unparse(d).startswith(WARP) for d in node.decorator_list):
            yield node


@pytest.mark.parametrize("path", FORMULAS, ids=lambda path: path.stem)
def test_operators_are_imported(path):
    tree = ast.parse(path.read_text())
    imported = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module in ("lgvi_kernels.lanes.arithmetic", "lgvi_kernels.law")
        for alias in node.names
    }
    if "*" in imported:
        imported |= OFFERED
    used = set()
    for function in device_functions(tree):
        for node in ast.walk(function):
            if isinstance(node, (ast.BinOp, ast.UnaryOp)) and type(node.op) in OPERATORS and not whole_numbers(node):
                used.add(OPERATORS[type(node.op)])
    assert used <= imported, f"{path.name}: import {sorted(used - imported)} from lgvi_kernels.lanes.arithmetic"


def test_what_laws_import_is_no_role():
    assert not OFFERED & {*ROLES, *ROLES_OF_PARTS, "distance", "force", "potential", "params"}


def whole_numbers(node):
    """Index arithmetic, a number with a sign, and numbers made by `real(...)`: never lanes."""
    text = ast.unparse(node)
    if text.startswith("real("):
        return True
    return (
        any(isinstance(sub, ast.Constant) and isinstance(sub.value, int) for sub in ast.walk(node))
        or text[1:].replace(".", "").isdigit()
    )


def test_statuses_have_the_numbers_that_the_host_reads():
    numbers = [
        (path.name, node.targets[0].id, node.value.value)
        for path in KERNELS.rglob("*.py")
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in Status.__members__
    ]
    assert {name for _, name, _ in numbers} >= {"STEP_TOO_LARGE", "NOT_CONVERGED", "NON_FINITE", "BACKWARD_DRAG"}
    assert [(name, number) for _, name, number in numbers] == [(name, Status[name].value) for _, name, _ in numbers]
