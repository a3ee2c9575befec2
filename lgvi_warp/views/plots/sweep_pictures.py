# SPDX-License-Identifier: Apache-2.0
"""Pictures of sweeps: success by case and over the grid, metrics by case, paired differences, inputs of failures.

Each function draws on `figure=` or on a new figure, writes a file if `path` is given, and returns its axes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import failed, under_way
from lgvi_warp.common.summaries import percent
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import samples_of
from lgvi_warp.robustness.sweeps.output import Sweep
from lgvi_warp.robustness.sweeps.setup import END, SweepCell
from lgvi_warp.robustness.sweeps.summary import against_baseline, ends_of
from lgvi_warp.robustness.sweeps.sweep_table import SUCCESS
from lgvi_warp.statistics import tracking
from lgvi_warp.store.layout import units_of_numbers
from lgvi_warp.views.plots.canvas import COLORS, GREY, MARKERS, legend_below, panels, point_down, style, wrapped
from lgvi_warp.views.plots.fans import draw_bands
from lgvi_warp.views.plots.picture import FilePath

# Most boxes of one panel, and most members that are drawn as points.
MOST_BOXES, MOST_POINTS = 40, 4000
# Most members, and most times, of a fan.
MOST_PATHS = 200
# Most fans side by side.
MOST_COLUMNS = 3
# Names of cases stand upright where there are more.
MOST_LEVEL = 6
QUARTILES = {"whislo": 0.05, "q1": 0.25, "med": 0.5, "q3": 0.75, "whishi": 0.95}


def _ran(sweep: Sweep, case: str | None = None) -> list[SweepCell]:
    """The cells that ran, of all cases or of one; NothingToDraw where no cell of the sweep did."""
    cells = [cell for cell in sweep.cells if not sweep.record(cell).refused]
    if not cells:
        raise NothingToDraw("all cells were refused")
    return [cell for cell in cells if case in (None, cell.case.name)]


def _long(sweep: Sweep) -> list[str]:
    """Names of the axes of the grid with two values or more."""
    return [name for name, values in sweep.setup.axes.items() if len(values) > 1]


def _short(sweep: Sweep, case: str, point: Mapping[str, Any]) -> str:
    """A case and a point of the grid in few words: values alone, of axes with several."""
    return ", ".join([case, *(str(point[name]) for name in _long(sweep))])


def _meaning(sweep: Sweep) -> str:
    """Meanings of the words of `_short`."""
    return ", ".join(["case", *_labels(sweep, _long(sweep)).values()])


def _labels(sweep: Sweep, names: Iterable[str]) -> dict[str, str]:
    """Names of numbers, and axes of the grid, with their units."""
    units = units_of_numbers(sweep.setup.scene, names)
    return {name: name if unit == "1" else f"{name} [{unit}]" for name, unit in units.items()}


def plot_success(sweep: Sweep, path: FilePath | None = None, *, figure: Any = None) -> np.ndarray:
    """Draw the success of each case with its intervals: by case, over the axis of the grid, or a map over its first two axes.

    A map has the interval in each field, and is drawn at the first value of any further axis.
    """
    cells, long = _ran(sweep), _long(sweep)
    if len(long) >= 2:
        return _maps(sweep, long, path, figure)
    with panels(figure, path, (1, 1), (8.0, 5.0)) as grid:
        axes = grid[0, 0]
        if long:
            values = sweep.setup.axes[long[0]]
            for i, case in enumerate(sweep.cases):
                line = {"marker": MARKERS[i], "label": case} | style(i)
                _ends(axes, sweep, _ran(sweep, case), _places(values), long[0], **line)
            axes.set_xticks(_places(values), [str(value) for value in values])
            axes.set_xlabel(_labels(sweep, long)[long[0]])
            axes.legend()
        else:
            _ends(axes, sweep, cells, list(map(float, range(len(cells)))), None, marker="o", linestyle="none")
            turned = 0.0 if len(cells) <= MOST_LEVEL else 90.0
            axes.set_xticks(range(len(cells)), [cell.case.name for cell in cells], rotation=turned)
        axes.set_ylabel(f"members that pass [%], {sweep.confidence:.0%} interval")
        axes.grid(alpha=0.3)
    return grid.ravel()


def _ends(axes: Any, sweep: Sweep, cells: list[SweepCell], places: list[float], name: str | None, **line: Any) -> None:
    """Success of cells with error bars [%]: one a place, or each at the place of its value of an axis of the grid."""
    if not cells:
        return
    if name is not None:
        values = sweep.setup.axes[name]
        places = [places[values.index(cell.point[name])] for cell in cells]
    value, lower, upper = 100.0 * np.array([sweep.success(cell.case.name, cell.point) for cell in cells]).T
    bars = np.maximum(0.0, [value - lower, upper - value])
    axes.errorbar(places, value, bars, capsize=4.0, **line)


def _places(values: list[Any]) -> list[float]:
    """Positions of values on an axis: numbers at their value, if all are finite, else evenly."""
    if all(isinstance(value, int | float) and np.isfinite(value) for value in values):
        return [float(value) for value in values]
    return [float(i) for i in range(len(values))]


def _maps(sweep: Sweep, long: list[str], path: FilePath | None, figure: Any) -> np.ndarray:
    """Success over two axes, one map a case, at the first value of any other axis."""
    x, y = (sweep.setup.axes[name] for name in long[:2])
    labels = _labels(sweep, long)
    further = {name: values[0] for name, values in sweep.setup.axes.items() if name not in long[:2]}
    size = (1.6 + 1.1 * len(x)) * len(sweep.cases), 1.8 + 0.6 * len(y)
    with panels(figure, path, (1, len(sweep.cases)), size, sharey=True) as grid:
        for axes, case in zip(grid[0], sweep.cases, strict=True):
            values = np.full((len(y), len(x)), np.nan)
            for cell in sweep.cells_of(case, further):
                i, j = y.index(cell.point[long[1]]), x.index(cell.point[long[0]])
                words, color = "refused", "black"
                if not sweep.record(cell).refused:
                    value, lower, upper = 100.0 * np.array(sweep.success(case, cell.point))
                    values[i, j] = value
                    words, color = f"{value:.1f}\n{lower:.1f} to {upper:.1f}", "white" if value < 50.0 else "black"
                axes.text(j, i, words, ha="center", va="center", fontsize=8, color=color)
            axes.imshow(values, origin="lower", vmin=0.0, vmax=100.0, cmap="viridis", aspect="auto")
            axes.set_xticks(range(len(x)), [str(value) for value in x])
            axes.set_yticks(range(len(y)), [str(value) for value in y])
            axes.set_xlabel(labels[long[0]])
            axes.set_title(f"{case}: members that pass [%]")
        grid[0, 0].set_ylabel(labels[long[1]])
        if remark := ", ".join(f"{labels[name]} = {further[name]}" for name in long[2:]):
            grid[0, 0].figure.suptitle(f"at {remark}")
    return grid.ravel()


def plot_metrics(sweep: Sweep, path: FilePath | None = None, *, figure: Any = None) -> np.ndarray:
    """Draw boxes of each metric by case, at each point of the grid: quartiles, whiskers at 5 and 95 %.

    Boxes are of members that did not fail and whose number is finite. The first 40 cells that ran are drawn.
    """
    every = _ran(sweep)
    cells, names = every[:MOST_BOXES], [name for name in sweep.metrics if name != END]
    if not names:
        raise NothingToDraw("there are no metrics")
    places, size = range(1, len(cells) + 1), (max(7.0, 1.5 + 0.35 * len(cells)), 1.5 + 2.2 * len(names))
    with panels(figure, path, (len(names), 1), size, sharex=True) as grid:
        for axes, name in zip(grid[:, 0], names, strict=True):
            boxes = [_box(sweep, cell, name) for cell in cells]
            drawn = axes.bxp(boxes, showfliers=False, patch_artist=True, medianprops={"color": "black"})
            for patch, cell in zip(drawn["boxes"], cells, strict=True):
                patch.set(facecolor=COLORS[sweep.cases.index(cell.case.name) % len(COLORS)], alpha=0.6)
            unit = sweep.unit(name)
            axes.set_ylabel(name if unit == "1" else f"{name}\n[{unit}]")
            axes.grid(alpha=0.3, axis="y")
        turned = 0.0 if len(cells) <= MOST_LEVEL else 90.0
        grid[-1, 0].set_xticks(places, [_short(sweep, cell.case.name, cell.point) for cell in cells], rotation=turned)
        hidden = f"; {len(every) - len(cells)} more cells are not shown" if len(every) > len(cells) else ""
        grid[-1, 0].set_xlabel(_meaning(sweep) + hidden)
    return grid.ravel()


def _box(sweep: Sweep, cell: SweepCell, name: str) -> dict[str, float]:
    """Quantiles of a metric in a cell, by Matplotlib's names; NaN where no member has one."""
    record = sweep.record(cell)
    numbers = record.numbers[name][np.isfinite(record.numbers[name]) & ~failed(record.status)]
    levels = list(QUARTILES.values())
    return dict(zip(QUARTILES, np.quantile(numbers, levels) if len(numbers) else np.full(5, np.nan), strict=True))


