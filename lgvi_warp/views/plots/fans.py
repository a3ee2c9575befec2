# SPDX-License-Identifier: Apache-2.0
"""Fans: one number of all members under way against time, as bands of quantiles; and the same of several runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import mapping_of, result_of
from lgvi_warp.common.errors import NothingToDraw, refusal
from lgvi_warp.common.status import Status, failed, stop_time
from lgvi_warp.results.outcomes import outcomes
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.views.choice import mixed, of_members
from lgvi_warp.views.drawn import at_levels
from lgvi_warp.views.fleet import members_of_run, title
from lgvi_warp.views.plots.canvas import (
    COLORS,
    TINTS,
    band,
    legend_below,
    line_marker,
    mark,
    panel,
    point_down,
    shade,
    style,
    wrap_each,
)
from lgvi_warp.views.plots.picture import FilePath, picture
from lgvi_warp.views.plots.read import (
    ValuesUnderWay,
    estimate_for,
    quantity_of,
    survey_of,
    unbounded_text,
    with_samples,
)
from lgvi_warp.views.plots.words import HINT, floors, floors_of_each, in_words, is_depth, label_of

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result
    from lgvi_warp.statistics.estimates.estimate import Estimate

# Bands of the fan, outermost first: lower quantile, upper quantile.
BANDS = ((0.0, 1.0), (0.05, 0.95), (0.25, 0.75))
# Most marks of ended members with the same outcome: more would cover the bands.
MARKS = 200
# Statistics that can stand for samples, the best first.
STANDING = ("quantiles", "mean", "extremes")


@picture
def fan(result: Result, of: Any = "depth", *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw a quantity against time: the median and bands between quantiles of the members under way at each time.

    Markers show where members failed or were stopped by an event. A single vehicle is drawn as a line. Roll and yaw are
    drawn about their mean direction. If no samples were kept, statistics of the quantity are drawn.

    Args:
        result: A result, in memory or in a store.
        of: Name of the quantity or of one component, such as "speed" or "position[0]", or a `lw.statistics.Quantity`;
            default "depth".

    Returns:
        The axes.

    Raises:
        NothingToDraw: Neither samples nor statistics of the quantity were kept, or no member has a finite value.
        SceneError: The quantity is unknown, or has several components.

    Examples:
        >>> import lgvi_warp as lw
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100"), members=8)
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> lw.plots.fan(result, "speed", path="speed.png").get_ylabel()
        'speed [m/s]'
    """
    meaning = quantity_of(of)
    estimate = None if result_of(result).samples else estimate_for(result, meaning.name, STANDING)
    if estimate is None:
        result = with_samples(result)
    with panel(ax, path) as axes:
        if estimate is None:
            survey = draw_fan(axes, result, meaning)
            text, notes = text_of(survey, members_of_run(result)), notes_on(result, survey)
        else:
            text = f"{of_members(result.members, members_of_run(result))}, from statistics"
            notes = []
            _draw_estimate(axes, *estimate)
            axes.set(xlabel="time [s]", ylabel=label_of(meaning))
            if is_depth(meaning):
                point_down(axes, floors(result))
        if ax is None:
            axes.set_title(wrap_each((title(result), *notes), axes.figure))
        if axes.get_legend_handles_labels()[0]:
            legend_below(axes, ncols=4, title=text)
    return axes


def draw_fan(axes: Any, result: Result, of: Quantity) -> ValuesUnderWay:
    """Draw a fan, the ends of members, and labels."""
    survey = survey_of(result, of)
    if failed(result.status).all() and not survey.under_way[1:].any():
        raise NothingToDraw("every member failed before the second sample: there is nothing to draw; "
                            "see result.status and result.failure_time")  # fmt: skip
    marker = line_marker(survey.time)
    if survey.total == 1:
        line = np.where(survey.counted, survey.values, np.nan)[:, 0]
        axes.plot(survey.time, line, color=COLORS[0], marker=marker, label=in_words(of.name))
    else:
        draw_bands(axes, survey.time, survey.values, survey.counted, low=survey.low, high=survey.high, marker=marker)
    _ends(axes, result, survey)
    axes.set(xlabel="time [s]", ylabel=label_of(of))
    axes.grid(True, alpha=0.3)
    if of.name == "energy error":
        axes.axhline(0.0, color="black", linewidth=0.5)
    if is_depth(of):
        point_down(axes, floors(result))
    return survey


