# SPDX-License-Identifier: Apache-2.0
"""A uniform current that is a sum of harmonics in time."""

import numpy as np

from lgvi_warp.reference.terms import Flow, Law, View


class CurrentHarmonics(Law):
    """Attributes as in `lw.terms.CurrentHarmonics`."""

    def flow(self, view: View) -> Flow:
        """u = sum a cos(omega t + phase) and its derivative. docs/theory/water.md, (W8)."""
        omega = 2.0 * np.pi / self.periods
        angle = omega * view.t + self.phases
        return Flow(np.cos(angle) @ self.amplitudes, -(omega * np.sin(angle)) @ self.amplitudes, np.zeros((3, 3)))
