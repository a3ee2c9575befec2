# SPDX-License-Identifier: Apache-2.0
"""Statistics of a run against time, a panel each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import result_of
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.views.choice import of_members
from lgvi_warp.views.fleet import members_of_run
from lgvi_warp.views.plots.canvas import band, legend_below, panels, point_down, shade, style, wrapped
from lgvi_warp.views.plots.picture import FilePath, picture
from lgvi_warp.views.plots.words import DEPTHS, floors, in_words, unit_of

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result
    from lgvi_warp.statistics.estimates.estimate import Estimate

# Most panels of statistics, and most lines in a panel.
PANELS, LINES = 12, 12


@picture
def statistics(result: Result, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw a run's statistics against time, one panel for each statistic.

    Quantiles are drawn as bands, means and probabilities as lines with intervals, extremes as a band, histograms as
    colours. Covariances, and statistics with a single time, are not drawn; the title names them.

    Args:
        result: A result with statistics. At most 12 of them are drawn.

    Returns:
        The axes, shape (panels,).

    Raises:
        NothingToDraw: The run gathered no statistic that can be drawn against time.
    """
    drawn = drawable(result)[:PANELS]
    if not drawn:
        raise NothingToDraw("no statistic against time was gathered: there is nothing to draw. Give statistics=[...]")
    columns = min(3, len(drawn))
    rows = -(-len(drawn) // columns)
    size = max(7.0, 4.6 * columns), 3.9 * rows + 1.0
    with panels(figure, path, (rows, columns), size, len(drawn)) as grid:
        for axes, estimate in zip(grid.flat, drawn, strict=False):
            axes.set(title=wrapped(in_words(estimate.name), axes.figure, 1.0 / columns), xlabel="time [s]")
            axes.grid(True, alpha=0.3)
            _PANEL[estimate.settings["type"]](axes, estimate)
            _units(axes, result, estimate)
        names = {estimate.name for estimate in drawn}
        omitted = [name for name in result.statistics if name not in names]
        more = f"; not drawn, see the table of statistics: {', '.join(omitted)}" if omitted else ""
        members, level = of_members(result.members, members_of_run(result)), drawn[0].confidence
        grid[0, 0].figure.suptitle(wrapped(f"{members}, {level:.0%} confidence intervals{more}", grid[0, 0].figure))
    return grid.ravel()[: len(drawn)]


def _units(axes: Any, result: Result, estimate: Estimate) -> None:
    """Say the unit of the vertical axis, and turn an axis of depths downwards."""
    if estimate.settings["type"] in _PROBABILITIES:
        axes.set(ylabel="probability", ylim=(-0.02, 1.02) if float(np.nanmax(estimate.upper)) > 0.5 else (0.0, None))
        return
    components = [str(label) for label in estimate.coordinates.get("component", ())]
    histogram = estimate.settings["type"] == "histogram"
    unit = unit_of(components[0]) if histogram else estimate.unit
    name = components[0] if histogram or len(components) == 1 else ""
    deep = unit == "m" and bool(components) and all(label in DEPTHS for label in components)
    axes.set_ylabel(f"{in_words(name)} [{unit or '1'}]{', down' * deep}".strip())
    if deep:
        point_down(axes, floors(result))


def drawable(result: Result) -> list[Estimate]:
    """Select the statistics against time, which `lw.plots.statistics` draws."""
    return [
        estimate
        for estimate in result_of(result).statistics.values()
        if len(estimate.time) > 1 and estimate.settings["type"] in _PANEL
    ]


def _levels_panel(axes: Any, estimate: Estimate) -> None:
    """Draw pairs of quantiles as bands about the middle one, with a colour and a hatch for each component."""
    levels = estimate.coordinates["level"]
    for c in range(min(estimate.value.shape[2], LINES)):
        values, name = estimate.value[:, :, c], in_words(str(estimate.coordinates["component"][c]))
        for i in range(len(levels) // 2):
            label = band(levels[i], levels[-1 - i]) if c == 0 else None
            shade(axes, estimate.time, values[:, i], values[:, -1 - i], c, c + i, 0.15 * (i + 1), label)
        if len(levels) % 2:
            axes.plot(estimate.time, values[:, len(levels) // 2], label=name, **style(c))
    legend_below(axes, ncols=4)


def _lines_panel(axes: Any, estimate: Estimate) -> None:
    """Draw a line for each component, with its interval."""
    shape = (len(estimate.time), -1)
    value, lower, upper = (array.reshape(shape) for array in (estimate.value, estimate.lower, estimate.upper))
    names = estimate.coordinates["component"] if estimate.coordinates["component"].size else np.array([estimate.name])
    for c in range(min(value.shape[1], LINES)):
        line = style(c)
        axes.plot(estimate.time, value[:, c], label=in_words(str(names[c])) if c < len(names) else None, **line)
        axes.fill_between(estimate.time, lower[:, c], upper[:, c], color=line["color"], alpha=0.3, linewidth=0)
    legend_below(axes, ncols=4)


def _extremes_panel(axes: Any, estimate: Estimate) -> None:
    """Draw a band from the smallest to the largest value of each component."""
    for c in range(min(estimate.value.shape[1], LINES)):
        label = in_words(str(estimate.coordinates["component"][c]))
        shade(axes, estimate.time, estimate["minimum"][:, c], estimate["maximum"][:, c], c, alpha=0.3, label=label)
    legend_below(axes, ncols=4)


def _histogram_panel(axes: Any, estimate: Estimate) -> None:
    """Draw the fractions of the first component, bins against time; by square roots, since at the start all are in one bin."""
    from matplotlib.colors import PowerNorm

    time, edge = estimate.time, estimate.coordinates["edge"]
    middle = 0.5 * (time[1:] + time[:-1])
    edges, shares = np.concatenate([time[:1], middle, time[-1:]]), 100.0 * estimate.value[:, 0].T
    drawn = axes.pcolormesh(edges, edge, shares, cmap="cividis", norm=PowerNorm(0.5, vmin=0.0))
    axes.grid(False)
    axes.figure.colorbar(drawn, ax=axes, label="share of members [%]")


_PROBABILITIES = ("exceedance", "first_passage", "outcome")
_LINES = ("mean", "circular_mean", *_PROBABILITIES)
_PANEL = {"quantiles": _levels_panel, "extremes": _extremes_panel, "histogram": _histogram_panel}
_PANEL |= dict.fromkeys(_LINES, _lines_panel)
