# SPDX-License-Identifier: Apache-2.0
"""Linearly implicit Runge-Kutta methods on the same state as the explicit ones: damping decays, however strong it is.

k_i = f(y_i) + h A (g_i1 k_1 + ... + g_ii k_i). Of df/dy the matrix A has only what damping does to the momenta: what it leaves
out costs accuracy, no order. So one 6x6 matrix a step is factorised, and b and R are explicit. Where the momenta stay as they
are at all stages, as in a steady turn, so they do at the end of the step.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, mul, sub  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply, solve6, transpose_times

# As in make_moves, the stages are written out.
MOST_STAGES = 4


@wp.func
def gathered(s: Any, k: Any, weight: Any):
    """s + weight k, of the rates of the momenta."""
    s.p = s.p + weight * k.p
    s.pi = s.pi + weight * k.pi
    return s


def make_damped(Rates, make_moves, row, coupled):
    """The rates of one stage from those without A; row: g_i1 to g_ii. docs/theory/runge_kutta.md, (K15)."""
    before = make_moves(gathered, tuple(weight / row[-1] for weight in row[:-1]), None)

    @wp.func
    def damped(k: Any, slopes: Any, factor: Any, c: Any, h: Any):
        """With s = sum_j<i g_ij / g k_j, the equation of the stage is (1 - h g A) (k + s) = f + s."""
        s = before(Rates(), slopes, h.dtype(1.0))
        nu, Om = solve6(factor, k.p + s.p, k.pi + s.pi)
        k.p = c.inertia.M * nu - s.p
        k.pi = c.inertia.J_forces * Om - s.pi
        if wp.static(coupled):
            k.p = k.p + apply(c.inertia.C, Om)
            k.pi = k.pi + transpose_times(c.inertia.C, nu)
        return k

    return damped


def make_factor(implicit, velocities, slope, g):
    """(x, constants, h): the inertia plus h g times damping's matrix. implicit: see make_implicit; slope: see make_forces."""

    @wp.func
    def factor(x: Any, c: Any, h: Any):
        nu, Om = velocities(c.inertia, x.p, x.pi)
        return implicit(slope(x, c, h, nu, Om), c.inertia, (h.dtype(wp.static(g)) * h) * c.inertia.inverse_scale)

    return factor


def make_damped_stages(Slopes, rates, states, damped, factor):
    """One function (x, constants, h) -> the slopes. states, damped: functions of each stage (see make_stage, make_damped)."""
    count = len(damped)
    _, at_1, at_2, at_3 = states + [None] * (MOST_STAGES - count)
    damped_0, damped_1, damped_2, damped_3 = damped + [None] * (MOST_STAGES - count)

    @wp.func
    def stages(x: Any, c: Any, h: Any):
        k = Slopes()
        f = factor(x, c, h)
        k.k0 = damped_0(rates(x, c, h), k, f, c, h)
        if wp.static(count > 1):
            k.k1 = damped_1(rates(at_1(x, k, c, h), c, h), k, f, c, h)
        if wp.static(count > 2):
            k.k2 = damped_2(rates(at_2(x, k, c, h), c, h), k, f, c, h)
        if wp.static(count > 3):
            k.k3 = damped_3(rates(at_3(x, k, c, h), c, h), k, f, c, h)
        return k

    return stages
