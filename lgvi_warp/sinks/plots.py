"""A picture of a fleet: depth as a fan of quantiles, the energy error, and a few paths."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from lgvi_warp.result import Result

# Quantile pairs of the fan, outermost first, and how dark each band is.
BANDS = ((0.0, 1.0, 0.15), (0.05, 0.95, 0.25), (0.25, 0.75, 0.4))
PATHS = 12
COLOR = "tab:blue"


def plot(result: Result, path: str | os.PathLike[str]) -> Path:
    """Draw the fleet into a picture file; its ending chooses the format. Returns the path.

    Needs position, attitude, velocity and angular velocity at two times or more. Members that failed are left out.
    Raises ImportError without matplotlib (extra: viz), ValueError when there is nothing to draw.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError("plots need matplotlib: pip install 'lgvi-warp[viz]'") from error
    good = np.flatnonzero(np.asarray(result.status) == 0)
    if len(good) == 0:
        raise ValueError("every member failed: there is nothing to draw; see result.status and result.failure_time")
    figure = Figure(figsize=(15.0, 4.8))
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
