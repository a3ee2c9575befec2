"""Weight less buoyancy (section IV of Nordkvist & Sanyal 2010)."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Weight:
    """net: weight less buoyancy (m - rho V) g [N]."""

    net: float

    def wrench(self, z, b):
        """Force f(b, R) = net z and no torque, z = R^T e3."""
        return self.net * z, np.zeros(3)

    def potential(self, z, b):
        """U = -net b3 [J]."""
        return -self.net * b[2]
