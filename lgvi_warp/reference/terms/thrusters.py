# SPDX-License-Identifier: Apache-2.0
"""Thrusters with a lag, a thrust curve with dead band and saturation, loss of thrust with speed, and torque."""

from typing import Any

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.following import Following


class Thrusters(Following):
    """Attributes as in `lw.terms.Thrusters`, with coefficients forward, backward (n,), and in `Following`."""

    polynomial = (0.0, 1.0)
    polynomial_astern = (0.0, 1.0)
    table_commands: Any = None
    table_thrusts: Any = None
    advance_loss: Array | float = 0.0
    advance_loss_astern: Array | float = 0.0
    torque_coefficient: Array | float = 0.0
    torque_loss: Array | float = 0.0
    power_commands: Any = None
    power_table: Any = None
    shaft_speed: Array | float = 0.0
    efficiency: Array | float = 1.0

    def beyond(self, n: Array) -> Array:
        """w, the commands after the lag (n,) minus the dead band."""
        return np.asarray(np.sign(n) * np.maximum(np.abs(n) - self.dead_band, 0.0))

    def curve(self, w: Array) -> Array:
        """f (n,), the curve ahead and astern, without the coefficients."""
        if self.table_commands is not None:
            columns = zip(w, np.transpose(self.table_thrusts), strict=True)
            return np.array([np.interp(x, self.table_commands, values) for x, values in columns])
        ahead, astern = np.maximum(w, 0.0), np.maximum(-w, 0.0)
        f_ahead = sum(p * ahead ** (i + 1) for i, p in enumerate(self.polynomial))
        return np.asarray(f_ahead - sum(p * astern ** (i + 1) for i, p in enumerate(self.polynomial_astern)))

    def thrust(self, n: Array) -> Array:
        """Thrusts (n,) [N] at zero speed, from the commands after the lag."""
        w = self.beyond(n)
        return np.asarray(np.where(w > 0.0, self.forward, self.backward) * self.curve(w))

    def wrench(self, view: View) -> tuple[Array, Array]:
        """The thrust along each axis, and the torque k w |w| about it."""
        n = self.place(view)
        w = self.beyond(n)
        forces = self.thrust(n)[:, None] * self.direction
        torque = sum((cross(r, f) for r, f in zip(self.position, forces, strict=True)), np.zeros(3))
        return forces.sum(axis=0), torque + (self.torque_coefficient * w * np.abs(w)) @ self.direction

    def power(self, view: View) -> float:
        """Power [W]: from a table (k, n) at w, or shaft speed times torque against the turn, divided by the efficiency."""
        w = self.beyond(self.place(view))
        if self.power_table is not None:
            columns = zip(w, np.transpose(self.power_table), strict=True)
            return float(sum(np.interp(x, self.power_commands, watts) for x, watts in columns))
        speeds = [d @ (view.nu + cross(view.Om, r)) for r, d in zip(self.position, self.direction, strict=True)]
        torque = self.torque_coefficient * w * np.abs(w) - self.torque_loss * np.abs(w) * np.array(speeds)
        hand = np.sign(self.torque_coefficient)
        return float(np.sum(np.maximum(self.shaft_speed * w * hand * torque, 0.0) / self.efficiency))

    def damping(self, view: View) -> Array:
        """Thrust decreases by c_u |w| a and torque by k_u |w| a; a: speed of the thruster along its direction."""
        D = np.zeros((6, 6))
        w = self.beyond(self.place(view))
        losses = np.abs(w) * np.where(w > 0.0, self.advance_loss, self.advance_loss_astern)
        for r, d, loss, torque in zip(self.position, self.direction, losses, np.abs(w) * self.torque_loss, strict=True):
            along = np.concatenate([d, cross(r, d)])
            D += np.outer(loss * along + torque * np.concatenate([np.zeros(3), d]), along)
        return D