def plot_differences(sweep: Sweep, path: FilePath | None = None, *, figure: Any = None) -> np.ndarray:
    """Draw the differences of success to the baseline on the same members, with their intervals."""
    rows = [row for row in against_baseline(sweep) if row.of == SUCCESS]
    if not rows:
        raise NothingToDraw("there is no other case that ran to compare with the baseline")
    with panels(figure, path, (1, 1), (8.0, 1.4 + 0.3 * len(rows))) as grid:
        axes = grid[0, 0]
        for real, color, shape, label in ((True, COLORS[0], "o", "significant"), (False, GREY, "s", "not significant")):
            places = [i for i, row in enumerate(rows) if bool(row.real) is real]
            if places:
                ends = [(row.difference.value, row.difference.lower, row.difference.upper) for row in rows]
                value, lower, upper = 100.0 * np.array(ends)[places].T
                bars = np.maximum(0.0, [value - lower, upper - value])
                axes.errorbar(value, places, xerr=bars, fmt=shape, capsize=4.0, color=color, label=label)
        axes.set_yticks(range(len(rows)), [_short(sweep, row.second, row.point) for row in rows])
        axes.set(ylim=(len(rows) - 0.5, -0.5), ylabel=_meaning(sweep))
        axes.axvline(0.0, color="0.3", linewidth=0.8)
        axes.set_xlabel(f"success minus that of {sweep.baseline} [% of members], {sweep.confidence:.0%} interval")
        axes.grid(alpha=0.3, axis="x")
        legend_below(axes, ncols=2)
    return grid.ravel()


