# SPDX-License-Identifier: Apache-2.0
"""Find the cheapest setting in which a mean has a bias below an error, by ladders of a pilot and single precision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.settings import EnsembleSettings
from lgvi_warp.uncertainty.estimating.bias import Bias, beyond
from lgvi_warp.uncertainty.estimating.estimate import drawn, ladders_of, spacing_of
from lgvi_warp.uncertainty.estimating.levels import Runs, Setting
from lgvi_warp.uncertainty.estimating.pilot import Ladder, Pilot, climb
from lgvi_warp.uncertainty.estimating.question import question_of

# A ladder ends by the root mean square, of which value and interval together are 1.12 times at most.
ROOM = 1.2


@dataclass(frozen=True)
class MeanSetting:
    """A setting, the bias of the mean in it, its cost of a member [s], and the finer setting of the bias estimate.

    members: number of pairs for the bias. beyond: bound of the reference's own bias, in the unit of the mean.
    """

    setting: Setting
    bias: Bias
    cost: float
    reference: Setting
    members: int
    beyond: float

    @property
    def largest(self) -> float:
        """Largest absolute value in the bias's interval."""
        return abs(self.bias.value) + self.bias.half


def mean_settings(
    fleet: Ensemble, of: str, error: float, t1: float, methods: Sequence[str] | None, report: Callable[[float], None],
    seconds: float, threads: int | None = None,
) -> list[MeanSetting]:  # fmt: skip
    """Settings whose bias at the end is at most an error, the cheapest first; SceneError if there is none.

    of: the mean of one number, as in `lw.estimate`. methods: methods to try; None for those of `lw.estimate`. seconds:
        approximate processor time to spend.
    """
    fleet = drawn(fleet)
    seed = int(EnsembleSettings(1, fleet.seed).seed)
    question, spacing = question_of(of), spacing_of(fleet.scene, t1)
    runs = Runs([fleet], question, t1, seed=seed, execution={"threads": threads})
    # In double precision, also of a scene in single: in_single tells what that adds.
    ladders, noise = ladders_of(fleet, t1, spacing, methods, None, "float64")
    pilot, kept, closest = (
        Pilot(runs, question.target, noise, error / ROOM, most=seconds),
        list[MeanSetting](),
        list[MeanSetting](),
    )
    for i, steps in enumerate(ladders):
        ladder = climb(pilot, steps)
        report((i + 1) / len(ladders))
        known = in_ladder(pilot, ladder)
        closest += known
        kept += [each for each in known if each.largest <= error][:1]
        if ladder.end == "apart" or (kept and runs.seconds > seconds):
            break
    kept += [twin for each in list(kept) if (twin := in_single(pilot, each)) and twin.largest <= error]
    if not kept:
        if not closest:
            raise SceneError(
                [f"error = {error:g} of {question.label}: no step qualified: members fail. Fix the failing members"]
            )
        best = min(closest, key=lambda each: each.largest)
        problem = (
            f"error = {error:g} of {question.label}: its bias is known to {best.largest:.2g} alone, by {best.setting}"
        )
        raise SceneError([f"{problem} against {best.reference} on {best.members} members. Ask for a larger one"])
    return sorted(kept, key=lambda each: each.cost)


def in_ladder(pilot: Pilot, ladder: Ladder) -> list[MeanSetting]:
    """The steps of a ladder, the coarsest first, with their biases."""
    if len(ladder.settings) < 2:
        return []
    last, pairs, rest = ladder.settings[-1], ladder.halvings[-1].members, beyond(ladder.halvings, ladder.order)
    return [
        MeanSetting(setting, bias, pilot.runs.measured_cost(setting), last, pairs, rest)
        for setting, bias in zip(ladder.settings, ladder.biases(), strict=True)
    ]


def in_single(pilot: Pilot, each: MeanSetting) -> MeanSetting | None:
    """The setting in single precision, with the difference added to the bias; None if it is refused or fails."""
    if each.setting.dtype != "float64":
        return None
    twin = Setting(each.setting.method, each.setting.h, "float32", each.setting.scene)
    try:
        if not np.isfinite(pilot.y(twin, pilot.grid(each.setting), pilot.first)).all():
            return None
        apart = pilot.pair(twin, each.setting, pilot.first)
    except SceneError:
        return None
    bias = Bias(each.bias.value + apart.value, each.bias.half + apart.half)
    return MeanSetting(twin, bias, pilot.runs.measured_cost(twin), each.reference, each.members, each.beyond)
