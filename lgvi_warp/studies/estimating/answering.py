# SPDX-License-Identifier: Apache-2.0
"""From a pilot to the answer: the setting, the estimator, the run with numbers fixed beforehand, and what is told of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.studies.estimating import bias as biases
from lgvi_warp.studies.estimating.answer import Estimated
from lgvi_warp.studies.estimating.bias import Bias
from lgvi_warp.studies.estimating.choice import ROOM, Observed, Way, candidates, gains
from lgvi_warp.studies.estimating.chosen import Chosen, coarser_than, constant, finer, setting_of
from lgvi_warp.studies.estimating.estimators import MeanEstimate, plain
from lgvi_warp.studies.estimating.levels import Level, Runs, Setting, estimated
from lgvi_warp.studies.estimating.pilot import FEW, SHARE, STAGES, Pilot, failing, observed, refuse_heavy
from lgvi_warp.studies.estimating.target import Solved

# More members in the pilot pay where they cost at most this part of the run.
WORTH = 0.3
# Where members of two steps are apart, Sobol points that do not gain at least this with few members are not looked at.
CLEAR = 2.0
# Members that show what settings share and how much Sobol points gain, where that is worth its cost.
LOOKS = (*STAGES[1:], 4 * STAGES[-1])
# Coarse levels are in single precision, whose kernel is another one, where plain Monte Carlo costs at least this [s].
WORTH_A_KERNEL = 0.5
# Runs that add members where the error told is beyond the one asked for, and how many in those that there are.
ROUNDS, MOST_MORE = 2, 3.0
# Noise of the pilot has indices from 0, that of the levels from here on, so many for each.
INDICES = 2**27
# Members of a level at most.
MOST = 2**26
# Members that tell the bias where a pilot is not worth its cost: this part of the run's, at least so many.
PART, LEAST = 16, 16


def answered(
    pilot: Pilot, ladders: Sequence[Sequence[Setting]], coarse: Sequence[Sequence[Setting]], fixed: bool,
    own: Setting | None, report: Callable[[float], None], content: Mapping[str, Any],
) -> Estimated:  # fmt: skip
    """Run the pilot, choose, run, and tell."""
    chosen = setting_of(pilot, ladders, fixed, own)
    report(0.1)
    if constant(pilot, chosen.setting):
        return told(pilot, chosen, [], None, None, own, content)
    while True:
        top = chosen.setting
        seen = looked(pilot, chosen, coarser_than(pilot, chosen, coarse))
        pilot_seconds = pilot.runs.seconds
        report(0.2)
        levels, ways, failed = tried(pilot, seen, chosen, report)
        if failed is None:
            break
        pilot.messages.append(f"{failed} is left out: members fail at it")
        if chosen.place + 1 == len(chosen.ladder.settings):
            raise failing(top, np.concatenate(levels[0].y))
        chosen = finer(pilot, chosen)
    solved, part = enough(pilot, chosen, levels)
    report(1.0)
    return told(pilot, chosen, levels, (seen, ways, pilot_seconds), (solved, part), own, content)


def tried(
    pilot: Pilot, seen: Observed, chosen: Chosen, report: Callable[[float], None]
) -> tuple[list[Level], list[Way], Setting | None]:
    """Run the best way that does not stand on a setting at which members fail; the top setting where they fail at it."""
    while True:
        ways = candidates(seen, chosen.variance, pilot.estimator)
        if pilot.estimator not in (None, ways[0].name):
            problem = (
                f"cannot be had of {chosen.setting}: no setting that is much cheaper follows it, or nothing varies"
            )
            raise refusal("estimator", pilot.estimator, problem, "leave it out, or give a shorter h")
        levels = levels_of(pilot, seen, ways[0])
        failed = run(pilot.runs, levels, lambda part: report(0.2 + 0.7 * part))
        if failed is None or failed == chosen.setting:
            return levels, ways, failed
        pilot.messages.append(f"{failed} is left out: members fail at it")
        seen = without(seen, failed)


def looked(pilot: Pilot, chosen: Chosen, coarser: Sequence[Setting]) -> Observed:
    """What the settings have in common, of as many members as are worth their cost."""
    top, variance, only = chosen.setting, chosen.variance, pilot.estimator
    few = only is None and pilot.plain_members(top, pilot.first) <= FEW
    seen = observed(pilot, top, [] if few else in_single(pilot, top, coarser), pilot.first)
    seen = with_coarsest(pilot, seen, variance)
    if only is None and chosen.ladder.end == "apart" and gains(candidates(seen, variance)).get("sobol", 1.0) < CLEAR:
        return replace(seen, normals=seen.normals[:, :0])
    if pilot.settled and only is not None and not only.startswith("levels"):
        few = LOOKS[0] > SHARE * pilot.plain_members(top, pilot.first)
        return seen if few else observed(pilot, top, [], LOOKS[0])
    for members in LOOKS:
        best = candidates(seen, variance, only)[0]
        kept = worth_more(seen, variance, only)
        more = 0.75 * members * sum(seen.costs[seen.settings.index(setting)] for setting in (top, *kept))
        more += (1 + len(kept)) * seen.call
        within_share = pilot.runs.seconds + more <= pilot.most_seconds(top, pilot.first)
        if few or more > (WORTH if within_share else SHARE) * best.seconds:
            break
        seen = with_coarsest(pilot, observed(pilot, top, kept, members), variance)
    return seen


def in_single(pilot: Pilot, top: Setting, coarser: Sequence[Setting]) -> list[Setting]:
    """Coarse settings in single precision, where plain Monte Carlo costs so much that another kernel pays."""
    plain_seconds = pilot.plain_members(top, pilot.first) * pilot.runs.cost(top, pilot.grid(top))
    if not pilot.single or plain_seconds < WORTH_A_KERNEL:
        return list(coarser)
    found = list[Setting]()
    for setting in coarser:
        twin = replace(setting, dtype="float32")
        try:
            same = np.isfinite(pilot.y(twin, pilot.grid(top), pilot.first)).all()
        except SceneError:
            return list(coarser)
        found.append(twin if same else setting)
    return found


def with_coarsest(pilot: Pilot, seen: Observed, variance: float) -> Observed:
    """The same with more members of the best way's coarsest setting, which cost little and most are run of."""
    best = candidates(seen, variance, pilot.estimator)[0]
    last = best.chain[-1]
    worth = [n for n in LOOKS if n * seen.costs[last] <= SHARE * best.seconds and n > len(seen.z[last])]
    if last == 0 or not worth:
        return seen
    setting = seen.settings[last]
    y = pilot.y(setting, pilot.grid(setting), worth[-1])
    if np.isnan(y).any():
        return seen
    costs = [pilot.runs.cost(each, pilot.grid(each)) for each in seen.settings]
    return replace(seen, costs=costs, alone={**seen.alone, last: pilot.target.contributions(y, seen.at)})


