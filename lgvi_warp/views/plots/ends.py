# SPDX-License-Identifier: Apache-2.0
"""Outcomes of the members, and the spread of their numbers at one time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import listed, result_of
from lgvi_warp.common.errors import Faults, NothingToDraw, refusal
from lgvi_warp.common.status import Status, stop_time
from lgvi_warp.results import outcomes as ended_so
from lgvi_warp.results.quantities import OfResult, quantities
from lgvi_warp.views.choice import select_members
from lgvi_warp.views.fleet import OUTCOME_STYLES, title
from lgvi_warp.views.plots.canvas import (
    COLORS,
    hatch,
    legend_below,
    mark,
    narrow,
    panel,
    panels,
    point_down,
    widen,
    wrapped,
)
from lgvi_warp.views.plots.picture import FilePath, picture
from lgvi_warp.views.plots.read import at_one_time, estimate_for, with_samples
from lgvi_warp.views.plots.words import DEPTHS, floors, in_words, some_of, unit_of

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result
    from lgvi_warp.statistics.estimates.estimate import Estimate

# Times at which shares are drawn where members end.
TIMES = 400
MOST_BINS = 40
# Most members of a scatter plot, and most quantities.
MOST_POINTS, MOST_PAIRS = 1000, 6


@picture
def outcomes(result: Result, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw the shares of members under way and of ended members, by outcome, against time.

    No samples are needed, so runs with keep="none" can be drawn, too.

    Args:
        result: A result.

    Returns:
        The axes.

    Examples:
        >>> import lgvi_warp as lw
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100"), members=8)
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> lw.plots.outcomes(result).get_ylabel()
        'share of members [%]'
    """
    result_of(result)
    with panel(ax, path) as axes:
        draw_outcomes(axes, result)
        if ax is None:
            axes.set_title(wrapped(title(result), axes.figure))
    return axes


def draw_outcomes(axes: Any, result: Result) -> None:
    """Draw the shares of the members under way and of those that ended, with a legend."""
    codes, status, when = ended_so.outcomes(result), np.asarray(result.status), stop_time(result)
    time = np.unique(np.concatenate([np.linspace(result.time[0], result.time[-1], TIMES), result.time[[0, -1]]]))
    ended = [code for code in codes if code != Status.OK]
    counts = {code: np.searchsorted(np.sort(when[status == code]), time, side="right") for code in ended}
    going = result.members - sum(counts.values(), np.zeros(len(time)))
    shares = [100.0 * count / result.members for count in (going, *counts.values())]
    ok = int((status == Status.OK).sum())
    labels = [f"under way; {ok:,} reach the end"] + [_first(result, code, when) for code in ended]
    colors = [OUTCOME_STYLES[code].color for code in (Status.OK, *ended)]
    for i, area in enumerate(axes.stackplot(time, *shares, colors=colors, labels=labels)):
        area.set(hatch=hatch(i), edgecolor="white", linewidth=0.0)
    axes.set(xlabel="time [s]", ylabel="share of members [%]", xlim=(time[0], time[-1]), ylim=(0.0, 100.0))
    legend_below(axes, ncols=1)


def _first(result: Result, code: Status, when: np.ndarray) -> str:
    """An outcome, how many members had it, and when the first had it."""
    members = np.asarray(result.status) == code
    count = f"{int(members.sum()):,} of {result.members:,}"
    return f"{code.name.lower()}: {count}, the first at {when[members].min():.4g} s"


