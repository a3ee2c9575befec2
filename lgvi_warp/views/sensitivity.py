"""A picture of a sensitivity analysis: bars with confidence intervals, one panel for each quantity."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.views.plots import figure_class, save_figure

if TYPE_CHECKING:
    from lgvi_warp.studies.sensitivity import Indices

COLORS = ("tab:blue", "tab:orange", "tab:green")
# Most panels: a picture of more cannot be read.
MOST = 12


def plot_sensitivity(found: Indices, path: str | os.PathLike[str]) -> Path:
    """Draw the indices of each factor as bars with their confidence intervals.

    Args:
        found: Indices of `lw.uq.sobol` or `lw.uq.morris`; the first 12 quantities that vary are drawn.
        path: The file; its ending chooses the format.

    Returns:
        The path.

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        ValueError: No quantity varies.
        OSError: The file cannot be written.
    """
    figure_of = figure_class()
    shown = [q for q in range(len(found.quantities)) if np.isfinite(getattr(found, found.columns[0])[q]).any()][:MOST]
    if not shown:
        raise ValueError("no quantity varies: there is nothing to draw")
    d = len(found.factors)
    columns = min(len(shown), 3)
    lines = -(-len(shown) // columns)
    figure = figure_of(figsize=(2.5 + 4.5 * columns, 1.4 + lines * (1.2 + 0.35 * d)), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharey=True).reshape(-1)
    for axes, q in zip(panels, shown, strict=False):
        _bars(axes, found, q)
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    panels[0].set_yticks(np.arange(d), found.factors)
    panels[0].invert_yaxis()
    panels[0].legend(loc="best", fontsize="small")
    failed = f", {found.failed} failed" if found.failed else ""
    hidden = len(found.quantities) - len(shown)
    more = f"; {hidden} quantities not shown" if hidden else ""
    figure.suptitle(f"{found.name}, {found.samples} samples, {found.members} members{failed}; "
                    f"{found.confidence:.0%} intervals{more}", fontsize="medium")  # fmt: skip
    return save_figure(figure, path, 100)


def _bars(axes: Any, found: Indices, q: int) -> None:
    """Draw the bars of one quantity, the columns of a factor side by side."""
    places = np.arange(len(found.factors))
    width = 0.8 / len(found.columns)
    for i, column in enumerate(found.columns):
        name = found.intervals.get(column)
        half = getattr(found, name)[q] if name else None
        at = places + (i - 0.5 * (len(found.columns) - 1)) * width
        axes.barh(
            at, getattr(found, column)[q], width, xerr=half, label=column, color=COLORS[i], error_kw={"capsize": 2.0}
        )
    axes.axvline(0.0, color="black", linewidth=0.5)
    axes.set(title=found.quantities[q], xlabel="part of the variance" if found.name.startswith("Sobol") else "effect")
    axes.grid(True, axis="x", alpha=0.3)