def worth_more(seen: Observed, variance: float, only: str | None = None) -> list[Setting]:
    """The coarser settings of ways that cost at most twice the least."""
    ways = candidates(seen, variance, only)
    near = {i for way in ways if way.seconds <= 2.0 * ways[0].seconds for i in way.chain}
    return [seen.settings[i] for i in sorted(near - {0})]


def without(seen: Observed, failed: Setting) -> Observed:
    """The same without a setting."""
    kept = [i for i, setting in enumerate(seen.settings) if setting != failed]

    def chosen(values: Sequence[Any]) -> list[Any]:
        return [values[i] for i in kept]

    pair, alone = seen.pair, {kept.index(i): z for i, z in seen.alone.items() if i in kept}
    return replace(seen, z=chosen(seen.z), costs=chosen(seen.costs), settings=chosen(seen.settings), alone=alone,
                   pair=lambda f, c: pair(kept[f], kept[c]))  # fmt: skip


def levels_of(pilot: Pilot, seen: Observed, way: Way) -> list[Level]:
    """The levels of a way, each with points and noise of its own."""
    levels, weight = [], 1.0
    for i, (place, members) in enumerate(zip(way.chain, way.members, strict=True)):
        if members > MOST:
            problem = f"would take {members:,} members and {way.seconds:.2g} s by the best way"
            raise refusal("error", pilot.error, problem, "give a larger one")
        top = seen.settings[place]
        coarse = seen.settings[way.chain[i + 1]] if i + 1 < len(way.chain) else None
        if coarse is None and pilot.target.tail < 1.0:
            # Fewer have none in the tail; the worst ones are skewed, and replicates have a 16th of them each.
            members = max(members, pilot.first * (4 if pilot.target.kind == "cvar" else 1))
        slope = way.slopes[i] if coarse is not None else 0.0
        name = f"estimate level {i} {way.kind}"
        levels.append(
            Level(top, coarse, slope, weight, pilot.grid(top), way.kind, members, (i + 1) * INDICES, f"{name} {top}")
        )
        weight *= slope
    return levels


def run(runs: Runs, levels: Sequence[Level], report: Callable[[float], None]) -> Setting | None:
    """Run the levels' members; the setting of which some failed, None for none."""
    for i, level in enumerate(levels):
        level.grow(runs, level.members)
        for setting, numbers in ((level.fine, level.y), (level.coarse, level.below)):
            if setting is not None and np.isnan(numbers[-1]).any():
                return setting
        report((i + 1) / len(levels))
    return None


