# SPDX-License-Identifier: Apache-2.0
"""From a pilot to the answer: the setting, the estimator, the run with numbers fixed beforehand, and what is told of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.studies.estimating import bias as biases
from lgvi_warp.studies.estimating.answer import Estimated
from lgvi_warp.studies.estimating.bias import APART, Bias
from lgvi_warp.studies.estimating.choice import Observed, Way, candidates, gains
from lgvi_warp.studies.estimating.estimators import MeanEstimate, plain
from lgvi_warp.studies.estimating.levels import Level, Runs, Setting, estimated
from lgvi_warp.studies.estimating.pilot import (
    FEW,
    FIRST,
    SHARE,
    STAGES,
    Ladder,
    Pilot,
    at_once,
    climb,
    failing,
    observed,
    refuse_heavy,
    runs_at,
)
from lgvi_warp.studies.estimating.target import Solved

# More members in the pilot pay where they cost at most this part of the run.
WORTH = 0.3
# Members that show what settings share and how much Sobol points gain, where that is worth its cost.
LOOKS = (*STAGES[1:], 4 * STAGES[-1])
# Coarser settings that levels are sought among.
MOST_COARSER = 4
# Noise of the pilot has indices from 0, that of the levels from here on, so many for each.
INDICES = 2**27
# Members of a level at most.
MOST = 2**26
# Members that tell the bias where a pilot is not worth its cost: this part of the run's, at least so many.
PART, LEAST = 16, 16


@dataclass(frozen=True)
class Chosen:
    """A setting, its bias, how that was told, and the error that is left to sampling.

    place: of the setting in the ladder.
    """

    ladder: Ladder
    place: int
    bias: Bias
    error: float
    reference: str

    @property
    def setting(self) -> Setting:
        """The setting whose statistic is estimated."""
        return self.ladder.settings[self.place]

    @property
    def variance(self) -> float:
        """The variance of sampling that the error leaves; a quarter of its square where the bias takes it all."""
        return max(self.error**2 - self.bias.mean_square, 0.25 * self.error**2, 1e-300)


def answered(
    pilot: Pilot, ladders: Sequence[Sequence[Setting]], coarse: Sequence[Sequence[Setting]], fixed: bool,
    own_step: float | None, report: Callable[[float], None], content: Mapping[str, Any],
) -> Estimated:  # fmt: skip
    """Run the pilot, choose, run, and tell."""
    chosen = setting_of(pilot, ladders, fixed, own_step)
    report(0.1)
    if constant(pilot, chosen.setting):
        return told(pilot, chosen, [], None, None, own_step, content)
    while True:
        top = chosen.setting
        seen = looked(pilot, top, coarser_than(pilot, chosen, coarse), chosen.variance)
        pilot_seconds = pilot.runs.seconds
        report(0.2)
        levels, ways, failed = tried(pilot, seen, chosen, report)
        if failed is None:
            break
        pilot.messages.append(f"{failed} is left out: members fail at it")
        if chosen.place + 1 == len(chosen.ladder.settings):
            raise failing(top, np.concatenate(levels[0].y))
        chosen = finer(chosen)
    solved, part = enough(pilot, chosen, levels)
    return told(pilot, chosen, levels, (seen, ways, pilot_seconds), (solved, part), own_step, content)


def tried(
    pilot: Pilot, seen: Observed, chosen: Chosen, report: Callable[[float], None]
) -> tuple[list[Level], list[Way], Setting | None]:
    """Run the best way that does not stand on a setting at which members fail; the top setting where they fail at it."""
    while True:
        ways = candidates(seen, chosen.variance)
        levels = levels_of(pilot, seen, ways[0])
        failed = run(pilot.runs, levels, lambda part: report(0.2 + 0.7 * part))
        if failed is None or failed == chosen.setting:
            return levels, ways, failed
        pilot.messages.append(f"{failed} is left out: members fail at it")
        seen = without(seen, failed)


def finer(chosen: Chosen) -> Chosen:
    """The next step of the ladder."""
    place = chosen.place + 1
    return replace(chosen, place=place, bias=chosen.ladder.biases()[place])


def setting_of(pilot: Pilot, ladders: Sequence[Sequence[Setting]], fixed: bool, own_step: float | None) -> Chosen:
    """Climb the ladders and choose the setting that is predicted to cost least; the own step where members are few."""
    climbed = []
    own = ladders[0][-2] if fixed else None if own_step is None else replace(ladders[0][0], h=own_step)
    for i, steps in enumerate(ladders):
        if i == 0 and own is not None and seems_few(pilot, steps) and (ladder := at_once(pilot, own)):
            return choice_of(pilot, ladder, own)
        asked = own if fixed else None
        ladder = climb(pilot, steps, asked)
        if asked is not None and asked not in ladder.settings:
            why = ladder.refused.get(str(asked), "it was not run")
            raise SceneError([f"setting = {asked}: {why}; give a shorter step, or leave h out"])
        if ladder.settings:
            climbed.append(choice_of(pilot, ladder, asked))
        elif i == len(ladders) - 1 and not climbed:
            causes = "; ".join(f"{name}: {why}" for name, why in list(ladder.refused.items())[-2:])
            raise SceneError([f"setting: no step was taken: {causes}; mend what fails, or fix method= and h="])
        if climbed and climbed[-1].ladder.end == "apart":
            break
    best = min(climbed, key=lambda each: (each.bias.mean_square > each.error**2, price(pilot, each)))
    return compared(pilot, best, [each for each in climbed if each is not best])


def seems_few(pilot: Pilot, steps: Sequence[Setting]) -> bool:
    """Whether plain Monte Carlo needs few members, by the coarsest step that runs."""
    for setting in steps:
        ladder = Ladder()
        if runs_at(pilot, setting, ladder):
            return pilot.plain_members(setting, FIRST) <= FEW
    return False


def price(pilot: Pilot, chosen: Chosen) -> float:
    """What a member costs over the variance that is left [s]."""
    return pilot.runs.cost(chosen.setting, pilot.grid(chosen.setting)) / chosen.variance


def choice_of(pilot: Pilot, ladder: Ladder, fixed: Setting | None) -> Chosen:
    """The setting of a ladder, and its bias."""
    last = ladder.settings[-1]
    error = pilot.asked(pilot.solved(last, FIRST))
    if not error > 0.0:
        problem = f"asks for a part of {pilot.runs.question.label}, which is 0"
        raise refusal("relative_error", pilot.error, problem, "give error=, in the unit of the statistic")
    place = ladder.settings.index(fixed) if fixed is not None else ladder.settled(error)
    bias = ladder.biases()[place]
    pairs = ladder.halvings[-1].members if ladder.halvings else FIRST
    return Chosen(ladder, place, bias, error, f"{last} on {pairs} members" if place < len(ladder.settings) - 1
                  else f"the halving before, from {ladder.settings[max(place - 1, 0)]}, on {pairs} members")  # fmt: skip


def compared(pilot: Pilot, best: Chosen, others: Sequence[Chosen]) -> Chosen:
    """The same with what another method differs by: where the two disagree the bias may be as large; and notes."""
    ladder, messages = best.ladder, pilot.messages
    messages += [f"{name} is left out: {why}" for name, why in ladder.refused.items()]
    for other in others if pilot.noise == "none" else ():
        mine, theirs = ladder.settings[-1], other.ladder.settings[-1]
        found = pilot.pair(theirs, mine, FIRST)
        unknown = found.half + best.ladder.biases()[-1].half + other.ladder.biases()[-1].half
        if abs(found.value) > unknown:
            messages.append(f"{theirs} and {mine} differ by {found.value:.2g}, more than their halvings do")
            best = replace(best, bias=replace(best.bias, half=best.bias.half + abs(found.value)))
    lefts = [each.left for each in ladder.halvings]
    if ladder.end == "apart" or (lefts and lefts[-1] > APART and pilot.noise == "free"):
        cause = ("noise acts whose path no two steps share" if pilot.noise == "free"
                 else "small differences grow over the run until they fill its spread, as in chaos")  # fmt: skip
        messages.append(
            f"levels gain nothing: members of two steps are apart (1 - rho^2 is {lefts[-1]:.2g}), since {cause}"
        )
    if math.sqrt(best.bias.mean_square) > 0.87 * best.error:
        messages.append(
            f"the bias is known to {math.sqrt(best.bias.mean_square):.2g} alone, the error asked for is {best.error:.2g}: "
            + {"apart": "members of all steps are apart", "members": "more members of the pilot would cost too much"}.get(
                ladder.end, "ask for a shorter t1 or a larger error")
        )  # fmt: skip
    return best


def constant(pilot: Pilot, setting: Setting) -> bool:
    """Whether all members have one number since nothing varies."""
    return pilot.runs.dimensions == 0 and pilot.noise == "none" and bool(
        np.ptp(pilot.y(setting, pilot.grid(setting), FIRST)) == 0.0
    )  # fmt: skip


def coarser_than(pilot: Pilot, chosen: Chosen, coarse: Sequence[Sequence[Setting]]) -> list[Setting]:
    """Coarser settings that levels may stand on: of the ladder, and the longest steps of the cheaper scenes."""
    top, found = chosen.setting, list[Setting]()
    if chosen.ladder.end == "apart" or pilot.noise == "free":
        return []
    # Steps that are too long spread otherwise than the next one.
    pairs = zip(chosen.ladder.settings[: chosen.place], chosen.ladder.halvings, strict=False)
    below = [setting for setting, halving in pairs if halving.alike]
    found += below[:: max(1, math.ceil(len(below) / MOST_COARSER))]
    for steps in coarse:
        for step in steps:
            multiple = step.h / top.h
            if multiple < 1.0 - 1e-9 or abs(multiple - round(multiple)) > 1e-9 * multiple:
                continue
            try:
                if not np.isnan(pilot.y(replace(step, method=top.method), pilot.grid(top), FIRST)).any():
                    found.append(replace(step, method=top.method))
                    break
            except SceneError as error:
                pilot.messages.append(f"{step} is left out: {error.faults[0]}")
    return found


def looked(pilot: Pilot, top: Setting, coarser: Sequence[Setting], variance: float) -> Observed:
    """What the settings have in common, of as many members as are worth their cost."""
    few = pilot.plain_members(top, FIRST) <= FEW
    seen = observed(pilot, top, [] if few else coarser, FIRST)
    for members in LOOKS:
        best = candidates(seen, variance)[0]
        kept = worth_more(seen, variance)
        more = 0.75 * members * sum(seen.costs[seen.settings.index(setting)] for setting in (top, *kept))
        within_share = pilot.runs.seconds + more <= pilot.most_seconds(top, FIRST)
        if few or more > (WORTH if within_share else SHARE) * best.seconds:
            break
        seen = observed(pilot, top, kept, members)
    return seen


def worth_more(seen: Observed, variance: float) -> list[Setting]:
    """The coarser settings of ways that cost at most twice the least."""
    ways = candidates(seen, variance)
    near = {i for way in ways if way.seconds <= 2.0 * ways[0].seconds for i in way.chain}
    return [seen.settings[i] for i in sorted(near - {0})]


def without(seen: Observed, failed: Setting) -> Observed:
    """The same without a setting."""
    kept = [i for i, setting in enumerate(seen.settings) if setting != failed]

    def chosen(values: Sequence[Any]) -> list[Any]:
        return [values[i] for i in kept]

    pair = seen.pair
    return replace(seen, z=chosen(seen.z), costs=chosen(seen.costs), settings=chosen(seen.settings),
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
    """The estimate; where its error is beyond the one asked for, once more with twice the members.

    The variance is then at least a quarter of the first: a stop by chance must not tell too small an error.
    """
    if pilot.target.kind in ("mean", "cvar"):
        refuse_heavy(pilot.runs.question.label, np.concatenate(levels[0].y))
    solved, part = estimated(levels, pilot.target)
    if part.variance <= max(chosen.error**2 - chosen.bias.mean_square, 0.25 * chosen.error**2):
        return solved, part
    for level in levels:
        level.grow(pilot.runs, level.members)
        if any(np.isnan(numbers[-1]).any() for numbers in (level.y, level.below) if numbers):
            raise failing(level.fine, level.y[-1])
    before = part.variance
    solved, part = estimated(levels, pilot.target)
    return solved, replace(part, variance=max(part.variance, 0.25 * before))


def told(
    pilot: Pilot, chosen: Chosen, levels: Sequence[Level], found: tuple[Observed, Sequence[Way], float] | None,
    reached: tuple[Solved, MeanEstimate] | None, own_step: float | None, content: Mapping[str, Any],
) -> Estimated:  # fmt: skip
    """The answer in full."""
    top, target, runs = chosen.setting, pilot.target, pilot.runs
    question, messages = runs.question, list(pilot.messages)
    if reached is None or found is None:
        y = pilot.y(top, pilot.grid(top), FIRST)
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
    own = None if own_step is None else variance_of_one / max(chosen.error, 1e-300) ** 2 * cost * top.h / own_step
    return Estimated(
        of=question.label, unit=question.unit, value=part.value, interval=(low, high), error=chosen.error,
        sampling_error=math.sqrt(part.variance), bias=chosen.bias.value,
        bias_interval=(chosen.bias.value - chosen.bias.half, chosen.bias.value + chosen.bias.half),
        setting=str(top), settings=top.options(), reference=chosen.reference, estimator=name, members=members,
        seconds=runs.seconds, pilot_seconds=pilot_seconds, plain_seconds=plain_members * cost, own_seconds=own,
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
