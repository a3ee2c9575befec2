# SPDX-License-Identifier: Apache-2.0
"""Footprint of a run: positions of its members at the end, at an event, or at a time."""

from __future__ import annotations

import math
from dataclasses import replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.common.arguments import result_of
from lgvi_warp.common.errors import SceneError, closest, refusal
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.status import failed, stop_time
from lgvi_warp.common.times import rows_at
from lgvi_warp.physics.terms.events import from_list
from lgvi_warp.results.outcomes import answer_of
from lgvi_warp.results.quantities import quantities
from lgvi_warp.statistics.ends import outcomes
from lgvi_warp.uncertainty.footprint.answer import Footprint, Region, time_of
from lgvi_warp.uncertainty.footprint.density import (
    FAR,
    MAIN,
    THIN,
    Outline,
    effective,
    least_members,
    moments,
    near,
    regions,
    spread,
)

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

SHARES = (0.5, 0.9, MAIN, 0.99)
# Most places that the answer holds, for pictures.
MOST_PLACES = 1000
# The answer of a run names circles from this radius on [m].
LEAST_CIRCLE = 0.01
# Spread below so many units in the last place of the coordinates is round-off.
ROUND_OFF = 16.0


def run_answer(result: Result) -> str:
    """Sentence on the outcomes and the final positions of the members of a run."""
    how = answer_of(result)
    if result.members < least_members(MAIN):
        return how
    try:
        found = _footprint(result, "end", outlined=False)
    except SceneError:  # positions were not kept, or no member has an end
        return how
    return f"{how[:-1]}; {found.answer}" if found.main.radius >= LEAST_CIRCLE else how


def footprint(result: Result, at: str | float = "end") -> Footprint:
    """Find the smallest regions that contain given shares of the members' positions, and their areas.

    The shares are 50, 90, 95 and 99 %. A region is the area where the kernel density of the positions exceeds a level,
    chosen so that this share of new members would lie in it. It may have several parts and holes. Members that failed
    or never reach the event have no position; `lacking` of the answer counts them.

    Args:
        result: A result with positions, in memory or in a store.
        at: "end", for final positions; the name of an event or outcome, such as "floor", for the positions of members
            that ended with it; or a sample time [s].

    Returns:
        Regions, centre, covariance, and the answer in one sentence.

    Raises:
        SceneError: If positions were not saved, no sample has this time, or no member has such a position.
        MissingExtra: If contourpy is not installed (extra: viz).

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> start = lw.distributions.Normal(std=[3.0, 2.0, 0.0])
        >>> fleet = lw.Ensemble(scene, members=200, vary={"start.position": start})
        >>> found = lw.studies.footprint(lw.solve(fleet, h=0.1, t1=10.0))
        >>> found.answer
        '95 % end within 6.10 m of a point 9.74 m north and 2.40 m west of the origin.'
    """
    return _footprint(result_of(result), at)


