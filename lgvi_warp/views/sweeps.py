"""Pictures of sweeps: success by case and over the grid, metrics by case, paired differences, what failures go with."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import failed, under_way
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.statistics import tracking
from lgvi_warp.studies.sweeps.found import SUCCESS
from lgvi_warp.studies.sweeps.output import Sweep, against_baseline
from lgvi_warp.studies.sweeps.setup import END, Cell
from lgvi_warp.views.plots.canvas import figure_class, save_figure
from lgvi_warp.views.plots.fans import draw_bands

# Most boxes of one panel, and most members that are drawn as points.
MOST_BOXES, MOST_POINTS = 40, 4000
# Most members, and most times, of a fan.
MOST_PATHS = 200


def _ran(found: Sweep) -> list[Cell]:
    """The cells that ran; NothingToDraw where none did."""
    cells = [cell for cell in found.cells if not found.record(cell).refused]
    if not cells:
        raise NothingToDraw("all cells were refused")
    return cells


def plot_success(found: Sweep, path: str | os.PathLike[str]) -> Path:
    """Draw the success of each case with its intervals: over the first axis of the grid, a line for each value of the others.

    With two axes of two or more values each, a map of each case over both is drawn beside, with the interval in each field.

    Args:
        found: the sweep.
        path: of the picture.

    Returns:
        The path.

    Raises:
        NothingToDraw: all cells were refused.
        ImportError: matplotlib is not installed (extra: viz).
    """
    _ran(found)
    axes = found.setup.axes
    long = [name for name, values in axes.items() if len(values) > 1][:2]
    if len(long) == 2:
        return _maps(found, long, path)
    figure = figure_class()(figsize=(7.0, 4.5), layout="constrained")
    panel = figure.add_subplot()
    if not long:
        cells = _ran(found)
        ends = np.array([found.success(cell.case.name, cell.point) for cell in cells])
        panel.errorbar(range(len(cells)), 100.0 * ends[:, 0], _bars(ends), fmt="o", capsize=4.0)
        panel.set_xticks(range(len(cells)), [cell.case.name for cell in cells])
    else:
        for case in found.cases:
            cells = [cell for cell in found.cells_of(case) if not found.record(cell).refused]
            if cells:
                ends = np.array([found.success(case, cell.point) for cell in cells])
                places = _places([cell.point[long[0]] for cell in cells])
                panel.errorbar(places, 100.0 * ends[:, 0], _bars(ends), fmt="o-", capsize=4.0, label=case)
        values = axes[long[0]]
        panel.set_xticks(_places(values), [str(value) for value in values])
        panel.set_xlabel(long[0])
        panel.legend()
    panel.set_ylabel(f"passes [%], {found.confidence:.0%} interval")
    panel.grid(alpha=0.3)
    return save_figure(figure, path, 150)


def _bars(ends: np.ndarray) -> np.ndarray:
    """Lengths of error bars below and above [%], of (value, lower, upper)."""
    return 100.0 * np.maximum(0.0, np.stack([ends[:, 0] - ends[:, 1], ends[:, 2] - ends[:, 0]]))


def _places(values: list[Any]) -> list[float]:
    """Where values stand on an axis: numbers where they are, if all are finite, else evenly."""
    if all(isinstance(value, int | float) and np.isfinite(value) for value in values):
        return [float(value) for value in values]
    return [float(i) for i in range(len(values))]


def _maps(found: Sweep, names: list[str], path: str | os.PathLike[str]) -> Path:
    """Success over two axes, one map a case, at the first value of any other axis."""
    x, y = (found.setup.axes[name] for name in names)
    others = {name: values[0] for name, values in found.setup.axes.items() if name not in names}
    size = 1.6 + 1.1 * len(x), 1.6 + 0.6 * len(y)
    figure = figure_class()(figsize=(size[0] * len(found.cases), size[1]), layout="constrained")
    panels = figure.subplots(1, len(found.cases), squeeze=False)[0]
    for panel, case in zip(panels, found.cases, strict=True):
        values = np.full((len(y), len(x)), np.nan)
        for cell in found.cells_of(case, others):
            i, j = y.index(cell.point[names[1]]), x.index(cell.point[names[0]])
            if found.record(cell).refused:
                panel.text(j, i, "refused", ha="center", va="center", fontsize=7)
                continue
            value, lower, upper = found.success(case, cell.point)
            values[i, j] = 100.0 * value
            dark = value < 0.5
            panel.text(j, i, f"{100.0 * value:.1f}\n{100.0 * lower:.1f} to {100.0 * upper:.1f}", ha="center", va="center",
                       fontsize=7, color="white" if dark else "black")  # fmt: skip
        panel.imshow(values, origin="lower", vmin=0.0, vmax=100.0, cmap="viridis", aspect="auto")
        panel.set_xticks(range(len(x)), [str(value) for value in x])
        panel.set_yticks(range(len(y)), [str(value) for value in y])
        panel.set_xlabel(names[0])
        panel.set_ylabel(names[1])
        panel.set_title(f"{case}: passes [%]", fontsize=9)
    return save_figure(figure, path, 150)


def plot_metrics(found: Sweep, path: str | os.PathLike[str]) -> Path:
    """Draw boxes of each metric by case, at each point of the grid: quartiles, whiskers at 5 and 95 %.

    Args:
        found: the sweep.
        path: of the picture.

    Returns:
        The path.

    Raises:
        NothingToDraw: all cells were refused, or there are no metrics.
        ImportError: matplotlib is not installed (extra: viz).
    """
    cells = _ran(found)[:MOST_BOXES]
    names = [name for name in found.metrics if name != END]
    if not names:
        raise NothingToDraw("there are no metrics")
    figure = figure_class()(figsize=(max(6.0, 1.5 + 0.35 * len(cells)), 2.6 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, squeeze=False)[:, 0]
    for panel, name in zip(panels, names, strict=True):
        boxes = []
        for cell in cells:
            record = found.record(cell)
            x = record.numbers[name]
            good = x[np.isfinite(x) & ~failed(record.status)]
            levels = np.quantile(good, [0.05, 0.25, 0.5, 0.75, 0.95]) if len(good) else np.full(5, np.nan)
            boxes.append(dict(zip(("whislo", "q1", "med", "q3", "whishi"), levels, strict=True)))
        panel.bxp(boxes, showfliers=False)
        unit = found.unit(name)
        panel.set_ylabel(name if unit == "1" else f"{name} [{unit}]", fontsize=8)
        panel.set_xticks(range(1, len(cells) + 1), [""] * len(cells))
        panel.grid(alpha=0.3, axis="y")
    panels[-1].set_xticks(range(1, len(cells) + 1), [cell.name for cell in cells], rotation=90, fontsize=7)
    return save_figure(figure, path, 150)


def plot_differences(found: Sweep, path: str | os.PathLike[str]) -> Path:
    """Draw the differences of success to the baseline on the same members, with their intervals.

    Args:
        found: the sweep.
        path: of the picture.

    Returns:
        The path.

    Raises:
        NothingToDraw: there is nothing to compare.
        ImportError: matplotlib is not installed (extra: viz).
    """
    rows = [row for row in against_baseline(found) if row.of == SUCCESS]
    if not rows:
        raise NothingToDraw("there is no other case that ran to compare with the baseline")
    figure = figure_class()(figsize=(7.5, 1.2 + 0.3 * len(rows)), layout="constrained")
    panel = figure.add_subplot()
    for i, row in enumerate(rows):
        d = row.difference
        bars = [[100.0 * (d.value - d.lower)], [100.0 * (d.upper - d.value)]]
        panel.errorbar([100.0 * d.value], [i], xerr=bars, fmt="o", capsize=4.0, color="C0" if row.real else "0.6")
    labels = [f"{row.second}{' at ' + at if (at := _point(row.point)) else ''}" for row in rows]
    panel.set_yticks(range(len(rows)), labels, fontsize=7)
    panel.axvline(0.0, color="0.3", linewidth=0.8)
    panel.set_xlabel(f"passes more than {found.baseline} [points]; grey: not real")
    panel.grid(alpha=0.3, axis="x")
    return save_figure(figure, path, 150)


def plot_causes(found: Sweep, path: str | os.PathLike[str]) -> Path:
    """Draw which members pass over the two inputs that explain most of it, in the cell where most is open.

    Args:
        found: the sweep.
        path: of the picture.

    Returns:
        The path.

    Raises:
        NothingToDraw: in no cell some members pass and some do not, or nothing varies.
        ImportError: matplotlib is not installed (extra: viz).
    """
    open_ = [(abs(found.passed(cell).mean() - 0.5), cell.index, cell) for cell in _ran(found)]
    off, _, cell = min(open_)
    rows = found.causes(cell.case.name, cell.point)[:2]
    if off == 0.5 or not rows:
        raise NothingToDraw("in no case some members pass and some do not, or nothing varies")
    passed, inputs = found.passed(cell)[:MOST_POINTS], found.inputs(cell)
    x = inputs[rows[0]["input"]][:MOST_POINTS]
    y = inputs[rows[1]["input"]][:MOST_POINTS] if len(rows) > 1 else np.arange(len(x))
    figure = figure_class()(figsize=(6.5, 5.0), layout="constrained")
    panel = figure.add_subplot()
    for chosen, label, color in ((passed, "passes", "C0"), (~passed, "fails", "C3")):
        panel.plot(x[chosen], y[chosen], ".", color=color, markersize=3.0, label=f"{label}: {int(chosen.sum()):,}")
    panel.set_xlabel(f"{rows[0]['input']}: explains {100.0 * rows[0]['share']:.3g} % of success")
    if len(rows) > 1:
        panel.set_ylabel(f"{rows[1]['input']}: {100.0 * rows[1]['share']:.3g} %")
    panel.set_title(cell.name, fontsize=9)
    panel.legend()
    return save_figure(figure, path, 150)


def plot_responses(found: Sweep, path: str | os.PathLike[str], of: str = "", members: int = MOST_PATHS) -> Path:
    """Draw fans of what is tracked over time, by case at the first point of the grid, of members that are run again.

    Args:
        found: the sweep.
        path: of the picture.
        of: "depth", "heading", "speed", "north" or "east"; by default what the first such metric is of.
        members: number of members that are run again, the first ones; by default 200.

    Returns:
        The path.

    Raises:
        NothingToDraw: all cells were refused, or no metric is of such a number.
        ImportError: matplotlib is not installed (extra: viz).
    """
    first = {name: values[0] for name, values in found.setup.axes.items()}
    cells = [cell for cell in _ran(found) if cell.point == first]
    channels = tracking.CHANNELS[False]
    asked = [str(metric.of) for metric in found.setup.metrics.values() if str(metric.of) in channels]
    of = of or next(iter(asked), "")
    if of not in channels or not cells:
        raise NothingToDraw("no metric is of a number that is tracked over time")
    channel, count = channels[of], min(members, found.members_count)
    figure = figure_class()(figsize=(4.5 * len(cells), 4.0), layout="constrained")
    panels = figure.subplots(1, len(cells), squeeze=False, sharey=True)[0]
    for panel, cell in zip(panels, cells, strict=True):
        assert cell.fleet is not None and cell.fleet.scene.controller is not None
        duration = float(found.setup.settings.get("t1") or cell.fleet.scene.run.duration or 0.0)
        period = float(cell.fleet.scene.controller.period)
        every = period * max(1, int(duration / period / MOST_PATHS))
        save = SaveAt(every=every, fields=(*channel.of_actual, channel.wanted))
        result = found.again(cell.case.name, range(count), cell.point, save)
        y, wanted = channel.actual(result.samples), np.median(channel.reference(result.samples), axis=1)
        draw_bands(panel, result.time, y, under_way(result))
        panel.plot(result.time, wanted, "k:", linewidth=1.0, label="wanted")
        panel.set_title(cell.name, fontsize=9)
        panel.set_xlabel("time [s]")
    panels[0].set_ylabel(f"{of} [{channel.unit}]: {count} members")
    panels[0].legend()
    return save_figure(figure, path, 150)


def _point(point: Any) -> str:
    return ", ".join(f"{name} = {value}" for name, value in point.items())


def pictures(found: Sweep) -> dict[str, Callable[[Any, Path], Path]]:
    """Return the functions that draw a sweep, by the name of the file; paired differences where there are cases to compare.

    Args:
        found: the sweep.
    """
    differences = {"differences.png": plot_differences} if len(found.cases) > 1 else {}
    return {
        "success.png": plot_success,
        "metrics.png": plot_metrics,
        **differences,
        "causes.png": plot_causes,
        "responses.png": plot_responses,
    }