@picture
def histogram(
    result: Result, of: Any = "depth", at: float | None = None, *, ax: Any = None, path: FilePath | None = None
) -> Any:
    """Draw a histogram of a quantity over the members at one time, stacked by the outcomes up to this time.

    Members that ended are counted with their last state. A depth is drawn on the vertical axis, which points down. If
    no samples were kept, a statistic lw.statistics.Histogram of the quantity is drawn.

    Args:
        result: A result, in memory or in a store.
        of: A quantity with one component, such as "depth" (default), "max(speed)" or a `lw.statistics.Quantity`.
        at: Time [s]; the sample nearest to this time is drawn. Default None: the last sample.

    Returns:
        The axes.

    Raises:
        NothingToDraw: Neither samples nor a histogram of the quantity were kept, or no member has a finite value.
        SceneError: The quantity is unknown, or has several components.

    Examples:
        >>> import lgvi_warp as lw
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100"), members=8)
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> lw.plots.histogram(result, "max(speed)", at=1.0).get_xlabel()
        'max(speed) [m/s]'
    """
    (meaning,) = quantities([of])
    faults = Faults()
    at = None if at is None else faults.number("at", at, "s")
    faults.raise_if_any()
    estimate = None if result_of(result).samples else estimate_for(result, meaning.label, ("histogram",))
    result = result if estimate else with_samples(result)
    edges, when, unit, shares = _gathered(*estimate, at) if estimate else _counted(result, meaning, at)
    down = meaning.label in DEPTHS
    with panel(ax, path) as axes:
        base = np.zeros(len(edges) - 1)
        for i, (label, (share, color)) in enumerate(shares.items()):
            draw, start = (axes.barh, {"left": base}) if down else (axes.bar, {"bottom": base})
            draw(edges[:-1], share, np.diff(edges), **start, color=color, hatch=hatch(i), edgecolor="white",
                 linewidth=0.3, align="edge", label=label)  # fmt: skip
            base = base + share
        name, count = f"{in_words(meaning.label)} [{unit or '1'}]", "share of members [%]"
        axes.set(xlabel=count if down else name, ylabel=f"{name}, down" if down else count)
        text = f"{in_words(meaning.label)} of {some_of(result, result.members)} at {when:g} s"
        axes.set_title(wrapped(text, axes.figure))
        if down:
            point_down(axes, floors(result))
        legend_below(axes, ncols=3)
    return axes


# Edges of bins, the time [s], the unit, and by label of a group of members its share [%] in each bin and its colour.
Shares = tuple[np.ndarray, float, str, dict[str, tuple[np.ndarray, str]]]


def _gathered(statistic: Estimate, component: int, at: float | None) -> Shares:
    """Counts of a statistic lw.statistics.Histogram at the time nearest to `at`."""
    frame = _nearest(statistic.time, at)
    outside = int(statistic["below"][frame, component] + statistic["above"][frame, component])
    more = f", {outside:,} of them outside the bins" if outside else ""
    share = 100.0 * statistic.value[frame, component]
    unit = unit_of(str(statistic.coordinates["component"][component]))
    shares = {f"{int(statistic.count[frame]):,} members{more}": (share, COLORS[0])}
    return statistic.coordinates["edge"], float(statistic.time[frame]), unit, shares


def _counted(result: Result, of: OfResult, at: float | None) -> Shares:
    """Members counted in bins at the sample nearest to `at`, by what had become of them."""
    members, frame = select_members(result).ranked, _nearest(result.time, at)
    values, labels, unit = at_one_time(result, of, members, frame)
    if len(labels) > 1:
        raise refusal("of", of.label, f"has {len(labels)} components", f"name one: {', '.join(labels)}")
    when, finite = float(result.time[frame]), np.isfinite(values[:, 0])
    if not finite.any():
        raise NothingToDraw(f"no member has a finite {of.label}: there is nothing to draw. See result.status")
    edges, shares = _edges(values[finite, 0]), {}
    for code, group in _groups(result, members, when):
        share = np.histogram(values[finite & group, 0], edges)[0] * (100.0 / len(members))
        shares[_counted_text(code, group)] = share, OUTCOME_STYLES[code].color
    return edges, when, unit, shares


def _edges(values: np.ndarray) -> np.ndarray:
    """Edges of bins; about numbers that are all the same to a millionth, a range of a thousandth."""
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high), 1e-12)
    if high - low < 1e-6 * size:
        low, high = low - 5e-4 * size, high + 5e-4 * size
    return np.linspace(low, high, int(np.clip(np.sqrt(len(values)), 5, MOST_BINS)) + 1)


