# SPDX-License-Identifier: Apache-2.0
"""A Doppler velocity log: the velocities along four beams."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.sensor import Losses, chance_of
from lgvi_warp.reference.random import normals
from lgvi_warp.reference.rotation import Array

# How far a beam looks for a floor on a grid [m]; azimuths of the beams from the bow, to starboard.
FARTHEST = 2e4
AZIMUTHS = np.radians([45.0, 135.0, 225.0, 315.0])


def beams(angle: float) -> Array:
    """The directions (4, 3) of the beams, `angle` [rad] from straight down, body axes."""
    s, c = math.sin(angle), math.cos(angle)
    return np.stack([s * np.cos(AZIMUTHS), s * np.sin(AZIMUTHS), np.full(4, c)], axis=1)


class DVL(Part):
    """Numbers of `lw.control.DVL`; floor [m], the depth of a flat floor, inf for none; keys of its random numbers.

    ground: None, or a `Ground`, a floor on a grid, which a beam searches up to 20 km.

    handed: None, or {name: readings passed on}, shared by sensors and filter.
    """

    key, handed, ground = "dvl", None, None
    place = np.zeros(3)
    angle, noise, dropout, every = math.radians(30.0), 0.0, 0.0, 1
    burst = outlier = outlier_std = 0.0
    floor, least_range, greatest_range, silent_from, silent_to = math.inf, 0.0, math.inf, math.inf, math.inf
    greatest_tilt: Any = None
    seed0 = seed1 = channel = 0

    def begin(self) -> None:
        """Set the velocity to 0 before the first reading."""
        self.last: Array = np.zeros(3)
        self.losses = [Losses(self.dropout, self.burst) for _ in AZIMUTHS]

    def locked(self, y: Measurement, directions: Array) -> Any:
        """Mask of beams (4,) with an echo from the floor at this tick."""
        four = normals(self.seed0, self.seed1, y.member, y.tick, self.channel + 1)
        kept = np.array([not losses.next(chance_of(z)) for losses, z in zip(self.losses, four, strict=True)])
        kept &= not self.silent_from <= y.t < self.silent_to
        if self.greatest_tilt is not None:
            kept &= y.R[2, 2] >= math.cos(self.greatest_tilt)
        if math.isfinite(self.floor):
            altitude = self.floor - (y.position + y.R @ self.place)[2]
            down = directions @ y.R[2]
            kept &= (down > 0.0) & (self.least_range * down <= altitude) & (altitude <= self.greatest_range * down)
        if self.ground is not None:
            start, most = y.position + y.R @ self.place, min(self.greatest_range, FARTHEST)
            ways = np.array([self.ground.along(start, y.R @ u, most) for u in directions])
            kept &= (self.least_range < ways) & (ways < most)
        return kept & (y.tick % self.every == 0)

    def measure(self, y: Measurement) -> Measurement:
        """Pass the beams on, or give y the velocity from three or four beams, or else the last velocity."""
        directions = beams(self.angle)
        four, sizes, strays = (
            normals(self.seed0, self.seed1, y.member, y.tick, self.channel + stream) for stream in (0, 2, 3)
        )
        along = directions @ (y.velocity + np.cross(y.angular_velocity, self.place)) + self.noise * four
        along = along + self.outlier_std * sizes * [chance_of(z) < self.outlier for z in strays]
        kept = self.locked(y, directions)
        if self.handed is not None:
            self.handed[self.key] = {"along": along, "fresh": kept}
            return y
        if kept.sum() >= 3:
            self.last = np.linalg.lstsq(directions[kept], along[kept], rcond=None)[0]
        return replace(y, velocity=self.last)
