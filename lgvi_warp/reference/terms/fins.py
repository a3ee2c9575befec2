# SPDX-License-Identifier: Apache-2.0
"""Fixed fins, and fins turned by a command, in the axes of their chord and normal."""

import math

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View


class Fins(Law):
    """Attributes as in `lw.terms.Fins`; density [kg/m3]."""

    def deflection(self, view: View) -> Array:
        """Angles (n,) [rad]: 0, since these fins do not turn."""
        return np.zeros(len(self.area))

    def damping(self, view: View) -> Array:
        """D (6, 6), the sum over the fins."""
        angles = self.deflection(view)
        return np.asarray(sum((self.fin_damping(i, angle, view) for i, angle in enumerate(angles)), np.zeros((6, 6))))

    def lift_coefficient(self, i: int, uc: float, un: float, V: float) -> float:
        """slope sin a cos a of fin i, a: angle of attack; uc, un: speed along chord and normal, V: their norm [m/s]."""
        return float(self.lift_slope[i] * uc * un / V**2)

    def fin_damping(self, i: int, angle: float, view: View) -> Array:
        """D (6, 6) of fin i at an angle: -l (uc n - un c) - d (uc c + un n), l = kl uc un / V, d = kd V + kn un^2 / V."""
        c, n = turned(*orthonormal(self.chord[i], self.normal[i]), angle)
        chord, normal = (np.concatenate([e, cross(self.position[i], e)]) for e in (c, n))
        twist = np.concatenate([view.nu, view.Om])
        uc, un = chord @ twist, normal @ twist
        V = math.hypot(uc, un)
        if V == 0.0:
            return np.zeros((6, 6))
        half = 0.5 * self.density * self.area[i]
        lift = half * self.lift_coefficient(i, uc, un, V) * V
        drag = half * (self.drag[i] * V + self.drag_normal[i] * un**2 / V)
        along, across = (
            np.outer(chord, chord) + np.outer(normal, normal),
            np.outer(normal, chord) - np.outer(chord, normal),
        )
        return np.asarray(drag * along + lift * across)


def orthonormal(chord: Array, normal: Array) -> tuple[Array, Array]:
    """Unit vectors along the chord, and along the part of the normal that is perpendicular to it."""
    c = np.asarray(chord) / math.sqrt(np.dot(chord, chord))
    n = normal - np.dot(normal, c) * c
    return c, n / math.sqrt(np.dot(n, n))


def turned(c: Array, n: Array, angle: float) -> tuple[Array, Array]:
    """c' = cos c + sin n, n' = cos n - sin c, for unit vectors c, n along chord and normal, turned by an angle [rad]."""
    return math.cos(angle) * c + math.sin(angle) * n, math.cos(angle) * n - math.sin(angle) * c
