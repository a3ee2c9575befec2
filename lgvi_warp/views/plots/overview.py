# SPDX-License-Identifier: Apache-2.0
"""The first look at a run: depth, energy and a few paths; and the drift of what its laws conserve."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import result_of
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import under_way
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.views.choice import AT_ONCE
from lgvi_warp.views.fleet import members_of_run, title
from lgvi_warp.views.plots.canvas import below, panel, panels, style, wrapped
from lgvi_warp.views.plots.estimates import statistics
from lgvi_warp.views.plots.fans import draw_fan, notes_on, text_of
from lgvi_warp.views.plots.read import check_fields, energy_of, quantity_of, selected, with_samples
from lgvi_warp.views.plots.tracks import draw_paths

if TYPE_CHECKING:
    from lgvi_warp.runs.result import Result

# Members whose momenta are followed: as many as are read at once in 240 frames, 40 numbers each.
MOST_FOLLOWED = AT_ONCE // 40 // 240 * 10


def summary(result: Result, *, figure: Any = None, path: str | os.PathLike[str] | None = None) -> np.ndarray:
    """Draw a run at a glance: depth and energy of the members under way, and paths of a few.

    Members that an event stopped, or that failed, are marked where they ended, in the colour of the outcome. Energy is drawn
    as its error where the scene's laws conserve it. Where not all fields of the motion were kept, there is no energy; where no
    samples were, the statistics are drawn.

    Args:
        result: A result, in memory or in a store.
        figure: Matplotlib figure to draw on; default None, one of its own.
        path: File to write; its ending chooses the format. Default None: none is written.

    Returns:
        The axes, shape (panels,).

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        NothingToDraw: Every member failed before the second sample, none has a finite position, or nothing was kept.
        OSError: The file cannot be written.
    """
    result_of(result)
    if not result.samples and result.kept is None and result.statistics:
        return statistics(result, figure=figure, path=path)
    result = with_samples(result)
    check_fields(result, ("position",), "a summary")
    with_energy = set(FIELDS) <= set(result.samples)
    with panels(figure, path, (1, 3 if with_energy else 2), (15.0 if with_energy else 10.0, 5.6)) as grid:
        axes, lines = grid[0], [title(result)]
        fans = [("Depth", quantity_of("depth"))] + [("", energy_of(result))] * with_energy
        for panel_axes, (name, of) in zip(axes, fans, strict=False):
            survey = draw_fan(panel_axes, result, of)
            lines += notes_on(result, survey)
            panel_axes.set_title(name or of.name.capitalize())
            if panel_axes.get_legend_handles_labels()[0] and survey.total > 1:
                below(panel_axes, ncols=3, title=text_of(survey, members_of_run(result)) if name else None)
        draw_paths(axes[-1], result)
        figure = axes[0].figure
        figure.suptitle("\n".join(wrapped(line, figure) for line in dict.fromkeys(lines)))
    return axes


def drift(result: Result, *, ax: Any = None, path: str | os.PathLike[str] | None = None) -> Any:
    """Draw the largest change of what the scene's laws conserve, energy and momenta, over the members under way.

    Args:
        result: A result with all fields of the motion, in memory or in a store.
        ax: Matplotlib axes to draw on; default None, those of a figure of its own.
        path: File to write; its ending chooses the format. Default None: none is written.

    Returns:
        The axes, with a logarithmic scale.

    Raises:
        ImportError: Matplotlib is not installed (extra: viz).
        NothingToDraw: The laws conserve nothing, or fields of the motion were not kept.
        OSError: The file cannot be written.
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
                      marker="o" if len(some.time) < 3 else "", **style(i))  # fmt: skip
        axes.set(xlabel="time [s]", ylabel="largest change since the start", yscale="log")
        axes.set_title(wrapped(f"{head}; {title(result)}", axes.figure))
        axes.grid(True, alpha=0.3)
        below(axes, ncols=3)
    return axes


def _conserved(some: Result, name: str) -> tuple[np.ndarray, str]:
    """A conserved quantity of members, shape (f, m, c), and its unit."""
    if name == "energy":
        return some.energy[..., None], "J"
    if name == "horizontal_momentum":
        return invariants.linear_momentum(some)[..., :2], "N s"
    return invariants.angular_momentum(some)[..., 2:], "N m s"
