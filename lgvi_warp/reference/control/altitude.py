# SPDX-License-Identifier: Apache-2.0
"""Guidance at an altitude above the sea floor."""

from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference


class Altitude(Part):
    """Attributes as in `lw.control.Altitude`; an Altimeter, or the ground of the chart."""

    look_ahead, shallowest, deepest = 0.0, 0.0, 12_000.0
    altimeter: Any = None
    ground: Any = None

    def floor(self, y: Measurement) -> float:
        """Known depth of the floor."""
        if self.altimeter is not None:
            direction = np.asarray(self.altimeter.direction, float)
            hit = self.altimeter.point + self.altimeter.reading * direction / np.linalg.norm(direction)
            return float(y.position[2] + (y.R @ hit)[2])
        ahead = y.R[:2, 0] / np.linalg.norm(y.R[:2, 0])
        here = y.position[:2]
        return min(self.ground.at(here), self.ground.at(here + self.look_ahead * ahead))

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Set the reference depth, within its limits."""
        wanted = max(min(self.floor(y) - self.altitude, self.deepest), self.shallowest)
        return replace(r, position=np.array([*r.position[:2], wanted]))
