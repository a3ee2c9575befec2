# SPDX-License-Identifier: Apache-2.0
"""Attitude from angular rates, corrected slowly by a measured attitude."""

from dataclasses import replace

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.low_pass import share
from lgvi_warp.reference.control.readings import turn_to
from lgvi_warp.reference.rotation import exp


class ComplementaryFilter(Part):
    """Attributes as in `lw.control.ComplementaryFilter`."""

    def begin(self) -> None:
        """Reset the estimate, before the first reading."""
        self.last: Measurement | None = None

    def measure(self, y: Measurement) -> Measurement:
        """R exp(T (Om_old + Om) / 2), then a fraction 1 - exp(-T / time constant) of the turn to the measured attitude."""
        if self.last is not None:
            R = self.last.R @ exp(0.5 * y.period * (self.last.angular_velocity + y.angular_velocity))
            y = replace(y, R=R @ exp(share(y.period, self.time_constant) * turn_to(R, y.R)))
        self.last = y
        return y
