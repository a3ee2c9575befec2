"""To be said in one sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STATES = ("position", "attitude", "velocity", "angular_velocity")


@dataclass(frozen=True, eq=False)
class Members:
    """A run of m members. Parameters have a leading dimension of 1 (shared) or m (varied), in the scene's names.

    position (m, 3) [m], attitude (m, 3, 3) body to inertial, velocity (m, 3) [m/s], angular_velocity (m, 3) [rad/s].
    indices (m,): which members they are, and seed: what their random numbers are keyed by, in a subset as in the whole.
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
        """m."""
        return len(self.position)
