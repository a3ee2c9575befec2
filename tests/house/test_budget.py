# SPDX-License-Identifier: Apache-2.0
"""The house keeps within its budget: lines, files, public names, and places that are hard to read.

`python -m tests.house.test_budget` prints what there is beside what may be.
"""

import tomllib
from collections import Counter

import pytest

import lgvi_warp as lw
from tests.house.graph import ROOMS, ROOT
from tests.house.words import FOLDERS, places
from tests.support.public import DOORS

BUDGET = tomllib.loads((ROOT / "tests" / "house" / "budget.toml").read_text())
# What stands on the core and asks how sure, how robust, how accurate, and what that costs.
USES = {"measuring", "uncertainty", "robustness", "accuracy"}
# A number that has fallen so far is written down anew, so that it stays low.
SLACK = 0.95


def lines(folder):
    """Lines of Python below a folder, or of a file."""
    paths = folder.rglob("*.py") if folder.is_dir() else [folder] if folder.suffix == ".py" else []
    return sum(len(path.read_text().splitlines()) for path in paths)


def groups():
    """{group: folders} of the code: each room of the package is of the core, of the uses, or an extension."""
    package = {path.name for path in (ROOT / "lgvi_warp").iterdir()}
    core = sorted(package - USES - {"extensions", "reference"})
    return {
        "mathematics": ["kernels", "lgvi_warp/reference"],
        "core": [f"lgvi_warp/{name}" for name in core],
        "uses": [f"lgvi_warp/{name}" for name in sorted(USES)],
        "extensions": ["lgvi_warp/extensions"],
    } | {name: [name] for name in ("tests", "benchmarks", "examples")}


def files_by_folder():
    """{folder of the package: its Python files}, without those of the device code: there each law is a file."""
    paths = (path.parent.relative_to(ROOT).as_posix() for path in (ROOT / "lgvi_warp").rglob("*.py"))
    return Counter(paths)


def found():
    """{table: {key: number}} as the budget has them."""
    rooms = {name for floor in ROOMS for name in floor} - {"extensions"}
    rooms |= {f"extensions/{path.name}" for path in (ROOT / "lgvi_warp/extensions").iterdir() if path.is_dir()}
    return {
        "lines": {group: sum(lines(ROOT / folder) for folder in folders) for group, folders in groups().items()},
        "largest": {
            "room": max(lines(ROOT / "lgvi_warp" / room) for room in rooms),
            "folder": max(files_by_folder().values()),
        },
        "names": {"lw": len([name for name in lw.__all__ if name not in DOORS])}
        | {door: len(module.__all__) for door, module in DOORS.items()},
        "words": {folder: sum(1 for _ in places(folder)) for folder in FOLDERS},
    }


@pytest.fixture(scope="module")
def now():
    return found()


@pytest.mark.parametrize("table", BUDGET)
def test_the_house_keeps_within_its_budget(now, table):
    over = {
        key: (number, BUDGET[table].get(key, 0))
        for key, number in now[table].items()
        if number > BUDGET[table].get(key, 0)
    }
    assert over == {}, "make it smaller, or raise the number in budget.toml and write the reason in CHANGELOG.md"


@pytest.mark.parametrize("table", BUDGET)
def test_the_budget_holds_no_slack(now, table):
    loose = {key: (number, now[table].get(key, 0)) for key, number in BUDGET[table].items()
             if number > 20 and now[table].get(key, 0) < SLACK * number}  # fmt: skip
    assert loose == {}, "Write the smaller number into budget.toml"


if __name__ == "__main__":
    for table, numbers in found().items():
        print(f"[{table}]")
        print(*(f"{key} = {number}" for key, number in numbers.items()), sep="\n")
