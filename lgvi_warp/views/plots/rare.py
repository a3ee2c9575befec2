# SPDX-License-Identifier: Apache-2.0
"""Picture of a rare event: exceedance probabilities of its limit, and the inputs of failing members."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import of_kind
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.random import generator
from lgvi_warp.views.plots.canvas import COLORS, GREY, panels, style, wrapped
from lgvi_warp.views.plots.picture import FilePath, picture

if TYPE_CHECKING:
    from lgvi_warp.uncertainty.rare.answer import RareEvent
    from lgvi_warp.uncertainty.rare.subset import SubsetRun

# Members as plain sampling draws them, and most failing ones, that are drawn.
PLAIN, MOST = 1000, 1000


@picture
def rare(found: RareEvent, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw the result of `lw.rare_event`: exceedance probabilities of the limit, and the inputs of failing members.

    The first panel, drawn for subset simulation or splitting, shows the probability that the limit exceeds a value. The
    event is at 0; circles mark thresholds. The second shows failing and all members in the two most changed inputs.

    Args:
        found: Result of `lw.rare_event`.

    Returns:
        The axes, shape (panels,).

    Raises:
        NothingToDraw: The answer has no levels (as by plain sampling), and nothing but noise varies.
    """
    of_kind("found", found, "probability runs normals", "of lw.rare_event", "give what lw.rare_event returns")
    numbers = bool(found.moved) and len(found.normals) > 0
    count = int(bool(found.runs)) + int(numbers)
    if not count:
        raise NothingToDraw("the event was sampled plainly, and no number varies: there is nothing to draw")
    with panels(figure, path, (1, count), (1.0 + 5.0 * count, 4.8)) as grid:
        if found.runs:
            _levels(grid[0, 0], found)
        if numbers:
            _failing(grid[0, -1], found)
        title = f"{found.event}: probability {found.probability:.3g}, relative error {100 * found.relative_error:.2g} %"
        grid[0, 0].figure.suptitle(wrapped(title, grid[0, 0].figure))
    return np.asarray(grid.ravel())


def _levels(axes: Any, answer: RareEvent) -> None:
    """Draw how probable limits are, by each run."""
    for i, run in enumerate(answer.runs[:4]):
        limits, chances = survival(run)
        axes.semilogy(limits, chances, label=f"run {i + 1}, {run.members:,} members", **style(i))
        bounds = run.thresholds[1:]
        axes.semilogy(bounds, np.interp(bounds, limits, chances), "o", color=style(i)["color"], fillstyle="none")
    axes.axvline(0.0, color="0.3", linestyle=":", label="the event")
    axes.axhline(answer.probability, color="0.3", linewidth=0.8)
    axes.set(xlabel="limit (event: above 0)", ylabel="probability of exceedance")
    axes.grid(alpha=0.3)
    axes.legend()


def survival(run: SubsetRun) -> tuple[np.ndarray, np.ndarray]:
    """Limits (m,), rising, and how probable it is by a run that a member's is above them (m,)."""
    limits, chances, chance = [], [], 1.0
    ends = [*run.thresholds[1:], np.inf]
    for own, bound in zip(run.limits, ends, strict=True):
        ranked = np.sort(own[np.isfinite(own)])
        # Members with the same limit, such as all that an event stopped, are all of them at it or above.
        above = chance * (len(own) - np.searchsorted(ranked, ranked)) / len(own)
        inside = ranked < bound
        limits.append(ranked[inside])
        chances.append(above[inside])
        chance *= float((own >= bound).mean()) if np.isfinite(bound) else 1.0
    return np.concatenate(limits), np.concatenate(chances)


def _failing(axes: Any, answer: RareEvent) -> None:
    """Draw failing members over plain ones, in the two numbers that are moved most."""
    names = list(answer.moved)
    spread = np.abs(answer.weights @ answer.normals) + np.sqrt(answer.weights @ answer.normals**2)
    first, second = (*np.argsort(-spread)[:2], 0)[:2]
    plain = generator(0, "rare picture").standard_normal((PLAIN, 2))
    chosen = generator(1, "rare picture").choice(len(answer.weights), size=MOST, p=answer.weights)
    axes.plot(
        plain[:, 0], plain[:, 1] if len(names) > 1 else 0.0 * plain[:, 1], ".", color=GREY, ms=3, label="all members"
    )
    x = answer.normals[chosen, first]
    y = answer.normals[chosen, second] if len(names) > 1 else 0.0 * x
    axes.plot(x, y, "^", color=COLORS[1], markersize=3, label="failing members")
    axes.set(xlabel=f"{names[first]} [sd]", ylabel=f"{names[second]} [sd]" if len(names) > 1 else "")
    axes.grid(alpha=0.3)
    axes.legend()
