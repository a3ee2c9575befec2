# SPDX-License-Identifier: Apache-2.0
"""Cross-flow drag of a slender hull along the body's x axis, by two Gauss points per segment."""

import math

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class CrossFlow(Law):
    """Attributes as in `lw.terms.CrossFlow`; density [kg/m3]."""

    def points(self) -> list[tuple[float, float]]:
        """(x, weight times Cd D) of each Gauss point, Cd D linear in each segment."""
        strength, strips = self.drag_coefficient * self.diameters, []
        for i in range(len(self.stations) - 1):
            middle, half = (
                0.5 * (self.stations[i] + self.stations[i + 1]),
                0.5 * (self.stations[i + 1] - self.stations[i]),
            )
            for x in (middle - half / math.sqrt(3.0), middle + half / math.sqrt(3.0)):
                part = (x - self.stations[i]) / (2.0 * half)
                strips.append((x, half * ((1.0 - part) * strength[i] + part * strength[i + 1])))
        return strips

    def damping(self, view: View) -> Array:
        """Sum of c |w| A^T A, w = A (nu; Om) = (v + x r, w - x q)."""
        D, twist = np.zeros((6, 6)), np.concatenate([view.nu, view.Om])
        for x, weight in self.points():
            A = np.array([[0.0, 1.0, 0.0, 0.0, 0.0, x], [0.0, 0.0, 1.0, 0.0, -x, 0.0]])
            D += 0.5 * self.density * weight * math.hypot(*(A @ twist)) * A.T @ A
        return D
