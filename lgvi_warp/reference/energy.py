"""Energy and spatial momenta of one vehicle."""

import numpy as np


def energy(x, body):
    """p.M^-1 p / 2 + pi.J^-1 pi / 2 + U(b, R) [J]."""
    z = x.R.T @ np.array([0.0, 0.0, 1.0])
    kinetic = 0.5 * x.p @ np.linalg.solve(body.M, x.p) + 0.5 * x.pi @ np.linalg.solve(body.J, x.pi)
    return kinetic + sum(term.potential(z, x.b) for term in body.terms)


def linear_momentum(x):
    """R p in inertial axes [N s]: conserved by every sub-map but K."""
    return x.R @ x.p


def angular_momentum(x):
    """R pi + b x R p about the inertial origin [N m s]: conserved by T and by D."""
    return x.R @ x.pi + np.cross(x.b, x.R @ x.p)
