# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that varies with depth: its deviation from the constant buoyancy."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View


class Stratification(Law):
    """Numbers of `lw.terms.Stratification`; buoyancy [N], center_of_buoyancy (3,) [m, body axes]."""

    potential_force = True
    compressibility = 0.0

    def excess_depth(self, view: View) -> float:
        """Depth d of the centre of buoyancy minus d0 [m]."""
        return float(view.b[2] + view.R[2] @ self.center_of_buoyancy - self.reference_depth)

    def wrench(self, view: View) -> tuple[Array, Array]:
        """f = -B ((1 + gradient x) (1 - compressibility x) - 1) R^T e3 at the centre of buoyancy."""
        x, gradient, kappa = self.excess_depth(view), self.gradient, self.compressibility
        f = np.asarray(-self.buoyancy * (gradient * x - kappa * x - gradient * kappa * x**2) * view.down)
        return f, cross(self.center_of_buoyancy, f)

    def potential(self, view: View) -> float:
        """U = B ((gradient - compressibility) x^2 / 2 - gradient compressibility x^3 / 3) [J]."""
        x, gradient, kappa = self.excess_depth(view), self.gradient, self.compressibility
        return float(self.buoyancy * ((gradient - kappa) * x**2 / 2.0 - gradient * kappa * x**3 / 3.0))
