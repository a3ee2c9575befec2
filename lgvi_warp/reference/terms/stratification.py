# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that varies with depth: its deviation from the constant."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View


class Stratification(Law):
    """Numbers as those of `lw.terms.Stratification`; buoyancy [N], center_of_buoyancy (3,) [m, body]."""

    potential_force = True

    def excess_depth(self, view: View) -> float:
        """d - d0 of the centre of buoyancy [m]."""
        return float(view.b[2] + view.R[2] @ self.center_of_buoyancy - self.reference_depth)

    def wrench(self, view: View) -> tuple[Array, Array]:
        """f = -B gradient (d - d0) R^T e3 at the centre of buoyancy."""
        f = np.asarray(-self.buoyancy * self.gradient * self.excess_depth(view) * view.down)
        return f, cross(self.center_of_buoyancy, f)

    def potential(self, view: View) -> float:
        """U = B gradient (d - d0)^2 / 2 [J]."""
        return 0.5 * self.buoyancy * self.gradient * self.excess_depth(view) ** 2
