"""Linearly implicit Runge-Kutta methods on the same state as the explicit ones: damping decays, however strong it is.

k_i = f(y_i) + h A (g_i1 k_1 + ... + g_ii k_i). Of df/dy the matrix A has damping alone: how momenta and, through
velocities, b and R follow from it. What A leaves out costs accuracy, no order. Equations of the momenta alone are solved,
with one 6x6 matrix a step. Where f of the momenta is zero at all stages, as in a steady turn, k is zero too.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, mul, sub  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply, solve6, transpose_times
from lgvi_kernels.maps.submaps import rotate

# As in make_moves, the stages are written out.
MOST_STAGES = 4


@wp.func
def gathered(s: Any, k: Any, weight: Any):
    """s + weight k, of the rates of the momenta."""
    s.p = s.p + weight * k.p
    s.pi = s.pi + weight * k.pi
    return s


def make_damped(Rates, make_moves, row, coupled):
    """The rates of one stage from those without A; row: g_i1 to g_ii."""
    g = row[-1]
    before = make_moves(gathered, tuple(weight / g for weight in row[:-1]), None)

    @wp.func
    def damped(k: Any, slopes: Any, factor: Any, x: Any, c: Any, h: Any):
        """With s = sum_j<i g_ij / g k_j, the equation of the stage is (1 - h g A) (k + s) = f + s."""
        s = before(Rates(), slopes, h.dtype(1.0))
        nu, Om = solve6(factor, k.p + s.p, k.pi + s.pi)
        k.p = c.inertia.M * nu - s.p
        k.pi = c.inertia.J_forces * Om - s.pi
        if wp.static(coupled):
            k.p = k.p + apply(c.inertia.C, Om)
            k.pi = k.pi + transpose_times(c.inertia.C, nu)
        part = h.dtype(wp.static(g)) * h
        k.b = k.b + rotate(x, part * nu)
        k.R0 = k.R0 + cross(x.R0, part * Om)
        k.R2 = k.R2 + cross(x.R2, part * Om)
        return k

    return damped


def make_factor(implicit, velocities, doubled, g):
    """(x, constants, h): the inertia less h g A. implicit: see make_implicit; doubled: see make_forces."""

    @wp.func
    def factor(x: Any, c: Any, h: Any):
        nu, Om = velocities(c.inertia, x.p, x.pi)
        return implicit(doubled(x, c, h, nu, Om), c.inertia, (h.dtype(wp.static(g)) * h) * c.inertia.inverse_scale)

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
        k.k0 = damped_0(rates(x, c, h), k, f, x, c, h)
        if wp.static(count > 1):
            k.k1 = damped_1(rates(at_1(x, k, c, h), c, h), k, f, x, c, h)
        if wp.static(count > 2):
            k.k2 = damped_2(rates(at_2(x, k, c, h), c, h), k, f, x, c, h)
        if wp.static(count > 3):
            k.k3 = damped_3(rates(at_3(x, k, c, h), c, h), k, f, x, c, h)
        return k

    return stages
