# SPDX-License-Identifier: Apache-2.0
"""Bode and Nyquist plots of open loops, with the spread over the fleet."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import of_kind
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.summaries import plural
from lgvi_warp.views.choice import mixed, of_members
from lgvi_warp.views.plots.canvas import COLORS, panel, panels, shade, style, wrapped
from lgvi_warp.views.plots.fans import draw_bands
from lgvi_warp.views.plots.picture import FilePath, picture

if TYPE_CHECKING:
    from lgvi_warp.robustness.linear.open_loop import OpenLoops

# Most loops that are drawn, and frequencies, down from Nyquist's to this part of it.
MOST, FREQUENCIES, LOWEST = 1000, 1000, 1e-4
# Phases are drawn from this less a turn up to it [rad]: no loop comes with such a phase from its integrators.
HIGHEST = 0.5
# Half of the width of Nyquist's window about -1.
REACH = 3.0


def _drawn(opened: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Members that are drawn (m,), frequencies (k,) [rad/s], and characteristic loci (m, k, r)."""
    of_kind("opened", opened, "models loci", "of lw.linear.loop", "give what lw.linear.loop returns")
    members = np.array([i for i, model in enumerate(opened.models) if model is not None], int)
    if not len(members):
        reasons = ", ".join(sorted(set(opened.why.tolist())))
        raise NothingToDraw(
            f"none of {plural(opened.members, 'member')} has a loop ({reasons}): there is nothing to draw"
        )
    members = np.sort(members[np.argsort(mixed(members), kind="stable")[:MOST]])
    frequencies = np.geomspace(LOWEST, 1.0, FREQUENCIES) * np.pi / opened.dt
    chosen = replace(opened, models=tuple(opened.models[i] for i in members))
    return members, frequencies, chosen.loci(frequencies)


def _title(axes: Any, opened: OpenLoops, members: np.ndarray) -> None:
    axes.set_title(wrapped(f"{opened.at}: open loops of {of_members(len(members), opened.members)}", axes.figure))


@picture
def bode(opened: OpenLoops, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw gain and phase of open loops against frequency: the median and bands between quantiles over the members.

    For loops with several inputs, the characteristic loci (eigenvalues of the frequency response) are drawn, sorted by
    magnitude: for each locus, the median and the range over the members.

    Args:
        opened: Open loops of `lw.linear.loop`.

    Returns:
        The axes of gain and phase, shape (2,).

    Raises:
        NothingToDraw: No member has a loop; the message says why.
    """
    members, w, values = _drawn(opened)
    gains = np.abs(values)
    phases = np.unwrap(HIGHEST - np.mod(HIGHEST - np.angle(np.nan_to_num(values)), 2.0 * np.pi), axis=1)
    phases = np.where(gains > 0.0, phases, np.nan)
    with panels(figure, path, (2, 1), (8.0, 8.0), sharex=True) as grid:
        rows = zip(grid[:, 0], (gains, phases), (1.0, -np.pi), ("gain", "phase [rad]"), strict=True)
        for axes, each, level, label in rows:
            if values.shape[2] == 1:
                draw_bands(axes, w, each[:, :, 0].T, np.isfinite(each[:, :, 0]).T)
            else:
                for i in np.flatnonzero((gains > 0.0).any(axis=(0, 1))).tolist():
                    low, middle, high = np.quantile(each[:, :, i], (0.0, 0.5, 1.0), axis=0)
                    shade(axes, w, low, high, i)
                    axes.plot(w, middle, label=f"characteristic locus {i + 1}", **style(i))
            axes.axhline(level, color="0.3", linestyle=":", linewidth=1.0)
            axes.set(ylabel=label, xscale="log")
            axes.grid(True, alpha=0.3)
        grid[0, 0].set_yscale("log")
        grid[1, 0].set_xlabel("frequency [rad/s]")
        grid[0, 0].legend()
        _title(grid[0, 0], opened, members)
    return grid[:, 0]


@picture
def nyquist(opened: OpenLoops, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw the Nyquist curves of open loops near -1, one curve for each member; the curve nearest to -1 is highlighted.

    Only positive frequencies are drawn. For loops with several inputs, the characteristic loci (eigenvalues of the
    frequency response) are drawn. A dotted line shows the unit circle.

    Args:
        opened: Open loops of `lw.linear.loop`.

    Returns:
        The axes.

    Raises:
        NothingToDraw: No member has a loop; the message says why.
    """
    members, _, values = _drawn(opened)
    distances = np.nanmin(np.abs(1.0 + values), axis=(1, 2))
    nearest = int(np.argmin(distances))
    with panel(ax, path, (7.0, 7.0)) as axes:
        for i, loci in enumerate(values):
            marked = i == nearest
            line = {"color": COLORS[1], "linewidth": 1.6, "zorder": 3} if marked else {"color": COLORS[0], "alpha": 0.4}
            label = f"member {members[i]}, nearest to -1 (distance {distances[i]:.3g})" if marked else None
            for locus in loci.T:
                axes.plot(locus.real, locus.imag, label=label, **line)
                label = None
        turn = np.linspace(0.0, 2.0 * np.pi, 200)
        axes.plot(np.cos(turn), np.sin(turn), color="0.3", linestyle=":", linewidth=1.0)
        axes.plot([-1.0], [0.0], "k+", markersize=12.0)
        axes.set(xlim=(-1.0 - REACH, -1.0 + REACH), ylim=(-REACH, REACH), xlabel="real part", ylabel="imaginary part")
        axes.set_aspect("equal")
        axes.grid(True, alpha=0.3)
        axes.legend()
        if ax is None:
            _title(axes, opened, members)
    return axes