def plot_causes(sweep: Sweep, path: FilePath | None = None, *, figure: Any = None) -> np.ndarray:
    """Draw which members pass, over the two inputs that best explain it, in the worst cell in which some pass."""
    shares = [(sweep.passed(cell).mean(), cell.index, cell) for cell in _ran(sweep)]
    share, _, cell = min([each for each in shares if 0.0 < each[0] < 1.0], default=(0.0, 0, sweep.cells[0]))
    rows = sweep.causes(cell.case.name, cell.point)[:2] if share else []
    if not rows:
        raise NothingToDraw("in no case some members pass and some do not, or nothing varies")
    some = "" if share == min(shares)[0] else " of those in which some members pass"
    labels = _labels(sweep, [row["input"] for row in rows])
    passed, inputs = sweep.passed(cell)[:MOST_POINTS], sweep.inputs(cell)
    x = inputs[rows[0]["input"]][:MOST_POINTS]
    y = inputs[rows[1]["input"]][:MOST_POINTS] if len(rows) > 1 else np.arange(len(x))
    with panels(figure, path, (1, 1), (7.0, 5.5)) as grid:
        axes = grid[0, 0]
        for chosen, label, color, marker in ((passed, "passes", COLORS[0], "."), (~passed, "fails", COLORS[1], "x")):
            axes.plot(
                x[chosen], y[chosen], marker, color=color, markersize=4.0, label=f"{label}: {int(chosen.sum()):,}"
            )
        words = [f"{labels[row['input']]}: explains {100.0 * row['share']:.3g} % of success" for row in rows]
        axes.set(xlabel=words[0], ylabel=words[1] if len(rows) > 1 else "member index")
        axes.set_title(wrapped(f"Worst cell{some}: {cell.name}", axes.figure))
        axes.legend()
    return grid.ravel()


