# SPDX-License-Identifier: Apache-2.0
"""A picture of a sensitivity analysis: bars with confidence intervals, one panel for each quantity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import of_kind
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.views.plots.canvas import COLORS, hatch, panels, wrapped
from lgvi_warp.views.plots.picture import FilePath, picture
from lgvi_warp.views.plots.words import in_words

if TYPE_CHECKING:
    from lgvi_warp.uncertainty.sensitivity.indices import Indices

# Most panels: a picture of more cannot be read.
MOST = 12


@picture
def sensitivity(found: Indices, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw the sensitivity indices of each factor as bars with confidence intervals, one panel for each quantity.

    Args:
        found: Indices from `lw.uq.sobol`, `lw.uq.morris` or `lw.uq.given_data`. At most 12 quantities are drawn.

    Returns:
        The axes, shape (quantities,).

    Raises:
        NothingToDraw: No quantity varies between the members.
    """
    remedy = "give what lw.uq.sobol and its like return"
    of_kind("found", found, "quantities factors columns", "sensitivity indices", remedy)
    varied = [q for q in range(len(found.quantities)) if np.isfinite(getattr(found, found.columns[0])[q]).any()]
    drawn = varied[:MOST]
    if not drawn:
        raise NothingToDraw("no quantity varies: there is nothing to draw")
    # Of a factor that changes no quantity at all, as one without a spread, every index is zero.
    acting = np.any([np.asarray(getattr(found, column))[varied] != 0.0 for column in found.columns], axis=(0, 1))
    shown = np.flatnonzero(acting | ~acting.any())
    d = len(shown)
    columns = min(len(drawn), 3)
    rows = -(-len(drawn) // columns)
    size = 3.0 + 4.5 * columns, 2.2 + rows * (1.4 + 0.4 * d)
    with panels(figure, path, (rows, columns), size, len(drawn), sharey=True) as grid:
        for axes, q in zip(grid.flat, drawn, strict=False):
            _bars(axes, found, q, shown)
        grid[0, 0].set_yticks(np.arange(d), [found.factors[i] for i in shown])
        grid[0, 0].invert_yaxis()
        figure = grid[0, 0].figure
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
        failed = f", {found.failed} failed" if found.failed else ""
        names = [in_words(name) for q, name in enumerate(found.quantities) if q not in drawn]
        more = f"; quantities not shown: {', '.join(names)}" if names else ""
        still = [name for name, acts in zip(found.factors, acting, strict=True) if not acts and acting.any()]
        more += f"; factors without effect: {', '.join(still)}" if still else ""
        text = f"{found.name}, {found.samples} samples, {found.members} members{failed}"
        figure.suptitle(wrapped(f"{text}; {found.confidence:.0%} confidence intervals{more}", figure))
    return grid.ravel()[: len(drawn)]


def _bars(axes: Any, indices: Indices, q: int, shown: np.ndarray) -> None:
    """Draw the bars of one quantity, the columns of a factor side by side; shown: indices of the factors."""
    places, columns = np.arange(len(shown)), getattr(indices, "drawn", ()) or indices.columns
    width = 0.8 / len(columns)
    for i, column in enumerate(columns):
        name = indices.intervals.get(column)
        half = getattr(indices, name)[q][shown] if name else None
        at = places + (i - 0.5 * (len(columns) - 1)) * width
        axes.barh(at, getattr(indices, column)[q][shown], width, xerr=half, label=column, color=COLORS[i], hatch=hatch(i),
                  edgecolor="white", linewidth=0.0, error_kw={"capsize": 2.0})  # fmt: skip
    axes.axvline(0.0, color="black", linewidth=0.5)
    share = indices.name.startswith("Sobol") or "first" in indices.columns
    axes.set(title=in_words(indices.quantities[q]), xlabel="share of variance" if share else "effect [quantity's unit]")
    axes.grid(True, axis="x", alpha=0.3)
