# SPDX-License-Identifier: Apache-2.0
"""Allocation by a weighted pseudo-inverse."""

from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, cannot
from lgvi_warp.reference.rotation import Array


class PseudoInverse(Part):
    """Attributes as in `lw.control.PseudoInverse`; effect (6, n): wrench per unit of effort of each channel of `to`.

    The actuator has `limit`, and effort(command) with its inverse command_for(effort). losses: (channel, time [s]) of
    channels that are known to be lost.
    """

    weights = None
    losses: tuple[tuple[int, float], ...] = ()
    time = 0.0

    def measure(self, y: Measurement) -> Measurement:
        """Store the time, slightly increased since times are rounded."""
        self.time = y.t + 1e-6 * y.h
        return y

    def allocate(self, w: Array, actuators: dict[str, Any]) -> Array:
        """t = W^-1 B^T (B W^-1 B^T)^+ w, as commands within limits; (I - B B^+) w and B times the excess remain."""
        actuator, B = actuators[self.to], self.effect.copy()
        B[:, [channel for channel, time in self.losses if self.time >= time]] = 0.0
        W = np.diag(1.0 / np.sqrt(np.ones(B.shape[1]) if self.weights is None else np.asarray(self.weights)))
        inverse = W @ np.linalg.pinv(B @ W, rcond=1e-10)
        t = inverse @ w
        wanted = actuator.command_for(t)
        actuator.command = np.clip(wanted, -actuator.limit, actuator.limit)
        cut = t - actuator.effort(actuator.command)
        # The inverse of a curve has an error; what a limit cuts off is more.
        cut = np.where(np.abs(cut) > 1e-5 * np.abs(t), cut, 0.0)
        return np.asarray(cannot(B @ inverse) @ w + B @ cut)
