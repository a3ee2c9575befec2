# SPDX-License-Identifier: Apache-2.0
"""Control fins: their deflection follows a command, with a limit, a largest rate and a lag."""

import math
from typing import Any

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.fins import Fins, orthonormal
from lgvi_warp.reference.terms.following import Following


class ControlFins(Following, Fins):
    """Attributes as in `lw.terms.ControlFins` and in `Following`."""

    flow_angle = True
    lift_angles: Any = None
    lift_coefficients: Any = None

    def deflection(self, view: View) -> Array:
        """Angle of each fin."""
        return self.place(view)

    def lift_coefficient(self, i: int, uc: float, un: float, V: float) -> float:
        """The coefficient of `Fins`, or of the table, which is an odd function of the angle of attack."""
        if self.lift_angles is None:
            return super().lift_coefficient(i, uc, un, V)
        return float(self.lift_slope[i] * self.table(math.atan2(un, uc)))

    def table(self, angle: float) -> float:
        """Value of the lift table at an angle [rad] of either sign."""
        return math.copysign(float(np.interp(abs(angle), self.lift_angles, self.lift_coefficients)), angle)

    def fin_damping(self, i: int, angle: float, view: View) -> Array:
        """D of `Fins`; without the flow's angle: lift slope d u u, drag (drag + drag_normal d^2) |u| u, d: fin's angle."""
        if self.flow_angle:
            return super().fin_damping(i, angle, view)
        c, n = orthonormal(self.chord[i], self.normal[i])
        chord, normal = (np.concatenate([e, cross(self.position[i], e)]) for e in (c, n))
        u = chord @ np.concatenate([view.nu, view.Om])
        half = 0.5 * self.density * self.area[i]
        lift = self.lift_slope[i] * (angle if self.lift_angles is None else self.table(angle))
        drag = self.drag[i] + self.drag_normal[i] * angle**2
        return np.asarray(half * (drag * abs(u) * np.outer(chord, chord) - lift * u * np.outer(normal, chord)))
