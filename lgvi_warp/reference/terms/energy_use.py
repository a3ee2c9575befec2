# SPDX-License-Identifier: Apache-2.0
"""Power of everything but the actuators of a vehicle; the sum of all powers over time is in the state (see submaps.py)."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class EnergyUse(Law):
    """Numbers: hotel [W]."""

    hotel: float

    def start(self) -> Array:
        """The rows in which the device has the sum and its low part: the twin's is in the state."""
        return np.zeros(2)

    def power(self, view: View) -> float:
        """The hotel load."""
        return float(self.hotel)
