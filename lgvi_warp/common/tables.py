# SPDX-License-Identifier: Apache-2.0
"""Tables of records for other programs."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.common import files as durable
from lgvi_warp.common.errors import printable

# How a text begins that a spreadsheet runs.
FORMULAS = ("=", "+", "-", "@", "\t", "\r", "\n")


def write_csv(
    rows: Sequence[Mapping[str, Any]], path: str | os.PathLike[str], root: str | os.PathLike[str] | None = None
) -> Path:
    """Write records to a CSV file; it is complete or does not appear."""
    names = list(dict.fromkeys(key for row in rows for key in row))
    with durable.placed(path, root) as beside, beside.open("x", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([cell(name) for name in names])
        writer.writerows([[cell(row.get(name, "")) for name in names] for row in rows])
    return Path(path)


def cell(value: Any) -> Any:
    """Make a cell of a table: a text cannot be a formula for a spreadsheet, and has no control characters."""
    if not isinstance(value, str):
        return value
    text = printable(value)
    return f"'{text}" if value.startswith(FORMULAS) and not is_number(text) else text


def is_number(text: str) -> bool:
    """Whether a text is a number, with or without a sign."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def markdown(text: str) -> str:
    """Escape a text for Markdown: no control characters, and no Markdown except marks at the beginning of a line."""
    lines = [re.fullmatch(r"(#+ |- |\d+\. )?(.*)", printable(line)) for line in text.split("\n")]
    return "\n".join((found[1] or "") + re.sub(r"[\\`*<>\[\]|~]", r"\\\g<0>", found[2]) for found in lines if found)
