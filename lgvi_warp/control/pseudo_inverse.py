# SPDX-License-Identifier: Apache-2.0
"""Allocation by a weighted pseudo-inverse of the actuators' effect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import rest_rows
from lgvi_warp.control.efforts import EffortAllocation, pseudo_inverse
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, side_by_side

# The most channels with known faults of one actuator: there is a set of lines for each subset of them.
MOST_LOST = 4


@dataclass(frozen=True, eq=False, kw_only=True)
class PseudoInverse(EffortAllocation):
    """Allocation by a weighted pseudo-inverse of the wrenches of the channels (Fossen 2021, 11.2).

    For the demand w, weights W and wrenches B of unit efforts, the efforts are t = W^-1 B^T (B W^-1 B^T)^+ w. They
    minimise |B t - w| and, among all t that do so, the sum of weight t^2. Components that no law demands are ignored. An
    effort is the thrust of a thruster, the angle of a fin (with B at `speed`), or the force or moment of a control_wrench.
    The command of a thruster follows from its curve at zero advance speed: a moving thruster gives less thrust, but
    the demand counts as delivered. Thrusters with a polynomial need a `limit`. The polynomial is inverted up to
    this limit or up to its first maximum, whichever is smaller.

    Args:
        to: Key of the term that takes the commands.
        weights: Cost of each effort, (channels,), above 0; 1 by default.
        speed: Forward speed [m/s] at which the effect of fins is evaluated; 1 by default. "measured" uses, at each tick,
            the measured forward speed through the water, but at least `least_speed`.
        least_speed: Least speed [m/s] at which the effect of fins is evaluated if `speed` is "measured".
    """

    type: ClassVar[str] = "pseudo_inverse"

    def check_actuator(self, faults: Faults) -> None:
        super().check_actuator(faults)
        lost = self.lost_channels
        if len(lost) > MOST_LOST:
            faults.add(
                f"{self.key}.to",
                self.to,
                f"has {len(lost)} channels with known faults",
                f"let at most {MOST_LOST} be known",
            )

    def device_in(self, aligned: bool) -> str:
        return f"pseudo_inverse:{self.curve_word}{',lost' if self.losses else ''}{self.words_at_speed}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # For each set of losses the lines of the pseudo-inverse; each channel's wrench and numbers; curves and inverses.
        B, weights = self.effect_and_weights(numbers, context)
        lost, rows = self.lost_channels, []
        for s in range(1 << len(lost)):
            lines = pseudo_inverse(B, weights, [channel for j, channel in enumerate(lost) if s >> j & 1])
            rows += [rest_rows(B @ lines), lines.reshape(len(lines), -1)]
        channels = self.channel_rows(B, context)
        rows.append(channels.reshape(len(channels), -1))
        actuator_numbers = context.own(self.actuator)
        curves, size = self.curves(actuator_numbers)
        first, count = self.bus.commands[self.to]
        words = {
            "commands": first,
            "count": count,
            "sets": 1 << len(lost),
            "size": size,
            **self.kind_of_curves(actuator_numbers),
            **self.at_speed(numbers),
        }
        return Packed(words | {"shared": sum(block.shape[1] for block in rows)}, side_by_side(*rows, curves))
