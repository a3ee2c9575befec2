# SPDX-License-Identifier: Apache-2.0
"""Guidance along waypoints by line of sight."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, upright
from lgvi_warp.reference.rotation import Array


class Waypoints(Part):
    """Numbers as those of `lw.control.Waypoints`."""

    method, kappa, gamma, at_end = "los", 0.1, 0.002, "stop"

    def begin(self) -> None:
        """The first leg; J and beta are 0."""
        self.leg, self.J, self.beta = 0, 0.0, 0.0

    def way(self, leg: int, position: Array) -> tuple[float, float, float, float]:
        """Angle and length of a leg on the map; how far the position is along, and to starboard of it."""
        begin, end = self.points[leg], self.points[leg + 1]
        x, y, _ = end - begin
        angle = np.arctan2(y, x)
        along, aside = upright(angle)[:2, :2].T @ (position - begin)[:2]
        return float(angle), float(np.hypot(x, y)), float(along), float(aside)

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Change the leg where this one is done, then head along it."""
        legs = len(self.points) - 1
        last = legs if self.at_end == "stop" else legs - 1
        _, length, along, aside = self.way(min(self.leg, legs - 1), y.position)
        if np.hypot(length - along, aside) < self.radius or along > length:
            self.leg = min(self.leg + 1, last)
        i = min(self.leg, legs - 1)
        angle, length, along, aside = self.way(i, y.position)
        if self.leg == legs:
            return replace(r, position=self.points[-1], velocity=np.zeros(3), R=upright(angle), speed=0.0)
        D = self.look_ahead
        if self.method == "los":
            heading = angle - np.arctan(aside / D)
        elif self.method == "ilos":
            aim = aside + self.kappa * self.J
            heading = angle - np.arctan(aim / D)
            self.J += y.period * D * aside / (D**2 + aim**2)
        else:
            heading = angle - self.beta - np.arctan(aside / D)
            self.beta += y.period * self.gamma * D * aside / np.hypot(D, aside)
        begin, end = self.points[i], self.points[i + 1]
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        position = begin + along * direction
        position[2] = np.interp(along, [0.0, length], [begin[2], end[2]])
        if 0.0 < along < length:
            direction[2] = (end[2] - begin[2]) / length
        velocity = self.speed * direction / np.linalg.norm(direction)
        return replace(r, position=position, velocity=velocity, R=upright(heading), speed=self.speed)
