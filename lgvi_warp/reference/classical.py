# SPDX-License-Identifier: Apache-2.0
"""The classical integrators of the paper's comparison, on the continuous equations of its section II."""

import math
from collections.abc import Sequence

import numpy as np

from lgvi_warp.reference.paper import Motion
from lgvi_warp.reference.rotation import Array, cross, exp, hat, norm, sinc
from lgvi_warp.reference.submaps import Body

# nu, Om and their rates at a stage.
Stage = tuple[Array, Array, Array, Array]


def rates(b: Array, R: Array, nu: Array, Om: Array, body: Body) -> tuple[Array, Array, Array]:
    """Eq. (1) and the dynamics of section II: db/dt in inertial axes, then dnu/dt and dOm/dt in body axes.

    docs/theory/integrator.md, (1), (I1).
    """
    force, torque = body.wrench(b, R)
    p, pi = body.M @ nu, body.J @ Om
    nu_rate = np.linalg.solve(body.M, cross(p, Om) + force)
    Om_rate = np.linalg.solve(body.J, cross(pi, Om) + cross(p, nu) + torque)
    return R @ nu, nu_rate, Om_rate


def along_screw(b: Array, R: Array, d: Array, theta: Array) -> tuple[Array, Array]:
    """(b, R) exp of the twist (d [m], theta) in SE(3): b + R V d and R exp(hat(theta)), V the integral of exp.

    docs/theory/runge_kutta.md, (K14).
    """
    n, H = norm(theta), hat(theta)
    third = (n - math.sin(n)) / n**3 if n > 1e-2 else 1.0 / 6.0 - n**2 / 120.0 + n**4 / 5040.0
    V = np.eye(3) + 0.5 * sinc(0.5 * n) ** 2 * H + third * H @ H
    return b + R @ V @ d, R @ exp(theta)


# Crouch & Grossman 1993; Hairer, Lubich & Wanner, Geometric Numerical Integration, IV.8: their method of order 3.
# docs/theory/runge_kutta.md, (K13).
CG3_A = ((), (-1.0 / 24.0,), (161.0 / 24.0, -6.0))
CG3_B = (1.0, -2.0 / 3.0, 2.0 / 3.0)


def cg3(b: Array, R: Array, nu: Array, Om: Array, body: Body, h: float) -> Motion:
    """Crouch-Grossman, order 3, on SE(3) x R6: R <- R exp(h b1 Om1) exp(h b2 Om2) exp(h b3 Om3).

    docs/theory/runge_kutta.md, (K14).

    b moves along the same screws. Returns b, R, nu, Om at k + 1.
    """
    stages: list[Stage] = []
    for row in CG3_A:
        bi, Ri, nui, Omi = crouch_grossman_row(b, R, nu, Om, h, row, stages)
        _, nu_rate, Om_rate = rates(bi, Ri, nui, Omi, body)
        stages.append((nui, Omi, nu_rate, Om_rate))
    return crouch_grossman_row(b, R, nu, Om, h, CG3_B, stages)


def crouch_grossman_row(
    b: Array, R: Array, nu: Array, Om: Array, h: float, row: Sequence[float], stages: list[Stage]
) -> Motion:
    """Move from the state at k along the frozen twists of the stages so far, weighted by one row of the tableau."""
    for weight, (nui, Omi, nu_rate, Om_rate) in zip(row, stages, strict=True):
        b, R = along_screw(b, R, h * weight * nui, h * weight * Omi)
        nu, Om = nu + h * weight * nu_rate, Om + h * weight * Om_rate
    return b, R, nu, Om


# Classical Runge-Kutta of order 4.
RK4_C = (0.0, 0.5, 0.5, 1.0)
RK4_B = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)


def inverse_dexp(theta: Array, Om: Array) -> Array:
    """d exp^-1 to order 3, for R = R_k exp(hat(theta)): theta' = Om + theta x Om / 2 + theta x (theta x Om) / 12.

    docs/theory/runge_kutta.md, (K9).
    """
    return Om + 0.5 * cross(theta, Om) + cross(theta, cross(theta, Om)) / 12.0


def rkmk4(b: Array, R: Array, nu: Array, Om: Array, body: Body, h: float) -> Motion:
    """Runge-Kutta-Munthe-Kaas, order 4 (HLW IV.8.2): RK4 for the rotation vector. Returns b, R, nu, Om at k + 1.

    docs/theory/runge_kutta.md, (K9).
    """
    theta = np.zeros(3)
    rate: tuple[Array, ...] = (np.zeros(3),) * 4
    total = rate
    for c, weight in zip(RK4_C, RK4_B, strict=True):
        stage = [x + h * c * r for x, r in zip((b, theta, nu, Om), rate, strict=True)]
        b_rate, nu_rate, Om_rate = rates(stage[0], R @ exp(stage[1]), stage[2], stage[3], body)
        rate = (b_rate, inverse_dexp(stage[1], stage[3]), nu_rate, Om_rate)
        total = tuple(t + weight * r for t, r in zip(total, rate, strict=True))
    return b + h * total[0], R @ exp(h * total[1]), nu + h * total[2], Om + h * total[3]
