# SPDX-License-Identifier: Apache-2.0
"""PID control of the heading."""

from lgvi_warp.reference.control import Integral, Measurement, Part, Reference, heading_error
from lgvi_warp.reference.rotation import Array


class HeadingPID(Part):
    """Attributes as in `lw.control.HeadingPID`."""

    ki = kd = 0.0
    integral_limit = 1e6
    anti_windup = "conditional"

    def begin(self) -> None:
        """Set the integral to 0, and clear the last error."""
        self.integral = Integral()

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """N = kp e + ki I + kd (r_d - r)."""
        e = heading_error(r.R, y.R)
        total = self.integral.at_tick(y.period, self.integral_limit, unmet[5], self.anti_windup == "conditional")
        N = self.kp * e + self.ki * total + self.kd * (r.angular_velocity[2] - y.angular_velocity[2])
        self.integral.error = e
        w = w.copy()
        w[5] += N
        return w
