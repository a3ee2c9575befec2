# SPDX-License-Identifier: Apache-2.0
"""Power of everything except the actuators of a vehicle; the energy used is in the state (see submaps.py)."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class EnergyUse(Law):
    """Numbers: hotel [W]."""

    hotel: float

    def start(self) -> Array:
        """Rows for the sum and its low part in the device code; the twin has the sum in its state."""
        return np.zeros(2)

    def power(self, view: View) -> float:
        """The hotel load."""
        return float(self.hotel)
