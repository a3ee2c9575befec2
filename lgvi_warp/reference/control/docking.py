# SPDX-License-Identifier: Apache-2.0
"""Guidance into a dock along its centre line."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, upright


class Docking(Part):
    """Attributes as in `lw.control.Docking`."""

    offset, kappa = 0.0, 0.1

    def begin(self) -> None:
        """Reset the phase; J is 0."""
        self.phase, self.J = "not begun", 0.0

    def next_phase(self, left: float, off: float) -> str:
        """Next phase of a vehicle at the distance `left` before the dock's plane and `off` the centre line."""
        outside = off > self.mouth + max(left, 0.0) * np.tan(self.funnel)
        if self.phase == "not begun":
            return "on the line" if left > 0.0 else "going round"
        if self.phase == "on the line":
            if left <= 0.0:
                return "going round" if outside else "docked"
            return "going round" if outside and left <= self.judged else "on the line"
        if self.phase == "going round":
            return "going round" if left < self.approach else "on the line"
        return self.phase

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Guide along the centre line, or round to its start."""
        axes = upright(self.heading)
        dock = np.asarray(self.position, float)
        along, aside, below = axes.T @ (y.position - dock)
        self.phase = self.next_phase(-along, float(np.hypot(aside, below)))
        if self.phase == "docked":
            return replace(r, position=dock, velocity=np.zeros(3), R=axes, speed=0.0)
        if self.phase == "going round":
            self.J, pace = 0.0, self.speed
            turn = np.arctan2(self.offset - aside, -self.approach - along)
            position = np.array([*y.position[:2], dock[2]])
        else:
            aim, D = aside + self.kappa * self.J, self.look_ahead
            self.J += y.period * D * aside / (D**2 + aim**2)
            turn = -np.arctan(aim / D)
            share = np.clip(-along / self.slowing, 0.0, 1.0)
            pace = self.contact_speed + share * (self.speed - self.contact_speed)
            position = dock + along * axes[:, 0]
        R = axes @ upright(turn)
        speed = max(pace + y.water_velocity[0] - y.velocity[0], 0.0)
        return replace(r, position=position, velocity=pace * R[:, 0], R=R, speed=float(speed))
