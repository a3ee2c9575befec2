# SPDX-License-Identifier: Apache-2.0
"""The table of docs/reference/paper_to_code.md: every name in it exists, and every equation's function says its number."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROWS = [
    [cell.strip() for cell in line.strip().strip("|").split("|")]
    for line in (ROOT / "docs" / "reference" / "paper_to_code.md").read_text().splitlines()
    if re.match(r"\| *(\(\d+\)|section)", line)
]


def resolve(name):
    """The object that a dotted name or tests/file.py::name stands for."""
    if name.startswith("tests/"):
        path, _, function = name.partition("::")
        assert f"def {function}(" in (ROOT / path).read_text(), name
        return None
    module, _, attribute = name.rpartition(".")
    found = importlib.import_module(module)
    if not hasattr(found, attribute) and hasattr(found, f"make_{attribute}"):
        return getattr(found, f"make_{attribute}")
    return getattr(found, attribute)


def test_the_table_covers_the_papers_equations():
    numbers = {int(number) for row in ROWS for number in re.findall(r"\((\d+)\)", row[0])}
    assert {*range(10, 15), *range(19, 25)} <= numbers


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_every_name_resolves(row):
    names = re.findall(r"`([\w./:]+)`", " ".join(row[2:]))
    assert len(names) >= 3, row
    for name in names:
        resolve(name)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_the_twin_names_its_equation(row):
    numbers = re.findall(r"\((\d+)\)", row[0])
    for name in re.findall(r"`([\w.]+)`", row[3]):
        documented = (resolve(name).__doc__ or "") + (importlib.import_module(name.rpartition(".")[0]).__doc__ or "")
        assert all(number in documented for number in numbers), (name, numbers)
