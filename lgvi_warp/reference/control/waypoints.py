# SPDX-License-Identifier: Apache-2.0
"""Guidance along waypoints by line of sight."""

from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, upright
from lgvi_warp.reference.control.loiter import circled
from lgvi_warp.reference.rotation import Array


class Waypoints(Part):
    """Attributes as in `lw.control.Waypoints`; done: time of the tick at which the last point was reached [s]."""

    method, kappa, gamma, at_end = "los", 0.1, 0.002, "stop"
    times: Any = None
    loiter_radius: Any = None
    loiter_turns: Any = None
    loiter_time: Any = None
    clockwise = True

    def begin(self) -> None:
        """Start at the first leg, without a circle; J and beta are 0."""
        self.leg, self.J, self.beta = 0, 0.0, 0.0
        self.circling, self.angle, self.since, self.bearing = False, 0.0, 0.0, 0.0
        self.done: float | None = None

    def way(self, leg: int, position: Array) -> tuple[float, float, float, float]:
        """Angle and length of a leg on the map; distance of the position along the leg, and to starboard of it."""
        begin, end = self.points[leg], self.points[leg + 1]
        x, y, _ = end - begin
        angle = np.arctan2(y, x)
        along, aside = upright(angle)[:2, :2].T @ (position - begin)[:2]
        return float(angle), float(np.hypot(x, y)), float(along), float(aside)

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Change the leg at its end, then head along it."""
        legs = len(self.points) - 1
        last = legs - 1 if self.at_end == "go_on" else legs
        i = min(self.leg, legs - 1)
        _, length, along, aside = self.way(i, y.position)
        done = np.hypot(length - along, aside) < self.radius or along > length
        center = self.points[i + 1]
        if self.loiter_radius is not None:
            done = self.circled_enough(y, i + 1, done and self.leg < legs)
        if done:
            self.leg = min(self.leg + 1, last)
            if self.leg == legs and self.done is None:
                self.done = y.t
        if self.circling or (self.leg == legs and self.at_end == "loiter"):
            return circled(r, y, center, self.loiter_radius, self.look_ahead, self.speed, self.clockwise)
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
        pace = speed = self.speed
        if self.times is not None:
            pace = self.pace_in_time(y, i, np.hypot(1.0, (end - begin)[2] / length) * (length - along))
            speed = max(pace + y.water_velocity[0] - y.velocity[0], 0.0) if pace > 0.0 else 0.0
        velocity = pace * direction / np.linalg.norm(direction)
        return replace(r, position=position, velocity=velocity, R=upright(heading), speed=speed)

    def pace_in_time(self, y: Measurement, leg: int, distance: float) -> float:
        """Speed that covers a distance by the time of a leg's end, up to the set speed; 0 before the first time."""
        if y.t + 0.5 * y.h <= self.times[0]:
            return 0.0
        return float(min(max(distance, 0.0) / max(self.times[leg + 1] - y.t, y.period), self.speed))

    def circled_enough(self, y: Measurement, point: int, arrived: bool) -> bool:
        """Whether a leg is done; its end point may have to be circled first."""
        turns = 0.0 if self.loiter_turns is None else self.loiter_turns[point]
        time = 0.0 if self.loiter_time is None else self.loiter_time[point]
        out = y.position - self.points[point]
        before, self.bearing = self.bearing, float(np.arctan2(out[1], out[0]))
        if self.circling:
            change = (self.bearing - before + np.pi) % (2.0 * np.pi) - np.pi
            self.angle += change if self.clockwise else -change
            self.since += y.period
            self.circling = self.angle < 2.0 * np.pi * turns or self.since + 0.5 * y.h < time
            return not self.circling
        self.angle = self.since = 0.0
        self.circling = arrived and max(turns, time) > 0.0
        return arrived and not self.circling
