# SPDX-License-Identifier: Apache-2.0
"""Linearly implicit Runge-Kutta methods on the same y as the explicit ones: damping of any strength decays.

k_i = f(y_i) + h A (g_i1 k_1 + ... + g_ii k_i). The matrix A is the part of df/dy for the effect of damping on the
momenta. The omitted parts reduce the accuracy, not the order.
"""

from typing import Protocol

import numpy as np

from lgvi_warp.reference.explicit import USER, Step, Tableau, at, followed, pack, rates, unpack
from lgvi_warp.reference.rotation import Array, hat
from lgvi_warp.reference.submaps import Body, State, damping, look, water


class Implicit(Tableau, Protocol):
    """A tableau with the matrix g of a linearly implicit method."""

    @property
    def implicit(self) -> tuple[tuple[float, ...], ...]:
        """Matrix g: row i has i + 1 numbers, the last of which is the same in all rows."""


def slope(x: State, body: Body, h: float) -> Array:
    """D(s nu) (6, 6), an approximation of the derivative of D(nu) nu: s = 1 + q^2 / (1 + q^2), q = h tr I6^-1 D.

    docs/theory/runge_kutta.md, (K16).
    """
    nu, Om = np.split(np.linalg.solve(body.I6, np.concatenate([x.p, x.pi])), 2)
    flow = water(look(x, body, h), body)
    q = h * float(np.trace(np.linalg.solve(body.I6, damping(x, body, h, nu, Om, flow))))
    s = 1.0 + q**2 / (1.0 + q**2)
    return damping(x, body, h, s * nu, s * Om, flow)


def stages(x: State, body: Body, h: float, tableau: Implicit, origin: Array = USER) -> Array:
    """k_i (stages, 15) of y = pack(x), x with b and pi at `origin`.

    docs/theory/runge_kutta.md, (K15).

    With s_i = sum_j<i g_ij / g k_j, the equation of k_i is (1 - h g A) (k_i + s_i) = f + s_i.
    """
    y, K = pack(x), np.zeros((len(tableau.b), 15))
    g = tableau.implicit[0][0]
    moved = np.eye(6)  # momenta at the user's origin -> at this one
    moved[3:, :3] = -hat(origin)
    factor = (
        moved @ (np.eye(6) + g * h * slope(at(x, -origin), body, h) @ np.linalg.inv(body.I6)) @ np.linalg.inv(moved)
    )
    for i, (row, c) in enumerate(zip(tableau.a, tableau.c, strict=True)):
        K[i] = rates(followed(unpack(y + h * np.array(row) @ K[:i], x, x.t + c * h), body, c * h), body, h, origin)
        s = np.array(tableau.implicit[i][:i]) @ K[:i, 9:] / g
        K[i, 9:] = np.linalg.solve(factor, K[i, 9:] + s) - s
    return K


def stepper(tableau: Implicit, origin: Array = USER) -> Step:
    """step(x, body, h): y + h sum_i b_i k_i, with y taken at a point (3,) [m] of the body; x is at the user's origin."""

    def step(x: State, body: Body, h: float) -> State:
        x = at(x, origin)
        y = pack(x) + h * np.array(tableau.b) @ stages(x, body, h, tableau, origin)
        return at(followed(unpack(y, x, x.t + h), body, h), -origin)

    return step
