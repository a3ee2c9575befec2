"""Pictures of runs, statistics, trade-offs and stability maps, drawn with Matplotlib."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common.errors import MissingExtra, NothingToDraw
from lgvi_warp.common.status import Status, failed, stop_time, under_way
from lgvi_warp.runs.outcomes import outcomes
from lgvi_warp.views.choice import shown
from lgvi_warp.views.fleet import LOOKS, energy_curve, evenly, quantiles, title

if TYPE_CHECKING:
    from lgvi_warp.runs.result import Result
    from lgvi_warp.statistics.estimate import Estimate
    from lgvi_warp.studies.stability.grid import Line
    from lgvi_warp.studies.stability.map import StabilityMap
    from lgvi_warp.studies.tradeoff import Measurement, Tradeoff

# Bands of the fan, outermost first: lower quantile, upper quantile, opacity.
BANDS = ((0.0, 1.0, 0.15), (0.05, 0.95, 0.25), (0.25, 0.75, 0.4))
PATHS = 12
COLOR = "tab:blue"


def save_figure(figure: Any, path: str | os.PathLike[str], dpi: int) -> Path:
    """Write a picture; the file is there whole or not at all.

    Args:
        figure: A Matplotlib figure.
        path: The file; its ending chooses the format.
        dpi: Dots per inch.

    Returns:
        The path.

    Raises:
        OSError: The file cannot be written.
    """
    target = Path(path)
    with durable.placed(target) as beside:
        figure.savefig(beside, dpi=dpi, format=target.suffix.removeprefix(".") or "png")
    return target


def plot(result: Result, path: str | os.PathLike[str]) -> Path:
    """Draw the fleet into a picture file: depth, energy and a few paths.

    The fans are of the members under way at each time. Members that an event stopped, or that failed, are marked where they
    ended, in the colour of the outcome. Energy is drawn as its error where the scene's laws conserve it.

    Args:
        result: A result with position, attitude, velocity and angular velocity.
        path: The file; its ending chooses the format.

    Returns:
        The path.

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        NothingToDraw: Every member failed before the second sample, or none has a finite position.
        OSError: The file cannot be written.
    """
    figure_of = figure_class()
    counted = under_way(result)
    _refuse_nothing(result, counted)
    figure = figure_of(figsize=(15.0, 4.8))
    depth, energy, paths = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.05, right=0.985, bottom=0.12, top=0.85, wspace=0.26)
    fan(depth, result.time, result.position[..., 2], counted)
    _ends(depth, result)
    depth.set(title="Depth", xlabel="time [s]", ylabel="depth b3 [m], down")
    depth.invert_yaxis()
    depth.legend(loc="best", fontsize="small", title=_counted_text(result, counted), title_fontsize="small")
    curve = energy_curve(result)
    fan(energy, result.time, curve.values, counted)
    energy.set(title=curve.name, xlabel="time [s]", ylabel=curve.label)
    energy.legend(loc="best", fontsize="small")
    if curve.name == "Energy error":
        energy.axhline(0.0, color="black", linewidth=0.5)
    _paths(paths, result)
    figure.suptitle(title(result))
    return save_figure(figure, path, 100)


def _refuse_nothing(result: Result, counted: np.ndarray) -> None:
    """Raise NothingToDraw where no member was anywhere, or went on beyond its start."""
    reason = ""
    if failed(result.status).all() and not counted[1:].any():
        reason = "every member failed before the second sample"
    elif not (counted & np.isfinite(result.position).all(axis=-1)).any():
        reason = "no member has a finite position"
    if reason:
        raise NothingToDraw(f"{reason}: there is nothing to draw; see result.status and result.failure_time")


def figure_class() -> Any:
    """Load Matplotlib's Figure.

    Returns:
        The class.

    Raises:
        ImportError: Matplotlib is not installed; the message has the remedy.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise MissingExtra("plots", "matplotlib", "viz") from error
    return Figure