def enough(pilot: Pilot, chosen: Chosen, levels: Sequence[Level]) -> tuple[Solved, MeanEstimate]:
    """The estimate; where its error is beyond the one asked for, with what it takes, up to four times the members, twice.

    The variance is then at least what the first one lets expect of so many members, over as much again: a stop by chance
    must not tell too small an error.
    """
    if pilot.target.kind in ("mean", "cvar"):
        refuse_heavy(pilot.runs.question.label, np.concatenate(levels[0].y))
    solved, part = estimated(levels, pilot.target)
    allowed = max(chosen.error**2 - chosen.bias.mean_square, 0.25 * chosen.error**2)
    # A quantile's density, and how many are beyond it, on which the error stands, are known by the same members.
    least = 1.0 if pilot.target.kind in ("quantile", "cvar") else 0.0
    for _ in range(ROUNDS):
        if part.variance <= allowed:
            break
        before, share = part.variance, min(max(ROOM[levels[0].kind] * part.variance / allowed - 1.0, least), MOST_MORE)
        for level in levels:
            level.grow(pilot.runs, level.more(share))
            if any(np.isnan(numbers[-1]).any() for numbers in (level.y, level.below) if numbers):
                raise failing(level.fine, level.y[-1])
        solved, part = estimated(levels, pilot.target)
        part = replace(part, variance=max(part.variance, before / (1.0 + share) ** 2))
    return solved, part


def told(
    pilot: Pilot, chosen: Chosen, levels: Sequence[Level], found: tuple[Observed, Sequence[Way], float] | None,
    reached: tuple[Solved, MeanEstimate] | None, own: Setting | None, content: Mapping[str, Any],
) -> Estimated:  # fmt: skip
    """The answer in full."""
    top, target, runs = chosen.setting, pilot.target, pilot.runs
    question, messages = runs.question, list(pilot.messages)
    if reached is None or found is None:
        y = pilot.y(top, pilot.grid(top), pilot.first)
        part, name, members, rivals, pilot_seconds = (
            MeanEstimate(float(y[0]), 0.0, math.inf),
            "one run",
            {str(top): 1},
            {},
            0.0,
        )
        variance_of_one = 0.0
        messages.append("nothing varies and no noise acts: one run is the answer, with its bias alone")
    else:
        seen, ways, pilot_seconds = found
        part, name, rivals = reached[1], ways[0].name, gains(ways)
        members = {str(level.fine) + (f" less {level.coarse}" if level.coarse else ""): sum(map(len, level.y))
                   for level in levels}  # fmt: skip
        variance_of_one = plain(seen.z[0], seen.least).variance * len(seen.z[0])
    low, high = biases.interval(part.value, part.half_width(0.95), chosen.bias)
    if target.kind == "probability":
        low, high = within(part, low, high, chosen.bias, sum(members.values()))
    plain_members = variance_of_one / max(chosen.variance, 1e-300)
    cost = runs.cost(top, pilot.grid(top))
    own_seconds = None if own is None else variance_of_one / max(chosen.error, 1e-300) ** 2 * cost * top.h / own.h
    return Estimated(
        of=question.label, unit=question.unit, value=part.value, interval=(low, high), error=chosen.error,
        sampling_error=math.sqrt(part.variance), bias=chosen.bias.value,
        bias_interval=(chosen.bias.value - chosen.bias.half, chosen.bias.value + chosen.bias.half),
        setting=str(top), settings=top.options(), reference=chosen.reference, estimator=name, members=members,
        seconds=runs.seconds, pilot_seconds=pilot_seconds, plain_seconds=plain_members * cost, own_seconds=own_seconds,
        rivals=rivals, messages=tuple(messages), provenance=dict(content) | {"settings": top.options()},
    )  # fmt: skip


def within(part: MeanEstimate, low: float, high: float, bias: Bias, members: int) -> tuple[float, float]:
    """The interval of a probability: Wilson's, with as many members as have the variance, in [0, 1]."""
    p = float(np.clip(part.value, 0.0, 1.0))
    from scipy.special import stdtrit

    t = float(stdtrit(max(part.freedom, 1.0), 0.975))
    n = p * (1.0 - p) / part.variance if part.variance > 0.0 and 0.0 < p < 1.0 else members
    ends = intervals.wilson(np.array(p), np.array(n), 0.95, t)
    low, _ = biases.interval(p, p - float(ends[0]), bias)
    _, high = biases.interval(p, float(ends[1]) - p, bias)
    return max(low, 0.0), min(high, 1.0)
