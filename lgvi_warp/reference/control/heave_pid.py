# SPDX-License-Identifier: Apache-2.0
"""PID control of the depth by a force."""

from lgvi_warp.reference.control import Integral, Measurement, Part, Reference
from lgvi_warp.reference.rotation import Array


class HeavePID(Part):
    """Attributes as in `lw.control.HeavePID`."""

    ki = kd = 0.0
    integral_limit = 1e6
    anti_windup = "conditional"

    def begin(self) -> None:
        """Set the integral to 0, and clear the last error."""
        self.integral = Integral()

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """Z = kp e + ki I + kd (reference - measured rate of the depth)."""
        e = r.position[2] - y.position[2]
        total = self.integral.at_tick(y.period, self.integral_limit, unmet[2], self.anti_windup == "conditional")
        self.integral.error = e
        w = w.copy()
        w[2] += self.kp * e + self.ki * total + self.kd * (r.velocity[2] - (y.R @ y.velocity)[2])
        return w