def fan(axes: Any, time: np.ndarray, values: np.ndarray, counted: np.ndarray) -> None:
    """Draw quantile bands and the median of many members against time.

    Args:
        axes: Matplotlib axes.
        time: Times [s], shape (k,).
        values: A number of each member, shape (k, n).
        counted: Mask (k, n) of the members that count at each time.
    """
    levels = sorted({q for low, high, _ in BANDS for q in (low, high)} | {0.5})
    curves = dict(zip(levels, quantiles(values, counted, levels), strict=True))
    for low, high, alpha in BANDS:
        label = "all" if low == 0.0 else f"{high - low:.0%}"
        axes.fill_between(time, curves[low], curves[high], color=COLOR, alpha=alpha, linewidth=0, label=label)
    axes.plot(time, curves[0.5], color="black", linewidth=1.0, label="median")


def _counted_text(result: Result, counted: np.ndarray) -> str:
    """Number of members in the fan, at its beginning and at its end."""
    if counted.all():
        return f"{result.members:,} members"
    first, last = (int(counted[i].sum()) for i in (0, -1))
    return f"under way: {first:,} at {result.time[0]:g} s,\n{last:,} at {result.time[-1]:g} s"


# Most marks of ended members with the same outcome.
MARKS = 1000


def _ends(axes: Any, result: Result) -> None:
    """Mark by outcome where and when members ended before the end of the run: depth against time."""
    when, depth = stop_time(result), result.position[-1, :, 2]
    for code in outcomes(result):
        members = np.flatnonzero(np.asarray(result.status) == code)
        if code != Status.OK:
            drawn = evenly(members, MARKS)
            label = f"{code.name.lower()} ({len(members):,})"
            axes.scatter(when[drawn], depth[drawn], s=18, zorder=3, label=label, **_mark(code))


def _mark(code: Status) -> dict[str, Any]:
    """Colour and marker of an outcome; filled markers have a black edge."""
    look = LOOKS[code]
    edge = {"edgecolors": "black", "linewidths": 0.4} if code.stopped else {"linewidths": 1.2}
    return {"color": look.color, "marker": look.marker} | edge


# Most panels of statistics, and most lines in a panel.
PANELS, LINES = 12, 12


