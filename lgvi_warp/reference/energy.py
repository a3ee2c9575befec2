# SPDX-License-Identifier: Apache-2.0
"""Energy and spatial momenta of one vehicle."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.submaps import Body, State


def energy(x: State, body: Body) -> float:
    """p.M^-1 p / 2 + pi.J^-1 pi / 2 + U(b, R) [J]. docs/theory/splitting.md, (S1)."""
    kinetic = 0.5 * x.p @ np.linalg.solve(body.M, x.p) + 0.5 * x.pi @ np.linalg.solve(body.J, x.pi)
    return float(kinetic) + body.potential(x.b, x.R)


def linear_momentum(x: State) -> Array:
    """R p in inertial axes [N s]: conserved by every sub-map except K. docs/theory/splitting.md, (S12)."""
    return x.R @ x.p


def angular_momentum(x: State) -> Array:
    """R pi + b x R p about the inertial origin [N m s]: conserved by T and by D. docs/theory/splitting.md, (S12)."""
    return x.R @ x.pi + cross(x.b, x.R @ x.p)
