"""Linearly implicit Runge-Kutta methods on the same y as the explicit ones: damping decays, however strong it is.

k_i = f(y_i) + h A (g_i1 k_1 + ... + g_ii k_i). Of df/dy the matrix A has damping alone: how momenta and, through
velocities, b and R follow from it. It is that of twice the velocity, D(2 nu), which is the derivative of D(nu) nu where
each column of D grows as the size of its velocity, or not at all.
"""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.explicit import USER, Step, Tableau, at, pack, rates, unpack
from lgvi_warp.reference.rotation import Array, cross, hat
from lgvi_warp.reference.submaps import Body, State, damping, look, water


class Implicit(Tableau):
    """A tableau with the matrix g of a linearly implicit method."""

    @property
    def implicit(self) -> tuple[tuple[float, ...], ...]:
        """Row i has i + 1 numbers, the last of which is the same in all rows."""


def damping_matrix(x: State, body: Body, h: float) -> Array:
    """D(2 nu) (6, 6) about the user's origin.

    Args:
        x, body, h: State at the start; inertia and laws; step [s].
    """
    nu, Om = np.split(np.linalg.solve(body.I6, np.concatenate([x.p, x.pi])), 2)
    return damping(x, body, h, 2.0 * nu, 2.0 * Om, water(look(x, body, h), body))


def following(x: State, twist: Array, origin: Array) -> Array:
    """Rate of b and of two rows of R (9,) of a twist (6,) at the user's origin.

    Args:
        x: State whose attitude turns the twist.
        twist: Velocity (3,) [m/s] and angular velocity (3,) [rad/s], body axes.
        origin: Point (3,) [m] of the body, from the user's origin, that b is the position of.
    """
    nu, Om = np.split(twist, 2)
    return np.concatenate([x.R @ (nu + cross(Om, origin)), cross(x.R[0], Om), cross(x.R[2], Om)])


def stages(x: State, body: Body, h: float, tableau: Implicit, origin: Array = USER) -> Array:
    """k_i (stages, 15) of y = pack(x).

    With s_i = sum_j<i g_ij / g k_j, the equation of k_i is (1 - h g A) (k_i + s_i) = f + s_i.

    Args:
        x, body, h: State at the start, with b and pi at `origin`; inertia and laws; step [s].
        tableau: Coefficients of the method.
        origin: Point (3,) [m] of the body, from the user's origin; default that origin.
    """
    y, K = pack(x), np.zeros((len(tableau.b), 15))
    g = tableau.implicit[0][0]
    moved = np.eye(6)  # momenta at the user's origin -> at this one
    moved[3:, :3] = -hat(origin)
    factor = body.I6 + g * h * damping_matrix(at(x, -origin), body, h)
    for i, (row, c) in enumerate(zip(tableau.a, tableau.c, strict=True)):
        K[i] = rates(unpack(y + h * np.array(row) @ K[:i], x, x.t + c * h), body, h, origin)
        s = np.array(tableau.implicit[i][:i]) @ K[:i, 9:] / g
        twist = np.linalg.solve(factor, np.linalg.solve(moved, K[i, 9:] + s))
        K[i, 9:] = moved @ body.I6 @ twist - s
        K[i, :9] += g * h * following(x, twist, origin)
    return K


def stepper(tableau: Implicit, origin: Array = USER) -> Step:
    """step(x, body, h): y + h sum_i b_i k_i, with y taken at a point (3,) [m] of the body; x is at the user's origin."""

    def step(x: State, body: Body, h: float) -> State:
        x = at(x, origin)
        y = pack(x) + h * np.array(tableau.b) @ stages(x, body, h, tableau, origin)
        return replace(at(unpack(y, x, x.t + h), -origin))

    return step
