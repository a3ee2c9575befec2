# SPDX-License-Identifier: Apache-2.0
"""A filter of the reference: a third-order reference model."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.control import Measurement, Part, Reference, heading_error, upright
from lgvi_warp.reference.rotation import Array


def exponential(A: Array) -> Array:
    """e^A of a square matrix: A is halved until its series is short, and the sum is squared as often."""
    halvings = 3 + max(0, int(np.ceil(np.log2(np.abs(A).max()))))
    term = total = np.eye(len(A))
    for k in range(1, 16):
        term = term @ A / (k * 2.0**halvings)
        total = total + term
    return np.asarray(np.linalg.matrix_power(total, 2**halvings))


class ReferenceModel(Part):
    """Attributes as in `lw.control.ReferenceModel`."""

    damping_ratio = rate_limit = None

    def begin(self) -> None:
        """Reset the filtered motion, before the first tick."""
        self.z: Array | None = None

    def moved(self, i: int, target: float, period: float) -> Array:
        """x, x' and x'' of number i after one period [s] with a constant target."""
        assert self.z is not None
        omega, zeta = self.natural_frequency[i], 1.0 if self.damping_ratio is None else self.damping_ratio[i]
        b = 2.0 * zeta + 1.0
        A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(omega**3), -b * omega**2, -b * omega]])
        shift = np.array([target, 0.0, 0.0])
        z = shift + exponential(A * period) @ (self.z[i] - shift)
        limit = np.inf if self.rate_limit is None else self.rate_limit[i]
        if abs(z[1]) > limit:
            rate = np.sign(z[1]) * limit
            z = np.array([self.z[i][0] + period * rate, rate, 0.0])
        return z

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Reference depth and heading, and with four filtered numbers the position, with their rates."""
        places = [0, 1, 2] if len(self.natural_frequency) == 4 else [2]
        if self.z is None:
            rates = y.R @ y.velocity
            heading = np.arctan2(y.R[1, 0], y.R[0, 0])
            starts = [(y.position[i], rates[i]) for i in places] + [(heading, y.angular_velocity[2])]
            self.z = np.array([(*start, 0.0) for start in starts])
        z, e = self.z, heading_error(r.R, upright(self.z[-1, 0]))
        targets = [r.position[i] for i in places] + [z[-1, 0] + e]
        self.z = np.array([self.moved(i, target, y.period) for i, target in enumerate(targets)])
        position, velocity = r.position.copy(), r.velocity.copy()
        position[places], velocity[places] = z[:-1, 0], z[:-1, 1]
        R = upright(-e) @ r.R
        return replace(
            r,
            position=position,
            velocity=velocity,
            R=R,
            angular_velocity=z[-1, 1] * R[2],
            angular_acceleration=z[-1, 2] * R[2],
        )
