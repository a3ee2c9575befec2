# SPDX-License-Identifier: Apache-2.0
"""Loads of spatially varying water on a slender hull, strip by strip, by two Gauss points per segment."""

import math

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Flow, Law, View, WaterAt

AXIS = np.array([1.0, 0.0, 0.0])
ACROSS = np.diag([0.0, 1.0, 1.0])


class HullLoads(Law):
    """Attributes as in `lw.terms.HullLoads`, with a given added_mass; density [kg/m3]."""

    def points(self) -> list[tuple[float, float, float, float, float, float]]:
        """Gauss points: x, weight, Cd D, area S, (S^2 / 4 pi)' and added mass per length."""
        strips = []
        for i in range(len(self.stations) - 1):
            length = self.stations[i + 1] - self.stations[i]
            for part in (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)):
                x, D, a, drag = (
                    (1.0 - part) * table[i] + part * table[i + 1]
                    for table in (
                        self.stations,
                        self.diameters,
                        self.added_mass,
                        self.drag_coefficient * self.diameters,
                    )
                )
                S, slope = (
                    math.pi * D**2 / 4.0,
                    math.pi * D / 2.0 * (self.diameters[i + 1] - self.diameters[i]) / length,
                )
                strips.append((x, 0.5 * length, drag, S, S * slope / (2.0 * math.pi), a))
        return strips

    def load(self, view: View, water_at: WaterAt) -> tuple[Array, Array]:
        """Load of each strip in its local water, minus the load that the water at the origin would cause."""
        D, w, here = np.zeros((6, 6)), np.zeros(6), water_at(np.zeros(3))
        body = view.nu + view.R.T @ here.velocity
        for x, weight, drag, S, tilting, a in self.points():
            there, arm = water_at(x * AXIS), x * AXIS
            v = body + cross(view.Om, arm)
            near, far = (v - view.R.T @ water.velocity for water in (there, here))
            alpha = view.R.T @ (material(there, there.velocity) - material(here, here.velocity))
            # d/dt of the momentum a w, which lies across an axis that turns.
            more = far - near
            found = ACROSS @ view.R.T @ (material(there, view.R @ v) - material(here, view.R @ body))
            found += cross(view.Om, ACROSS @ more) - ACROSS @ cross(view.Om, more)
            momentum, momentum_here = a * ACROSS @ near, a * ACROSS @ far
            held, held_here = (
                view.R.T @ water.gradient.T @ view.R @ p for water, p in ((there, momentum), (here, momentum_here))
            )
            force = self.density * S * alpha + a * found - held
            torque = cross(arm, force) + cross(AXIS, self.density * tilting * alpha)
            torque = torque - cross(AXIS, AXIS @ near * momentum - AXIS @ far * momentum_here)
            w += weight * np.concatenate([force + held_here, torque])
            # Drag c |w| w, w = A (nu; Om) less the water's difference.
            A = np.array([[0.0, 1.0, 0.0, 0.0, 0.0, x], [0.0, 0.0, 1.0, 0.0, -x, 0.0]])
            c = 0.5 * self.density * weight * drag * math.hypot(*near[1:])
            D += c * A.T @ A
            w += c * A.T @ (far - near)[1:]
        return D, w


def material(water: Flow, v: Array) -> Array:
    """Acceleration of the water [m/s2], inertial axes, at a point that moves through it at v."""
    return water.rate + water.gradient @ v
