# SPDX-License-Identifier: Apache-2.0
"""The estimates of a run at its end, as lines of text."""

from __future__ import annotations

from collections.abc import Iterator

from lgvi_warp.statistics.estimates.estimate import Estimates
from lgvi_warp.statistics.estimates.lines import entries_of, texts_of


def entries(estimates: Estimates) -> Iterator[tuple[str, str, float, float, float, int]]:
    """List the numbers of a run at its end."""
    for estimate in estimates.values():
        yield from entries_of(estimate)


def table(estimates: Estimates) -> list[str]:
    """Return one line for each number: its label, its value, its interval, and its number of members."""
    rows = [row for estimate in estimates.values() for row in texts_of(estimate)]
    widths = [max((len(row[i]) for row in rows), default=0) for i in range(3)]
    return ["  ".join([*(text.ljust(width) for text, width in zip(row, widths, strict=False)), row[3]]) for row in rows]
