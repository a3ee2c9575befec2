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
    """Numbers as those of `lw.control.Fault`, its kind that of one member; for each number that it changes one object.

    angle: whether differences are within half a turn; held: whether an intermittent one keeps the last number.
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
        """Forget everything."""
        self.last: float | None = None
        # Numbers since the onset, that of the tick before it first.
        self.since: list[float] = []

    def acts(self, tick: int, T: float) -> bool:
        """Whether it acts at a tick, T [s] after the one before. docs/theory/control_loop.md, (C5)."""
        if not self.time / T - SAME <= tick < self.until / T - SAME:
            return False
        if self.kind != "intermittent":
            return True
        cycle = max(1, round(self.period / T))
        age = tick - math.ceil(self.time / T - SAME)
        return bool(age % cycle < self.duty * cycle - SAME)

    def change(self, tick: int, T: float, x: float, place: float | None = None) -> float:
        """Its number x at a tick as it leaves the fault; place: where the actuator is, of one that lags."""
        now = self.acts(tick, T)
        self.since = [*self.since, x] if now and self.since else [x if self.last is None else self.last, x]
        out = self.changed(x, round(self.delay / T), T, place if len(self.since) == 2 else None) if now else x
        if not now:
            self.since = []
        self.last = out
        return out

    def changed(self, x: float, late: int, T: float, place: float | None) -> float:
        """The number while it acts; place: at the onset."""
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
    """Numbers as those of `lw.control.Fault`, of a sensor; of: what that sensor reads. A channel "all": of all numbers."""

    def begin(self) -> None:
        """No reading yet."""
        numbers = {"angle": self.of in ("heading", "attitude"), "held": True} | vars(self)
        self.each = [Fault(**numbers) for _ in range(3)]

    def measure(self, y: Measurement) -> Measurement:
        """The reading, with those numbers changed that it hits."""
        if not self.each[0].acts(y.tick, y.period):
            for fault, x in zip(self.each, np.atleast_1d(values(y, self.of)), strict=False):
                fault.change(y.tick, y.period, float(x))
            return y
        v = np.array(values(y, self.of), float)
        for i in range(len(v)) if self.each[0].channel == "all" else [int(self.each[0].channel)]:
            v[i] = self.each[i].change(y.tick, y.period, float(v[i]))
        return with_values(y, self.of, v)
