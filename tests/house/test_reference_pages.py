# SPDX-License-Identifier: Apache-2.0
"""The reference pages say what the code says: statuses, warnings, methods, public names."""

import re

import lgvi_warp as lw
from lgvi_warp.common.status import Status, Warnings
from lgvi_warp.methods import method
from tests.conftest import ROOT
from tests.support.public import PATHS, WHOLE

FOLDER = ROOT / "docs" / "reference"


def rows(page, heading):
    """The cells of the first table below a heading; a bar within a cell is written as \\|."""
    text = (FOLDER / page).read_text().partition(f"# {heading}\n")[2]
    lines = re.search(r"^\|.*?(?=\n\n|\Z)", text, re.DOTALL | re.MULTILINE)[0].splitlines()[2:]
    return [[cell.replace("\\|", "|").strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]] for line in lines]


def test_statuses():
    expected = [[str(int(code)), f"`{code.name}`", code.text] for code in sorted(Status)]
    assert rows("status.md", "Statuses") == expected


def test_warnings():
    expected = [[str(int(bit)), f"`{bit.name}`", bit.value_name, bit.text] for bit in Warnings]
    assert rows("status.md", "Warnings") == expected


def test_methods_and_their_orders():
    orders = {name.strip("`"): int(order) for name, _, order, *_ in rows("methods.md", "Methods")}
    assert {name: lw.Method(name).order for name in orders} == orders
    compositions = {name.partition("(")[0] for name in orders if "(" in name}
    assert compositions == set(method.COMPOSITIONS | method.HALVES)
    simple = {name for name in orders if "(" not in name}
    assert simple == set(method.PROGRAMS | method.RUNGE_KUTTA | method.TWO_PART | method.GAUSS)


def test_every_public_name_has_a_line():
    page = (FOLDER / "api.md").read_text()
    names = re.findall(r"^\| `lw\.([\w.]+)` \|", page, re.MULTILINE)
    in_table = re.findall(r"^\| \[(\w+)\]", (FOLDER.parent / "guide" / "terms" / "README.md").read_text(), re.MULTILINE)
    names += [f"terms.{lw.laws.Term.kinds[name].__name__}" for name in in_table]
    assert sorted(names) == sorted([*PATHS, *WHOLE])
