# SPDX-License-Identifier: Apache-2.0
"""The parameters and initial states of the members of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Members:
    """Parameters and initial states of m members.

    Args:
        parameters: Numbers of the scene by name, with a leading dimension of 1 (shared) or m (varied).
        position: Positions, (m, 3) [m], in inertial axes.
        attitude: Attitudes, (m, 3, 3), body to inertial axes.
        velocity: Velocities, (m, 3) [m/s], in body axes.
        angular_velocity: Angular velocities, (m, 3) [rad/s], in body axes.
        indices: Indices of these members in the ensemble, (m,).
        seed: Seed of the ensemble. It and the index key a member's random numbers, in a subset as in the whole.
    """

    parameters: dict[str, np.ndarray]
    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    indices: np.ndarray
    seed: int

    @property
    def count(self) -> int:
        """The number of members, m."""
        return len(self.position)
