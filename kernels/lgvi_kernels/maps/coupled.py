# SPDX-License-Identifier: Apache-2.0
"""The coupled Moser-Veselov rotation W: the free motion of 1/2 (pi - S p).Js^-1 (pi - S p), S symmetric, Js diagonal.

With Jd = tr(Js)/2 I - Js and Sd = tr(S)/2 I - S, F solves  vee(F Jd - Jd F^T) + h (tr(F Sd) I - F Sd) p = h pi. For S = 0
it is equation (24). The unknown is c with F = cay(c): [diag(D - s) - hat(k)] c = al, where P = h p, a = h pi - S P,
D = 2 Js, r = 2 c.S c / (1 + c.c), al = a + r P, k = al - 2 Sd P, s = al.c.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    add,
    any_positive,
    cross,
    div,
    dot,
    mul,
    neg,
    ones,
    positive,
    sub,
    vec3,
)
from lgvi_kernels.lanes.rotations import rodrigues, solve3
from lgvi_kernels.lanes.sums import moved, turned, twisted
from lgvi_kernels.maps.solve import NOT_CONVERGED

# Newton's method doubles the digits in each step: an iteration that has not settled after so many will not.
MOST_ITERATIONS = 12
# A residual may stagnate at round-off above the tolerance: more than this times it is no solution.
STAGNATION = 100.0


@wp.func
def turning(c: Any, S: Any):
    """r = 2 c.S c / (1 + c.c). docs/theory/coupled.md, (X15)."""
    q = dot(c, S * c)
    return (q + q) / (ones(q) + dot(c, c))


@wp.func
def trace_less(S: Any, v: Any):
    """Sd v = tr(S)/2 v - S v."""
    half = v.x.dtype(0.5) * (S.diagonal.x + S.diagonal.y + S.diagonal.z)
    return half * v - S * v


@wp.func
def w_guess(a: Any, P: Any, J: Any, S: Any, sg: Any):
    """r from c = a / D, then s from the linear part of its quartic, then c. docs/theory/coupled.md, (X16)."""
    D = J + J
    DD = vec3(D.y * D.z, D.z * D.x, D.x * D.y)
    al = a + turning(a / D, S) * P
    k = al - sg - sg
    ka = dot(k, al)
    k2 = k * k
    a2 = al * al
    sums = vec3(D.y + D.z, D.z + D.x, D.x + D.y)
    s = (dot(a2, DD) + ka * ka) / (D.x * DD.x + dot(k2, D) + dot(a2, sums))
    b = D - vec3(s, s, s)
    bb = vec3(b.y * b.z, b.z * b.x, b.x * b.y)
    return (ones(s) / (b.x * bb.x + dot(k2, b))) * (bb * al + ka * k + cross(b * k, al))


@wp.func
def w_value(c: Any, a: Any, P: Any, J: Any, S: Any, sg: Any):
    """rho = al - (D - s) c + k x c. docs/theory/coupled.md, (X15)."""
    al = a + turning(c, S) * P
    return al - (J + J) * c + dot(al, c) * c + cross(al - sg - sg, c)


@wp.func
def w_newton(c: Any, value: Any, a: Any, P: Any, J: Any, S: Any, sg: Any):
    """c + [diag(D - s) - hat(k) - c al^T - w g^T]^-1 rho, w = P + P x c + (P.c) c, g = 2/(1 + c.c) (2 S c - r c)."""
    r = turning(c, S)
    al = a + r * P
    k = al - sg - sg
    s = dot(al, c)
    w = P + cross(P, c) + dot(P, c) * c
    Sc = S * c
    g = ((ones(s) + ones(s)) / (ones(s) + dot(c, c))) * (Sc + Sc - r * c)
    d = J + J - vec3(s, s, s)
    m0 = c.x * al + w.x * g
    m1 = c.y * al + w.y * g
    m2 = c.z * al + w.z * g
    r0 = vec3(d.x - m0.x, k.z - m0.y, -k.y - m0.z)
    r1 = vec3(-k.z - m1.x, d.y - m1.y, k.x - m1.z)
    r2 = vec3(k.y - m2.x, -k.x - m2.y, d.z - m2.z)
    return c + solve3(r0, r1, r2, value)


def make_W(Rotation, rotate, iterations, adaptive, checked):
    """W with a fixed number of Newton steps, or iterated to the tolerance in the lanes that need it (see solve.py).

    docs/theory/coupled.md, (X13), (X14).
    """

    @wp.func
    def parameter(alarm: Any, a: Any, P: Any, J: Any, S: Any, tolerance: Any):
        """(c, alarm): F = cay(c)."""
        # Sd P, which no step changes.
        sg = trace_less(S, P)
        c = w_guess(a, P, J, S, sg)
        for _ in range(wp.static(iterations)):
            c = w_newton(c, w_value(c, a, P, J, S, sg), a, P, J, S, sg)
        if wp.static(adaptive or checked):
            bound = tolerance * tolerance
            v = w_value(c, a, P, J, S, sg)
            e = dot(v, v) - bound * dot(a, a)
            if wp.static(adaptive):
                n = int(0)
                while n < wp.static(MOST_ITERATIONS) and any_positive(e):
                    c = positive(e, w_newton(c, v, a, P, J, S, sg), c)
                    v = w_value(c, a, P, J, S, sg)
                    e = dot(v, v) - bound * dot(a, a)
                    n += 1
                e = dot(v, v) - tolerance.dtype(wp.static(STAGNATION**2)) * (bound * dot(a, a))
            if wp.static(checked):
                zero = ones(e) - ones(e)
                code = positive(e, tolerance.dtype(wp.static(float(NOT_CONVERGED))) * ones(e), zero)
                size = positive(e, dot(v, v) / dot(a, a), zero)
                alarm.size = positive(alarm.code, alarm.size, size)
                alarm.code = positive(alarm.code, alarm.code, code)
        return c, alarm

    @wp.func
    def W(x: Any, c: Any, h: Any):
        """Y = -vee(F Sd - Sd F^T); b += R Y, pi -= Y x p; then R <- R F, p <- F^T p, pi <- F^T pi."""
        S = c.inertia.S
        P = h * x.p
        u, alarm = parameter(x.alarm, h * x.pi - S * P, P, c.inertia.J, S, c.tolerance)
        x.alarm = alarm
        beta = (ones(u.x) + ones(u.x)) / (ones(u.x) + dot(u, u))
        F = rodrigues(Rotation(), u, beta, beta)
        m0 = trace_less(S, F.row0)
        m1 = trace_less(S, F.row1)
        m2 = trace_less(S, F.row2)
        Y = vec3(m1.z - m2.y, m2.x - m0.z, m0.y - m1.x)
        x = moved(x, rotate(x, Y))
        x = twisted(x, cross(x.p, Y))
        return turned(x, F)

    return W
