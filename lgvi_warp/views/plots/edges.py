# SPDX-License-Identifier: Apache-2.0
"""Picture of stability margins: their cumulative distributions over the members of a fleet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import of_kind
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.views.plots.canvas import panels, style, widen, wrapped
from lgvi_warp.views.plots.picture import FilePath, picture

if TYPE_CHECKING:
    from lgvi_warp.robustness.linear.margins import Margins

LABELS = {
    "gain_lower": "lower gain margin, a factor",
    "gain_upper": "upper gain margin, a factor",
    "delay": "delay margin [s]",
    "phase": "phase margin [rad]",
    "disk": "disk margin",
    "disk_gain_upper": "disk-based gain margin, a factor",
    "disk_phase": "disk-based phase margin [rad]",
    "sensitivity_peak": "peak of sensitivity S",
    "complementary_peak": "peak of complementary sensitivity T",
}
# Of these a member is the worse, the more it has.
MORE_IS_WORSE = ("lower", "peak")
# Panels side by side at most.
COLUMNS = 3
# The share of members whose margin is marked: one in twenty bears less, or, of a lower margin, more.
MARKED = 0.05


@picture
def margins(found: Margins, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw the distribution of each stability margin over the members that have margins, one panel for each margin.

    Curves are cumulative distributions, by eigenvalues and, if requested, by runs. A dotted line marks the value that
    95 % of the members reach (peaks, lower gains: do not exceed). A curve ends below 100 % if margins are infinite.

    Args:
        found: Margins from `lw.linear.margins`.

    Returns:
        The axes, shape (margins,).

    Raises:
        NothingToDraw: No member has margins; the message says why.
    """
    of_kind("found", found, "steady values by_runs", "of lw.linear.margins", "give what lw.linear.margins returns")
    steady = np.asarray(found.steady)
    if not steady.any():
        fault = f"none of the {found.members} members has margins ({found.reasons_text})"
        raise NothingToDraw(f"{fault}: there is nothing to draw")
    ways = {way: values for way, values in (("eigenvalues", found.values), ("runs", found.by_runs)) if values}
    names = [name for name in next(iter(ways.values())) if name in LABELS or name.endswith("_peak")]
    columns = min(len(names), COLUMNS)
    rows = -(-len(names) // columns)
    with panels(figure, path, (rows, columns), (1.0 + 4.5 * columns, 4.5 * rows), sharey=True) as grid:
        for axes in grid.flat[len(names) :]:
            axes.remove()
        for axes, name in zip(grid.flat, names, strict=False):
            for i, way in enumerate(way for way in ways if name in ways[way]):
                _curve(axes, *found.curve(name, way), label=f"by {way}", **style(i))
            _mark(axes, found.curve(name)[0], name)
            axes.set(xlabel=LABELS.get(name, f"peak gain to {name.removesuffix('_peak')}"), ylim=(0.0, 102.0))
            widen(axes.xaxis)
            # An offset of all ticks would lie over the label; equal numbers take few ticks of many digits.
            axes.locator_params(axis="x", nbins=4)
            axes.xaxis.set_major_formatter("{x:.6g}")
            axes.grid(alpha=0.3)
            axes.legend()
        for axes in grid[:, 0]:
            axes.set_ylabel("members at or below this value [%]")
        lost = found.members - int(steady.sum())
        remark = f"; {lost:,} have none ({found.reasons_text})" if lost else ""
        title = f"{found.loop}: margins of {found.members - lost:,} members{remark}"
        grid[0, 0].figure.suptitle(wrapped(title, grid[0, 0].figure))
    return grid.ravel()[: len(names)]


def _curve(axes: Any, values: np.ndarray, shares: np.ndarray, **line: Any) -> None:
    """Draw the part of the members with at most so much (n,), up to the largest finite value."""
    finite = np.isfinite(values)
    start = values[finite][:1]
    x, y = np.concatenate([start, values[finite]]), np.concatenate([0.0 * start, 100.0 * shares[finite]])
    axes.step(x, y, where="post", **line)


def _mark(axes: Any, values: np.ndarray, name: str) -> None:
    """Mark the value that all but one in twenty members reach, or do not exceed if smaller is better."""
    level = 1.0 - MARKED if name.endswith(MORE_IS_WORSE) else MARKED
    edge = float(np.quantile(values, level, method="inverted_cdf"))
    if np.isfinite(edge):
        verb = "at most" if name.endswith(MORE_IS_WORSE) else "at least"
        label = f"{100.0 * (1.0 - MARKED):g} % of members: {verb} {edge:.3g}"
        axes.axvline(edge, color="0.3", linestyle=":", label=label)
