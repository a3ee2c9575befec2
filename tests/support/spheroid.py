# SPDX-License-Identifier: Apache-2.0
"""The force of water on a prolate spheroid in a potential flow, by integrating the pressure over its surface.

Unsteady Bernoulli with Lamb's potentials (Hydrodynamics, 1932, art. 105 and 114): exact where the flow is linear in space.
Nothing of the package is used.
"""

from dataclasses import dataclass

import numpy as np

DENSITY = 1000.0


@dataclass(frozen=True)
class Spheroid:
    """Semi-axes a > c [m], the long one along the first body axis. Vectors and matrices are in body axes.

    Each disturbance is a polynomial of the place times a function of zeta, which is constant on confocal spheroids.
    """

    a: float
    c: float

    @property
    def displaced(self):
        """Mass of the displaced water [kg]."""
        return 4.0 / 3.0 * np.pi * DENSITY * self.a * self.c**2

    def surface(self, count=160, around=24):
        """Points (k, 3) and outward area elements (k, 3): Gauss's rule along the axis, equal angles around it."""
        mu, weight = np.polynomial.legendre.leggauss(count)
        angle = 2.0 * np.pi * np.arange(around) / around
        mu, angle = (x.ravel() for x in np.meshgrid(mu, angle, indexing="ij"))
        s = np.sqrt(1.0 - mu**2)
        unit = np.stack([mu, s * np.cos(angle), s * np.sin(angle)], axis=1)
        axes = np.array([self.a, self.c, self.c])
        size = np.repeat(weight, around) * 2.0 * np.pi / around * self.a * self.c**2
        return unit * axes, size[:, None] * unit / axes

    def disturbance(self, points, nu, strain):
        """Potential (k,) and its gradient (k, 3) on the surface, of a body that moves at nu in water that strains about it."""
        f2 = self.a**2 - self.c**2
        t = self.a / np.sqrt(f2)
        q = t**2 - 1.0
        x, y, z = points.T
        r2 = y**2 + z**2
        D = x**2 / t**3 + t * r2 / q**2
        grad_t = np.stack([x / t**2, y / q, z / q], axis=1) / D[:, None]
        L = 0.5 * np.log((t + 1.0) / (t - 1.0))
        # Legendre's functions of the second kind: Q2 and its derivatives; Q1 is in `ahead`.
        Q2 = (0.5 * (3.0 * t**2 - 1.0) * L - 1.5 * t, 3.0 * t * L - 0.5 * (3.0 * t**2 - 1.0) / q - 1.5,
              3.0 * L - 3.0 * t / q + 2.0 * t / q**2, -8.0 / q**3)  # fmt: skip
        ahead, across = (L - 1.0 / t, -1.0 / q + 1.0 / t**2), (L - t / q, 2.0 / q**2)
        tilted, round_ = (Q2[1] / t, Q2[2] / t - Q2[1] / t**2), (Q2[2], Q2[3])
        zero, one = np.zeros_like(x), np.ones_like(x)
        mu2 = x**2 / (f2 * t**2)
        axial = Q2[0] * 0.5 * (3.0 * mu2 - 1.0), Q2[1] * 0.5 * (3.0 * mu2 - 1.0) - 3.0 * Q2[0] * mu2 / t
        axial_place = np.stack([Q2[0] * 3.0 * x / (f2 * t**2), zero, zero], axis=1)
        # (polynomial, its gradient, (function of t, derivative), d log polynomial / dt along the normal, strength)
        parts = (
            (x, (one, zero, zero), ahead, 1.0 / t, nu[0]),
            (y, (zero, one, zero), across, t / q, nu[1]),
            (z, (zero, zero, one), across, t / q, nu[2]),
            (x * y, (y, x, zero), tilted, 1.0 / t + t / q, -strain[0, 1]),
            (x * z, (z, zero, x), tilted, 1.0 / t + t / q, -strain[0, 2]),
            (y * z, (zero, z, y), round_, 2.0 * t / q, -strain[1, 2]),
            (0.5 * (y**2 - z**2), (zero, y, -z), round_, 2.0 * t / q, -0.5 * (strain[1, 1] - strain[2, 2])),
        )
        k = -strain[0, 0] * f2 * t / Q2[1]
        phi, gradient = k * axial[0], k * (axial_place + axial[1][:, None] * grad_t)
        for polynomial, slope, (g, dg), rate, strength in parts:
            # The normal velocity of the disturbance is that of the body less that of the water.
            k = strength * rate / (g * rate + dg)
            phi = phi + k * g * polynomial
            gradient = gradient + k * (g * np.stack(slope, axis=1) + (dg * polynomial)[:, None] * grad_t)
        return phi, gradient

    def force(self, *motion):
        """Force of the pressure [N] on the body; motion: as of `pressure`."""
        _, area = self.surface()
        return -self.pressure(*motion) @ area

    def moment(self, *motion):
        """Moment of the pressure about the body's centre [N m]; motion: as of `pressure`."""
        y, area = self.surface()
        return -self.pressure(*motion) @ np.cross(y, area)

    def pressure(self, v, dv, u, rate, strain, strain_rate):
        """Pressure (k,) [Pa] on the surface of the body that moves at v with acceleration dv and does not turn.

        u, rate, strain, strain_rate: the water's velocity, du/dt, du/dx (symmetric, without trace) and d2u/dxdt at the
        body's centre.
        """
        y, _ = self.surface()
        nu = v - u
        _, disturbed = self.disturbance(y, nu, strain)
        # The disturbance goes with the body: at a fixed place it changes by its motion, too.
        grown, _ = self.disturbance(y, dv - rate - strain @ v, strain_rate)
        change = y @ rate + 0.5 * np.einsum("ki,ij,kj->k", y, strain_rate, y) + grown - disturbed @ v
        velocity = u + y @ strain.T + disturbed
        return -DENSITY * (change + 0.5 * np.sum(velocity**2, axis=1))

    def added_mass(self):
        """(3,) [kg] along the axes, by the same integral."""
        still = np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
        return np.array([-self.force(np.zeros(3), e, *still)[i] for i, e in enumerate(np.eye(3))])

    def acceleration(self, mass, v, u, rate, strain, strain_rate):
        """dv/dt [m/s2] of a body of this mass on which nothing but the pressure acts."""
        water = u, rate, strain, strain_rate
        return self.force(v, np.zeros(3), *water) / (mass + self.added_mass())
