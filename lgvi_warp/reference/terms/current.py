"""Currents: steady and uniform, or by depth."""

from dataclasses import dataclass

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Flow, Law, View


@dataclass(frozen=True)
class Current(Law):
    """velocity (3,) [m/s], inertial."""

    velocity: Array

    def flow(self, view: View) -> Flow:
        """The constant velocity, without derivatives."""
        return Flow(np.asarray(self.velocity), np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class CurrentProfile(Law):
    """depths (k,) [m], rising; velocities (k, 3) [m/s], inertial: linear between, constant outside."""

    depths: Array
    velocities: Array

    def flow(self, view: View) -> Flow:
        """u(b3), and its slope within the segment."""
        depth = view.b[2]
        u = np.array([np.interp(depth, self.depths, column) for column in np.transpose(self.velocities)])
        gradient = np.zeros((3, 3))
        i = int(np.searchsorted(self.depths, depth, side="right")) - 1
        if 0 <= i < len(self.depths) - 1:
            change = np.asarray(self.velocities)[i + 1] - np.asarray(self.velocities)[i]
            gradient[:, 2] = change / (self.depths[i + 1] - self.depths[i])
        return Flow(u, np.zeros(3), gradient)
