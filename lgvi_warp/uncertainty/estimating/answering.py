# SPDX-License-Identifier: Apache-2.0
"""From a pilot to the answer: choose the setting and the estimator, run with fixed numbers of members, and report."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.uncertainty.estimating import bias as biases
from lgvi_warp.uncertainty.estimating.answer import Estimated
from lgvi_warp.uncertainty.estimating.bias import Bias
from lgvi_warp.uncertainty.estimating.choice import ROOM, Observed, Way, candidates, gains, rounded
from lgvi_warp.uncertainty.estimating.chosen import Chosen, coarser_than, constant, finer, setting_of
from lgvi_warp.uncertainty.estimating.estimators import MeanEstimate
from lgvi_warp.uncertainty.estimating.levels import Level, Runs, Setting, design, estimated, samples_of
from lgvi_warp.uncertainty.estimating.pilot import FEW, SHARE, STAGES, Pilot, failing, observed
from lgvi_warp.uncertainty.estimating.target import Solved, Sought, quantile_of

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
# Noise of the pilot has indices from 0, that of the levels from here on, so many for each; of rare strata so many for each.
INDICES, STRATUM_INDICES = 2**27, 2**21
# Members of a level at most.
MOST = 2**26
# Where fewer members are beyond a quantile, its interval is between order statistics.
FAR = 30


def answered(
    pilot: Pilot, ladders: Sequence[Sequence[Setting]], coarse: Sequence[Sequence[Setting]], fixed: bool,
    own: Setting | None, report: Callable[[float], None], content: Mapping[str, Any],
) -> Estimated:  # fmt: skip
    """Run the pilot, choose setting and estimator, run the members, and return the answer."""
    chosen = setting_of(pilot, ladders, fixed, own)
    report(0.1)
    if constant(pilot, chosen.setting):
        return told(
            pilot, chosen, [], [], None, one_run(pilot.runs, chosen.setting, pilot.grid(chosen.setting)), own, content
        )
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
    rounds, part = enough(pilot, chosen, levels)
    report(1.0)
    return told(pilot, chosen, levels, rounds, (ways, pilot_seconds), part, own, content)


def tried(
    pilot: Pilot, seen: Observed, chosen: Chosen, report: Callable[[float], None]
) -> tuple[list[Level], list[Way], Setting | None]:
    """Run the best way without settings at which members fail; also returns the top setting if members fail at it."""
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
    """Observe how closely the settings agree, with as many members as are worth their cost."""
    top, variance, only = chosen.setting, chosen.variance, pilot.estimator
    few = only is None and pilot.plain_members(top, pilot.first, unseen=True) <= FEW
    seen = observed(pilot, top, [] if few else in_single(pilot, top, coarser), pilot.first)
    seen = with_coarsest(pilot, seen, variance)
    if only is None and chosen.ladder.end == "apart" and gains(candidates(seen, variance)).get("sobol", 1.0) < CLEAR:
        return replace(seen, normals=seen.normals[:, :0])
    for members in LOOKS:
        best = candidates(seen, variance, only)[0]
        kept = worth_more(seen, variance, only)
        more = 0.75 * members * sum(seen.costs[seen.settings.index(setting)] for setting in (top, *kept))
        more += (1 + len(kept)) * seen.call
        within_share = pilot.runs.counted + more <= pilot.most_seconds(top, pilot.first)
        if few or more > (WORTH if within_share else SHARE) * best.seconds:
            break
        seen = with_coarsest(pilot, observed(pilot, top, kept, members), variance)
    return seen


def in_single(pilot: Pilot, top: Setting, coarser: Sequence[Setting]) -> list[Setting]:
    """Coarse settings, in single precision if plain Monte Carlo costs so much that compiling another kernel pays."""
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
    """The observations with more members of the best way's coarsest setting, which is cheap and runs most members."""
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
    """The coarser settings of ways that cost at most twice as much as the cheapest way."""
    ways = candidates(seen, variance, only)
    near = {i for way in ways if way.seconds <= 2.0 * ways[0].seconds for i in way.chain}
    return [seen.settings[i] for i in sorted(near - {0})]


