# SPDX-License-Identifier: Apache-2.0
"""Geometric PID control of position and attitude."""

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, PoseIntegrals, Reference, balance, pose_errors
from lgvi_warp.reference.rotation import Array


class PosePID(Part):
    """Attributes as in `lw.control.PosePID`; weight, buoyancy, center_of_mass, center_of_buoyancy: see `balance`."""

    ki = ki_r = np.zeros(3)
    integral_limit = (1e6, 1e6)
    feedforward = "none"
    anti_windup = "conditional"

    def begin(self) -> None:
        """Set the integrals of force and torque to 0."""
        self.integrals = PoseIntegrals()

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """f = R^T (kp e_b + ki I) + kd (R^T v_d - nu); tau = -kr e_R - kw (Omega - R^T R_d Omega_d) - ki_r I_R."""
        e, e_R, velocity, rate = pose_errors(r, y)
        total, I_R = self.integrals.at_tick(self, y, unmet, e, e_R)
        force = y.R.T @ (self.kp * e + self.ki * total) + self.kd * velocity
        torque = -self.kr * e_R + self.kw * rate - self.ki_r * I_R
        return np.asarray(w + np.concatenate([force, torque]) + balance(self, y))
