# SPDX-License-Identifier: Apache-2.0
"""Allocation within the limits of the actuators: what one channel cannot make, others do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import whole
from lgvi_warp.control.base import rest_rows
from lgvi_warp.control.efforts import EffortAllocation, pseudo_inverse
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number, side_by_side


@dataclass(frozen=True, eq=False, kw_only=True)
class BoundedLeastSquares(EffortAllocation):
    """Commands for efforts within their limits whose wrench is nearest to the demand (Johansen & Fossen 2013, section 2.2).

    Where the efforts of `PseudoInverse` are within the limits, they are taken to the last digit. Else, in each round, every
    effort in turn moves to where the error is least, and then all that are not at a limit are solved for again, up to the
    first limit. The error is the sum of (priority times component)^2, moments divided by the mean lever arm of the channels.
    Without sweeps it is the redistributed pseudo-inverse: each round only solves again for the efforts that are not at a
    limit. Channels that are known to be lost make nothing, however many they are.

    Args:
        to: Key of the term that takes the commands.
        weights: Cost of each effort, (channels,), above 0; 1 by default.
        speed: Speed ahead [m/s] at which fins are judged; 1 by default.
        priorities: How much an error in X, Y, Z, K, M, N counts, (6,), above 0; 1 by default. [1, 1, 1, 10, 10, 10] makes
            moments before forces.
        rounds: How often free channels are solved for; 4 by default.
        sweeps: How often every effort moves in turn before each of these; 2 by default, 0: not at all.

    Examples:
        >>> import lgvi_warp as lw
        >>> allocation = lw.control.BoundedLeastSquares(to="thrusters", priorities=[1, 1, 1, 10, 10, 10])
        >>> law = lw.control.PosePID(kp=[50.0] * 3, kd=[80.0] * 3, kr=[10.0] * 3, kw=[8.0] * 3, feedforward="restoring")
        >>> hold = lw.control.SetPoint(position=[0.0, 0.0, 5.0], heading=0.0)
        >>> controller = lw.Controller(period=0.1, guidance=[hold], laws=[law], allocation=[allocation])
        >>> lw.Scene.named("bluerov2_heavy", controller=controller).controller.parts[-1].rounds
        4
    """

    type: ClassVar[str] = "bounded_least_squares"

    priorities: Any = number((6,), "1", (1.0,) * 6, above=0.0)
    rounds: int = whole(1, "is no number of rounds", "give 1 or more", default=4)
    sweeps: int = whole(0, "is no number of sweeps", "give 0 or more", default=2)

    def device_in(self, aligned: bool) -> str:
        return f"bounded_least_squares:{self.curve_word}{'' if self.sweeps else ',redistributes'}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The pseudo-inverse's lines; each channel's numbers, its effect by priorities, 1 / weight and 1 / its square.
        B, weights = self.effect_and_weights(numbers, context)
        lines = pseudo_inverse(B, weights, ())
        force, moment = (np.square(B[:, half]).sum(axis=(1, 2)) for half in (slice(0, 3), slice(3, 6)))
        arm = np.sqrt(np.where((force > 0.0) & (moment > 0.0), moment / np.where(force > 0.0, force, 1.0), 1.0))
        priorities = numbers["priorities"] / np.where(np.arange(6) < 3, 1.0, arm[:, None])
        scaled = np.swapaxes(priorities[..., None] * B, -1, -2)
        square = np.square(scaled).sum(axis=-1, keepdims=True)
        step = np.divide(1.0, square, out=np.zeros_like(square), where=square > 0.0)
        channels = self.channel_rows(B, context, scaled, 1.0 / weights[..., None], step)
        rows = [rest_rows(B @ lines), self.asked * priorities, *(x.reshape(len(x), -1) for x in (lines, channels))]
        actuator_numbers = context.own(self.actuator)
        curves, size = self.curves(actuator_numbers)
        first, count = self.bus.commands[self.to]
        words = {
            "commands": first,
            "count": count,
            "shared": sum(block.shape[1] for block in rows),
            "size": size,
            **self.kind_of_curves(actuator_numbers),
            "rounds": self.rounds,
            "sweeps": self.sweeps,
        }
        return Packed(words, side_by_side(*rows, curves))
