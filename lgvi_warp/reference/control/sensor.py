# SPDX-License-Identifier: Apache-2.0
"""A sensor."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.readings import shifted, values, with_values
from lgvi_warp.reference.random import normals
from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import View


def chance_of(z: float) -> float:
    """Phi of a standard normal, a uniform number."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))


class Losses:
    """Losses with a probability: independent, or in bursts of a mean length (Gilbert 1960)."""

    def __init__(self, dropout: float, burst: float) -> None:
        self.dropout, self.burst = dropout, burst
        self.lost: bool | None = None

    def next(self, u: float) -> bool:
        """Whether the next reading is lost, from a uniform number."""
        chance = self.dropout
        if self.burst > 0.0 and self.lost is not None and self.dropout < 1.0:
            begins = self.dropout / (1.0 - self.dropout) / self.burst
            chance = 1.0 - 1.0 / self.burst if self.lost else begins
        self.lost = bool(u < chance)
        return self.lost


class Sensor(Part):
    """Attributes as in `lw.control.Sensor`, for a 3-vector one number or (3,); the key of its random numbers.

    handed: None, or {name: data passed on}, shared by sensors and a filter; key: its name there.
    """

    key, handed = "sensor", None
    noise = bias = drift = quantum = dropout = burst = outlier = outlier_std = 0.0
    deepest, place = math.inf, None
    reads: str = "geometry"
    waves: Any = ()
    every, latency = 1, 0
    seed0 = seed1 = channel = 0

    def begin(self) -> None:
        """Start without a reading and without a random walk."""
        self.walk: Any = 0.0
        self.arrived: list[Measurement] = []
        self.losses = Losses(self.dropout, self.burst)

    def drawn(self, y: Measurement, stream: int) -> Array:
        """Four standard normals of this tick."""
        return normals(self.seed0, self.seed1, y.member, y.tick, self.channel + stream)

    def measure(self, y: Measurement) -> Measurement:
        """The reading that has arrived so far."""
        count, truth = len(values(y, self.of)), y
        if self.place is not None:
            arm = y.R @ self.place
            y = replace(y, position=y.position + (arm if count == 3 else arm * [0.0, 0.0, 1.0]))
        if self.reads == "pressure":
            at = View(
                y.R,
                truth.position + (0.0 if self.place is None else y.R @ self.place),
                y.water_velocity,
                y.angular_velocity,
                y.t,
            )
            depth = y.position[2] + sum(wave.head(at) for wave in self.waves)
            y = replace(y, position=np.array([*y.position[:2], max(depth, 0.0)]))
        first, second, third = (self.drawn(y, stream) for stream in (0, 1, 2))
        stray = self.outlier_std * third[:count] * (chance_of(third[3]) < self.outlier)
        z = shifted(y, self.of, self.bias + self.walk + self.noise * first[:count] + stray)
        steps = first[1:2] if count == 1 else second[:3]
        self.walk = self.walk + self.drift * np.sqrt(y.period) * steps
        v, q = values(z, self.of), np.broadcast_to(self.quantum, count)
        if np.any(q > 0.0):
            v = np.where(q > 0.0, np.rint(v / np.where(q > 0.0, q, 1.0)) * q, v)
            z = with_values(z, self.of, v)
        lost = self.losses.next(chance_of(first[3])) or y.position[2] > self.deepest
        old = y.tick % self.every != 0
        if self.handed is not None:
            self.handed[self.key] = {"values": values(z, self.of), "fresh": not (old or lost)}
            return truth
        self.arrived.append(self.arrived[-1] if self.arrived and (old or lost) else z)
        delayed = self.arrived[max(y.tick - int(self.latency), 0)]
        if self.of == "attitude":
            return replace(y, R=delayed.R)
        return with_values(y, self.of, values(delayed, self.of))
