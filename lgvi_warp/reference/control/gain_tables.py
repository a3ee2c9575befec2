# SPDX-License-Identifier: Apache-2.0
"""A law whose numbers are tables over a measured quantity, and an allocation for the measured speed."""

from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference
from lgvi_warp.reference.rotation import Array


class GainTables(Part):
    """law: the part with numbers; tables: {number: (over, at, values)}; the Altimeter for tables over the altitude."""

    altimeter: Any = None

    def begin(self) -> None:
        """Reset the memory of the law."""
        self.law.begin()

    def measured(self, over: str, y: Measurement) -> float:
        """The speed ahead through the water, the depth, or the height above the point where the beam meets the floor."""
        if over == "altitude":
            beam = np.asarray(self.altimeter.direction, float)
            hit = self.altimeter.point + self.altimeter.reading * beam / np.linalg.norm(beam)
            return float((y.R @ hit)[2])
        return float(y.water_velocity[0] if over == "speed" else y.position[2])

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """Demand of the law, with numbers that are linear between the nodes and constant beyond the ends."""
        for name, (over, at, values) in self.tables.items():
            x, flat = self.measured(over, y), np.reshape(values, (len(at), -1))
            number = np.array([np.interp(x, at, column) for column in flat.T])
            setattr(self.law, name, number.reshape(np.shape(values)[1:]))
        return np.asarray(self.law.control(w, r, y, unmet))


class MeasuredSpeed(Part):
    """allocation: one with the effect at 1 m/s; least_speed [m/s]. Efforts have this effect times the speed squared.

    astern: Sign of the effect if the speed ahead is negative.
    """

    astern = 1.0

    def begin(self) -> None:
        """Reset the memory of the allocation."""
        self.allocation.begin()

    def measure(self, y: Measurement) -> Measurement:
        """Store the speed ahead through the water."""
        u = y.water_velocity[0]
        self.square = (self.astern if u < 0.0 else 1.0) * max(abs(u), self.least_speed) ** 2
        measured: Measurement = self.allocation.measure(y)
        return measured

    def allocate(self, w: Array, actuators: dict[str, Any]) -> Array:
        """Commands for the demand divided by the speed squared; the remaining demand is multiplied by it."""
        return np.asarray(self.square * self.allocation.allocate(w / self.square, actuators))
