# SPDX-License-Identifier: Apache-2.0
"""PID control of the depth by the pitch angle."""

import numpy as np

from lgvi_warp.reference.control import Integral, Measurement, Part, Reference
from lgvi_warp.reference.rotation import Array


class DepthPID(Part):
    """Attributes as in `lw.control.DepthPID`."""

    ki = ki_pitch = kd_pitch = k_heave = 0.0
    pitch_limit = 0.5
    integral_limit = (1e6, 1e6)
    anti_windup = "conditional"

    def begin(self) -> None:
        """Set the integrals of depth and pitch to 0."""
        self.of_depth, self.of_pitch, self.beyond = Integral(), Integral(), 0.0

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """theta_d = -(kp e + ki I) within its limit; M = kp_pitch e_theta + ki_pitch I_theta - kd_pitch q - k_heave w."""
        conditional = self.anti_windup == "conditional"
        e = r.position[2] - y.position[2]
        total = self.of_depth.at_tick(y.period, self.integral_limit[0], -self.beyond, conditional)
        wanted = -(self.kp * e + self.ki * total)
        theta_d = np.clip(wanted, -self.pitch_limit, self.pitch_limit)
        self.beyond, self.of_depth.error = wanted - theta_d, e
        e_theta = theta_d - np.arctan2(-y.R[2, 0], np.hypot(y.R[0, 0], y.R[1, 0]))
        I_theta = self.of_pitch.at_tick(y.period, self.integral_limit[1], unmet[4], conditional)
        self.of_pitch.error = e_theta
        w = w.copy()
        w[4] += self.kp_pitch * e_theta + self.ki_pitch * I_theta
        w[4] -= self.kd_pitch * y.angular_velocity[1] + self.k_heave * y.velocity[2]
        return w
