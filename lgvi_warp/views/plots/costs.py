# SPDX-License-Identifier: Apache-2.0
"""Pictures of the time per member and step: against members and threads, and for each term."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.reading import file_text
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.views.plots.canvas import COLORS, MARKERS, hatch, legend_below, panel, panels, style
from lgvi_warp.views.plots.picture import FilePath, picture

COST = "ns_per_vehicle_step"
# The row of a scene without terms, in what `lw.bench.term_cost` and the benchmarks write.
NONE = "none"

Rows = Iterable[Mapping[str, Any]] | str | os.PathLike[str]


@picture
def scaling(rows: Rows, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw the time per member and step against the number of members, and against the number of threads.

    Dotted lines show ideal scaling: with twice the threads, the time is halved.

    Args:
        rows: Rows that `python -m benchmarks run members threads` prints, or the path of a file with such rows as JSON
            lines. Rows of other measurements are ignored.

    Returns:
        The axes of members and of threads, shape (2,).

    Raises:
        NothingToDraw: No row has the keys members, threads and ns_per_vehicle_step.
        OSError: A file cannot be read or written.
    """
    points = measured(rows, ("members", "threads"), "`python -m benchmarks run members threads`")
    with panels(figure, path, (1, 2), (12.0, 5.6)) as grid:
        for axes, across, of_line in ((grid[0, 0], "members", "threads"), (grid[0, 1], "threads", "members")):
            for i, count in enumerate(sorted({point[of_line] for point in points})):
                line = sorted((point[across], point[COST]) for point in points if point[of_line] == count)
                x, y = np.array(line, dtype=float).T
                label = f"{count:,} {of_line if count != 1 else of_line[:-1]}"
                axes.plot(x, y, marker=MARKERS[i % len(MARKERS)], label=label, **style(i))
                if across == "threads" and len(x) > 1:
                    axes.plot(x, y[0] * x[0] / x, color="black", linestyle=(0, (1, 2)), linewidth=0.8)
            axes.set(xscale="log", yscale="log", xlabel=f"{across} [1]", ylabel="time per member and step [ns]")
            axes.minorticks_off()
            axes.grid(True, alpha=0.3)
            ticks = sorted({point[across] for point in points})
            if len(ticks) < 8:
                axes.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
            legend_below(axes, ncols=3)
        grid[0, 0].figure.suptitle("Wall time of the run per member and step; dotted: ideal scaling with threads")
    return grid[0]


@picture
def term_cost(rows: Rows, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw the time per member and step with each term alone as bars, and without terms as a line.

    Args:
        rows: Rows of `lw.bench.term_cost`, or a file of JSON lines that `python -m benchmarks run terms` printed. If
            the rows have several methods, only the first is drawn, with one bar for each precision.

    Returns:
        The axes.

    Raises:
        NothingToDraw: No row has the keys term, method, dtype and ns_per_vehicle_step.
        OSError: A file cannot be read or written.
    """
    points = measured(rows, ("term", "method", "dtype"), "lw.bench.term_cost(scene)")
    method = points[0]["method"]
    points = [point for point in points if point["method"] == method]
    terms = list(dict.fromkeys(point["term"] for point in points))
    dtypes = list(dict.fromkeys(point["dtype"] for point in points))
    thick = 0.8 / len(dtypes)
    with panel(ax, path, (8.0, 2.2 + 0.42 * len(terms))) as axes:
        for i, dtype in enumerate(dtypes):
            prices = {point["term"]: point[COST] for point in points if point["dtype"] == dtype}
            places = [terms.index(term) + (i - 0.5 * (len(dtypes) - 1)) * thick for term in prices]
            bars = axes.barh(places, prices.values(), thick, color=COLORS[i], hatch=hatch(i), edgecolor="white", linewidth=0.0,
                             label=dtype)  # fmt: skip
            axes.bar_label(bars, fmt="%.3g", padding=3)
            if NONE in prices:
                axes.axvline(prices[NONE], linewidth=1.0, **style(i))
        axes.set(xlabel="time per member and step [ns]", ylabel="term [name]")
        axes.set_yticks(range(len(terms)), terms)
        axes.margins(x=0.12)
        axes.invert_yaxis()
        axes.grid(True, axis="x", alpha=0.3)
        if ax is None:
            axes.set_title(f"{method} on one core; lines: scene without terms")
        legend_below(axes, ncols=3)
    return axes


def measured(rows: Rows, keys: tuple[str, ...], remedy: str) -> list[Mapping[str, Any]]:
    """Take the rows of one kind of measurement, which have these keys and a cost."""
    if isinstance(rows, str | os.PathLike):
        rows = [parsed(line) for line in file_text(rows, "cost file").splitlines() if line.startswith("{")]
    rows = listed("rows", rows, "rows")
    points = [row for row in rows if isinstance(row, Mapping) and all(key in row for key in (*keys, COST))]
    if not points:
        raise NothingToDraw(f"no row has {', '.join(keys)} and {COST}: there is nothing to draw. Give rows of {remedy}")
    return points
