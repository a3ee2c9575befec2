# SPDX-License-Identifier: Apache-2.0
"""An altimeter, and the sea floor that it measures."""

from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.sensor import Sensor
from lgvi_warp.reference.rotation import Array


class Ground:
    """A gridded floor: depth (x, y), origin (2,), spacing (2,), all [m]; bilinear between nodes, constant outside."""

    def __init__(self, depth: Array, origin: Array, spacing: Array) -> None:
        self.depth, self.origin, self.spacing = depth, np.asarray(origin, float), np.asarray(spacing, float)
        self.last = np.array(depth.shape) - 1

    def at(self, place: Array) -> float:
        """The depth at north and east."""
        u = np.clip((place - self.origin) / self.spacing, 0.0, self.last)
        cell = np.minimum(u.astype(int), np.maximum(self.last - 1, 0))
        total = 0.0
        for corner in np.ndindex(2, 2):
            near = np.prod(np.where(np.array(corner) == 1, u - cell, 1.0 - (u - cell)))
            total += near * self.depth[tuple(np.minimum(cell + corner, self.last))]
        return float(total)

    def along(self, start: Array, beam: Array, most: float) -> float:
        """Distance to the floor along a beam: in each cell on its way the height is quadratic, given by three values."""
        crossings = [0.0, most]
        for axis in (0, 1):
            if beam[axis] != 0.0:
                faces = self.origin[axis] + self.spacing[axis] * np.arange(self.last[axis] + 1)
                crossings += [s for s in (faces - start[axis]) / beam[axis] if 0.0 < s < most]
        faces = np.unique(crossings)
        for near, far in zip(faces[:-1], faces[1:], strict=True):
            s = np.array([near, 0.5 * (near + far), far])
            heights = [self.at(start[:2] + x * beam[:2]) - start[2] - x * beam[2] for x in s]
            if heights[0] <= 0.0:
                return float(near)
            if heights[2] <= 0.0:
                a, b, c = np.polynomial.polynomial.polyfit([0.0, 0.5, 1.0], heights, 2)
                roots = np.roots([c, b, a]) if abs(c) > 1e-12 * abs(b) else np.array([-a / b])
                return float(near + (far - near) * min(x.real for x in roots if -1e-9 <= x.real <= 1.0 + 1e-9))
        return most


class Altimeter(Part):
    """Attributes as in `lw.control.Altimeter`; ground: the floor. The last reading is `reading`."""

    direction, point, most = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 100.0
    ground: Any = None

    def begin(self) -> None:
        """Start without a reading."""
        names = {"noise", "bias", "drift", "quantum", "every", "latency", "dropout", "burst", "outlier", "outlier_std"}
        names |= {"seed0", "seed1", "channel"}
        self.errors = Sensor(of="depth", **{name: value for name, value in vars(self).items() if name in names})
        self.errors.begin()
        self.reading = 0.0

    def measure(self, y: Measurement) -> Measurement:
        """Take a reading, with the errors of a sensor that reads it as a depth; the measurement is unchanged."""
        beam = y.R @ (np.asarray(self.direction, float) / np.linalg.norm(self.direction))
        reach = self.ground.along(y.position + y.R @ np.asarray(self.point, float), beam, self.most)
        seen = self.errors.measure(replace(y, position=np.array([*y.position[:2], reach])))
        self.reading = float(np.clip(seen.position[2], 0.0, self.most))
        return y