def plot_responses(
    sweep: Sweep, path: FilePath | None = None, of: str = "", members: int = MOST_PATHS, *, figure: Any = None
) -> np.ndarray:
    """Draw fans of a tracked quantity or of its error over time, in the best and the worst cell, for members run again.

    If several cells are equally good, the first is drawn; if all are, the cases at the first point of the grid.

    of: "depth", "heading", "speed", "north" or "east"; or an error, "position", "attitude" or "cross_track". By default
        the quantity of the metric whose medians differ most between the drawn cells, relative to the interquartile
        ranges.
    """
    cells = _extremes(sweep)
    of = of or _tracked(sweep, [cell for _, cell in cells])
    if of not in tracking.ERRORS:
        raise NothingToDraw("no metric is of a number that is tracked over time")
    count = min(members, sweep.members_count)
    columns = min(MOST_COLUMNS, len(cells))
    rows = -(-len(cells) // columns)
    size = 4.5 * columns, 4.0 * rows
    with panels(figure, path, (rows, columns), size, len(cells), sharex=True, sharey=True) as grid:
        for axes, (word, cell) in zip(grid.flat, cells, strict=False):
            _response(axes, sweep, cell, of, count)
            title = f"{word}{percent(sweep.passed(cell).mean(), 3)} % pass: {cell.name}"
            axes.set_title(wrapped(title, axes.figure, 0.9 / columns))
        grid[0, 0].figure.supxlabel("time [s]")
        unit = tracking.error(of, False).unit
        away = "" if of in tracking.CHANNELS[False] else "error of "
        grid[0, 0].figure.supylabel(f"{away}{of} [{unit}]: {count} members")
        if of == "depth":
            point_down(grid[0, -1])
        grid[0, 0].legend()
    return grid.ravel()[: len(cells)]


def _extremes(sweep: Sweep) -> list[tuple[str, SweepCell]]:
    """The best cell and the worst, with these words; where all are equal, those at the first point of the grid."""
    ran, (best, worst) = _ran(sweep), ends_of(sweep)
    if best != worst:
        return [("best, ", best[0]), ("worst, ", worst[0])]
    return [("", cell) for cell in ran if cell.point == ran[0].point]


def _tracked(sweep: Sweep, cells: list[SweepCell]) -> str:
    """Metric whose medians differ most between cells, of numbers tracked over time; "" without one."""

    def apart(name: str) -> float:
        boxes = [_box(sweep, cell, name) for cell in cells]
        medians = [box["med"] for box in boxes if np.isfinite(box["med"])]
        width = np.nansum([box["q3"] - box["q1"] for box in boxes])
        return float(np.ptp(medians) / (width + 1e-300)) if medians else 0.0

    known = [name for name, metric in sweep.setup.metrics.items() if str(metric.of) in tracking.ERRORS]
    return str(sweep.setup.metrics[max(known, key=apart)].of) if known else ""


def _response(axes: Any, sweep: Sweep, cell: SweepCell, of: str, count: int) -> None:
    """Draw the fan of the first members of a cell, and the reference of the quantity."""
    assert cell.fleet is not None
    assert cell.fleet.scene.controller is not None
    duration = float(sweep.setup.settings.get("t1") or cell.fleet.scene.run.duration or 0.0)
    period = float(cell.fleet.scene.controller.period)
    every = period * max(1, int(duration / period / MOST_PATHS))
    channel, error = tracking.CHANNELS[False].get(of), tracking.error(of, False)
    fields = error.fields if channel is None else (*channel.of_actual, channel.wanted)
    result = sweep.again(cell.case.name, range(count), cell.point, SaveAt(every=every, fields=fields))
    numbers = error(*samples_of(result)) if channel is None else channel.actual(result.samples)
    draw_bands(axes, result.time, numbers.reshape(len(result.time), -1), under_way(result))
    if channel is not None:
        wanted = np.median(channel.reference(result.samples), axis=1)
        axes.plot(result.time, wanted, "k:", linewidth=1.0, label="reference")


def plot_rare(sweep: Sweep, path: FilePath | None = None, *, figure: Any = None) -> np.ndarray:
    """Draw the probabilities of rare failures with their intervals, on a logarithmic axis."""
    rows = [(cell, answer.found) for cell in sweep.cells if sweep.rares is not None
            and (answer := sweep.rares.of(cell)) is not None and answer.found is not None]  # fmt: skip
    if not rows:
        raise NothingToDraw("no cell has a rare failure")
    with panels(figure, path, (1, 1), (8.0, 1.4 + 0.4 * len(rows))) as grid:
        axes = grid[0, 0]
        for i, (cell, found) in enumerate(rows):
            bars = np.array([[found.probability - found.interval[0]], [found.interval[1] - found.probability]])
            color = COLORS[sweep.cases.index(cell.case.name) % len(COLORS)]
            axes.errorbar([found.probability], [i], xerr=bars, fmt="o", capsize=4.0, color=color)
        axes.set_yticks(range(len(rows)), [_short(sweep, cell.case.name, cell.point) for cell, _ in rows])
        axes.set(ylim=(len(rows) - 0.5, -0.5), ylabel=_meaning(sweep), xscale="log")
        axes.set_xlabel("probability that a member fails, 95 % interval")
        axes.grid(alpha=0.3, axis="x")
    return grid.ravel()


# Functions that draw a sweep, by the name of the file.
PICTURES: dict[str, Callable[[Any, Path], Any]] = {
    "success.png": plot_success,
    "metrics.png": plot_metrics,
    "differences.png": plot_differences,
    "causes.png": plot_causes,
    "responses.png": plot_responses,
    "rare.png": plot_rare,
}


def pictures(sweep: Sweep) -> dict[str, Callable[[Any, Path], Any]]:
    """Return the functions that draw a sweep, by the name of the file; without differences if there is one case."""
    absent = {"differences.png"} if len(sweep.cases) < 2 else set()
    absent |= {"rare.png"} if sweep.rares is None else set()
    return {name: draw for name, draw in PICTURES.items() if name not in absent}