def without(seen: Observed, failed: Setting) -> Observed:
    """The observations without one setting."""
    kept = [i for i, setting in enumerate(seen.settings) if setting != failed]

    def chosen(values: Sequence[Any]) -> list[Any]:
        return [values[i] for i in kept]

    pair, alone = seen.pair, {kept.index(i): z for i, z in seen.alone.items() if i in kept}
    return replace(seen, z=chosen(seen.z), costs=chosen(seen.costs), settings=chosen(seen.settings), alone=alone,
                   pair=lambda f, c: pair(kept[f], kept[c]))  # fmt: skip


def levels_of(pilot: Pilot, seen: Observed, way: Way) -> list[Level]:
    """The levels of a way, each with its own points and noise."""
    levels, weight = list[Level](), seen.weight
    for i, (place, members) in enumerate(zip(way.chain, way.members, strict=True)):
        if members > MOST:
            problem = f"would take {members:,} members and {way.seconds:.2g} s by the best way"
            raise refusal("error", pilot.error, problem, "give a larger one")
        top = seen.settings[place]
        coarse = seen.settings[way.chain[i + 1]] if i + 1 < len(way.chain) else None
        if coarse is None and pilot.target.tail < 1.0:
            # Fewer have none in the tail; the worst ones are skewed, and replicates have a 16th of them each.
            members = max(members, pilot.first * (4 if pilot.target.kind == "cvar" else 2))
        slope = way.slopes[i] if coarse is not None else 0.0
        name = f"estimate level {i} {way.kind}"
        levels.append(
            Level(top, coarse, slope, weight, pilot.grid(top), way.kind, members, (i + 1) * INDICES, f"{name} {top}",
                  seen.reach if coarse is None else 0.0)
        )  # fmt: skip
        weight *= slope
    top, first = seen.settings[way.chain[0]], (len(levels) + 1) * INDICES
    for k, each in enumerate(pilot.runs.strata[1:], 1):
        members = rounded(way.kind, levels[0].members * each.probability / seen.weight, pilot.runs.dimensions)
        name = f"estimate stratum {k} {way.kind} {top}"
        levels.append(Level(top, None, 0.0, each.probability, pilot.grid(top), way.kind, members,
                            first + k * STRATUM_INDICES, name, stratum=k))  # fmt: skip
    return levels


def run(runs: Runs, levels: Sequence[Level], report: Callable[[float], None]) -> Setting | None:
    """Run the levels' members; returns the setting at which some failed, or None."""
    for i, level in enumerate(levels):
        level.grow(runs, level.members)
        if (failed := level.failed()) is not None:
            return failed
        report((i + 1) / len(levels))
    return None


# The members that a round of a run added to each level, and the share of all that these are.
Round = tuple[float, list[int]]


def enough(pilot: Pilot, chosen: Chosen, levels: Sequence[Level]) -> tuple[list[Round], MeanEstimate]:
    """The estimate; while its error exceeds the requested one, members are added, in at most two rounds.

    The levels with most of the variance grow.
    """
    target, runs, kind = pilot.target, pilot.runs, levels[0].kind
    pilot.check_tail(chosen.setting, np.concatenate(levels[0].y))
    at, part = estimated(levels, target)
    rounds = [(0.0, [level.members for level in levels])]
    allowed = max(chosen.error**2 - chosen.bias.mean_square, 0.25 * chosen.error**2)
    # A quantile's density, and how many are beyond it, on which the error stands, are known by the same members.
    least = 1.0 if target.kind in ("quantile", "cvar") else 0.0
    for _ in range(ROUNDS):
        if part.variance <= allowed:
            break
        share = min(max(ROOM[kind] * part.variance / allowed - 1.0, least), MOST_MORE)
        much = [level.part(target, at).variance > 0.5 * allowed / len(levels) for level in levels]
        counts = [level.more(share) if grows else 0 for level, grows in zip(levels, much, strict=True)]
        at, part = grown(runs, target, levels, (share, counts), part)
        rounds.append((share, counts))
        pilot.check_tail(chosen.setting, np.concatenate(levels[0].y))
    return rounds, part


