# SPDX-License-Identifier: Apache-2.0
"""Gauss collocation, order 2s with s stages, on y = (b, the rows of R, p, pi), of one vehicle with all its laws.

It is symmetric and keeps every quadratic invariant to round-off: R^T R, R p without forces, and so on. It is symplectic
in canonical variables. (R, p, pi) are not canonical, so here it is symplectic to the method's order only.
Hairer, Lubich & Wanner, Geometric Numerical Integration, II.1.3, IV.2.1, VIII.6 (iteration, compensated sums).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre

from lgvi_warp.reference.explicit import derivatives, remembered_half
from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.submaps import Body, State

# A fixed-point iteration that has not settled after this many rounds will not.
MOST_ITERATIONS = 100


class NotConverged(ValueError):  # noqa: N818
    """Raised if the iteration for the stages does not converge."""


@dataclass(frozen=True)
class Gauss:
    """a (s, s), b (s,), c (s,); ahead (s, s): matrix that extrapolates the stages of a step from the previous step."""

    a: Array
    b: Array
    c: Array
    ahead: Array


def polynomials(x: Array, degree: int) -> Array:
    """The Legendre polynomials P_0 .. P_degree at x (n,): (n, degree + 1)."""
    return np.asarray(legendre.legvander(x, degree))


def gauss(s: int) -> Gauss:
    """The method of s stages. a_ij: integral to c_i of b_j sum_k (2k + 1) P_k(x_j) P_k, x = 2c - 1.

    docs/theory/runge_kutta.md, (K17).
    """
    x, w = legendre.leggauss(s)
    b, c, P = 0.5 * w, 0.5 * (x + 1.0), polynomials(x, s)
    # The integral of P_k from 0 to c_i is (P_k+1 - P_k-1) / (2 (2k + 1)).
    integrals = np.column_stack([2.0 * c, P[:, 2:] - P[:, : s - 1]]) / 2.0
    a = integrals @ P[:, :s].T * b
    ahead = polynomials(x + 2.0, s - 1) @ ((2 * np.arange(s)[:, None] + 1) * P[:, :s].T) * b
    return Gauss(a, b, c, ahead)


def pack(x: State) -> Array:
    """y (18,): b [m], R row by row, p [N s], pi [N m s]: with all of R, whose R^T R is a quadratic invariant."""
    return np.concatenate([x.b, x.R.ravel(), x.p, x.pi])


def unpack(y: Array, x: State, t: float) -> State:
    """The state of y (18,), see `pack`, at t; other entries as in x."""
    return replace(x, b=y[:3], R=y[3:12].reshape(3, 3), p=y[12:15], pi=y[15:], t=t)


def rates(x: State, body: Body, h: float) -> Array:
    """Rate of the vector of `pack`, dy/dt (18,)."""
    b, R, p, pi = derivatives(x, body, h)
    return np.concatenate([b, R.ravel(), p, pi])


def solve_stages(x: State, body: Body, h: float, method: Gauss, K: Array) -> tuple[Array, int]:
    """K_i = f(y + h sum_j a_ij K_j), (s, 18), by fixed-point iteration from a guess K (s, 18), and the number of iterations.

    docs/theory/runge_kutta.md, (K18).

    The iteration ends when the change is round-off or no longer falls. Raises NotConverged.
    """
    y, smallest = pack(x), np.inf
    for iteration in range(1, MOST_ITERATIONS + 1):
        Y = y + h * method.a @ K
        new = np.array([rates(unpack(Yi, x, x.t + c * h), body, h) for Yi, c in zip(Y, method.c, strict=True)])
        change, K = float(np.abs(h * (new - K)).max()), new
        if change == 0.0 or (change >= smallest and change <= 1e-12 * np.abs(y).max()):
            return K, iteration
        smallest = min(smallest, change)
    raise NotConverged(f"Gauss: the stages still change by {change:.3g} after {iteration} iterations. Shorten the step")


def advance(x: State, body: Body, h: float, steps: int, s: int = 3) -> tuple[State, int]:
    """The state after this many steps of h [s], and the number of evaluations of the right-hand side. Raises NotConverged.

    docs/theory/runge_kutta.md, (K18).

    Each step starts from the extrapolated stages of the previous step; the sum y + h sum b_i K_i is compensated.
    """
    method, evaluations = gauss(s), 0
    K: Array = np.zeros((s, 18))
    lost: Array = np.zeros(18)
    for k in range(steps):
        x = remembered_half(replace(x, t=x.step * h), body, h, second=False)
        K = method.ahead @ K if k else np.tile(rates(x, body, h), (s, 1))
        K, iterations = solve_stages(x, body, h, method, K)
        y, add = pack(x), h * method.b @ K + lost
        new = y + add
        lost = add - (new - y)
        x = remembered_half(unpack(new, x, x.t + h), body, h, second=True)
        x = replace(x, step=x.step + 1, t=(x.step + 1) * h)
        evaluations += s * iterations
    return x, evaluations
