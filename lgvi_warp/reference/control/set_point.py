# SPDX-License-Identifier: Apache-2.0
"""Guidance by a set-point."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, upright


class SetPoint(Part):
    """Attributes as in `lw.control.SetPoint`; None leaves a quantity without a set point."""

    position = depth = heading = speed = None

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Set the position, an upright attitude of this heading, and the speed."""
        position = r.position if self.position is None else np.asarray(self.position)
        if self.depth is not None:
            position = np.array([*position[:2], self.depth])
        turned = self.heading is not None or self.position is not None
        R = upright(self.heading or 0.0) if turned else r.R
        return replace(r, position=position, R=R, speed=r.speed if self.speed is None else self.speed)