def notes_on(result: Result, survey: ValuesUnderWay) -> list[str]:
    """Say what a reader of a fan has to know beside it."""
    few_times = HINT if len(survey.time) < 3 else ""
    return [note for note in (unbounded_text(result, survey), few_times) if note]


def text_of(survey: ValuesUnderWay, total: int) -> str:
    """Say how many members are in a fan, at its beginning and at its end."""
    first, last = int(survey.under_way[0]), int(survey.under_way[-1])
    text = of_members(survey.total, total)
    if (survey.under_way != survey.total).any():
        text = f"under way: {first:,} at {survey.time[0]:g} s,\n{last:,} at {survey.time[-1]:g} s"
    return text if survey.ranked == survey.total else f"{text}; quantiles from {survey.ranked:,}"


def draw_bands(axes: Any, time: np.ndarray, values: np.ndarray, counted: np.ndarray, **median: Any) -> None:
    """Draw bands between quantiles of the members (k, n) that count at each time [s], and their median.

    **median: Arguments of Axes.plot for the median; and low and high (k,), extremes where they are of more members.
    """
    levels = sorted({q for band in BANDS for q in band} | {0.5})
    curves = dict(zip(levels, at_levels(values, counted, levels), strict=True))
    curves[0.0], curves[1.0] = median.pop("low", curves[0.0]), median.pop("high", curves[1.0])
    for (low, high), color in zip(BANDS, TINTS, strict=True):
        label = "all" if low == 0.0 else band(low, high)
        axes.fill_between(time, curves[low], curves[high], color=color, linewidth=0, label=label)
    axes.plot(time, curves[0.5], color="black", linewidth=1.2, label="median", **median)


def _ends(axes: Any, result: Result, survey: ValuesUnderWay) -> None:
    """Mark by outcome where and when members ended before the end of the run."""
    when, status = stop_time(result), np.asarray(result.status)
    for code in outcomes(result):
        if code != Status.OK:
            members = np.flatnonzero(status == code)
            # The first and the last to end, and a fair choice of the others.
            first_and_last = members[[when[members].argmin(), when[members].argmax()]]
            drawn = np.union1d(members[np.argsort(mixed(members), kind="stable")[:MARKS]], first_and_last)
            label = f"{code.name.lower()} ({len(members):,})"
            axes.scatter(when[drawn], survey.last[drawn], s=24, zorder=3, label=label, **mark(code))


def _draw_estimate(axes: Any, estimate: Estimate, component: int) -> None:
    """Draw one component of a statistic in place of samples: bands of quantiles, a mean with its interval, or extremes."""
    kind, time = estimate.settings["type"], estimate.time
    if kind == "quantiles":
        levels, values = estimate.coordinates["level"], estimate.value[:, :, component]
        pairs = len(levels) // 2
        for i in range(pairs):
            color, label = TINTS[max(0, len(TINTS) - pairs + i)], band(levels[i], levels[-1 - i])
            axes.fill_between(time, values[:, i], values[:, -1 - i], color=color, linewidth=0, label=label)
        if len(levels) % 2:
            label = f"{band(0.0, levels[pairs])} quantile"
            axes.plot(time, values[:, pairs], color="black", linewidth=1.2, label=label)
    elif kind == "mean":
        low, high, level = estimate.lower[:, component], estimate.upper[:, component], estimate.confidence
        axes.fill_between(time, low, high, color=TINTS[1], linewidth=0, label=f"{level:.0%} confidence interval")
        axes.plot(time, estimate.value[:, component], color="black", linewidth=1.2, label="mean")
    else:
        low, high = estimate["minimum"][:, component], estimate["maximum"][:, component]
        axes.fill_between(time, low, high, color=TINTS[0], linewidth=0, label="all")
    axes.grid(True, alpha=0.3)


