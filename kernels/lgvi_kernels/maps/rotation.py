# SPDX-License-Identifier: Apache-2.0
"""Equation (24), Nordkvist & Sanyal 2010: the rotation F nearest to I with F Jd - Jd F^T = hat(a).

Jd = tr(J)/2 I - J with J diagonal (principal axes). a and J may share any common factor: the host divides both by max J,
which keeps the fourth powers of the quartic within the range of float32.

A solver describes F by a parameter (a number or a vector) and is a handful of functions of it: the start value, the value
of its equation, a Newton step, the excess of the residual over a tolerance, and the rotation that the parameter stands for.
solve.py puts them together.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import absolute, add, cross, div, dot, least, mul, neg, ones, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.rotations import rodrigues, solve3


@wp.func
def reach(a: Any, J: Any):
    """|J^-1 a|^2: where it is below 1, a rotation F exists; for a on a principal axis it exists only there.

    docs/theory/rotation.md, (R12).
    """
    return dot(a * a, inverse_square(J))


@wp.func
def inverse_square(J: Any):
    """1 / J^2, constant over the steps."""
    return vec3(ones(J.x) / (J.x * J.x), ones(J.y) / (J.y * J.y), ones(J.z) / (J.z * J.z))


# --- quartic: the scalar reduction. s = a.c is the smallest root of
#     q(s) = s^4 - d1 s^3 + (d2 + 2A) s^2 - (d3 + d1 A) s + e + A^2, and F = cay(c), c = n / det.


@wp.func
def quartic_coefficients(a: Any, J: Any):
    """(e + A^2, d3 + d1 A, d2 + 2A, d1), the coefficients of q from the constant one up.

    docs/theory/rotation.md, (R8).
    """
    # Each function below asks for them anew: once inlined, the compiler computes them once.
    D = J + J
    DD = vec3(D.y * D.z, D.z * D.x, D.x * D.y)
    a2 = a * a
    A = a2.x + a2.y + a2.z
    d1 = D.x + D.y + D.z
    return dot(a2, DD) + A * A, D.x * DD.x + d1 * A, DD.x + DD.y + DD.z + A + A, d1


@wp.func
def quartic_linear(a: Any, J: Any):
    """The root of q's linear part: from here every Newton step stays on the near side of the root.

    docs/theory/rotation.md, (R9).
    """
    q0, q1, q2, d1 = quartic_coefficients(a, J)
    return q0 / q1


@wp.func
def quartic_series(a: Any, J: Any):
    """The root's series in x = q0 / q1 to third order, x (1 + q2 x / q1 + ...), as one rational function.

    docs/theory/rotation.md, (R10).

    x ((1 - e - f) / (1 - 2 e)) with e = q2 x / q1 < 0.4 for |J^-1 a| < 1 and f = d1 x^2 / q1. One division, like the
    linear part alone, and at |J^-1 a| = 0.01 already exact to round-off.
    """
    q0, q1, q2, d1 = quartic_coefficients(a, J)
    q11 = q1 * q1
    q02 = q0 * q2
    return (q0 * (q1 * (q11 - q02) - d1 * (q0 * q0))) / (q11 * (q11 - q02 - q02))


@wp.func
def quartic_value(s: Any, a: Any, J: Any):
    """q(s). By (a.c - s) c = G(c) it is also the residual of equation (24): |G| = |q| |c| / det.

    docs/theory/rotation.md, (R8).
    """
    q0, q1, q2, d1 = quartic_coefficients(a, J)
    return (((s - d1) * s + q2) * s - q1) * s + q0


@wp.func
def quartic_newton(s: Any, value: Any, a: Any, J: Any):
    """s - q(s) / q'(s). docs/theory/rotation.md, (R9)."""
    q0, q1, q2, d1 = quartic_coefficients(a, J)
    return s - value / (((s.dtype(4.0) * s - s.dtype(3.0) * d1) * s + q2 + q2) * s - q1)


@wp.func
def quartic_scale(J: Any):
    """det |a| / |c|, nearly: det ~ 8 J1 J2 J3 and |c| < |a| / (2 J_min). A bound, constant over the steps."""
    shortest = least(J.x, least(J.y, J.z))
    return shortest.dtype(16.0) * (J.x * J.y * J.z * shortest)


@wp.func
def quartic_excess(value: Any, a: Any, J: Any, tolerance: Any):
    """Positive where the relative residual exceeds the tolerance."""
    return absolute(value) - tolerance * quartic_scale(J)


@wp.func
def quartic_residual2(value: Any, a: Any, J: Any):
    """Square of the relative residual |G| / |a|."""
    r = value / quartic_scale(J)
    return r * r


@wp.func
def quartic_rotation(F: Any, s: Any, a: Any, J: Any):
    """c = n / det, F = I + 2/(det^2 + n.n) (det hat(n) + hat(n)^2): orthogonal whatever s is.

    docs/theory/rotation.md, (R7), (R11).
    """
    a2 = a * a
    A = a2.x + a2.y + a2.z
    b = J + J - vec3(s, s, s)
    bb = vec3(b.y * b.z, b.z * b.x, b.x * b.y)
    n = (bb + vec3(A, A, A)) * a + cross(b * a, a)
    det = b.x * bb.x + dot(a2, b)
    beta = (ones(s) + ones(s)) / (det * det + dot(n, n))
    return rodrigues(F, n, det * beta, beta)


