# SPDX-License-Identifier: Apache-2.0
"""Linear waves in deep water."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number
from lgvi_warp.physics.terms.current_harmonics import Harmonics


@dataclass(frozen=True, eq=False, kw_only=True)
class Waves(Harmonics):
    """A sum of linear waves in deep water, of wavenumber (2 pi / period)^2 / environment.gravity.

    Args:
        amplitudes: Amplitudes of the surface, (k,) [m].
        periods: Periods, (k,) [s], above 0.
        phases: Phases at t = 0 at the inertial origin, (k,) [rad]; 0 by default.
        headings_deg: Directions in which the waves travel, (k,) [deg] from north.

    Raises:
        SceneError: Where a period is not above 0, and as `Term`.
    """

    type: ClassVar[str] = "waves"

    amplitudes: Any = number(("k",), "m", least=0.0)
    headings_deg: Any = number(("k",), "deg")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Device rows of each component; raises SceneError where there is no gravity, hence no wavenumber.
        g = context.parameters["environment.gravity"]
        if np.any(g <= 0.0):
            fault = f"leaves the length of {self.key} unknown (wavenumber = omega^2 / gravity)"
            remedy = f"give gravity above 0, or leave {self.key} out"
            raise refusal("environment.gravity", float(g.min()), fault, remedy)
        rows = np.stack(np.broadcast_arrays(*components(numbers, g)), axis=-1)
        return Packed({"count": rows.shape[1]}, rows.reshape(len(rows), -1))

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        # Orbital velocity (k, n, 3) [m/s] at positions and times; above the surface as at the surface.
        gravity = parameters["environment.gravity"]
        total = np.zeros(position.shape)
        x, y, depth = np.moveaxis(position, -1, 0)
        for j in range(numbers["periods"].shape[1]):
            north, east, k, omega, phase, *speed = (table[:, j] for table in components(numbers, gravity))
            theta = north * x + east * y + (phase - omega * time[:, None])
            e = np.exp(-k * np.maximum(depth, 0.0))
            cosine, sine = e * np.cos(theta), e * np.sin(theta)
            total = total + np.stack([cosine * speed[0], cosine * speed[1], -sine * speed[2]], axis=-1)
        return total


def components(numbers: Numbers, gravity: np.ndarray) -> tuple[np.ndarray, ...]:
    """Components of each wave.

    Wavenumber north, east and in all, omega, phase, and speed at the surface likewise: (n, k) each.
    """
    omega, heading = 2.0 * np.pi / numbers["periods"], np.radians(numbers["headings_deg"])
    k = omega**2 / gravity[:, None]
    speed, along, across = numbers["amplitudes"] * omega, np.cos(heading), np.sin(heading)
    return k * along, k * across, k, omega, numbers["phases"], speed * along, speed * across, speed