@picture
def compare(results: Mapping[str, Result], of: Any = "depth", *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw a quantity of several runs against time: for each run, the median and the middle 90 % of members under way.

    A run without samples is drawn by a statistic `lw.statistics.Quantiles` or `lw.statistics.Mean` of the quantity.

    Args:
        results: Mapping of labels to results.
        of: Name of the quantity or of one component, or a `lw.statistics.Quantity`; default "depth".

    Returns:
        The axes.

    Raises:
        NothingToDraw: A run has neither samples nor such a statistic, or no member has a finite value.
        SceneError: `results` is empty, or the quantity is unknown or has several components.

    Examples:
        >>> import lgvi_warp as lw
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100"), members=8)
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> axes = lw.plots.compare({"a": result, "b": lw.solve(fleet, h=0.05, t1=2.0)}, "speed")
        >>> [line.get_label() for line in axes.lines]
        ['a: 8 members', 'b: 8 members']
    """
    for result in mapping_of("results", results, "labels to results").values():
        result_of(result)
    if not results:
        raise refusal("results", results, "holds no result", "give results by label: {'a': a, 'b': b}")
    meaning = quantity_of(of)
    curves = {label: _curve_of(result, meaning) for label, result in results.items()}
    with panel(ax, path) as axes:
        for i, (label, curve) in enumerate(curves.items()):
            if curve.banded:
                shade(axes, curve.time, curve.low, curve.high, i)
            marker = line_marker(curve.time)
            axes.plot(curve.time, curve.middle, marker=marker, label=f"{label}: {curve.text}", **style(i))
        axes.set(xlabel="time [s]", ylabel=label_of(meaning))
        axes.grid(True, alpha=0.3)
        if is_depth(meaning):
            point_down(axes, floors_of_each(results))
        sampled = any(curve.banded and not curve.from_statistics for curve in curves.values())
        legend_below(axes, title="median and middle 90 % of the members under way" if sampled else None)
    return axes


@dataclass(frozen=True, eq=False)
class RunCurve:
    """A number of one of several runs against time [s]: a line and the edges of a band about it, shape (k,) each.

    text: Of how many members it is, and of what statistic if it is of one.
    banded: Whether there is a band: one vehicle has none.
    """

    time: np.ndarray
    low: np.ndarray
    middle: np.ndarray
    high: np.ndarray
    text: str
    banded: bool
    from_statistics: bool


def _curve_of(result: Result, of: Quantity) -> RunCurve:
    """The median and the middle 90 % of the members under way, or without samples what quantiles or a mean tell."""
    estimate = None if result.samples else estimate_for(result, of.name, STANDING[:2])
    if estimate is None:
        survey = survey_of(with_samples(result), of)
        low, middle, high = at_levels(survey.values, survey.counted, [0.05, 0.5, 0.95])
        text = text_of(survey, members_of_run(result)).replace("\n", " ")
        return RunCurve(survey.time, low, middle, high, text, survey.total > 1, False)
    statistic, component = estimate
    members = of_members(result.members, members_of_run(result))
    if statistic.settings["type"] == "mean":
        edges = statistic.lower[:, component], statistic.value[:, component], statistic.upper[:, component]
        text = f"{members}, mean and {statistic.confidence:.0%} confidence interval"
    else:
        levels, values = statistic.coordinates["level"], statistic.value[:, :, component]
        center = int(np.abs(levels - 0.5).argmin())
        edges = values[:, 0], values[:, center], values[:, -1]
        text = f"{members}, {band(0.0, levels[center])} quantile, and band of {band(levels[0], levels[-1])}"
    return RunCurve(statistic.time, *edges, text, True, True)
