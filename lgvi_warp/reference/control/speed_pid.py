# SPDX-License-Identifier: Apache-2.0
"""PI control of the speed through the water."""

from lgvi_warp.reference.control import Integral, Measurement, Part, Reference
from lgvi_warp.reference.rotation import Array


class SpeedPID(Part):
    """Attributes as in `lw.control.SpeedPID`."""

    ki = drag = 0.0
    integral_limit = 1e6
    anti_windup = "conditional"

    def begin(self) -> None:
        """Set the integral to 0, and clear the last error."""
        self.integral = Integral()

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """X = kp e + ki I + drag u_d |u_d|."""
        e = r.speed - y.water_velocity[0]
        total = self.integral.at_tick(y.period, self.integral_limit, unmet[0], self.anti_windup == "conditional")
        self.integral.error = e
        w = w.copy()
        w[0] += self.kp * e + self.ki * total + self.drag * r.speed * abs(r.speed)
        return w
