# SPDX-License-Identifier: Apache-2.0
"""Overview of a run in up to four panels, and the drift of its conserved quantities."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import result_of
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import under_way
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.views.choice import AT_ONCE
from lgvi_warp.views.fleet import members_of_run, title
from lgvi_warp.views.plots.canvas import legend_below, line_marker, narrow, panel, panels, style, wrap_each, wrapped
from lgvi_warp.views.plots.ends import draw_outcomes
from lgvi_warp.views.plots.estimates import statistics
from lgvi_warp.views.plots.fans import draw_fan, notes_on, text_of
from lgvi_warp.views.plots.picture import FilePath, picture
from lgvi_warp.views.plots.read import check_fields, energy_of, quantity_of, selected, with_samples
from lgvi_warp.views.plots.steering import draw_angles, draw_commands
from lgvi_warp.views.plots.tracks import draw_plan
from lgvi_warp.views.plots.words import is_depth

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result
    from lgvi_warp.statistics.values.quantity import Quantity

# Members whose momenta are followed: as many as are read at once in 240 frames, 40 numbers each.
MOST_FOLLOWED = AT_ONCE // 40 // 240 * 10


@picture
def summary(result: Result, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw an overview of a run in up to four panels.

    The first panel shows paths of at most 12 members from above. The second shows the depth of all members, with marks
    where members failed or an event stopped them. The third shows the controller's commands with limits and faults or,
    without saved commands, roll, pitch and yaw. The last shows the outcomes if a member ended early, and otherwise the
    energy, or its change if the scene conserves it. Without samples, the statistics of the run are drawn.

    Args:
        result: A result, in memory or in a store.

    Returns:
        The axes, shape (panels,).

    Raises:
        NothingToDraw: Every member failed before the second sample, no position is finite, or nothing was kept.

    Examples:
        >>> import lgvi_warp as lw
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100"), members=8)
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> [axes.get_title() for axes in lw.plots.summary(result, path="fleet.png")]
        ['8 members from above', 'Depth', 'Attitude: medians, bands of 90 %', 'Energy']
    """
    result_of(result)
    if not result.samples and result.kept is None and result.statistics:
        return statistics(result, figure=figure, path=path)
    sampled = with_samples(result)
    check_fields(sampled, ("position",), "a summary")
    drawings: list[Callable[[Any], list[str]]] = [partial(_plan, sampled), partial(_fan, sampled, quantity_of("depth"))]
    if "command" in sampled.samples:
        drawings.append(partial(draw_commands, sampled))
    elif "attitude" in sampled.samples:
        drawings.append(partial(draw_angles, sampled))
    if np.any(result.status):
        drawings.append(partial(_outcomes, result))
    elif set(FIELDS) <= set(sampled.samples):
        drawings.append(partial(_fan, sampled, energy_of(sampled)))
    columns, height = (1, 4.2) if narrow() else (2, 5.4)
    rows = -(-len(drawings) // columns)
    with panels(figure, path, (rows, columns), (6.0 * columns, height * rows), len(drawings)) as grid:
        lines = [title(result)]
        for axes, draw in zip(grid.flat, drawings, strict=False):
            lines += draw(axes)
        figure = grid[0, 0].figure
        figure.suptitle(wrap_each(dict.fromkeys(lines), figure))
    return grid.ravel()[: len(drawings)]


def _plan(result: Result, axes: Any) -> list[str]:
    """Draw paths from above, of which nothing is told beside them."""
    draw_plan(axes, result)
    return []


def _fan(result: Result, of: Quantity, axes: Any) -> list[str]:
    """Draw a fan; return what a reader has to know beside it."""
    survey = draw_fan(axes, result, of)
    axes.set_title("Depth" if is_depth(of) else of.name.capitalize())
    if axes.get_legend_handles_labels()[0] and survey.total > 1:
        legend_below(axes, ncols=4, title=text_of(survey, members_of_run(result)))
    return notes_on(result, survey)


def _outcomes(result: Result, axes: Any) -> list[str]:
    """Draw the outcomes over time."""
    draw_outcomes(axes, result)
    axes.set_title("Outcomes")
    return []


@picture
def drift(result: Result, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw the largest change, over the members under way, of the energy and momenta that the scene conserves.

    Args:
        result: A result with all fields of the motion, in memory or in a store.

    Returns:
        The axes, with a logarithmic scale.

    Raises:
        NothingToDraw: The scene conserves neither energy nor momenta, or fields of the motion were not kept.
    """
    result, choice, some = selected(result, MOST_FOLLOWED, tuple(FIELDS), "the drift")
    kept = sorted(invariants.conserved(result))
    if not kept:
        work = ", ".join(invariants.at_work(result))
        raise NothingToDraw(f"nothing is conserved, since {work} does work: draw lw.plots.fan(result, 'energy')")
    counted = under_way(some)
    head = f"Drift of {choice.text}" if len(choice.members) < result.members else "Drift"
    with panel(ax, path) as axes:
        for i, name in enumerate(kept):
            values, unit = _conserved(some, name)
            change = np.abs(values - values[:1]).max(axis=-1)
            largest = np.fmax.reduce(np.where(counted, change, np.nan), axis=1)
            axes.plot(some.time, np.where(largest > 0.0, largest, np.nan), label=f"{name.replace('_', ' ')} [{unit}]",
                      marker=line_marker(some.time), **style(i))  # fmt: skip
        axes.set(xlabel="time [s]", ylabel="largest change since the start", yscale="log")
        axes.set_title(wrapped(f"{head}; {title(result)}", axes.figure))
        axes.grid(True, alpha=0.3)
        legend_below(axes, ncols=3)
    return axes


def _conserved(some: Result, name: str) -> tuple[np.ndarray, str]:
    """A conserved quantity of members, shape (f, m, c), and its unit."""
    if name == "energy":
        return some.energy[..., None], "J"
    if name == "horizontal_momentum":
        return invariants.linear_momentum(some)[..., :2], "N s"
    return invariants.angular_momentum(some)[..., 2:], "N m s"
