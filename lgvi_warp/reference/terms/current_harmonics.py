"""A uniform current that is a sum of harmonics in time."""

from dataclasses import dataclass

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Flow, Law, View


@dataclass(frozen=True)
class CurrentHarmonics(Law):
    """amplitudes (k, 3) [m/s], inertial; periods (k,) [s]; phases (k,) [rad]."""

    amplitudes: Array
    periods: Array
    phases: Array

    def flow(self, view: View) -> Flow:
        """u = sum a cos(omega t + phase) and its derivative."""
        omega = 2.0 * np.pi / self.periods
        angle = omega * view.t + self.phases
        return Flow(np.cos(angle) @ self.amplitudes, -(omega * np.sin(angle)) @ self.amplitudes, np.zeros((3, 3)))
