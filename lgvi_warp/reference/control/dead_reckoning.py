# SPDX-License-Identifier: Apache-2.0
"""Position from attitude and velocity."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part


class DeadReckoning(Part):
    """Attributes as in `lw.control.DeadReckoning`."""

    rule, velocity, depth = "trapezoid", "velocity", "reckoned"
    start_error = np.zeros(3)

    def begin(self) -> None:
        """Reset the position, before the first reading."""
        self.last: np.ndarray | None = None

    def measure(self, y: Measurement) -> Measurement:
        """b <- b + T (v_old + v) / 2, or T v_old, with inertial velocities, from the position at the first tick."""
        v = y.R @ getattr(y, self.velocity)
        if self.last is None:
            self.position = y.position + self.start_error
        else:
            mean = 0.5 * (self.last + v) if self.rule == "trapezoid" else self.last
            self.position = self.position + y.period * mean
        self.last, b = v, self.position.copy()
        if self.depth == "measured":
            b[2] = y.position[2]
        return replace(y, position=b)
