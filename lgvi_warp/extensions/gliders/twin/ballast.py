# SPDX-License-Identifier: Apache-2.0
"""Volumes displaced in addition to the vehicle's hull."""

import numpy as np

from lgvi_warp.extensions.gliders.twin.density_profile import DensityProfile
from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.following import Following


class Ballast(Following):
    """Ballast: position (n, 3) [m]; density [kg/m3], gravity [m/s2]; times (k,) [s], command (k, n) [m3]; see `Following`.

    profile: None, or the twin of a `density_profile`, whose densities replace `density`.
    """

    profile: DensityProfile | None = None

    def wrench(self, view: View) -> tuple[Array, Array]:
        """-rho g V R^T e3 at each point."""
        depths, density = view.b[2] + self.position @ view.down, np.full(len(self.position), self.density)
        if self.profile is not None:
            density = np.array([self.profile.density_at(depth) for depth in depths])
        forces = [-rho * self.gravity * V * view.down for rho, V in zip(density, self.place(view), strict=True)]
        torque = sum((cross(r, f) for r, f in zip(self.position, forces, strict=True)), np.zeros(3))
        return np.asarray(sum(forces)), torque

    def potential(self, view: View) -> float:
        """U, the sum of rho g V times the depth of each point [J], for constant volumes."""
        if len(self.times) > 1:
            return 0.0
        depths = view.b[2] + self.position @ view.down
        if self.profile is not None:
            columns = np.array([self.profile.column(depth) for depth in depths])
            return float(self.gravity * self.commanded(view.t) @ columns)
        return float(self.density * self.gravity * self.commanded(view.t) @ depths)