def plot_statistics(result: Result, path: str | os.PathLike[str]) -> Path:
    """Draw a run's statistics against time, one panel each.

    Quantiles are drawn as a fan, other statistics with their intervals. Statistics of paths, which have one time, and
    covariances are left to the table.

    Args:
        result: A result with statistics; the first 12 that can be drawn are.
        path: The file; its ending chooses the format.

    Returns:
        The path.

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        ValueError: There is no statistic against time.
        OSError: The file cannot be written.
    """
    figure_of = figure_class()
    drawn = drawable(result)[:PANELS]
    if not drawn:
        raise ValueError("no statistic against time was gathered: there is nothing to draw; give statistics=[...]")
    columns = min(3, len(drawn))
    rows = -(-len(drawn) // columns)
    figure = figure_of(figsize=(5.0 * columns, 3.8 * rows), layout="constrained")
    for axes, estimate in zip(figure.subplots(rows, columns, squeeze=False).flat, drawn, strict=False):
        _PANEL[estimate.settings["type"]](axes, estimate)
        histogram = estimate.settings["type"] == "histogram"
        axes.set(title=estimate.name, xlabel="time [s]", ylabel="" if histogram else f"[{estimate.unit}]")
        axes.grid(True, alpha=0.3)
        if "depth" in estimate.name or "position[2]" in estimate.name:
            axes.set_ylabel("[m], down" if estimate.unit == "m" else f"[{estimate.unit}]")
            if estimate.unit == "m":
                axes.invert_yaxis()
    for axes in list(figure.axes)[len(drawn) :]:
        axes.set_axis_off()
    figure.suptitle(f"{result.members} members, intervals of {drawn[0].confidence:.0%}")
    return save_figure(figure, path, 100)


def drawable(result: Result) -> list[Estimate]:
    """Select the statistics that `plot_statistics` draws.

    Args:
        result: A result.

    Returns:
        Its estimates against time, in the order of the result.
    """
    return [
        estimate
        for estimate in result.statistics.values()
        if len(estimate.time) > 1 and estimate.settings["type"] in _PANEL
    ]


def _levels_panel(axes: Any, one: Estimate) -> None:
    """Draw pairs of quantiles as bands about the middle one, with a colour for each component."""
    levels = one.coordinates["level"]
    for c in range(min(one.value.shape[2], LINES)):
        color, values = COLORS[c % len(COLORS)], one.value[:, :, c]
        for i in range(len(levels) // 2):
            label = f"{levels[-1 - i] - levels[i]:.0%}" if c == 0 else None
            axes.fill_between(
                one.time, values[:, i], values[:, -1 - i], color=color, alpha=0.2, linewidth=0, label=label
            )
        if len(levels) % 2:
            axes.plot(one.time, values[:, len(levels) // 2], color=color, label=one.coordinates["component"][c])
    axes.legend(loc="best", fontsize="small")


def _lines_panel(axes: Any, one: Estimate) -> None:
    """Draw a line for each component, with its interval."""
    shape = (len(one.time), -1)
    value, lower, upper = (array.reshape(shape) for array in (one.value, one.lower, one.upper))
    names = one.coordinates["component"] if one.coordinates["component"].size else np.array([one.name])
    for c in range(min(value.shape[1], LINES)):
        color = COLORS[c % len(COLORS)]
        axes.plot(one.time, value[:, c], color=color, label=names[c] if c < len(names) else None)
        axes.fill_between(one.time, lower[:, c], upper[:, c], color=color, alpha=0.3, linewidth=0)
    axes.legend(loc="best", fontsize="small")


def _extremes_panel(axes: Any, one: Estimate) -> None:
    """Draw a band from the smallest to the largest value."""
    for c in range(min(one.value.shape[1], LINES)):
        label = one.coordinates["component"][c]
        axes.fill_between(one.time, one["minimum"][:, c], one["maximum"][:, c], alpha=0.3, linewidth=0, label=label)
    axes.legend(loc="best", fontsize="small")


def _histogram_panel(axes: Any, one: Estimate) -> None:
    """Draw the fractions of the first component, bins against time."""
    drawn = axes.pcolormesh(one.time, one.coordinates["bin"], one.value[:, 0].T, shading="nearest")
    axes.figure.colorbar(drawn, ax=axes, label="fraction of members")


_LINES = ("mean", "circular_mean", "exceedance", "first_passage", "outcome")
_PANEL = {"quantiles": _levels_panel, "extremes": _extremes_panel, "histogram": _histogram_panel}
_PANEL |= dict.fromkeys(_LINES, _lines_panel)


def _paths(axes: Any, result: Result) -> None:
    """Draw a few members' paths from the side: depth against horizontal distance from the start."""
    drawn = shown(result, PATHS)
    finite = np.isfinite(result.position[0]).all(axis=-1)
    start = result.position[0, finite, :2].mean(axis=0)
    labelled: set[Status] = set()
    for member in drawn.members:
        code, p = Status(int(result.status[member])), result.position[:, member]
        distance = np.hypot(*(p[:, :2] - start).T)
        label = None if code in labelled else code.name.lower()
        labelled.add(code)
        axes.plot(distance, p[:, 2], color=LOOKS[code].color, linewidth=0.8, label=label)
        if code != Status.OK:
            axes.scatter(distance[-1], p[-1, 2], s=18, zorder=3, **_mark(code))
    axes.set(title=f"Paths of {drawn.text}", xlabel="horizontal distance [m]", ylabel="depth b3 [m], down")
    if labelled != {Status.OK}:
        axes.legend(loc="best", fontsize="small")
    axes.invert_yaxis()


COLORS = [*(f"C{i}" for i in range(10)), "navy", "darkgreen", "indigo", "black", "goldenrod", "deeppink", "teal"]
MARKERS = "os^vDPX*<>dphH"


def plot_tradeoff(found: Tradeoff, path: str | os.PathLike[str], of: str | None = None) -> Path:
    """Draw error against cost, with a line for each method and precision, and the biases of statistics.

    The settings that are cheapest for their error are joined by a thick line.

    Args:
        found: Measurements of `tradeoff`.
        path: The file; its ending chooses the format.
        of: Quantity of the errors, "position" and so on; default that of the trade-off.

    Returns:
        The path.

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        ValueError: No setting was measured.
        OSError: The file cannot be written.
    """
    figure_of = figure_class()
    of = of or found.of
    if not found.measurements:
        raise ValueError("no setting was measured: there is nothing to draw")
    figure = figure_of(figsize=(20.5, 7.5))
    cost_axes, bias_axes = figure.subplots(1, 2)
    figure.subplots_adjust(left=0.055, right=0.83, bottom=0.09, top=0.88, wspace=0.2)
    shown = found.shown(of)
    groups: dict[tuple[str, str], list[Measurement]] = {}
    for point in found.measurements:
        groups.setdefault((point.setting.name, point.setting.dtype), []).append(point)
    names = list(dict.fromkeys(name for name, _ in groups))
    for (name, dtype), members in groups.items():
        i = names.index(name)
        color, marker = COLORS[i % len(COLORS)], MARKERS[i % len(MARKERS)]
        style = {"color": color, "marker": marker, "markersize": 4.5, "linewidth": 1.0}
        label = name
        if dtype != "float64":
            style |= {"linestyle": "--", "markerfacecolor": "white"}
            label = f"{name}, {dtype}"
        members.sort(key=lambda point: point.setting.h)
        line = [point for point in members if point in shown]
        cost_axes.plot(*_errors_and_costs(line, of), label=label, **style)
        biased = [point for point in members if point.biases]
        biases = [point.biases.get(f"{of}_mean", np.nan) for point in biased]
        bias_axes.plot([point.setting.h for point in biased], biases, **style)
    cost_axes.plot(*_errors_and_costs(found.front(of), of), color="black", linewidth=5, alpha=0.2, solid_capstyle="round",
                   label="cheapest for each error", zorder=0)  # fmt: skip
    cost_axes.set(xlabel=f"largest error of {of} [{found.units[of]}], up to {found.until:g} s",
                  ylabel="microseconds of one core per vehicle and simulated second", title="Cost of accuracy")  # fmt: skip
    bias_axes.set(xlabel="step [s]", ylabel=f"bias / standard error of {found.members} members",
                  title=f"Bias of the mean of {of} up to {found.t1:g} s")  # fmt: skip
    for axes, drawn, reason in (
        (cost_axes, bool(shown), "no error of members: noise acts, or the reference is not good enough"),
        (bias_axes, any(point.biases for point in found.measurements), "no statistics: there is one member"),
    ):
        if drawn:
            axes.set(xscale="log", yscale="log")
        else:
            axes.text(0.5, 0.5, reason, ha="center", transform=axes.transAxes)
    if shown:
        cost_axes.invert_xaxis()
    bias_axes.axhline(1.4, color="black", linewidth=0.8, linestyle=":")
    bias_axes.text(0.01, 1.6, "chance", fontsize="small", transform=bias_axes.get_yaxis_transform())
    for axes in (cost_axes, bias_axes):
        axes.grid(True, alpha=0.3)
    handles, labels = cost_axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="center left", bbox_to_anchor=(0.838, 0.5), fontsize="x-small", ncols=2)
    sample = f"{found.members} members, 0 to {found.t1:g} s"
    figure.suptitle(f"{sample}; reference {found.reference}; better is to the right and down", fontsize="medium")
    return save_figure(figure, path, 100)


def _errors_and_costs(points: list[Measurement], of: str) -> tuple[list[float], list[float]]:
    """Coordinates of settings in the picture of costs."""
    return [point.error(of) for point in points], [point.us_per_vehicle_second for point in points]


# Colours of stability_map's classes, distinct for every kind of colour vision and in grey; silent failures are hatched.
CELLS = ("#0072B2", "#9BD1F0", "#F0E442", "#8C8C8C", "#D55E00")
# Line styles of the analytic limits.
STYLES = {"rotation": "-", "munk": "--", "restoring": "-.", "drag": ":"}


def plot_stability(found: StabilityMap, path: str | os.PathLike[str]) -> Path:
    """Draw a stability map, a panel for each method, with the analytic limits that lie in it.

    Args:
        found: A map of `stability_map`.
        path: The file; its ending chooses the format.

    Returns:
        The path.

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        OSError: The file cannot be written.
    """
    figure_of = figure_class()
    n = len(found.methods)
    columns = n if n <= 4 else -(-n // 2)
    rows = -(-n // columns)
    figure = figure_of(figsize=(max(4.3 * columns + 0.6, 9.0), 4.3 * rows + 1.9))
    panels = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
    height = 4.3 * rows + 1.9
    figure.subplots_adjust(left=0.9 / (4.3 * columns + 0.6), right=0.985, bottom=1.35 / height, top=1.0 - 0.75 / height,
                           wspace=0.07, hspace=0.2)  # fmt: skip
    drawn: set[str] = set()
    for axes, method in zip(panels, found.methods, strict=False):
        _cells(axes, found, method)
        drawn |= _limits(axes, found, method)
        limit = found.limit(method)
        title = f"{method}: every row to {limit.min():.2g} {found.x.unit}" if np.isfinite(limit).all() else method
        axes.set_title(title, fontsize="medium")
        axes.set_xlabel(f"{found.x.label} [{found.x.unit}]")
    for axes in panels[::columns]:
        axes.set_ylabel(f"{found.y.label} [{found.y.unit}]")
    for axes in panels[n:]:
        axes.set_visible(False)
    _legend(figure, drawn)
    scene = f"accurate: {found.of} to {found.error_bound:g} {found.unit} up to {found.error_time:.3g} s"
    bounded = f"bounded: energy up to {found.t1:.3g} s; worst of {found.directions} starts"
    figure.suptitle(f"{scene}; {bounded}", fontsize="medium")
    return save_figure(figure, path, 110)


def _edges(line: Line) -> np.ndarray:
    """Edges (k + 1,) of the cells about an axis's k values, halfway between neighbours."""
    values = np.log(line.values) if line.log else line.values
    half = 0.5 * np.diff(values) if len(values) > 1 else np.array([0.5])
    edges = np.concatenate([[values[0] - half[0]], values[:-1] + half[: len(values) - 1], [values[-1] + half[-1]]])
    return np.exp(edges) if line.log else edges


def _cells(axes: Any, found: StabilityMap, method: str) -> None:
    """Draw the classes as colours."""
    from matplotlib.colors import ListedColormap

    classes = found.classes[method]
    x, y = _edges(found.x), _edges(found.y)
    axes.pcolormesh(x, y, classes, cmap=ListedColormap(CELLS), vmin=-0.5, vmax=len(CELLS) - 0.5, shading="flat")
    silent = np.ma.masked_where(classes != len(CELLS) - 1, classes)
    if not silent.mask.all():
        axes.pcolor(x, y, silent, cmap=ListedColormap(CELLS[-1:]), hatch="xxx", edgecolor="black", linewidth=0.0)
    axes.set_xscale("log" if found.x.log else "linear")
    axes.set_yscale("log" if found.y.log else "linear")


def _limits(axes: Any, found: StabilityMap, method: str) -> set[str]:
    """Draw where h reaches each analytic limit, black on white to be seen on every colour; return the limits drawn."""
    drawn: set[str] = set()
    if min(len(found.x.values), len(found.y.values)) < 2:
        return drawn
    for name, ratios in found.ratios[method].items():
        level = np.log(np.maximum(ratios, 1e-12))
        if level.min() < 0.0 < level.max():
            drawn.add(name)
            for color, width in (("white", 4.0), ("black", 1.7)):
                axes.contour(found.x.values, found.y.values, level, [0.0], colors=color, linewidths=width,
                             linestyles="-" if color == "white" else STYLES[name])  # fmt: skip
    return drawn


def _legend(figure: Any, drawn: set[str]) -> None:
    """Draw the legend of classes and limits below the panels."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from lgvi_warp.studies.stability.limits import TEXTS
    from lgvi_warp.studies.stability.map import Cell

    handles: list[Any] = [
        Patch(facecolor=color, edgecolor="black", linewidth=0.4, label=f"{cell.name.lower()}: {cell.text}",
              hatch="xxx" if cell == Cell.SILENT else None)
        for cell, color in zip(Cell, CELLS, strict=True)
    ]  # fmt: skip
    handles += [Line2D([], [], color="black", linewidth=1.7, linestyle=style, label=TEXTS[name])
                for name, style in STYLES.items() if name in drawn]  # fmt: skip
    figure.legend(handles=handles, loc="lower center", ncols=3, fontsize="small", frameon=False)
