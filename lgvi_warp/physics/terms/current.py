# SPDX-License-Identifier: Apache-2.0
"""Currents. Momenta are relative to the water, so that drag and lift need no further code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, knots, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Current(Term):
    """A current that is the same everywhere and at all times.

    Args:
        velocity: Velocity of the water, (3,) [m/s], in inertial axes.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", terms=[lw.terms.Current(velocity=[0.5, 0.0, 0.0])])
        >>> fleet = lw.Ensemble(scene, members=100, vary={"current.velocity[1]": lw.distributions.Normal(std=0.1)})
        >>> fleet.parameters(0, 100)["current.velocity"].shape
        (100, 3)
    """

    type: ClassVar[str] = "current"
    strengths: ClassVar[tuple[str, ...]] = ("velocity",)
    carries: ClassVar[bool] = True

    velocity: Any = number((3,), "m/s")

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        return np.broadcast_to(numbers["velocity"], position.shape)


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentProfile(Term):
    """A current that varies with depth, as a table that is linear between its depths and constant outside.

    Args:
        depths: Depths, (k,) [m], rising.
        velocities: Velocities of the water at these depths, (k, 3) [m/s], in inertial axes.

    Raises:
        SceneError: If depths do not rise, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "current_profile"
    depth_field: ClassVar[str] = "depths"

    depths: Any = number(("k",), "m", rising=True)
    velocities: Any = number(("k", 3), "m/s")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        return Packed({"count": numbers["depths"].shape[1] - 1}, knots(numbers["depths"], numbers["velocities"]))

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        # Velocity (k, n, 3) [m/s] at the depth of each position, whatever the time.
        depths, velocities = numbers["depths"], numbers["velocities"]
        result = np.empty(position.shape)
        for i in range(position.shape[1]):
            at, values = depths[i % len(depths)], velocities[i % len(velocities)]
            for axis in range(3):
                result[:, i, axis] = np.interp(position[:, i, 2], at, values[:, axis])
        return result
