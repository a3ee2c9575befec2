# SPDX-License-Identifier: Apache-2.0
"""Forces and moments of a hull with wings from angle of attack and sideslip."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View

# The least part of the speed in the plane of ahead and below with which the axes of the flow are formed.
LEAST_PART = 1e-3


class Polar(Law):
    """Numbers of `lw.terms.Polar`, about the body's origin."""

    def damping(self, view: View) -> Array:
        """D, so that the wrench is -D (nu; Om). Side force and lift use antisymmetric matrices, which do no work."""
        V, (u, v, w) = float(np.linalg.norm(view.nu)), view.nu
        if V == 0.0:
            return np.zeros((6, 6))
        s = max(float(np.hypot(u, w)), LEAST_PART * V)
        a, b = np.arctan2(w, u), np.arctan2(v, np.hypot(u, w))
        # V times the axes of the flow, as matrices times (u, v, w).
        x = np.eye(3)
        y = np.array([[0.0, -u, 0.0], [u, 0.0, w], [0.0, -w, 0.0]]) / s
        z = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]) * V / s
        drag, side, lift = (
            self.drag + self.drag_by_attack * a**2,
            self.side_by_slip * b,
            self.lift + self.lift_by_attack * a,
        )
        roll, pitch, yaw = self.roll_by_slip * b, self.pitch + self.pitch_by_attack * a, self.yaw_by_slip * b
        by_rate = np.column_stack([k * axis @ view.nu for k, axis in zip(self.moment_by_rate, (x, y, z), strict=True)])
        force = -drag * x + side * y - lift * z
        moment = roll * x + pitch * y + yaw * z
        return -V * np.block([[force, np.zeros((3, 3))], [moment, by_rate]])