def grown(
    runs: Runs, target: Sought, levels: Sequence[Level], more: Round, before: MeanEstimate | None
) -> tuple[Solved, MeanEstimate]:
    """Add a round of members, and estimate again.

    The new variance is at least the variance before, divided by the squared growth in members, since stopping at a
    variance that is small by chance must not make the error too small.
    """
    share, counts = more
    for level, count in zip(levels, counts, strict=True):
        if count:
            level.grow(runs, count)
            if level.failed() is not None:
                raise failing(level.fine, level.y[-1])
    at, part = estimated(levels, target)
    least = 0.0 if before is None else before.variance / (1.0 + share) ** 2
    return at, replace(part, variance=max(part.variance, least))


def one_run(runs: Runs, setting: Setting, grid: float | None) -> MeanEstimate:
    """The number that all members share if nothing varies."""
    y = runs(setting, grid, design(runs.seed, "estimate pilot", runs.dimensions, 0, 1), np.arange(1))
    return MeanEstimate(float(y[0]), 0.0, math.inf)


def told(
    pilot: Pilot, chosen: Chosen, levels: Sequence[Level], rounds: Sequence[Round],
    found: tuple[Sequence[Way], float] | None, part: MeanEstimate, own: Setting | None, content: Mapping[str, Any],
) -> Estimated:  # fmt: skip
    """Assemble the complete answer."""
    top, runs = chosen.setting, pilot.runs
    messages = list(pilot.messages)
    ways, pilot_seconds = found or ((), 0.0)
    if found is None:
        messages.append("nothing varies and no noise acts: one run is the answer, with its bias alone")
    if len(runs.strata) > 1:
        messages.append(f"rare values of a Choice are sampled apart, as strata: {len(runs.strata) - 1}")
    variance_of_one = pilot.variance(top, pilot.first) if found else 0.0
    members = rounded("plain", variance_of_one / max(chosen.variance, 1e-300), 0) if found else 1
    recipe = {
        "of": runs.question.label, "estimator": ways[0].name if found else "one run", "seed": runs.seed,
        "t1": content["t1"], "error": chosen.error, "setting": top.to_dict(), "grid": pilot.grid(top),
        "levels": [level.to_dict() for level in levels], "rounds": [list(each) for each in rounds],
        "bias": [chosen.bias.value, chosen.bias.half], "reference": chosen.reference, "plain_members": members,
        "looked": pilot.looked.get(top, 0),
    }  # fmt: skip
    cost = runs.measured_cost(top, pilot.grid(top))
    own_seconds = None
    if own is not None and found:
        # The pace of the setting that was run, at the scene's own step.
        own_seconds = rounded("plain", variance_of_one / max(chosen.error, 1e-300) ** 2, 0) * cost * top.h / own.h
    return answer_of(runs, pilot.target, recipe, levels, part, content, pilot_seconds=pilot_seconds,
                     own_seconds=own_seconds, rivals=gains(ways) if found else {}, messages=tuple(messages))  # fmt: skip


def replayed(runs: Runs, target: Sought, recipe: Mapping[str, Any], content: Mapping[str, Any]) -> Estimated:
    """The answer from a recipe: the same members of the same levels, without a pilot."""
    levels = [Level.from_dict(each) for each in recipe["levels"]]
    part = None if levels else one_run(runs, Setting.from_dict(recipe["setting"]), recipe["grid"])
    for share, counts in recipe["rounds"]:
        _, part = grown(runs, target, levels, (share, counts), part)
    assert part is not None
    message = "by a recipe: its members were run again; the bias is that of the recipe, for which no pilot was run"
    return answer_of(runs, target, recipe, levels, part, content, pilot_seconds=0.0, messages=(message,))


