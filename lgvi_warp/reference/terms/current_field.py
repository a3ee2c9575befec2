# SPDX-License-Identifier: Apache-2.0
"""A current on a grid of north, east, depth and time."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Flow, Law, View


class CurrentField(Law):
    """Attributes as in `lw.terms.CurrentField`, with velocities (s, t, x, y, z, 3) and times."""

    def flow(self, view: View) -> Flow:
        """Multilinear interpolation: the sum over the corners of the cell, weighted by the nearness along every axis.

        docs/theory/water.md, (W6).
        """
        field: Array = self.velocities[int(self.scenario)]
        origin, spacing = np.array([self.times[0], *self.origin]), np.array([self.times[1], *self.spacing])
        u = (np.array([view.t, *view.b]) - origin) / spacing
        last = np.array(field.shape[:4]) - 1
        inside = (u > 0.0) & (u < last)
        held = np.clip(u, 0.0, last)
        cell = np.clip(np.floor(held).astype(int), 0, np.maximum(last - 1, 0))
        part = held - cell
        velocity, slopes = np.zeros(3), np.zeros((3, 4))
        for corner in np.ndindex(2, 2, 2, 2):
            at, c = np.minimum(cell + corner, last), np.array(corner)
            near = np.where(c == 1, part, 1.0 - part)
            value = field[tuple(at)]
            velocity = velocity + np.prod(near) * value
            for axis in np.flatnonzero(inside):
                others = np.prod(np.delete(near, axis))
                slopes[:, axis] += (2.0 * c[axis] - 1.0) * others * value / spacing[axis]
        return Flow(velocity, slopes[:, 0], slopes[:, 1:])
