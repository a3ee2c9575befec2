# SPDX-License-Identifier: Apache-2.0
"""Restoring moment of buoyancy (section IV of Nordkvist & Sanyal 2010)."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View


class Restoring(Law):
    """moment: buoyancy times its lever arm, B r, (minus weight times its own), (3,) [N m], from the body's origin."""

    potential_force = True
    in_order = ("moment",)

    def wrench(self, view: View) -> tuple[Array, Array]:
        """No force and the torque mU(b, R) = -B r x z, z = R^T e3. docs/theory/integrator.md, (I3)."""
        return np.zeros(3), -cross(self.moment, view.down)

    def potential(self, view: View) -> float:
        """U = B r.z [J]."""
        return float(self.moment @ view.down)
