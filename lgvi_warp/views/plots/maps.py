# SPDX-License-Identifier: Apache-2.0
"""Stability maps: classes of cells as colours, a panel for each method, with the analytic limits that lie in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import of_kind
from lgvi_warp.views.plots.canvas import panels, wrapped
from lgvi_warp.views.plots.picture import FilePath, picture

if TYPE_CHECKING:
    from lgvi_warp.accuracy.stability.grid import Line
    from lgvi_warp.accuracy.stability.map import StabilityMap

# Colours of stability_map's classes, distinct for every kind of colour vision and in grey; silent failures are hatched.
CELLS = ("#0072B2", "#9BD1F0", "#F0E442", "#8C8C8C", "#D55E00")
# Line styles of the analytic limits.
STYLES = {"rotation": "-", "munk": "--", "restoring": "-.", "drag": ":"}


@picture
def stability(found: StabilityMap, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw a stability map, one panel for each method, with the analytic stability limits that lie within the map.

    Args:
        found: A map from `lw.stability_map`.

    Returns:
        The axes, shape (methods,).
    """
    of_kind("found", found, "methods classes ratios", "a stability map", "give what lw.stability_map returns")
    n = len(found.methods)
    columns = min(n, 2)
    rows = -(-n // columns)
    with panels(figure, path, (rows, columns), (10.0, 4.2 * rows + 2.6), sharex=True, sharey=True) as grid:
        drawn: set[str] = set()
        for axes, method in zip(grid.flat, found.methods, strict=False):
            _cells(axes, found, method)
            drawn |= _limits(axes, found, method)
            limit = found.limit(method)
            text = f"{method}: bounded to {limit.min():.2g} {found.x.unit}" if np.isfinite(limit).all() else method
            axes.set(title=text, xlabel=f"{found.x.label} [{found.x.unit}]")
        for axes in grid[:, 0]:
            axes.set_ylabel(f"{found.y.label} [{found.y.unit}]")
        for axes in grid.flat[n:]:
            axes.set_visible(False)
        for axes in grid.flat[n - columns : n]:  # with nothing below
            axes.tick_params(labelbottom=True)
        figure = grid[0, 0].figure
        _legend(figure, drawn)
        scene = f"accurate: {found.of} error below {found.error_bound:g} {found.unit} until {found.error_time:.3g} s"
        bounded = f"bounded: energy until {found.t1:.3g} s; cells show the worst of {found.directions} starts"
        figure.suptitle(wrapped(f"{scene}; {bounded}", figure))
    return grid.ravel()[:n]


def _edges(line: Line) -> np.ndarray:
    """Edges (k + 1,) of the cells about an axis's k values, halfway between neighbours."""
    values = np.log(line.values) if line.log else line.values
    half = 0.5 * np.diff(values) if len(values) > 1 else np.array([0.5])
    edges = np.concatenate([[values[0] - half[0]], values[:-1] + half[: len(values) - 1], [values[-1] + half[-1]]])
    return np.exp(edges) if line.log else edges


def _cells(axes: Any, stability: StabilityMap, method: str) -> None:
    """Draw the classes as colours."""
    from matplotlib.colors import ListedColormap

    classes = stability.classes[method]
    x, y = _edges(stability.x), _edges(stability.y)
    axes.pcolormesh(x, y, classes, cmap=ListedColormap(CELLS), vmin=-0.5, vmax=len(CELLS) - 0.5, shading="flat")
    silent = np.ma.masked_where(classes != len(CELLS) - 1, classes)
    if not silent.mask.all():
        axes.pcolor(x, y, silent, cmap=ListedColormap(CELLS[-1:]), hatch="xxx", edgecolor="black", linewidth=0.0)
    axes.set_xscale("log" if stability.x.log else "linear")
    axes.set_yscale("log" if stability.y.log else "linear")


def _limits(axes: Any, stability: StabilityMap, method: str) -> set[str]:
    """Draw where h reaches each analytic limit, black on white to be seen on every colour; return the limits drawn."""
    drawn: set[str] = set()
    if min(len(stability.x.values), len(stability.y.values)) < 2:
        return drawn
    for name, ratios in stability.ratios[method].items():
        level = np.log(np.maximum(ratios, 1e-12))
        if level.min() < 0.0 < level.max():
            drawn.add(name)
            for color, width in (("white", 4.0), ("black", 1.7)):
                axes.contour(stability.x.values, stability.y.values, level, [0.0], colors=color, linewidths=width,
                             linestyles="-" if color == "white" else STYLES[name])  # fmt: skip
    return drawn


def _legend(figure: Any, drawn: set[str]) -> None:
    """Draw the legend of classes and limits below the panels."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from lgvi_warp.accuracy.stability.limits import TEXTS
    from lgvi_warp.accuracy.stability.map import Cell

    handles: list[Any] = [
        Patch(facecolor=color, edgecolor="black", linewidth=0.4, label=f"{cell.name.lower()}: {cell.text}",
              hatch="xxx" if cell == Cell.SILENT else None)
        for cell, color in zip(Cell, CELLS, strict=True)
    ]  # fmt: skip
    handles += [Line2D([], [], color="black", linewidth=1.7, linestyle=style, label=TEXTS[name])
                for name, style in STYLES.items() if name in drawn]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
