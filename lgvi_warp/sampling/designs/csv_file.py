# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers from a CSV file; each cell without a number is reported with its line and column."""

from __future__ import annotations

import csv
import io
import math
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults

# The most faulty lines that a message lists; the others are counted.
MOST_TOLD = 8

# The most faults that are counted; after them the rest of the file is not read.
MOST_COUNTED = 10_000

# The most characters of a line: enough for tens of thousands of columns.
LONGEST_LINE = 1 << 20

# Takes the names of the first line and returns those to read; adds a fault for each that is wrong.
Choose = Callable[[Faults, Sequence[str]], list[str]]


def columns_of(faults: Faults, path: str, content: bytes, choose: Choose) -> dict[str, np.ndarray]:
    """Columns (lines,) of a CSV file by name; {} if there is a fault.

    The names are in the first line that is neither empty nor a comment (#); every other line holds one number for each.
    Commas, semicolons or tabs separate cells; the first line decides which.
    """
    rows: Any = csv.reader(())
    try:
        head = next((line for line in _lines(content) if line.strip()), "")
        delimiter = next((separator for separator in "\t;" if separator in head), ",")
        rows = csv.reader(_lines(content), delimiter=delimiter, skipinitialspace=True)
        names = [name.strip() for name in next((row for row in rows if row), [])]
        _check_names(faults, path, rows.line_num, names, delimiter)
        chosen = [] if faults else choose(faults, names)
        _check_chosen(faults, path, rows.line_num, names, chosen)
        numbers = np.empty((0, 0)) if faults else _numbers(faults, path, rows, names, chosen)
    except csv.Error as error:
        faults.add("file", path, f"cannot be read ({error}, line {rows.line_num})", "correct that line")
    return {} if faults else dict(zip(chosen, np.ascontiguousarray(numbers.T), strict=True))


def _lines(content: bytes) -> Iterator[str]:
    """All lines, so that line numbers match the file; comments and empty lines become bare line ends."""
    text = io.TextIOWrapper(io.BytesIO(content), "utf-8-sig")
    while line := text.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            raise csv.Error(f"a line of more than {LONGEST_LINE / 1e6:.1f} million characters")
        yield line if line.lstrip()[:1] not in ("", "#") else "\n"


def _check_names(faults: Faults, path: str, line: int, names: Sequence[str], delimiter: str) -> None:
    """Add a fault if the first line does not contain names."""
    if not names:
        remedy = "write the names in its first line, then a line of numbers for each member"
        faults.add("file", path, "is empty", remedy)
    elif all(_number(name) is not None for name in names):
        fault = f"has numbers where the names should be (line {line})"
        faults.add("file", path, fault, 'write the names above them, without # (numpy.savetxt: comments="")')
    elif delimiter == "," and any(name.count("[") != name.count("]") for name in names):
        torn = next(name for name in names if name.count("[") != name.count("]"))
        remedy = 'quote a name with a comma: "vehicle.inertia[0,1]"'
        faults.add("file", path, f"has a name that a comma splits, {torn!r} (line {line})", remedy)


def _check_chosen(faults: Faults, path: str, line: int, names: Sequence[str], chosen: Sequence[str]) -> None:
    """Add a fault if a chosen name is empty or occurs twice."""
    counts = Counter(names)
    for name in sorted({name for name in chosen if counts[name] > 1}):
        faults.add("file", path, f"names a column twice, {name!r} (line {line})", "give each column a name of its own")
    if "" in chosen:
        fault = f"has a column without a name, number {names.index('') + 1} (line {line})"
        faults.add("file", path, fault, 'name it, or leave it out: ignore = [""]')


def _numbers(faults: Faults, path: str, rows: Any, names: Sequence[str], chosen: Sequence[str]) -> np.ndarray:
    """The numbers (lines, chosen) of the lines after the first."""
    place_of = {name: place for place, name in enumerate(names)}
    places = [place_of[name] for name in chosen]
    values, reports = array("d"), list[tuple[str, str]]()
    for row in rows:
        if not row:
            continue
        cells = [row[i] for i in places] if len(row) == len(names) else []
        try:
            numbers = [float(cell) for cell in cells]
        except ValueError:
            numbers = [math.nan]
        # The sum is finite where every number is, unless it overflows: then each number is checked.
        if not cells or not math.isfinite(sum(numbers)):
            reports += _faults_of_line(rows.line_num, row, names, chosen, cells)
            if len(reports) >= MOST_COUNTED:
                break
        values.extend(numbers)
    for fault, remedy in reports[:MOST_TOLD]:
        faults.add("file", path, fault, remedy)
    if len(reports) > MOST_TOLD:
        more = f"{len(reports) - MOST_TOLD} more such faults" + " or more" * (len(reports) >= MOST_COUNTED)
        faults.add("file", path, f"has {more}", "correct them too")
    if not values and not reports:
        faults.add("file", path, "has names and no members", "write a line of numbers for each member")
    return np.array(values).reshape(-1, len(chosen)) if not reports else np.empty((0, 0))


def _faults_of_line(
    line: int, row: Sequence[str], names: Sequence[str], chosen: Sequence[str], cells: Sequence[str]
) -> list[tuple[str, str]]:
    """The faults of one line, each with its remedy."""
    if len(row) != len(names):
        return [(f"has {len(names)} names and {len(row)} cells in line {line}", "give a cell for each name")]
    reports = []
    for name, cell in zip(chosen, cells, strict=True):
        number = _number(cell)
        if number is None:
            description = f"{cell!r}, which is not a number," if cell.strip() else "no number"
        elif not math.isfinite(number):
            description = f"{cell.strip()}, which is not finite,"
        else:
            continue
        remedy = f'write a number with a point, 120.5, or leave the column out: ignore = ["{name}"]'
        reports.append((f'has {description} in line {line}, column "{name}"', remedy))
    return reports


def _number(cell: str) -> float | None:
    """The number in a cell; None if there is none."""
    try:
        return float(cell)
    except ValueError:
        return None
