"""Currents: how the water moves. Momenta are relative to the water, so that drag and lift need no further code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, Setting, Term, knots, quantity
from lgvi_warp.physics.terms.wrench import not_rising, rising


@dataclass(frozen=True, eq=False, kw_only=True)
class Current(Term):
    """A current that is the same everywhere and at all times.

    Args:
        velocity: Velocity of the water, (3,) [m/s], in inertial axes.
    """

    type: ClassVar[str] = "current"
    device: ClassVar[str] = "current"

    velocity: Any = quantity((3,), "m/s")

    def present(self, own: Numbers) -> bool:
        """Whether the current of some member is not zero."""
        return bool(np.any(own["velocity"]))

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """The velocity unchanged: the kernel's inertial axes are the user's."""
        return Packed({"velocity": own["velocity"]})

    def water(self, own: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        """The same velocity (k, n, 3) [m/s] at all positions and times."""
        return np.broadcast_to(own["velocity"], position.shape)


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentProfile(Term):
    """A current that varies with depth by a table, linear between its depths and constant outside.

    Args:
        depths: Depths, (k,) [m], rising.
        velocities: Velocities of the water at these depths, (k, 3) [m/s], in inertial axes.

    Raises:
        SceneError: Where depths do not rise, and as `Term`.
    """

    type: ClassVar[str] = "current_profile"
    device: ClassVar[str] = "current_profile"

    depths: Any = quantity(("k",), "m")
    velocities: Any = quantity(("k", 3), "m/s")

    def check(self, faults: Faults) -> None:
        """Adds a fault where depths do not rise."""
        rising(faults, "depths", self.depths)

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """In addition, refuses members whose depths do not rise."""
        bad = super().unphysical(own)
        return bad | {"depths": bad["depths"] | not_rising(own["depths"])}

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """The table as device rows, knot by knot."""
        return Packed({"count": own["depths"].shape[1] - 1}, knots(own["depths"], own["velocities"]))

    def water(self, own: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        """Velocity (k, n, 3) [m/s] at the depth of each position, whatever the time."""
        depths, velocities = own["depths"], own["velocities"]
        result = np.empty(position.shape)
        for i in range(position.shape[1]):
            at, values = depths[i % len(depths)], velocities[i % len(velocities)]
            for axis in range(3):
                result[:, i, axis] = np.interp(position[:, i, 2], at, values[:, axis])
        return result
