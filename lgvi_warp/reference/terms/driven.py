# SPDX-License-Identifier: Apache-2.0
"""Actuators that a controller drives."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.following import Following
from lgvi_warp.reference.terms.thrusters import Thrusters


class ControlWrench(Following):
    """An ideal actuator: channels X, Y, Z, K, M, N."""

    driven = True

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Force and torque of the channels, in body axes."""
        n = self.place(view)
        return n[:3], n[3:]

    def effort(self, command: Array) -> Array:
        """The wrench of a command."""
        return command

    def command_for(self, effort: Array) -> Array:
        """The command of a wrench."""
        return effort


class DrivenThrusters(Thrusters):
    """Attributes as in the twin's `Thrusters`."""

    driven = True

    def effort(self, command: Array) -> Array:
        """Thrusts (k,) [N] of commands, at rest."""
        return self.thrust(command)

    def command_for(self, effort: Array) -> Array:
        """Smallest commands for thrusts (k,) [N]; for a thrust out of range, the command of the largest thrust."""
        return np.array([self._command(i, float(t)) for i, t in enumerate(effort)])

    def _thrust(self, i: int, side: float, w: float) -> float:
        command = np.zeros(len(self.limit))
        command[i] = side * (self.dead_band[i] + w)
        return float(side * self.thrust(command)[i])

    def _range(self, i: int, side: float) -> float:
        """Command at which the thrust of channel i stops rising, from the edge of the dead band.

        It is the limit, or the maximum of the curve.
        """
        reach = max(self.limit[i] - self.dead_band[i], 0.0)
        if self._thrust(i, side, 1e-9 * reach) <= 0.0 and self.table_commands is None:
            return 0.0
        curve = self.polynomial if side > 0.0 else self.polynomial_astern
        slope = [(k + 1) * p for k, p in enumerate(curve)]
        if self.table_commands is not None:
            return float(reach)
        turns = np.polynomial.polynomial.polyroots(slope)
        return min([float(w.real) for w in turns if abs(w.imag) < 1e-9 and w.real > 0.0] + [float(reach)])

    def _command(self, i: int, wanted: float) -> float:
        """Find the command by bisection."""
        side = 1.0 if wanted > 0.0 else -1.0
        low, high = 0.0, self._range(i, side)
        if wanted == 0.0 or high == 0.0:
            return 0.0
        while low < (middle := 0.5 * (low + high)) < high:
            low, high = (middle, high) if self._thrust(i, side, middle) < abs(wanted) else (low, middle)
        return float(side * (self.dead_band[i] + high))
