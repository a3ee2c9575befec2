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

    kind, channel, time, until, gain, offset, value = "gain", 0, 0.0, math.inf, 0.0, 0.0, None
    time_constant, delay, duty, period, angle, held = 1.0, 1.0, 1.0, 1.0, False, False

    def __init__(
        self, of: str, channel: int = 0, time: float = 0.0, gain: float = 0.0, offset: float = 0.0, **more: Any
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


class HandedFault(Part):
    """The same of a sensor whose readings an estimator takes.

    of: its key; handed: as of the sensors; numbers, flags: names of what it hands on, and of what says that this is new (or
    ""); scale: of offset and value.
    """

    scale, flags = 1.0, "fresh"

    def begin(self) -> None:
        """No reading yet."""
        names = ("handed", "numbers", "flags", "scale", "each", "seen")
        numbers = {name: value for name, value in vars(self).items() if name not in names}
        numbers["offset"] = self.scale * numbers.get("offset", 0.0)
        if numbers.get("value") is not None:
            numbers["value"] = self.scale * numbers["value"]
        self.each = [Fault(**numbers) for _ in range(6)]
        self.seen: dict[int, float] = {}

    def measure(self, y: Measurement) -> Measurement:
        """Change what the estimator gets."""
        read = self.handed[self.of]
        v = np.concatenate([np.atleast_1d(read[name]) for name in self.numbers])
        fresh = np.array(np.broadcast_to(read[self.flags], len(v))) if self.flags else np.ones(len(v), bool)
        chosen = range(len(v)) if self.each[0].channel == "all" else [int(self.each[0].channel)]
        for i in chosen:
            fault = self.each[i]
            simple = fault.kind in ("gain", "offset", "intermittent") or fault.value is not None
            self.seen[i] = v[i] if simple or fresh[i] or i not in self.seen else self.seen[i]
            out = fault.change(y.tick, y.period, self.seen[i])
            if fault.acts(y.tick, y.period):
                lost = fault.kind == "intermittent" and bool(self.flags)
                v[i] = v[i] if lost else out
                fresh[i] = fresh[i] and not lost
        if self.flags:
            read[self.flags] = fresh if np.ndim(read[self.flags]) else bool(np.all(fresh))
        for name in self.numbers:
            size = np.size(read[name])
            read[name], v = v[:size].reshape(np.shape(read[name])), v[size:]
        return y
