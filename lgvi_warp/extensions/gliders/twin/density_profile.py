# SPDX-License-Identifier: Apache-2.0
"""Density of the water against depth."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View

# Of Gauss, exact on each straight piece.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(2)


class DensityProfile(Law):
    """Numbers of `lw.terms.DensityProfile`; buoyancy [N], center_of_buoyancy (3,) [m], density rho0 [kg/m3]."""

    compressibility, reference_depth = 0.0, 0.0

    @property
    def potential_force(self) -> bool:  # type: ignore[override]
        """Whether the hull is incompressible, so that the force has a potential."""
        return self.compressibility == 0.0

    def density_at(self, depth: float) -> float:
        """rho(d) [kg/m3]."""
        return float(np.interp(depth, self.depths, self.densities))

    def column(self, depth: float) -> float:
        """Integral of rho from the surface to a depth [kg/m2]."""
        low, high = sorted((0.0, depth))
        inside = [at for at in self.depths if low < at < high]
        total = 0.0
        for a, b in zip([low, *inside], [*inside, high], strict=True):
            places = 0.5 * (a + b) + 0.5 * (b - a) * NODES
            total += 0.5 * (b - a) * sum(w * self.density_at(x) for w, x in zip(WEIGHTS, places, strict=True))
        return total if depth > 0.0 else -total

    def wrench(self, view: View) -> tuple[Array, Array]:
        """f = -(rho(d) g V (1 - compressibility (d - reference_depth)) - B) R^T e3, with V = B / (rho0 g)."""
        depth = float(view.b[2] + view.down @ self.center_of_buoyancy)
        share = self.density_at(depth) / self.density * (1.0 - self.compressibility * (depth - self.reference_depth))
        f = np.asarray(-self.buoyancy * (share - 1.0) * view.down)
        return f, cross(self.center_of_buoyancy, f)

    def potential(self, view: View) -> float:
        """U = V g column - B d [J], for an incompressible hull."""
        depth = float(view.b[2] + view.down @ self.center_of_buoyancy)
        return float(self.buoyancy * (self.column(depth) / self.density - depth))