def _footprint(result: Result, at: str | float, outlined: bool = True) -> Footprint:
    """Compute the footprint; without outlines it has only circles and ellipses, and needs no contourpy."""
    word = at.strip() if isinstance(at, str) else str(at) if isinstance(at, Real) else ""
    word = word if (when := time_of(word)) is None else f"{when:.12g}"
    positions, there = _positions(result, word, at)
    lacking = result.status[~there].counts()
    weights = np.ones(result.members) if result.weights is None else np.asarray(result.weights, np.float64)
    counted = there & (weights > 0.0)
    if not counted.any():
        raise refusal("at", word, f"no member has a place then ({summaries.counted(lacking)})", "see result.status")
    places, weights = positions[counted, :2].astype(np.float64), weights[counted]
    count, round_off = effective(weights), ROUND_OFF * np.finfo(positions.dtype).eps * np.abs(places).max(axis=1)
    held = near(places, weights, float(np.median(round_off)))
    # The frame of the regions is that of the near members. Too many far ones are no outliers, but a part of the cloud.
    centre, covariance = frame = moments(places[held], weights[held])
    outliers = 0.0 < weights[~held].sum() <= (1.0 - MAIN) * weights.sum()
    if not outliers:
        centre, covariance = moments(places, weights)
    away = places - centre
    along, across = spread(frame[1])
    round_off, ellipse = float(round_off[held].max()), math.prod(spread(covariance))
    shares = [share for share in SHARES if count >= least_members(share) - 1e-9]
    messages = [
        f"a region of {share:.0%} needs {least_members(share)} members" for share in SHARES if share not in shares
    ]
    if outliers:
        far = summaries.plural(int(np.count_nonzero(~held)), "member")
        verb = "lies" if far == "1 member" else "lie"
        messages.append(
            f"{far} {verb} more than {FAR:g} standard deviations away: centre, covariance and ellipse are of the others"
        )
    levels, growth = [Outline(np.nan, np.nan, np.nan, ())] * len(shares), dict[int, Outline]()
    if along <= round_off:
        away, ellipse, messages = 0.0 * away, 0.0, [*messages, "all members are at one point: a region has no area"]
    elif len(places) < 3 or across <= max(round_off, THIN * along):
        where = "at two points" if len(np.unique(places, axis=0)) == 2 else "on a line"
        ellipse = 0.0
        messages.append(f"the members are {where}: a region has no area")
    elif outlined:
        main = max(share for share in shares if share <= MAIN)
        levels, growth, resolved = regions(places, weights, frame[1], shares, main)
        if not resolved:
            messages.append("clusters are finer than the grid resolves: their regions are smaller than these")
    # The circle holds its share of new members, as the region does.
    distance = np.hypot(*away.T)
    order = np.argsort(distance)
    held = np.cumsum(weights[order]) / weights.sum() * count / (count + 1.0)
    circles = np.interp(shares, held, distance[order])
    ellipses = -2.0 * np.pi * np.log1p(-np.array(shares)) * ellipse
    environment = result.provenance.get("scene", {}).get("environment", {})
    drawn = np.random.default_rng(0).permutation(len(places))[:MOST_PLACES]
    return Footprint(
        at=word,
        members=len(places),
        lacking=lacking,
        centre=centre,
        covariance=covariance,
        regions=tuple(
            Region(share, level.area, level.low, level.high, float(circle), float(ellipse), level.polygons)
            for share, level, circle, ellipse in zip(shares, levels, circles, ellipses, strict=True)
        ),
        growth=tuple((members, level.area, level.low, level.high) for members, level in growth.items()),
        origin=tuple(environment["origin"]) if environment.get("origin") else None,
        places=places[np.sort(drawn)],
        messages=tuple(messages),
        provenance=result.provenance,
    )


def _positions(result: Result, word: str, at: Any) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) [m] of all members at an end or a time, and a mask (n,) of those that have one."""
    when, row, status = time_of(word), len(result.time) - 1, np.asarray(result.status)
    there = ~failed(status)
    if when is not None:
        if not len(rows := rows_at(result.time, when)):
            near = result.time[np.argsort(np.abs(result.time - when))[:2]]
            remedy = (
                f"give {' or '.join(f'{time:g}' for time in np.sort(near))}, or keep it: save=lw.SaveAt(at=[{word}])"
            )
            raise refusal("at", at, "is not a time of a sample", remedy)
        row, there = int(rows[0]), there | (stop_time(result) >= when)
    elif word != "end":
        events = from_list(result.provenance["scene"].get("events", ()))
        known = outcomes([event.key for event in events], [event.status for event in events])
        if word not in known:
            forms = ("end", "a time [s], as 12.5", *known)
            raise refusal("at", at, 'is neither "end", a time nor an outcome of this scene', closest(word, forms))
    positions = _row(result, row)
    if when is None and word != "end":
        # Only that row: a run in a store may be larger than the memory.
        last = replace(result, time=result.time[row:], samples={"position": positions[None]}, store=None, kept=None)
        positions = quantities(f"position at {word}")[0].values(last).astype(positions.dtype)
        there = np.ones(len(status), bool)
    return positions, there & np.isfinite(positions[:, :2]).all(axis=1)


def _row(result: Result, row: int) -> np.ndarray:
    """Positions of all members (n, 3) at one sample; from a store, only its chunks are read, one after another."""
    if "position" in result.samples:
        if result.store is None:
            return np.asarray(result.samples["position"][row])
        stored: Any = result.samples
        return np.asarray(stored.rows("position", slice(row, row + 1), slice(0, result.members))[0])
    remedy = (
        "run it with keep='all'; without save=... start and end alone take little memory. Kept members are result.kept"
    )
    raise SceneError([f"positions of all members were not kept. {capital(remedy)}"])