def _groups(result: Result, members: np.ndarray, when: float) -> list[tuple[Status, np.ndarray]]:
    """Masks of the members under way at a time, and of those that ended by then, by outcome; only those that occur."""
    status, ended = np.asarray(result.status)[members], stop_time(result)[members] <= when
    early = ((code, ended & (status == code)) for code in ended_so.outcomes(result) if code != Status.OK)
    return [(code, group) for code, group in ((Status.OK, ~ended), *early) if group.any()]


@picture
def pairs(
    result: Result,
    of: Sequence[Any] = ("position[0]", "position[1]", "depth", "speed"),
    *,
    figure: Any = None,
    path: FilePath | None = None,
) -> np.ndarray:
    """Draw each pair of quantities at the end as points, coloured by outcome, and each quantity as a histogram.

    Args:
        result: A result with the samples that the quantities need, in memory or in a store.
        of: Quantities with two to six components in total, such as "max(depth)"; default north, east, depth and speed.

    Returns:
        The axes, shape (m, m) for m components.

    Raises:
        NothingToDraw: Required samples were not kept, or no member has a finite start.
        SceneError: A quantity is unknown, or there are fewer than two or more than six components.
    """
    result = with_samples(result)
    choice = select_members(result, MOST_POINTS)
    columns: list[np.ndarray] = []
    names: list[str] = []
    for meaning in quantities(listed("of", of, "quantities")):
        values, labels, unit = at_one_time(result, meaning, choice.members)
        columns += list(values.T)
        names += [f"{in_words(label)} [{unit or '1'}]{', down' * (label in DEPTHS)}" for label in labels]
    m, small = len(names), narrow()
    # In one column there is no room for long labels beside each other.
    names = [name.replace(" [", "\n[") for name in names] if small else names
    if not 2 <= m <= MOST_PAIRS:
        raise refusal("of", list(of), f"has {m} numbers a member", f"name from 2 to {MOST_PAIRS}")
    groups = _groups(result, choice.members, float(result.time[-1]))
    size = max(8.0, 2.6 * m)
    with panels(figure, path, (m, m), (size, size)) as axes:
        for i in range(m):
            for j in range(m):
                _pair(axes[i, j], columns[j], columns[i], groups, i == j)
                axes[i, j].set(xlabel=names[j] if i == m - 1 else "", ylabel=names[i] if j == 0 else "")
                widen(axes[i, j].xaxis)
                if i != j:
                    widen(axes[i, j].yaxis)
                if names[i].endswith("down") and i != j:
                    axes[i, j].invert_yaxis()
                axes[i, j].locator_params(nbins=3)
                # An offset of all ticks would lie over the label.
                axes[i, j].xaxis.set_major_formatter("{x:.5g}")
                axes[i, j].yaxis.set_major_formatter("{x:.5g}")
                axes[i, j].tick_params(labelbottom=i == m - 1, labelleft=i != j and j == 0, axis="both")
                axes[i, j].tick_params(axis="x", labelrotation=90 if small else 0)
        handles, labels = axes[1, 0].get_legend_handles_labels()
        axes[0, -1].figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
        axes[0, 0].figure.align_ylabels(axes[:, 0])
        axes[0, 0].figure.align_xlabels(axes[-1])
        text = f"{some_of(result, len(choice.members))} at {result.time[-1]:g} s"
        axes[0, 0].figure.suptitle(wrapped(text, axes[0, 0].figure))
    return axes


def _pair(axes: Any, x: np.ndarray, y: np.ndarray, groups: list[tuple[Status, np.ndarray]], same: bool) -> None:
    """Draw points of two numbers, or bars of one."""
    if same:
        finite = x[np.isfinite(x)]
        axes.hist(finite, _edges(finite), color=COLORS[0])
        return
    for code, group in groups:
        axes.scatter(x[group], y[group], s=12, alpha=0.8, label=_counted_text(code, group), **mark(code))


def _counted_text(code: Status, group: np.ndarray) -> str:
    """An outcome, or "under way", and how many members of a mask (m,) have it."""
    return f"{'under way' if code == Status.OK else code.name.lower()} ({int(group.sum()):,})"


def _nearest(time: np.ndarray, at: float | None) -> int:
    """Index of the sample nearest to a time; of the last for None."""
    return len(time) - 1 if at is None else int(np.abs(time - at).argmin())
