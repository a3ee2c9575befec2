# SPDX-License-Identifier: Apache-2.0
"""Allocation within the limits of the actuators."""

from typing import Any

import numpy as np

from lgvi_warp.reference.control import cannot
from lgvi_warp.reference.control.pseudo_inverse import PseudoInverse
from lgvi_warp.reference.rotation import Array

# What is added to the matrix of free channels, and the error that counts as none, as parts of that of all, and of the demand.
RIDGE, DELIVERED = 1e-3, 1e-3
# An effort is at a limit where it is so near, as a part of the range.
AT_LIMIT = 1e-5


class BoundedLeastSquares(PseudoInverse):
    """Numbers as those of `lw.control.BoundedLeastSquares`; effect, losses and the actuator as of `PseudoInverse`."""

    priorities = np.ones(6)
    rounds, sweeps = 4, 2

    def allocate(self, w: Array, actuators: dict[str, Any]) -> Array:
        """Efforts of least sum (priority (B t - B B^+ w))^2 within the limits; left are (I - B B^+) w and what they lack."""
        actuator, B = actuators[self.to], self.effect
        cheap = 1.0 / (np.ones(B.shape[1]) if self.weights is None else np.asarray(self.weights))
        inverse = np.diag(np.sqrt(cheap)) @ np.linalg.pinv(B @ np.diag(np.sqrt(cheap)), rcond=1e-10)
        low, high = self.limits(actuator)
        arm = np.sqrt(np.square(B[3:]).sum() / np.square(B[:3]).sum()) if B[:3].any() and B[3:].any() else 1.0
        priorities = self.priorities / np.repeat([1.0, arm], 3)
        A, wanted = np.diag(priorities) @ B, inverse @ w
        t = np.clip(wanted, low, high)
        if np.any(t != wanted):
            for _ in range(self.rounds):
                for i in np.tile(np.arange(len(t)), self.sweeps):
                    t[i] = np.clip(t[i] + A[:, i] @ A @ (wanted - t) / (A[:, i] @ A[:, i]), low[i], high[i])
                t = self.solved(A, cheap, wanted, t, low, high)
        actuator.command = np.clip(actuator.command_for(t), -actuator.limit, actuator.limit)
        asked, lacking = np.any(B != 0.0, axis=1), B @ (wanted - t)
        enough = DELIVERED * np.linalg.norm(asked * priorities * w)
        return np.asarray(cannot(B @ inverse) @ w + np.where(np.abs(priorities * lacking) > enough, lacking, 0.0))

    def limits(self, actuator: Any) -> tuple[Array, Array]:
        """The efforts at full command astern and ahead; 0 of a channel that is known to be lost."""
        ends = (actuator.command_for(np.full(len(actuator.limit), side)) for side in (-1e9, 1e9))
        low, high = (actuator.effort(np.clip(end, -actuator.limit, actuator.limit)) for end in ends)
        lost = [channel for channel, time in self.losses if self.time >= time]
        low[lost] = high[lost] = 0.0
        return low, high

    def solved(self, A: Array, cheap: Array, wanted: Array, t: Array, low: Array, high: Array) -> Array:
        """The least change of the efforts between their limits that makes the error least, up to the first limit."""
        near = AT_LIMIT * (high - low)
        free = (t > low + near) & (t < high - near)
        ridge = RIDGE / 6.0 * np.sum(cheap * np.square(A).sum(axis=0)) * np.eye(6)
        change = np.where(
            free, cheap * (A.T @ np.linalg.solve((A * cheap * free) @ A.T + ridge, A @ (wanted - t))), 0.0
        )
        length = 1.0
        if self.sweeps:
            room = np.where(change > 0.0, high - t, t - low)
            size = np.abs(change)
            length = np.min(np.where(size > room, room / np.where(size > room, size, 1.0), 1.0))
        return np.clip(t + length * change, low, high)
