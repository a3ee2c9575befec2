"""Guidance by a set-point."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference


class SetPoint(Part):
    """Numbers as those of `lw.SetPoint`; what is not given is 0."""

    position = np.zeros(3)
    depth = None
    heading = 0.0
    speed = 0.0

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Position, an upright attitude of this heading, and speed."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        x, y_east, z = self.position
        position = np.array([x, y_east, z if self.depth is None else self.depth])
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(r, position=position, R=R, speed=self.speed)
