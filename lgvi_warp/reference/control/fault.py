# SPDX-License-Identifier: Apache-2.0
"""Faults of actuators and of sensors."""

import math
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.readings import values, with_values

# A time and a tick that differ by less than this part of a period are the same.
SAME = 1e-7


class Fault:
    """Attributes as in `lw.control.Fault`, with the kind of one member; one object for each number that it changes.

    angle: whether differences are within half a turn; held: whether an intermittent fault keeps the last number.
    """

    of: str
    channel: Any
    value: float | None = None
    kind, time, until, gain, offset = "gain", 0.0, math.inf, 0.0, 0.0
    time_constant, delay, duty, period, angle, held = 1.0, 1.0, 0.5, 1.0, False, False

    def __init__(
        self, of: str, channel: Any = 0, time: float = 0.0, gain: float = 0.0, offset: float = 0.0, **more: Any
    ):
        vars(self).update(of=of, channel=channel, time=time, gain=gain, offset=offset, **more)
        self.begin()

    def begin(self) -> None:
        """Reset the memory."""
        self.last: float | None = None
        # Numbers since the onset, that of the tick before it first.
        self.since: list[float] = []

    def acts(self, tick: int, T: float) -> bool:
        """Whether the fault acts at a tick, T [s] after the previous tick. docs/theory/control_loop.md, (C5)."""
        if not self.time / T - SAME <= tick < self.until / T - SAME:
            return False
        if self.kind != "intermittent":
            return True
        cycle = max(1, round(self.period / T))
        age = tick - math.ceil(self.time / T - SAME)
        return bool(age % cycle < self.duty * cycle - SAME)

    def change(self, tick: int, T: float, x: float, place: float | None = None) -> float:
        """The number x at a tick, changed by the fault; place: position of an actuator with a lag."""
        now = self.acts(tick, T)
        self.since = [*self.since, x] if now and self.since else [x if self.last is None else self.last, x]
        out = self.changed(x, round(self.delay / T), T, place if len(self.since) == 2 else None) if now else x
        if not now:
            self.since = []
        self.last = out
        return out

    def changed(self, x: float, late: int, T: float, place: float | None) -> float:
        """The number while the fault acts; place: position of the actuator at the onset."""
        last = self.since[0] if self.last is None else self.last
        stays = last if place is None or self.kind == "freeze" else place
        if self.kind == "slow":
            e = x - last
            e = e - 2.0 * math.pi * round(e / (2.0 * math.pi)) if self.angle else e
            share = 1.0 - math.exp(-T / self.time_constant) if self.time_constant > 0.0 else 1.0
            return last + share * e
        if self.kind == "delay":
            return self.since[max(len(self.since) - 1 - late, 0)]
        if self.kind == "freeze" or (self.kind == "intermittent" and self.held):
            return stays
        if self.kind == "stuck":
            return stays if self.value is None else self.value
        return (1.0 if self.kind == "offset" else self.gain) * x + self.offset


class SensorFault(Part):
    """Attributes as in `lw.control.Fault`, for a sensor; of: quantity that it reads. Channel "all": all its numbers."""

    def begin(self) -> None:
        """Start without a reading."""
        numbers = {"angle": self.of in ("heading", "attitude"), "held": True} | vars(self)
        self.each = [Fault(**numbers) for _ in range(3)]

    def measure(self, y: Measurement) -> Measurement:
        """Take a reading, and change the numbers of the fault's channel."""
        if not self.each[0].acts(y.tick, y.period):
            for fault, x in zip(self.each, np.atleast_1d(values(y, self.of)), strict=False):
                fault.change(y.tick, y.period, float(x))
            return y
        v = np.array(values(y, self.of), float)
        for i in range(len(v)) if self.each[0].channel == "all" else [int(self.each[0].channel)]:
            v[i] = self.each[i].change(y.tick, y.period, float(v[i]))
        return with_values(y, self.of, v)
