# SPDX-License-Identifier: Apache-2.0
"""Gauss collocation in the kernel: all of y = (b, the rows of R, p, pi) at once, its stages by fixed-point iteration.

Hairer, Lubich & Wanner, Geometric Numerical Integration, II.1.3 and VIII.6. The stages' slopes K_i stay in the packet's rows
of `memory`, where the next step starts from their extrapolation; a new run starts from K = 0.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    add,
    any_positive,
    cross,
    div,
    dot,
    element,
    mul,
    ones,
    positive,
    set_element,
    sub,
    vec3,
)
from lgvi_kernels.maps.solve import NOT_CONVERGED
from lgvi_kernels.maps.submaps import look, rotate

# Numbers of a slope: one for each number of the state.
SLOPE_FIELDS = 18
# A fixed-point iteration that has not settled after so many rounds will not.
MOST_ITERATIONS = 60


@wp.func
def slope3(c: Any, stage: int, offset: int):
    """Three numbers of K_stage."""
    row = stage * wp.static(SLOPE_FIELDS)
    rows = c.memory
    return vec3(
        element(rows, c.packet, row, offset),
        element(rows, c.packet, row, offset + 1),
        element(rows, c.packet, row, offset + 2),
    )


@wp.func
def set_slope3(c: Any, stage: int, offset: int, v: Any):
    """Write three numbers of K_stage."""
    row = stage * wp.static(SLOPE_FIELDS)
    set_element(c.memory, c.packet, row, offset, v.x)
    set_element(c.memory, c.packet, row, offset + 1, v.y)
    set_element(c.memory, c.packet, row, offset + 2, v.z)


@wp.func
def moved(x: Any, c: Any, stage: int, w: Any):
    """y + w K_stage."""
    x.b = x.b + w * slope3(c, stage, 0)
    x.R0 = x.R0 + w * slope3(c, stage, 3)
    x.R1 = x.R1 + w * slope3(c, stage, 6)
    x.R2 = x.R2 + w * slope3(c, stage, 9)
    x.p = x.p + w * slope3(c, stage, 12)
    x.pi = x.pi + w * slope3(c, stage, 15)
    return x


@wp.func
def renew(c: Any, stage: int, offset: int, active: Any, new: Any):
    """The slope in the lanes that are not done yet; returns the square of its change."""
    old = slope3(c, stage, offset)
    set_slope3(c, stage, offset, positive(active, new, old))
    change = new - old
    return dot(change, change)


def make_G(gauss, View, Wrench, law, velocities, iterations, adaptive, checked, timed):
    """One step. gauss: a, b, c and the matrix `ahead` of the extrapolation, as tuples; law: of position and time, or None."""
    a, b, c_, ahead = gauss
    s = len(b)
    A, Ahead = (wp.types.matrix((s, s), wp.float64)(*(x for row in m for x in row)) for m in (a, ahead))
    B, C = (wp.types.vector(s, wp.float64)(*v) for v in (b, c_))
    rounds = MOST_ITERATIONS if adaptive else iterations

    @wp.func
    def extrapolate(c: Any, h: Any):
        """K of this step from the last one's. Each is a sum over all old ones, so the new ones wait in the rows behind."""
        weights = wp.static(Ahead)
        for i in range(wp.static(s)):
            for j in range(wp.static(SLOPE_FIELDS)):
                k = h.dtype(weights[i, 0]) * c.memory[c.packet, j]
                for m in range(1, wp.static(s)):
                    k = k + h.dtype(weights[i, m]) * c.memory[c.packet, m * wp.static(SLOPE_FIELDS) + j]
                c.memory[c.packet, (wp.static(s) + i) * wp.static(SLOPE_FIELDS) + j] = k
        for i in range(wp.static(s * SLOPE_FIELDS)):
            c.memory[c.packet, i] = c.memory[c.packet, wp.static(s * SLOPE_FIELDS) + i]

    @wp.func
    def improve(x: Any, c: Any, h: Any, i: int, active: Any):
        """K_i = f(y + h sum_j a_ij K_j) in the active lanes; returns the square of the change of R, p and pi, in steps."""
        weights = wp.static(A)
        y = x
        for j in range(wp.static(s)):
            y = moved(y, c, j, h.dtype(weights[i, j]) * h)
        nu, Om = velocities(c.inertia, y.p, y.pi)
        dp = cross(y.p, Om)
        dpi = cross(y.pi, Om) + cross(y.p, nu)
        if wp.static(law is not None):
            if wp.static(timed):
                nodes = wp.static(C)
                y.time = x.time + nodes[i] * wp.float64(h)
            w = law(Wrench(), look(View(), y, c, h), c.params)
            dp = dp + c.inertia.inverse_scale * w.force
            dpi = dpi + c.inertia.inverse_scale * w.torque
        renew(c, i, 0, active, rotate(y, nu))
        unity = ones(active)
        e = renew(c, i, 3, active, cross(y.R0, Om)) + renew(c, i, 6, active, cross(y.R1, Om))
        e = e + renew(c, i, 9, active, cross(y.R2, Om))
        e = e + renew(c, i, 12, active, dp) / (unity + dot(x.p, x.p))
        e = e + renew(c, i, 15, active, dpi) / (unity + dot(x.pi, x.pi))
        return (h * h) * e

    @wp.func
    def G(x: Any, c: Any, h: Any):
        """y <- y + h sum_i b_i K_i."""
        extrapolate(c, h)
        unity = ones(x.b.x)
        zero = unity - unity
        bound = (c.tolerance * c.tolerance) * unity
        active = unity
        e = unity
        n = int(0)
        while n < wp.static(rounds) and any_positive(active):
            e = zero
            for i in range(wp.static(s)):
                e = e + improve(x, c, h, i, active)
            if wp.static(adaptive):
                active = positive(active, e - bound, zero)
            n += 1
        if wp.static(checked):
            # Of lanes that are done the change is that of the last round that they were in: at most the tolerance.
            if wp.static(adaptive):
                e = positive(active, e, zero)
            code = positive(e - bound, h.dtype(wp.static(float(NOT_CONVERGED))) * unity, zero)
            x.alarm.size = positive(x.alarm.code, x.alarm.size, positive(code, e, zero))
            x.alarm.code = positive(x.alarm.code, x.alarm.code, code)
        weights = wp.static(B)
        for i in range(wp.static(s)):
            x = moved(x, c, i, h.dtype(weights[i]) * h)
        return x

    return G
