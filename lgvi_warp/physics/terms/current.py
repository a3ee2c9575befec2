"""Currents: how the water moves. Momenta are relative to it, so drag and lift feel it without more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, Setting, Term, knots, quantity
from lgvi_warp.physics.terms.wrench import not_rising, rising


@dataclass(frozen=True, eq=False, kw_only=True)
class Current(Term):
    """A steady, uniform current.

    velocity: (3,) [m/s], inertial.
    """

    type: ClassVar[str] = "current"
    device: ClassVar[str] = "current"

    velocity: Any = quantity((3,), "m/s")

    def present(self, own: Numbers) -> bool:
        """Whether some member has one."""
        return bool(np.any(own["velocity"]))

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """As it is: inertial axes are not turned."""
        return Packed({"velocity": own["velocity"]})

    def water(self, own: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        """Velocity of the water (k, n, 3) [m/s]."""
        return np.broadcast_to(own["velocity"], position.shape)


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentProfile(Term):
    """A current that varies with depth: a table, linear between its depths and constant outside.

    depths: (k,) [m], rising; velocities: (k, 3) [m/s], inertial.
    """

    type: ClassVar[str] = "current_profile"
    device: ClassVar[str] = "current_profile"

    depths: Any = quantity(("k",), "m")
    velocities: Any = quantity(("k", 3), "m/s")

    def check(self, faults: Faults) -> None:
        """Depths must rise."""
        rising(faults, "depths", self.depths)

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """Also where a member's depths do not rise."""
        bad = super().unphysical(own)
        return bad | {"depths": bad["depths"] | not_rising(own["depths"])}

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """The table, knot by knot."""
        return Packed({"count": own["depths"].shape[1] - 1}, knots(own["depths"], own["velocities"]))

    def water(self, own: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        """Velocity of the water (k, n, 3) [m/s]."""
        depths, velocities = own["depths"], own["velocities"]
        result = np.empty(position.shape)
        for i in range(position.shape[1]):
            at, values = depths[i % len(depths)], velocities[i % len(velocities)]
            for axis in range(3):
                result[:, i, axis] = np.interp(position[:, i, 2], at, values[:, axis])
        return result
