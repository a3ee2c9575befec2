# SPDX-License-Identifier: Apache-2.0
"""Allocation within the limits of the actuators: when one channel is at its limit, others take over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import whole
from lgvi_warp.control.base import ROUND_OFF, rest_rows
from lgvi_warp.control.efforts import EffortAllocation, pseudo_inverse
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number, side_by_side

# Scratch rows of lgvi_kernels.laws.control.bounded_least_squares, beside 8 a channel.
WORK = 138


@dataclass(frozen=True, eq=False, kw_only=True)
class BoundedLeastSquares(EffortAllocation):
    """Allocation by bounded least squares: efforts within limits with the least error (Johansen & Fossen 2013, 2.2).

    The error is the sum over X, Y, Z, K, M, N of (priority times (wrench minus demand))^2, with moments divided by the mean
    lever arm of the channels. If the efforts of least error without limits are within the limits, they are used. They equal
    those of `PseudoInverse` if the channels can produce every component independently. Otherwise an active-set method
    finds the efforts of least error, to round-off. Channels that are known to be lost, however many, get no effort.

    Args:
        to: Key of the term that takes the commands.
        weights: Cost of each effort (defined in `PseudoInverse`), (channels,), above 0; 1 by default.
        speed: Forward speed [m/s] at which the effect of fins is evaluated; 1 by default. "measured" uses, at each tick,
            the measured forward speed through the water, but at least `least_speed`.
        least_speed: Least speed [m/s] at which the effect of fins is evaluated if `speed` is "measured".
        priorities: Weights of errors in X, Y, Z, K, M, N, (6,), above 0; 1 by default. [1, 1, 1, 10, 10, 10] gives moments
            priority over forces.
        iterations: Largest number of steps of the active-set method at a tick; 100 by default. The run's messages report
            ticks at which the method had not converged.

    Examples:
        >>> import lgvi_warp as lw
        >>> allocation = lw.control.BoundedLeastSquares(to="thrusters", priorities=[1, 1, 1, 10, 10, 10])
        >>> law = lw.control.PosePID(kp=[50.0] * 3, kd=[80.0] * 3, kr=[10.0] * 3, kw=[8.0] * 3, feedforward="restoring")
        >>> hold = lw.control.SetPoint(position=[0.0, 0.0, 5.0], heading=0.0)
        >>> controller = lw.Controller(period=0.1, guidance=[hold], laws=[law], allocation=[allocation])
        >>> lw.Scene.named("bluerov2_heavy", controller=controller).controller.parts[-1].iterations
        100
    """

    type: ClassVar[str] = "bounded_least_squares"

    iterates: ClassVar[bool] = True

    priorities: Any = number((6,), "1", (1.0,) * 6, above=0.0)
    iterations: int = whole(1, "is not a number of iterations", "give 1 or more", default=100)

    def device_in(self, aligned: bool) -> str:
        return f"bounded_least_squares:{self.curve_word}{self.words_at_speed}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The solution without limits, lines and priorities in their order; each channel's numbers and its scaled column.
        B, weights = self.effect_and_weights(numbers, context)
        force, moment = (np.square(B[:, half]).sum(axis=(1, 2)) for half in (slice(0, 3), slice(3, 6)))
        both = (force > 0.0) & (moment > 0.0)
        arm = np.sqrt(np.where(both, moment, 1.0) / np.where(both, force, 1.0))
        B, weights, arm, priorities = repeated(B, weights, arm, numbers["priorities"])
        root = 1.0 / np.sqrt(weights)
        units = np.where(np.arange(6) < 3, 1.0, 1.0 / arm[:, None])
        lines = self._solution(B, weights, units * priorities)
        order = np.argsort(-priorities, axis=1, kind="stable")
        sizes = np.take_along_axis(priorities, order, axis=1)
        of_demand = units[:, :, None] * np.eye(6)
        of_demand, scaled = (np.take_along_axis(x, order[:, :, None], axis=1) for x in (of_demand, of_demand @ B))
        scaled = np.where(np.abs(scaled) < ROUND_OFF * np.abs(scaled).max(axis=(1, 2), keepdims=True), 0.0, scaled)
        columns = np.swapaxes(scaled * root[:, None, :], -1, -2)
        channels = self.channel_rows(B, context, columns, root[..., None])
        rows = [rest_rows(B @ lines), of_demand, sizes, sizes**-2, arm, lines, channels]
        actuator_numbers = context.own(self.actuator)
        curves, size = self.curves(actuator_numbers)
        first, count = self.bus.commands[self.to]
        flat = [x.reshape(len(x), -1) for x in rows]
        words = {
            "commands": first,
            "count": count,
            "shared": sum(block.shape[1] for block in flat),
            "size": size,
            **self.kind_of_curves(actuator_numbers),
            "iterations": self.iterations,
            "unconverged": self.bus.unconverged,
            **self.at_speed(numbers),
        }
        return Packed(words, side_by_side(*flat, curves), work=WORK + 8 * count)

    def _solution(self, B: np.ndarray, weights: np.ndarray, priorities: np.ndarray) -> np.ndarray:
        """Map (n, channels, 6) from demand to the efforts of least error without limits: a prioritised pseudo-inverse."""
        lines = pseudo_inverse(B, weights, ())
        reached = np.einsum("nij,nji->ni", B, lines) > 1.0 - 1e-6
        spans = np.all(reached | ~np.any(B, axis=2), axis=1)
        weighted = pseudo_inverse(priorities[..., None] * B, weights, ()) * priorities[:, None, :]
        return np.where(spans[:, None, None], lines, weighted)