# --- cayley: F = I + 2/(1 + c.c) (hat(c) + hat(c)^2), G(c) = a + a x c + c (a.c) - 2 J c = 0.


@wp.func
def cayley_start(a: Any, J: Any):
    """The root of G's linear part in c."""
    return a / (J + J)


@wp.func
def cayley_value(c: Any, a: Any, J: Any):
    """G(c). docs/theory/rotation.md, (R5)."""
    return a + cross(a, c) + dot(a, c) * c - (J + J) * c


@wp.func
def cayley_newton(c: Any, value: Any, a: Any, J: Any):
    """c - dG^-1 G, dG = hat(a) + (a.c) I + c a^T - 2 J. docs/theory/rotation.md, (R6)."""
    s = dot(a, c)
    d = vec3(s, s, s) - J - J
    m0 = c.x * a
    m1 = c.y * a
    m2 = c.z * a
    r0 = vec3(m0.x + d.x, m0.y - a.z, m0.z + a.y)
    r1 = vec3(m1.x + a.z, m1.y + d.y, m1.z - a.x)
    r2 = vec3(m2.x - a.y, m2.y + a.x, m2.z + d.z)
    return c - solve3(r0, r1, r2, value)


@wp.func
def cayley_rotation(F: Any, c: Any, a: Any, J: Any):
    """F = cay(c). docs/theory/rotation.md, (R4)."""
    beta = (ones(c.x) + ones(c.x)) / (ones(c.x) + dot(c, c))
    return rodrigues(F, c, beta, beta)


# --- newton, as the paper: F = exp(hat(f)), a = sin|f|/|f| J f + (1 - cos|f|)/|f|^2 f x J f.


@wp.func
def sinc_series(x: Any):
    """alpha = sin|f|/|f|, beta = (1 - cos|f|)/|f|^2 and their derivatives by x = |f|^2.

    The step angle of a solvable equation (24) is below 1.6 rad: twelve Taylor terms are exact to round-off there, need
    no case for f = 0 and no call that would leave the SIMD lanes.
    """
    alpha = ones(x)
    beta = ones(x)
    dalpha = alpha - alpha
    dbeta = dalpha
    for i in range(11):
        n = 11 - i
        ka = x.dtype(1.0) / x.dtype(2 * n * (2 * n + 1))
        kb = x.dtype(1.0) / x.dtype((2 * n + 1) * (2 * n + 2))
        dalpha = -ka * (alpha + x * dalpha)
        dbeta = -kb * (beta + x * dbeta)
        alpha = ones(x) - ka * (x * alpha)
        beta = ones(x) - kb * (x * beta)
    half = x.dtype(0.5)
    return alpha, half * beta, dalpha, half * dbeta


@wp.func
def newton_start(a: Any, J: Any):
    """f = J^-1 a, the rate times the step."""
    return a / J


@wp.func
def newton_value(f: Any, a: Any, J: Any):
    """Section III-G: sin|f|/|f| J f + (1 - cos|f|)/|f|^2 f x J f - a. docs/theory/rotation.md, (R2)."""
    alpha, beta, dalpha, dbeta = sinc_series(dot(f, f))
    Jf = J * f
    return alpha * Jf + beta * cross(f, Jf) - a


@wp.func
def newton_newton(f: Any, value: Any, a: Any, J: Any):
    """f - (differential)^-1 value; the differential as printed in III-G. docs/theory/rotation.md, (R3)."""
    alpha, beta, dalpha, dbeta = sinc_series(dot(f, f))
    Jf = J * f
    k = (dalpha + dalpha) * Jf + (dbeta + dbeta) * cross(f, Jf)
    d = alpha * J
    # The rows of k f^T + alpha J + beta (hat(f) J - hat(J f)).
    r0 = vec3(k.x * f.x + d.x, k.x * f.y + beta * (Jf.z - f.z * J.y), k.x * f.z + beta * (f.y * J.z - Jf.y))
    r1 = vec3(k.y * f.x + beta * (f.z * J.x - Jf.z), k.y * f.y + d.y, k.y * f.z + beta * (Jf.x - f.x * J.z))
    r2 = vec3(k.z * f.x + beta * (Jf.y - f.y * J.x), k.z * f.y + beta * (f.x * J.y - Jf.x), k.z * f.z + d.z)
    return f - solve3(r0, r1, r2, value)


@wp.func
def newton_rotation(F: Any, f: Any, a: Any, J: Any):
    """Rodrigues' formula, section III-G. docs/theory/rotation.md, (R1)."""
    alpha, beta, dalpha, dbeta = sinc_series(dot(f, f))
    return rodrigues(F, f, alpha, beta)


@wp.func
def vector_excess(value: Any, a: Any, J: Any, tolerance: Any):
    """Positive where the residual vector is longer than tolerance |a|."""
    return dot(value, value) - (tolerance * tolerance) * dot(a, a)


@wp.func
def vector_residual2(value: Any, a: Any, J: Any):
    """Square of the relative residual."""
    return dot(value, value) / dot(a, a)
