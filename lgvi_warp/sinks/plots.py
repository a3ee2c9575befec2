"""A picture of a fleet: depth as a fan of quantiles, the energy error, and a few paths."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from lgvi_warp.result import Result
    from lgvi_warp.tradeoffs import Tradeoff

# Quantile pairs of the fan, outermost first, and how dark each band is.
BANDS = ((0.0, 1.0, 0.15), (0.05, 0.95, 0.25), (0.25, 0.75, 0.4))
PATHS = 12
COLOR = "tab:blue"


def plot(result: Result, path: str | os.PathLike[str]) -> Path:
    """Draw the fleet into a picture file; its ending chooses the format. Returns the path.

    Needs position, attitude, velocity and angular velocity at two times or more. Members that failed are left out.
    Raises ImportError without matplotlib (extra: viz), ValueError when there is nothing to draw.
    """
    figure_of = _figure()
    good = np.flatnonzero(np.asarray(result.status) == 0)
    if len(good) == 0:
        raise ValueError("every member failed: there is nothing to draw; see result.status and result.failure_time")
    figure = figure_of(figsize=(15.0, 4.8))
    depth, energy, paths = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.05, right=0.985, bottom=0.12, top=0.85, wspace=0.26)
    fan(depth, result.time, result.position[:, good, 2])
    depth.set(title="Depth", xlabel="time [s]", ylabel="depth b3 [m], down")
    depth.invert_yaxis()
    fan(energy, result.time, result.energy[:, good] - result.energy[:1, good])
    energy.set(title="Energy error", xlabel="time [s]", ylabel="E(t) - E(0) [J]")
    energy.axhline(0.0, color="black", linewidth=0.5)
    _paths(paths, result.position[:, good])
    failed = result.members - len(good)
    method, step = result.provenance["method"]["name"], result.provenance["step"]
    title = f"{result.members} members, {method}, step {step:g} s"
    figure.suptitle(title + (f", {failed} failed (left out)" if failed else ""))
    target = Path(path)
    figure.savefig(target, dpi=100)
    return target


def _figure() -> Any:
    """Matplotlib's Figure. Raises ImportError with the remedy."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError("plots need matplotlib: pip install 'lgvi-warp[viz]'") from error
    return Figure


def fan(axes: Any, time: np.ndarray, values: np.ndarray) -> None:
    """Quantile bands and the median of values (k, n) against time (k,)."""
    levels = sorted({q for low, high, _ in BANDS for q in (low, high)} | {0.5})
    curves = dict(zip(levels, np.quantile(values.astype(np.float64), levels, axis=1), strict=True))
    for low, high, alpha in BANDS:
        label = "all" if low == 0.0 else f"{high - low:.0%}"
        axes.fill_between(time, curves[low], curves[high], color=COLOR, alpha=alpha, linewidth=0, label=label)
    axes.plot(time, curves[0.5], color="black", linewidth=1.0, label="median")
    axes.legend(loc="best", fontsize="small")


def _paths(axes: Any, position: np.ndarray) -> None:
    """Paths of a few members from the side: horizontal distance from the start against depth."""
    chosen = np.unique(np.linspace(0, position.shape[1] - 1, PATHS).astype(int))
    start = position[0, :, :2].mean(axis=0)
    for member in chosen:
        p = position[:, member]
        axes.plot(np.hypot(*(p[:, :2] - start).T), p[:, 2], linewidth=0.8)
    axes.set(title=f"Paths of {len(chosen)} members", xlabel="horizontal distance [m]", ylabel="depth b3 [m], down")
    axes.invert_yaxis()


COLORS = [*(f"C{i}" for i in range(10)), "navy", "darkgreen", "indigo", "black", "goldenrod", "deeppink", "teal"]
MARKERS = "os^vDPX*<>dphH"


def plot_tradeoff(found: Tradeoff, path: str | os.PathLike[str], of: str | None = None) -> Path:
    """Draw error against cost, a line for each method and precision, the front thick, and the biases of statistics.

    of: "position" and so on, by default what the trade-off was asked for. Returns the path. Raises ImportError without
    matplotlib, ValueError when there is nothing to draw.
    """
    from lgvi_warp.comparison import QUANTITIES

    figure_of = _figure()
    of = of or found.of
    if not found.measurements:
        raise ValueError("no setting was measured: there is nothing to draw")
    figure = figure_of(figsize=(20.5, 7.5))
    left, right = figure.subplots(1, 2)
    figure.subplots_adjust(left=0.055, right=0.83, bottom=0.09, top=0.88, wspace=0.2)
    shown = found.shown(of)
    groups: dict[tuple[str, str], list[Any]] = {}
    for one in found.measurements:
        groups.setdefault((one.setting.name, one.setting.dtype), []).append(one)
    names = list(dict.fromkeys(name for name, _ in groups))
    for (name, dtype), members in groups.items():
        i = names.index(name)
        single = dtype != "float64"
        style = {
            "color": COLORS[i % len(COLORS)],
            "marker": MARKERS[i % len(MARKERS)],
            "markersize": 4.5,
            "linewidth": 1.0,
        }
        style |= {"linestyle": "--", "markerfacecolor": "white"} if single else {}
        line = sorted((one for one in members if one in shown), key=lambda one: one.setting.h)
        costs = [one.us_per_vehicle_second for one in line]
        left.plot([one.error(of) for one in line], costs, label=f"{name}, {dtype}" if single else name, **style)
        biased = sorted((one for one in members if one.biases), key=lambda one: one.setting.h)
        key = f"{of}_mean" if of != "energy" else "energy_mean"
        right.plot([one.setting.h for one in biased], [one.biases.get(key, np.nan) for one in biased], **style)
    front = found.front(of)
    left.plot([one.error(of) for one in front], [one.us_per_vehicle_second for one in front], color="black", linewidth=5,
              alpha=0.2, solid_capstyle="round", label="cheapest for each error", zorder=0)  # fmt: skip
    left.set(xlabel=f"largest error of {of} [{QUANTITIES[of]}], up to {found.until:g} s",
             ylabel="microseconds of one core per vehicle and simulated second", title="Cost of accuracy")  # fmt: skip
    right.set(xlabel="step [s]", ylabel=f"bias / standard error of {found.members} members",
              title=f"Bias of the mean of {of} up to {found.t1:g} s")  # fmt: skip
    for axes, drawn, why in (
        (left, bool(shown), "no error of members: noise acts, or the reference is not good enough"),
        (right, any(one.biases for one in found.measurements), "no statistics: there is one member"),
    ):
        if drawn:
            axes.set(xscale="log", yscale="log")
        else:
            axes.text(0.5, 0.5, why, ha="center", transform=axes.transAxes)
    if shown:
        left.invert_xaxis()
    right.axhline(1.4, color="black", linewidth=0.8, linestyle=":")
    right.text(0.01, 1.6, "chance", fontsize="small", transform=right.get_yaxis_transform())
    for axes in (left, right):
        axes.grid(True, alpha=0.3)
    figure.legend(
        *left.get_legend_handles_labels(), loc="center left", bbox_to_anchor=(0.838, 0.5), fontsize="x-small", ncols=2
    )
    title = (
        f"{found.members} members, 0 to {found.t1:g} s; reference {found.reference}; better is to the right and down"
    )
    figure.suptitle(title, fontsize="medium")
    target = Path(path)
    figure.savefig(target, dpi=100)
    return target
