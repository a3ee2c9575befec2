# SPDX-License-Identifier: Apache-2.0
"""Lie group methods on SO(3) x R^9, (R; b, p, pi), of one vehicle with all its laws."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.classical import CG3_A, CG3_B
from lgvi_warp.reference.explicit import USER, at, derivatives, followed, remembered_half
from lgvi_warp.reference.rotation import Array, cross, exp
from lgvi_warp.reference.submaps import Body, State


def algebra_rates(x: State, body: Body, h: float, origin: Array = USER) -> Array:
    """(Om; b', p', pi') (12,), an element of so(3) x R^9: R' = R hat(Om); x has b and pi at `origin`."""
    Om = np.linalg.solve(body.I6, np.concatenate([x.p, at(x, -origin).pi]))[3:]
    b, _, p, pi = derivatives(x, body, h, origin)
    return np.concatenate([Om, b, p, pi])


def bracket(u: Array, v: Array) -> Array:
    """[u, v] of so(3) x R^9: the cross product of the first three, and zeros. docs/theory/runge_kutta.md, (K11)."""
    return np.concatenate([cross(u[:3], v[:3]), np.zeros(9)])


def act(x: State, u: Array, t: float) -> State:
    """R exp(hat(u[:3])) and (b, p, pi) + u[3:], at t; u (12,): an element of the algebra so(3) x R^9.

    docs/theory/runge_kutta.md, (K11).
    """
    return replace(x, R=x.R @ exp(u[:3]), b=x.b + u[3:6], p=x.p + u[6:9], pi=x.pi + u[9:], t=t)


def rkmk4(x: State, body: Body, h: float, origin: Array = USER) -> State:
    """Munthe-Kaas & Owren (1999): order 4 with two commutators; R turns about `origin`.

    docs/theory/runge_kutta.md, (K10).

    As in Hairer, Lubich & Wanner, IV.8, but in body axes, where the commutators have opposite signs.
    """
    x = at(remembered_half(x, body, h, second=False), origin)

    def k(u: Array, c: float) -> Array:
        return h * algebra_rates(followed(act(x, u, x.t + c * h), body, c * h), body, h, origin)

    k1 = k(np.zeros(12), 0.0)
    k2 = k(0.5 * k1, 0.5)
    k3 = k(0.5 * k2 + bracket(k1, k2) / 8.0, 0.5)
    k4 = k(k3, 1.0)
    u = (k1 + 2.0 * k2 + 2.0 * k3 + k4 + 0.5 * bracket(k1, k4)) / 6.0
    return remembered_half(at(followed(act(x, u, x.t + h), body, h), -origin), body, h, second=True)


def cg3(x: State, body: Body, h: float, origin: Array = USER) -> State:
    """Crouch & Grossman (1993), order 3, with any laws, about `origin`; classical.cg3: the paper's, on SE(3) x R^6.

    docs/theory/runge_kutta.md, (K12).
    """
    x = at(remembered_half(x, body, h, second=False), origin)
    stages: list[Array] = []
    for row in (*CG3_A, CG3_B):
        y = x
        for weight, k in zip(row, stages, strict=True):
            y = act(y, weight * k, y.t)
        y = followed(replace(y, t=x.t + sum(row) * h), body, sum(row) * h)
        if row is not CG3_B:
            stages.append(h * algebra_rates(y, body, h, origin))
    return remembered_half(at(y, -origin), body, h, second=True)
