"""Weight less buoyancy (section IV of Nordkvist & Sanyal 2010)."""

from dataclasses import dataclass

import numpy as np

from lgvi_warp.reference.rotation import Array


@dataclass(frozen=True)
class Weight:
    """net: weight less buoyancy (m - rho V) g [N]."""

    net: float

    def wrench(self, z: Array, b: Array) -> tuple[Array, Array]:
        """Force f(b, R) = net z and no torque, z = R^T e3."""
        return self.net * z, np.zeros(3)

    def potential(self, z: Array, b: Array) -> float:
        """U = -net b3 [J]."""
        return -self.net * float(b[2])
