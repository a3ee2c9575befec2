"""Restoring moment of buoyancy (section IV of Nordkvist & Sanyal 2010)."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Restoring:
    """moment: buoyancy times the lever B r, (3,) [N m], r from the centre of gravity to that of buoyancy."""

    moment: np.ndarray

    def wrench(self, z, b):
        """No force and the torque mU(b, R) = -B r x z, z = R^T e3."""
        return np.zeros(3), -np.cross(self.moment, z)

    def potential(self, z, b):
        """U = B r.z [J]."""
        return self.moment @ z