def answer_of(
    runs: Runs, target: Sought, recipe: Mapping[str, Any], levels: Sequence[Level], part: MeanEstimate,
    content: Mapping[str, Any], messages: tuple[str, ...] = (), **more: Any,
) -> Estimated:  # fmt: skip
    """Assemble the answer from a recipe and the members that were run."""
    top, bias = Setting.from_dict(recipe["setting"]), Bias(*recipe["bias"])
    members: dict[str, int] = {}
    for level in levels:
        name = str(level.fine) + (f" less {level.coarse}" if level.coarse else "")
        members[name] = members.get(name, 0) + sum(map(len, level.y))
    if target.unbounded and levels:
        seen = recipe.get("looked", 0) + max(sum(map(len, level.y)) for level in levels if not level.stratum)
        messages += (f"Members rarer than 1 in {seen // 3:,} may not have been seen ({seen:,} were run). The interval "
                     "does not include their effect.",)  # fmt: skip
    low, high = biases.interval(part.value, part.half_width(0.95), bias)
    if target.kind == "probability":
        low, high = within(part, low, high, bias, sum(members.values()))
    elif target.kind == "quantile" and part.variance > 0.0:
        low, high = between_members(target, levels, part, low, high, bias)
    return Estimated(
        of=runs.question.label, unit=runs.question.unit, value=part.value, interval=(low, high), error=recipe["error"],
        sampling_error=math.sqrt(part.variance), bias=bias.value,
        bias_interval=(bias.value - bias.half, bias.value + bias.half),
        setting=str(top), settings=top.options(), reference=recipe["reference"], estimator=recipe["estimator"],
        members=members or {str(top): 1}, seconds=runs.seconds,
        plain_seconds=recipe["plain_members"] * runs.measured_cost(top, recipe["grid"]), recipe=recipe,
        provenance=dict(content) | {"settings": top.options()}, messages=messages, **more,
    )  # fmt: skip


def between_members(
    target: Sought, levels: Sequence[Level], part: MeanEstimate, low: float, high: float, bias: Bias
) -> tuple[float, float]:
    """The interval of a quantile with few members beyond it: the quantiles at the ends of its level's interval.

    It agrees with `lw.statistics.Quantiles`. An end is infinite if less than one member lies beyond it.
    """
    samples = samples_of(levels)
    level, at = target.level, target.solved(samples)
    # As many independent members have the variance of the part that is below.
    n = level * (1.0 - level) / (part.variance * at.density**2)
    if not n * target.tail < FAR:
        return low, high
    from scipy.special import stdtrit

    t = float(stdtrit(max(part.freedom, 1.0), 0.975))
    below, above = (float(end) for end in intervals.wilson(np.array(level), np.array(n), 0.95, t))
    ends = (-math.inf if n * below < 1.0 else quantile_of(samples, below),
            math.inf if n * (1.0 - above) < 1.0 else quantile_of(samples, above))  # fmt: skip
    low, _ = biases.interval(part.value, part.value - ends[0], bias)
    _, high = biases.interval(part.value, ends[1] - part.value, bias)
    return low, high


def within(part: MeanEstimate, low: float, high: float, bias: Bias, members: int) -> tuple[float, float]:
    """Wilson's interval of a probability, for the number of independent members with this variance."""
    p = float(np.clip(part.value, 0.0, 1.0))
    from scipy.special import stdtrit

    t = float(stdtrit(max(part.freedom, 1.0), 0.975))
    n = p * (1.0 - p) / part.variance if part.variance > 0.0 and 0.0 < p < 1.0 else members
    ends = intervals.wilson(np.array(p), np.array(n), 0.95, t)
    low, _ = biases.interval(p, p - float(ends[0]), bias)
    _, high = biases.interval(p, float(ends[1]) - p, bias)
    return max(low, 0.0), min(high, 1.0)
