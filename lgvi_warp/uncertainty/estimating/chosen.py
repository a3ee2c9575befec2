# SPDX-License-Identifier: Apache-2.0
"""The setting whose statistic is estimated: the step of a ladder with the lowest predicted cost, with its bias."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.common.sentences import sentences
from lgvi_warp.uncertainty.estimating.bias import APART, Bias, StepChange
from lgvi_warp.uncertainty.estimating.choice import candidates
from lgvi_warp.uncertainty.estimating.levels import Setting
from lgvi_warp.uncertainty.estimating.pilot import FEW, Ladder, Pilot, at_once, climb, failing, observed, runs_at

# Coarser settings that levels are sought among.
MOST_COARSER = 4
# Another method is tried where the pilot took at most this part of what the run would with the first.
ANOTHER = 0.3


@dataclass(frozen=True)
class Chosen:
    """A setting, its bias, the reference of the bias, and the requested error.

    place: index of the setting in the ladder.
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
        """Sampling variance that error and bias leave; a quarter of the error's square if the bias uses it up."""
        return max(self.error**2 - self.bias.mean_square, 0.25 * self.error**2, 1e-300)


def setting_of(pilot: Pilot, ladders: Sequence[Sequence[Setting]], fixed: bool, own: Setting | None) -> Chosen:
    """Run the ladders and choose the setting with the lowest predicted cost, or the scene's own for few members."""
    climbed = list[Chosen]()
    own = ladders[0][-2] if fixed else own
    if own is not None and seems_few(pilot, ladders[0]) and (ladder := at_once(pilot, own)):
        return with_rounding(pilot, choice_of(pilot, ladder, own))
    asked = own if fixed else None
    for i, steps in enumerate(ladders):
        if climbed and not worth_another(pilot, climbed[0]):
            break
        kept = [each for each in climbed if each.bias.mean_square <= each.error**2]
        most = min((pilot.runs.cost(each.setting, pilot.grid(each.setting)) for each in kept), default=math.inf)
        ladder = climb(pilot, steps, asked, most)
        if asked is not None and asked not in ladder.settings:
            why = ladder.refused.get(str(asked), "it was not run")
            raise SceneError([sentences(f"setting = {asked}", why, "give a shorter step, or leave h out")])
        if ladder.settings:
            climbed.append(choice_of(pilot, ladder, asked))
        elif i == len(ladders) - 1 and not climbed:
            refused = list(ladder.refused.items())[-2:]
            if len({why for _, why in refused}) == 1:  # no step would help
                raise SceneError([refused[0][1]])
            causes = "; ".join(f"{name}: {why}" for name, why in refused)
            raise SceneError([f"setting: no step qualified: {causes}. Fix the failing members, or set method= and h="])
        if climbed and climbed[-1].ladder.end == "apart":
            break
    climbed = [with_rounding(pilot, each) for each in climbed]
    best = min(climbed, key=lambda each: (each.bias.mean_square > each.error**2, price(pilot, each)))
    return compared(pilot, best, [each for each in climbed if each is not best])


def worth_another(pilot: Pilot, first: Chosen) -> bool:
    """True if another method's ladder pays: the first does not keep the error, or is cheap compared with the run."""
    if first.bias.mean_square > first.error**2:
        return True
    best = candidates(observed(pilot, first.setting, [], pilot.first), first.variance)[0]
    return pilot.runs.counted <= ANOTHER * best.seconds


def seems_few(pilot: Pilot, steps: Sequence[Setting]) -> bool:
    """True if plain Monte Carlo needs few members, judged by the coarsest step that runs."""
    for setting in steps:
        ladder = Ladder()
        if runs_at(pilot, setting, ladder):
            return pilot.plain_members(setting, pilot.first, unseen=True) <= FEW
    return False


def price(pilot: Pilot, chosen: Chosen) -> float:
    """Cost of a member [s] divided by the remaining variance."""
    return pilot.runs.cost(chosen.setting, pilot.grid(chosen.setting)) / chosen.variance


def choice_of(pilot: Pilot, ladder: Ladder, fixed: Setting | None) -> Chosen:
    """Choose the setting of a ladder, with its bias."""
    last = ladder.settings[-1]
    error = pilot.asked(pilot.solved(last, pilot.first))
    if not error > 0.0:
        problem = f"asks for a part of {pilot.runs.question.label}, which is 0"
        raise refusal("relative_error", pilot.error, problem, "give error=, in the unit of the statistic")
    place = ladder.settings.index(fixed) if fixed is not None else ladder.settled(error)
    bias = ladder.biases()[place]
    pairs = ladder.halvings[-1].members if ladder.halvings else pilot.first
    return Chosen(ladder, place, bias, error, f"{last} on {pairs} members" if place < len(ladder.settings) - 1
                  else f"the halving before, from {ladder.settings[max(place - 1, 0)]}, on {pairs} members")  # fmt: skip


def with_rounding(pilot: Pilot, chosen: Chosen) -> Chosen:
    """The choice with the bias of single precision added, which differences of steps do not show."""
    setting = chosen.setting
    if setting.dtype == "float64":
        return chosen
    twin = replace(setting, dtype="float64")
    apart = difference_of(pilot, setting, twin)
    bias = Bias(chosen.bias.value + apart.value, chosen.bias.half + apart.half)
    return replace(chosen, bias=bias, reference=f"{chosen.reference}, and float64 on {apart.members}")


def difference_of(pilot: Pilot, setting: Setting, twin: Setting) -> StepChange:
    """Change of the target from a setting to the same in double precision; SceneError if members fail there."""
    y = pilot.y(twin, pilot.grid(setting), pilot.first)
    if not np.isfinite(y).all():
        raise failing(twin, y)
    return pilot.pair(setting, twin, pilot.first)


def compared(pilot: Pilot, best: Chosen, others: Sequence[Chosen]) -> Chosen:
    """Compare with other methods: if two methods disagree, the bias is widened by their difference; adds messages."""
    ladder, messages = best.ladder, pilot.messages
    messages += [f"{name} is left out: {why}" for name, why in ladder.refused.items()]
    for other in others if pilot.noise == "none" else ():
        mine, theirs = ladder.settings[-1], other.ladder.settings[-1]
        found = pilot.pair(theirs, mine, pilot.first)
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
    """True if all members have the same number because nothing varies."""
    return pilot.runs.dimensions == 0 and pilot.noise == "none" and bool(
        np.ptp(pilot.y(setting, pilot.grid(setting), pilot.first)) == 0.0
    )  # fmt: skip


def finer(pilot: Pilot, chosen: Chosen) -> Chosen:
    """The choice with the next step of the ladder."""
    place = chosen.place + 1
    return with_rounding(pilot, replace(chosen, place=place, bias=chosen.ladder.biases()[place]))


def coarser_than(pilot: Pilot, chosen: Chosen, coarse: Sequence[Sequence[Setting]]) -> list[Setting]:
    """Coarser settings for levels: from the ladder, and the longest steps of the cheaper scenes."""
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
                if not np.isnan(pilot.y(replace(step, method=top.method), pilot.grid(top), pilot.first)).any():
                    found.append(replace(step, method=top.method))
                    break
            except SceneError as error:
                pilot.messages.append(f"{step} is left out: {error.faults[0]}")
    return found
