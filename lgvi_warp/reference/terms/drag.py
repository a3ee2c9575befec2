# SPDX-License-Identifier: Apache-2.0
"""Drag per axis, and by 6x6 matrices."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class Drag(Law):
    """Attributes as in `lw.terms.Drag`: -(l + q|v|) v on each axis."""

    def damping(self, view: View) -> Array:
        """The diagonal matrix l + q|v|."""
        return np.diag(self.linear + self.quadratic * np.abs(np.concatenate([view.nu, view.Om])))

    def exact(self, p: Array, inertia: Array, h: float) -> Array:
        """The momenta (6,) after h of drag alone: v e^-x / (1 + (h q|v|/I) (1 - e^-x)/x), x = h l / I, inertia I (6,).

        docs/theory/splitting.md, (S13).
        """
        v, x = p / inertia, h * self.linear / inertia
        mean = np.where(x == 0.0, 1.0, -np.expm1(-x) / np.where(x == 0.0, 1.0, x))
        return np.asarray(inertia * v * np.exp(-x) / (1.0 + h * self.quadratic * np.abs(v) / inertia * mean))

    def by_directions(self, nu: Array, inverse: Array, h: float) -> Array:
        """The velocities (6,) after h / 2 of drag along each axis alone, and again in reversed order; inverse: I6^-1.

        docs/theory/coupled.md, (X18).
        """
        for j in (*range(6), *reversed(range(6))):
            L = inverse[j, j]
            x = 0.5 * h * L * self.linear[j]
            mean = -np.expm1(-x) / x if x else 1.0
            w = nu[j] * np.exp(-x) / (1.0 + 0.5 * h * L * self.quadratic[j] * abs(nu[j]) * mean)
            nu = nu + (w - nu[j]) / L * inverse[:, j]
        return nu


class DragMatrix(Law):
    """Attributes as in `lw.terms.DragMatrix`: force_i = -sum_j (linear_ij + quadratic_ij |v_j|) v_j."""

    def damping(self, view: View) -> Array:
        """Each column of the quadratic matrix by its own speed."""
        return np.asarray(self.linear + self.quadratic * np.abs(np.concatenate([view.nu, view.Om])))
