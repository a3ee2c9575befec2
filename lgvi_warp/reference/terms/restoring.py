"""Restoring moment of buoyancy (section IV of Nordkvist & Sanyal 2010)."""

from dataclasses import dataclass

import numpy as np

from lgvi_warp.reference.rotation import Array, cross


@dataclass(frozen=True)
class Restoring:
    """moment: buoyancy times the lever B r, (3,) [N m], r from the centre of gravity to that of buoyancy."""

    moment: Array

    def wrench(self, z: Array, b: Array) -> tuple[Array, Array]:
        """No force and the torque mU(b, R) = -B r x z, z = R^T e3."""
        return np.zeros(3), -cross(self.moment, z)

    def potential(self, z: Array, b: Array) -> float:
        """U = B r.z [J]."""
        return float(self.moment @ z)
