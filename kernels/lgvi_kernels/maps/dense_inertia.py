# SPDX-License-Identifier: Apache-2.0
"""Velocities from momenta in the user's axes, (nu; Om) = I6^-1 (p; pi), of which only entries that are not zero make code."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, mul, ones, sub, vec3  # noqa: F401


def make_partial_dot(columns):
    """(total, a, b) -> total + a.b, of which the other columns are zero."""

    @wp.func
    def partial_dot(total: Any, a: Any, b: Any):
        if wp.static(0 in columns):
            total = total + a.x * b.x
        if wp.static(1 in columns):
            total = total + a.y * b.y
        if wp.static(2 in columns):
            total = total + a.z * b.z
        return total

    return partial_dot


def make_dense_velocities(entries):
    """(inertia, p, pi) -> (nu, Om); entries: (i, j) of the 6x6 matrix I6^-1 that are not zero."""

    def row(i, first):
        return make_partial_dot(frozenset(j - first for k, j in entries if k == i and first <= j < first + 3))

    ap, bp, cp, dp, ep, fp = (row(i, 0) for i in range(6))
    ao, bo, co, do, eo, fo = (row(i, 3) for i in range(6))

    @wp.func
    def dense_velocities(inertia: Any, p: Any, pi: Any):
        zero = ones(p.x) - ones(p.x)
        A = inertia.inverse_mass
        B = inertia.inverse_coupling
        C = inertia.inverse_inertia
        # Om has the transpose of B.
        B0 = vec3(B.row0.x, B.row1.x, B.row2.x)
        B1 = vec3(B.row0.y, B.row1.y, B.row2.y)
        B2 = vec3(B.row0.z, B.row1.z, B.row2.z)
        nu = vec3(
            ao(ap(zero, A.row0, p), B.row0, pi),
            bo(bp(zero, A.row1, p), B.row1, pi),
            co(cp(zero, A.row2, p), B.row2, pi),
        )
        Om = vec3(do(dp(zero, B0, p), C.row0, pi), eo(ep(zero, B1, p), C.row1, pi), fo(fp(zero, B2, p), C.row2, pi))
        return nu, Om

    return dense_velocities
