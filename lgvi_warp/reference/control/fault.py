# SPDX-License-Identifier: Apache-2.0
"""A fault of a sensor; those of actuators are in loop.py."""

import numpy as np

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.readings import values, with_values


class SensorFault(Part):
    """Numbers as those of `lw.control.Fault`, of a sensor; of: what that sensor reads."""

    gain = offset = 0.0

    def measure(self, y: Measurement) -> Measurement:
        """From the first tick at or after its time on, one number of the reading is gain * reading + offset."""
        if y.t + 1e-6 * y.h < self.time:
            return y
        v = np.array(values(y, self.of))
        v[self.channel] = self.gain * v[self.channel] + self.offset
        return with_values(y, self.of, v)
