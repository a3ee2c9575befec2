# SPDX-License-Identifier: Apache-2.0
"""numba, one member at a time: RK4 on 13 numbers, and the paper's Psi with equation (24) as its scalar reduction.

What a user of numba writes first: a loop over the members in parallel, small functions that are inlined, constants
folded, contractions to fused multiply-adds allowed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba as nb
import numpy as np

from benchmarks.peers.problem import End, Problem, Run, Runs, end_of, make_rates, matrix_end_of

RK4_STEPS = (1, 1.5, 2, 3, 4, 6, 8, 12, 16, 32, 64, 128, 256)  # a second
PSI_STEPS = (2, 4, 8, 16, 32, 64, 128, 256)
Kernel = Callable[[np.ndarray, np.ndarray, float, int], None]


def in_parallel(advance: Callable[..., None]) -> Kernel:
    """The kernel that advances each member."""

    @nb.njit(parallel=True, fastmath=True)
    def kernel(start: np.ndarray, end: np.ndarray, h: float, steps: int) -> None:
        for i in nb.prange(len(start)):
            advance(start[i], end[i], h, steps)

    return kernel


def rk4_kernel(problem: Problem) -> Kernel:
    """(start, end, h, steps): rows of 13."""
    rates = nb.njit(fastmath=True, inline="always")(make_rates(problem))

    @nb.njit(fastmath=True)
    def moved(y: Any, h: float, k: Any) -> Any:
        return (
            y[0] + h * k[0], y[1] + h * k[1], y[2] + h * k[2], y[3] + h * k[3], y[4] + h * k[4], y[5] + h * k[5],
            y[6] + h * k[6], y[7] + h * k[7], y[8] + h * k[8], y[9] + h * k[9], y[10] + h * k[10],
            y[11] + h * k[11], y[12] + h * k[12],
        )  # fmt: skip

    @nb.njit(fastmath=True)
    def advance(s: np.ndarray, end: np.ndarray, h: float, steps: int) -> None:
        y = (s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12])
        for _ in range(steps):
            k1 = rates(y)
            k2 = rates(moved(y, 0.5 * h, k1))
            k3 = rates(moved(y, 0.5 * h, k2))
            k4 = rates(moved(y, h, k3))
            y = moved(y, h / 6.0, k1)
            y = moved(y, h / 3.0, k2)
            y = moved(y, h / 3.0, k3)
            y = moved(y, h / 6.0, k4)
        for j in range(13):
            end[j] = y[j]

    return in_parallel(advance)


@nb.njit(fastmath=True, inline="always")
def cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@nb.njit(fastmath=True, inline="always")
def plus(a: Any, c: float, b: Any) -> Any:
    return a[0] + c * b[0], a[1] + c * b[1], a[2] + c * b[2]


@nb.njit(fastmath=True, inline="always")
def equation_24(a: Any, J: Any) -> Any:
    """(n, D): F = I + 2 (D hat(n) + hat(n)^2) / (D^2 + n.n), from the smallest root of a quartic and two Newton steps."""
    D1, D2, D3 = 2.0 * J[0], 2.0 * J[1], 2.0 * J[2]
    a11, a22, a33 = a[0] * a[0], a[1] * a[1], a[2] * a[2]
    A = a11 + a22 + a33
    e = a11 * D2 * D3 + a22 * D1 * D3 + a33 * D1 * D2
    c3, c2, c1 = D1 + D2 + D3, D1 * D2 + D2 * D3 + D3 * D1 + 2.0 * A, D1 * D2 * D3 + (D1 + D2 + D3) * A
    c0 = e + A * A
    s = c0 / c1
    for _ in range(2):
        value = (((s - c3) * s + c2) * s - c1) * s + c0
        slope = ((4.0 * s - 3.0 * c3) * s + 2.0 * c2) * s - c1
        s -= value / slope
    b1, b2, b3 = D1 - s, D2 - s, D3 - s
    n1 = (b2 * b3 + A) * a[0] + a[1] * a[2] * (D2 - D3)
    n2 = (b3 * b1 + A) * a[1] + a[2] * a[0] * (D3 - D1)
    n3 = (b1 * b2 + A) * a[2] + a[0] * a[1] * (D1 - D2)
    return (n1, n2, n3), b1 * b2 * b3 + a11 * b1 + a22 * b2 + a33 * b3


@nb.njit(fastmath=True, inline="always")
def turned_back(n: Any, D: float, size: float, v: Any) -> Any:
    """F^T v = v + 2 (n x (n x v) - D n x v) / (D^2 + n.n)."""
    t = cross(n, v)
    return plus(plus(v, size, cross(n, t)), -size * D, t)


def psi_kernel(problem: Problem) -> Kernel:
    """(start, end, h, steps): rows of b, R, nu, Om."""
    M1, M2, M3 = (float(x) for x in problem.M)
    J1, J2, J3 = J = tuple(float(x) for x in problem.J)
    net, d = float(problem.net), tuple(float(x) for x in problem.d)

    @nb.njit(fastmath=True, inline="always")
    def velocity(p: Any) -> Any:
        return p[0] / M1, p[1] / M2, p[2] / M3

    @nb.njit(fastmath=True, inline="always")
    def drifted(b: Any, h: float, r1: Any, r2: Any, r3: Any, p: Any) -> Any:
        v = velocity(p)
        d1 = r1[0] * v[0] + r1[1] * v[1] + r1[2] * v[2]
        d2 = r2[0] * v[0] + r2[1] * v[1] + r2[2] * v[2]
        d3 = r3[0] * v[0] + r3[1] * v[1] + r3[2] * v[2]
        return plus(b, h, (d1, d2, d3))

    @nb.njit(fastmath=True)
    def advance(s: np.ndarray, end: np.ndarray, h: float, steps: int) -> None:
        b, r1, r2, r3 = (s[0], s[1], s[2]), (s[3], s[4], s[5]), (s[6], s[7], s[8]), (s[9], s[10], s[11])
        p, q = (M1 * s[12], M2 * s[13], M3 * s[14]), (J1 * s[15], J2 * s[16], J3 * s[17])
        half = 0.5 * h
        for _ in range(steps):
            # Phi over half a step: (10)-(14).
            n, D = equation_24((half * q[0], half * q[1], half * q[2]), J)
            size = 2.0 / (D * D + n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
            b = drifted(b, half, r1, r2, r3, p)
            r1, r2, r3 = turned_back(n, D, size, r1), turned_back(n, D, size, r2), turned_back(n, D, size, r3)
            p = plus(turned_back(n, D, size, p), half * net, r3)
            q = plus(turned_back(n, D, size, q), half, cross(p, velocity(p)))
            q = plus(q, -half, cross(d, r3))
            # Phi* over the other: (19)-(23).
            q = plus(plus(q, half, cross(p, velocity(p))), -half, cross(d, r3))
            p = plus(p, half * net, r3)
            n, D = equation_24((half * q[0], half * q[1], half * q[2]), J)
            size = 2.0 / (D * D + n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
            r1, r2, r3 = turned_back(n, D, size, r1), turned_back(n, D, size, r2), turned_back(n, D, size, r3)
            p, q = turned_back(n, D, size, p), turned_back(n, D, size, q)
            b = drifted(b, half, r1, r2, r3, p)
        v, w = velocity(p), (q[0] / J1, q[1] / J2, q[2] / J3)
        for j in range(3):
            end[j], end[3 + j], end[6 + j] = b[j], r1[j], r2[j]
            end[9 + j], end[12 + j], end[15 + j] = r3[j], v[j], w[j]

    return in_parallel(advance)


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    nb.set_num_threads(threads)
    methods = (
        ("rk4", rk4_kernel(problem), problem.state(), end_of, RK4_STEPS),
        ("psi", psi_kernel(problem), problem.matrix_state(), matrix_end_of, PSI_STEPS),
    )
    for name, kernel, start, converted, rates in methods:
        for rate in rates:
            yield make_run(problem, name, kernel, start, converted, rate)


def make_run(
    problem: Problem, name: str, kernel: Kernel, start: np.ndarray, converted: Callable[[np.ndarray], End], rate: float
) -> Run:
    """One setting."""
    end, (h, steps) = np.empty_like(start), problem.steps(rate)
    return Run(name, f"h={h:g}", problem.members, lambda: kernel(start, end, h, steps), lambda: converted(end))
