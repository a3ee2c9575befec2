# SPDX-License-Identifier: Apache-2.0
"""Integral sliding mode control of the heading."""

import numpy as np

from lgvi_warp.reference.control import Integral, Measurement, Part, Reference, heading_error
from lgvi_warp.reference.rotation import Array


class HeadingSMC(Part):
    """Attributes as in `lw.control.HeadingSMC`."""

    k_d = nomoto_time = 0.0
    integral_limit = 1e6
    anti_windup = "conditional"

    def begin(self) -> None:
        """Set the integral to 0, and clear the last error."""
        self.integral = Integral()

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """Fossen 2021, (16.479), of errors psi - psi_d: N = (T a_v + r_v - k_d sigma - k_sigma sat(sigma / boundary)) / K."""
        error = -heading_error(r.R, y.R)
        total = -self.integral.at_tick(y.period, self.integral_limit, unmet[5], self.anti_windup == "conditional")
        self.integral.error = -error
        rate = y.angular_velocity[2] - r.angular_velocity[2]
        sigma = rate + 2.0 * self.lambda_ * error + self.lambda_**2 * total
        a_v = r.angular_acceleration[2] - 2.0 * self.lambda_ * rate - self.lambda_**2 * error
        switched = self.k_sigma * np.clip(sigma / self.boundary, -1.0, 1.0)
        w = w.copy()
        r_v = y.angular_velocity[2] - sigma
        w[5] += (self.nomoto_time * a_v + r_v - self.k_d * sigma - switched) / self.nomoto_gain
        return w
