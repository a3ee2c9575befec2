# SPDX-License-Identifier: Apache-2.0
"""The parts A and B of a splitting for potentials U_b(b) + U_R(R): both are flows, A to order 8.

A: pi.J^-1 pi / 2 + U_b(b), the free rotation and p <- p + h f. B: p.M^-1 p / 2 + U_R(R), T and pi <- pi + h m.
The free rotation is equation (24) with a modified inertia J~, J~^-1 = (1 + s) J^-1 + d I, s and d polynomials in
N = |h pi|^2 / 2 and H = h pi.J^-1 h pi / 2, which it conserves (Hairer & Vilmart 2006, J. Phys. A 39, 13225).
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, dot, least, mul, ones, positive, vec3  # noqa: F401
from lgvi_kernels.lanes.rotations import transpose_apply
from lgvi_kernels.maps.submaps import look

# A spin by theta about a principal axis has J~^-1 h pi = sin(theta): past a quarter turn (24) yields another angle.
REACH = (2.0 / wp.PI) ** 2


@wp.func
def series(k: Any, N: Any, H: Any):
    """s or d of order 8, from the coefficients of N, H; N^2, N H, H^2; N^3, N^2 H, N H^2, H^3."""
    third = ((k.c6 * N + k.c7 * H) * N + k.c8 * (H * H)) * N + k.c9 * (H * H * H)
    second = (k.c3 * N + k.c4 * H) * N + k.c5 * (H * H)
    return k.c1 * N + k.c2 * H + second + third


@wp.func
def modified(a: Any, inertia: Any):
    """(k a, k J~, reach^2) for a = h pi. Of J~ only the ratio to a counts: the factor k = det J~^-1 saves three divisions.

    reach is |J^-1 a| in quarter turns, and 1 where J~ has lost its sign.
    """
    half = a.x.dtype(0.5)
    w = inertia.inverse_J * a
    N = half * dot(a, a)
    H = half * dot(a, w)
    unity = ones(N)
    s = unity + series(inertia.shrink, N, H)
    d = series(inertia.shift, N, H)
    i = s * inertia.inverse_J + vec3(d, d, d)
    J = vec3(i.y * i.z, i.z * i.x, i.x * i.y)
    far = a.x.dtype(wp.static(REACH)) * dot(w, w)
    return (i.x * J.x) * a, J, positive(least(i.x, least(i.y, i.z)), far, unity + far)


def make_A(Rotation, solve_within, View, Wrench, law):
    """A. solve_within: see make_solve; law: of all forces, or None."""

    @wp.func
    def A(x: Any, c: Any, h: Any):
        """F = S~(h pi), R <- R F, p <- F^T p, pi <- F^T pi; then p <- p + h f(b, R)."""
        a, J, far = modified(h * x.pi, c.inertia)
        F, alarm = solve_within(Rotation(), x.alarm, a, J, far, c.tolerance)
        x.alarm = alarm
        x.p = transpose_apply(F, x.p)
        x.pi = transpose_apply(F, x.pi)
        x.R0 = transpose_apply(F, x.R0)
        x.R1 = transpose_apply(F, x.R1)
        x.R2 = transpose_apply(F, x.R2)
        if wp.static(law is not None):
            w = law(Wrench(), look(View(), x, c, h), c.params)
            x.p = x.p + (h * c.inertia.inverse_scale) * w.force
        return x

    return A


def make_B(drift, View, Wrench, law):
    """B. drift: T, or Ab for M = m I; law: of all torques, or None."""

    @wp.func
    def B(x: Any, c: Any, h: Any):
        """b <- b + h R nu, pi <- pi + h p x nu + h m(b, R)."""
        x = drift(x, c, h)
        if wp.static(law is not None):
            w = law(Wrench(), look(View(), x, c, h), c.params)
            x.pi = x.pi + (h * c.inertia.inverse_scale) * w.torque
        return x

    return B
