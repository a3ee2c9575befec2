# SPDX-License-Identifier: Apache-2.0
"""The parameters and initial states of the members of a run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from lgvi_warp.physics.given_draws import GivenDraws
    from lgvi_warp.sampling.final import Final


@dataclass(frozen=True, eq=False)
class Shifted:
    """Members followed by their copies with one number shifted, for derivatives.

    members: each of m members, then its copies with a number shifted by OFFSETS steps, for one number after the other.
    steps: (m, numbers), the step of the shifts, in the unit of each number.
    """

    members: Members
    steps: np.ndarray


@dataclass(frozen=True, eq=False)
class Members:
    """Parameters by name, with a leading dimension of 1 (shared) or m (varied), and initial states of m members.

    Positions (m, 3) [m] are in inertial axes, attitudes (m, 3, 3) from body to inertial axes, velocities (m, 3) [m/s]
    and angular velocities (m, 3) [rad/s] in body axes. Seed and index determine a member's random numbers, also in a
    subset, unless its normals are given. `starts` has the varied numbers of the start, (m, ...), by their names in the
    scene, such as "start.euler_deg"; `weight` (m,) is the weight of each member in statistics, None for equal weights.
    shifted: for a run with tangents, the shifted copies.
    final: final states of the run that they continue; None at the start.
    """

    parameters: dict[str, np.ndarray]
    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    indices: np.ndarray
    seed: int
    starts: dict[str, np.ndarray] = field(default_factory=dict)
    weight: np.ndarray | None = None
    final: Final | None = None
    given: GivenDraws | None = None
    shifted: Shifted | None = None

    @property
    def count(self) -> int:
        """The number of members, m."""
        return len(self.position)

    def at(self, some: slice) -> Members:
        """Some of the members, as views."""
        of_each = {
            name: getattr(self, name)[some]
            for name in ("position", "attitude", "velocity", "angular_velocity", "indices")
        }
        return replace(
            self,
            **of_each,
            parameters={name: values[some] if len(values) > 1 else values for name, values in self.parameters.items()},
            starts={name: values[some] for name, values in self.starts.items()},
            weight=None if self.weight is None else self.weight[some],
            final=None if self.final is None else self.final.part(np.arange(self.count)[some]),
            given=None if self.given is None else self.given.of_members(some),
            shifted=None,
        )
