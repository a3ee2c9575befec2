# SPDX-License-Identifier: Apache-2.0
"""Volumes displaced beside those of the vehicle."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.following import Following


class Ballast(Following):
    """position (n, 3) [m]; density [kg/m3], gravity [m/s2]; times (k,) [s] and command (k, n) [m3]; more as of `Following`."""

    def wrench(self, view: View) -> tuple[Array, Array]:
        """-rho g V R^T e3 at each point."""
        forces = [-self.density * self.gravity * volume * view.down for volume in self.place(view)]
        torque = sum((cross(r, f) for r, f in zip(self.position, forces, strict=True)), np.zeros(3))
        return np.asarray(sum(forces)), torque

    def potential(self, view: View) -> float:
        """U = rho g V times the depth of each point [J], of volumes that are held."""
        if len(self.times) > 1:
            return 0.0
        depths = view.b[2] + self.position @ view.down
        return float(self.density * self.gravity * self.commanded(view.t) @ depths)
