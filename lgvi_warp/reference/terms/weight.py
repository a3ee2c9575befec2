# SPDX-License-Identifier: Apache-2.0
"""Weight minus buoyancy (section IV of Nordkvist & Sanyal 2010)."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class Weight(Law):
    """net: weight minus buoyancy (m - rho V) g [N]."""

    potential_force = True
    in_order = ("net",)

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Force f(b, R) = net z and no torque, z = R^T e3. docs/theory/integrator.md, (I2)."""
        return self.net * view.down, np.zeros(3)

    def potential(self, view: View) -> float:
        """U = -net b3 [J]."""
        return -self.net * float(view.b[2])
