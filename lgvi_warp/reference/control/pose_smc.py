# SPDX-License-Identifier: Apache-2.0
"""Sliding mode control of position and attitude."""

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, PoseIntegrals, Reference, balance, pose_errors
from lgvi_warp.reference.rotation import Array


class PoseSMC(Part):
    """Attributes as in `lw.control.PoseSMC`; weight, buoyancy, center_of_mass, center_of_buoyancy: see `balance`."""

    integral_limit = (1e6, 1e6)
    feedforward = "none"
    anti_windup = "conditional"

    def begin(self) -> None:
        """Set the integrals of force and torque to 0."""
        self.integrals = PoseIntegrals()

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """f = k_d s + k_sigma sat(s / boundary), s = (R^T v_d - nu) + 2 lambda R^T e_b + lambda^2 R^T I; attitude alike."""
        e, e_R, velocity, rate = pose_errors(r, y)
        total, I_R = self.integrals.at_tick(self, y, unmet, e, e_R)
        s = velocity + 2.0 * self.lambda_ * (y.R.T @ e) + self.lambda_**2 * (y.R.T @ total)
        force = self.k_d * s + self.k_sigma * np.clip(s / self.boundary, -1.0, 1.0)
        s = rate - 2.0 * self.lambda_r * e_R - self.lambda_r**2 * I_R
        torque = self.k_d_r * s + self.k_sigma_r * np.clip(s / self.boundary_r, -1.0, 1.0)
        return np.asarray(w + np.concatenate([force, torque]) + balance(self, y))
