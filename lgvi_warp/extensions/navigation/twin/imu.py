# SPDX-License-Identifier: Apache-2.0
"""An inertial measurement unit: increments of its accelerometers and gyroscopes from one tick to the next."""

from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import Measurement, Part
from lgvi_warp.reference.control.readings import turn_to
from lgvi_warp.reference.random import normals
from lgvi_warp.reference.rotation import Array


class IMU(Part):
    """Numbers of `lw.control.IMU`, each (3,), with gravity [m/s^2], and the keys of its random numbers.

    accelerometer_start, gyroscope_start: (3,), drawn biases at the first tick, in addition to the constant biases.
    handed: None, or {name: readings passed on}, shared by sensors and filter.
    """

    key, handed = "imu", None
    place = accelerometer_bias = gyroscope_bias = accelerometer_start = gyroscope_start = np.zeros(3)
    accelerometer_noise = gyroscope_noise = accelerometer_walk = gyroscope_walk = np.zeros(3)
    gravity = 9.81
    seed0 = seed1 = channel_accelerometer = channel_gyroscope = 0

    def begin(self) -> None:
        """Begin without a previous motion, with the biases at the start."""
        self.last: tuple[Array, Array] | None = None
        self.bias_a: Any = self.accelerometer_bias + self.accelerometer_start
        self.bias_w: Any = self.gyroscope_bias + self.gyroscope_start

    def drawn(self, y: Measurement, channel: int, stream: int) -> Array:
        """Three standard normal numbers of this tick."""
        return normals(self.seed0, self.seed1, y.member, y.tick, channel + stream)[:3]

    def measure(self, y: Measurement) -> Measurement:
        """Pass on the increments of velocity and rotation since the last tick, in its axes, with their errors."""
        v = y.R @ (y.velocity + np.cross(y.angular_velocity, self.place))
        gained, T = np.zeros(3), y.period
        turned: Any = np.zeros(3)
        if self.last is not None:
            R_last, v_last = self.last
            gained = R_last.T @ (v - v_last - T * np.array([0.0, 0.0, self.gravity]))
            turned = turn_to(R_last, y.R)
            spread, a, w = np.sqrt(T), self.channel_accelerometer, self.channel_gyroscope
            gained = gained + T * self.bias_a + spread * self.accelerometer_noise * self.drawn(y, a, 0)
            turned = turned + T * self.bias_w + spread * self.gyroscope_noise * self.drawn(y, w, 0)
            self.bias_a = self.bias_a + spread * self.accelerometer_walk * self.drawn(y, a, 1)
            self.bias_w = self.bias_w + spread * self.gyroscope_walk * self.drawn(y, w, 1)
        first, self.last = self.last is None, (y.R, v)
        if self.handed is None:
            return y if first else replace(y, angular_velocity=turned / T)
        self.handed[self.key] = {"gained": gained, "turned": turned, "bias_a": self.bias_a, "bias_w": self.bias_w}
        return y
