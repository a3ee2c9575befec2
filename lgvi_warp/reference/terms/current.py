# SPDX-License-Identifier: Apache-2.0
"""Currents: steady and uniform, or as a profile over depth."""

import numpy as np

from lgvi_warp.reference.terms import Flow, Law, View


class Current(Law):
    """Attributes as in `lw.terms.Current`."""

    def flow(self, view: View) -> Flow:
        """The constant velocity, without derivatives."""
        return Flow(np.asarray(self.velocity), np.zeros(3), np.zeros((3, 3)))


class CurrentProfile(Law):
    """Attributes as in `lw.terms.CurrentProfile`."""

    def flow(self, view: View) -> Flow:
        """u(b3), and its slope within the segment. docs/theory/water.md, (W5)."""
        depth = view.b[2]
        u = np.array([np.interp(depth, self.depths, column) for column in np.transpose(self.velocities)])
        gradient = np.zeros((3, 3))
        i = int(np.searchsorted(self.depths, depth, side="right")) - 1
        if 0 <= i < len(self.depths) - 1:
            change = np.asarray(self.velocities)[i + 1] - np.asarray(self.velocities)[i]
            gradient[:, 2] = change / (self.depths[i + 1] - self.depths[i])
        return Flow(u, np.zeros(3), gradient)
