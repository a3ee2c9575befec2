# SPDX-License-Identifier: Apache-2.0
"""A first-order low-pass filter."""

import math
from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.readings import turn_to, values, with_values
from lgvi_warp.reference.rotation import exp


def share(period: float, time_constant: float) -> float:
    """1 - exp(-T / time constant): fraction of the way to its input that a filter moves in T [s]; 1 for constant 0.

    docs/theory/control_loop.md, (C7).
    """
    return -math.expm1(-period / time_constant) if time_constant > 0.0 else 1.0


class LowPass(Part):
    """Attributes as in `lw.control.LowPass`."""

    def begin(self) -> None:
        """Start without a reading: the first reading passes unchanged."""
        self.last: Measurement | None = None

    def measure(self, y: Measurement) -> Measurement:
        """x <- x + (1 - exp(-T / time constant)) (measured - x), from the first reading on.

        docs/theory/control_loop.md, (C7).
        """
        if self.last is not None:
            a, z = share(y.period, self.time_constant), self.last
            if self.of == "attitude":
                y = replace(y, R=z.R @ exp(a * turn_to(z.R, y.R)))
            else:
                old = values(z, self.of)
                e = values(y, self.of) - old
                if self.of == "heading":
                    e = np.arctan2(np.sin(e), np.cos(e))
                y = with_values(y, self.of, old + a * e)
        self.last = y
        return y
