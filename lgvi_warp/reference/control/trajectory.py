# SPDX-License-Identifier: Apache-2.0
"""Guidance by a trajectory in time."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, upright
from lgvi_warp.reference.rotation import Array


class Trajectory(Part):
    """Attributes as in `lw.control.Trajectory`."""

    headings = speed = None
    interpolation = "linear"

    def bends(self, values: Array) -> Array:
        """Second derivatives (k,) at the times: of natural cubic splines, or zero."""
        t, k = np.asarray(self.times), len(self.times)
        A, b, h = np.eye(k), np.zeros(k), np.diff(t)
        if self.interpolation == "linear":
            return b
        for i in range(1, k - 1):
            A[i, i - 1 : i + 2] = h[i - 1], 2.0 * (h[i - 1] + h[i]), h[i]
            b[i] = 6.0 * ((values[i + 1] - values[i]) / h[i] - (values[i] - values[i - 1]) / h[i - 1])
        return np.linalg.solve(A, b)

    def at(self, values: Array, t: float, h: float) -> tuple[float, float, float]:
        """A number with values (k,) at the times, and its two derivatives, at t; times within h / 2 are reached."""
        i = int(np.searchsorted(self.times, t + 0.5 * h)) - 1
        if i < 0 or i == len(self.times) - 1 or self.interpolation == "steps":
            return float(values[max(i, 0)]), 0.0, 0.0
        length, u = self.times[i + 1] - self.times[i], t - self.times[i]
        bend, next_bend = self.bends(values)[i : i + 2]
        slope = (values[i + 1] - values[i]) / length - length * (2.0 * bend + next_bend) / 6.0
        jerk = (next_bend - bend) / length
        value = values[i] + u * slope + u**2 * bend / 2.0 + u**3 * jerk / 6.0
        return float(value), float(slope + u * bend + u**2 * jerk / 2.0), float(bend + u * jerk)

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Position and velocity; heading with its rates; speed."""
        position, velocity, _ = np.array([self.at(column, y.t, y.h) for column in np.transpose(self.positions)]).T
        speed = np.linalg.norm(velocity)
        if self.speed is not None:
            steps = self.interpolation == "steps"
            speed = self.at(self.speed, y.t, y.h)[0] if steps else np.interp(y.t, self.times, self.speed)
        r = replace(r, position=position, velocity=velocity, speed=float(speed))
        if self.headings is None:
            return r
        heading, rate, acceleration = self.at(np.unwrap(self.headings), y.t, y.h)
        up = np.array([0.0, 0.0, 1.0])
        return replace(r, R=upright(heading), angular_velocity=rate * up, angular_acceleration=acceleration * up)
