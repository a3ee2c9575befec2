# SPDX-License-Identifier: Apache-2.0
"""The page of rooms: every room is on it, with the public names that it holds and their doors.

`python -m tests.house.test_layout` writes what it can tell by itself, the last column and the order of the rooms, anew.
"""

import ast
import re

from tests.house.graph import ROOMS, ROOT

PAGE = ROOT / "docs" / "develop" / "layout.md"
# A row: the room, what it holds, its doors.
ROW = re.compile(r"^(\| `(\w+)/` \|[^|]*\|)[^|]*\|$", re.MULTILINE)
ORDER = re.compile(r"^    common <.*(?:\n    .*)*", re.MULTILINE)
WIDE = 120


def doors():
    """{room: {door: names of it that live there}}; the door of the root is ""."""
    package = ROOT / "lgvi_warp"
    of_rooms = {path.parent.name: {} for path in package.glob("*/__init__.py")}
    for stub in sorted(package.rglob("*.pyi")):
        door = ".".join(stub.relative_to(package).with_suffix("").parts).removesuffix("__init__").strip(".")
        for line in ast.parse(stub.read_text()).body:
            if isinstance(line, ast.ImportFrom) and line.module != "lgvi_warp":
                names = of_rooms[line.module.split(".")[1]].setdefault(door, [])
                names += [alias.asname for alias in line.names]
    return of_rooms


def in_words(of_room):
    """`lw.terms` (20); of the root its names."""
    root = ", ".join(f"`lw.{name}`" for name in sorted(of_room.get("", [])))
    return ", ".join(
        [*filter(None, [root]), *(f"`lw.{door}` ({len(of_room[door])})" for door in sorted(of_room) if door)]
    )


def order():
    """The rooms from below, with line breaks."""
    lines, parts = [""], [", ".join(floor) for floor in ROOMS]
    for i, part in enumerate(parts):
        text = part if i == 0 else f" < {part}"
        if len(lines[-1]) + len(text) > WIDE:
            lines.append("")
        lines[-1] += text.lstrip() if lines[-1] == "" else text
    return "\n".join(f"    {line}" for line in lines)


def page():
    """The page as it should be."""
    of_rooms = doors()
    text = ROW.sub(lambda row: f"{row[1]} {in_words(of_rooms[row[2]])} |".replace("|  |", "| |"), PAGE.read_text())
    return ORDER.sub(order(), text, count=1)


def test_every_room_is_on_the_page():
    assert sorted(name for _, name in ROW.findall(PAGE.read_text())) == sorted(doors())


def test_doors_and_the_order_of_rooms_are_as_the_source_has_them():
    assert PAGE.read_text() == page(), "run: python -m tests.house.test_layout"


if __name__ == "__main__":
    PAGE.write_text(page())
