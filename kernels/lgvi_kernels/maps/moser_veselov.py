# SPDX-License-Identifier: Apache-2.0
"""Equation (24) solved explicitly, after Moser & Veselov (1991), Commun. Math. Phys. 139, 217, without eigenvectors.

X = F Jd satisfies X^2 = hat(a) X + Jd^2, and det(mu^2 I - mu hat(a) - Jd^2) is a cubic in m = mu^2,
m^3 - s1 m^2 + s2 m - s3. Of the six mu the three with positive real part are the eigenvalues of X. Their symmetric functions
sigma1, sigma2 and sigma3 = det Jd give, with Cayley-Hamilton, X^3 - sigma1 X^2 + sigma2 X - sigma3 = 0,
[hat(a)^2 + Jd^2 - sigma1 hat(a) + sigma2 I] F = adj(Jd) + sigma1 Jd - hat(a) Jd: one linear system, regular near the sphere
and for plates, where the eigenvectors fail. F is a rotation to round-off only; the others' is one whatever their error is.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    absolute,
    add,
    cross,
    div,
    dot,
    least,
    mul,
    neg,
    ones,
    positive,
    sub,
    vec3,
)
from lgvi_kernels.lanes.functions import exponential, greatest, logarithm, root
from lgvi_kernels.lanes.rotations import solve3

# Newton steps for the cubic's outer root, from at most twice that: explicit up to this, which stands for the cosine of
# a third of an angle, or the hyperbolic one, whichever the discriminant asks for.
CUBIC_STEPS = 6
# Below every number that matters, and above the smallest of float32.
TINY = 1e-30


@wp.func
def half_trace_less(J: Any):
    """The diagonal of Jd = tr(J)/2 I - J."""
    half = J.x.dtype(0.5)
    return half * vec3(J.y + J.z - J.x, J.z + J.x - J.y, J.x + J.y - J.z)


@wp.func
def mv_coefficients(a: Any, J: Any):
    """(s1, s2, det Jd), s3 = (det Jd)^2. docs/theory/rotation.md, (R13)."""
    d = half_trace_less(J)
    w = d * d
    a2 = a * a
    s1 = w.x + w.y + w.z - (a2.x + a2.y + a2.z)
    s2 = w.x * w.y + w.y * w.z + w.z * w.x - dot(a2, w)
    return s1, s2, d.x * d.y * d.z


@wp.func
def outer_root(Q: Any, R: Any):
    """The root y > 0 of y^3 - 3 Q y - 2 R for R >= 0: convex there, so Newton's steps from above stay above."""
    unity = ones(Q)
    zero = unity - unity
    tiny = Q.dtype(wp.static(TINY)) * unity
    R2 = R + R
    Q3 = Q + Q + Q
    cube_root = exponential(Q.dtype(wp.static(1.0 / 3.0)) * logarithm(greatest(R2, tiny)))
    y = positive(Q, root(greatest(Q3, zero)) + cube_root, least(R2 / (tiny - Q3), cube_root))
    for _ in range(wp.static(CUBIC_STEPS)):
        y2 = y * y
        y = (Q.dtype(2.0) * (y * y2) + R2) / (Q.dtype(3.0) * y2 - Q3 + tiny)
    return y


@wp.func
def mv_explicit(a: Any, J: Any):
    """sigma1 = tr(F Jd) = sqrt(m1) + sqrt(m2 + m3 + 2 sqrt(m2 m3)), m1 the root farthest from the mean."""
    s1, s2, s = mv_coefficients(a, J)
    mean = s.dtype(wp.static(1.0 / 3.0)) * s1
    Q = mean * mean - s.dtype(wp.static(1.0 / 3.0)) * s2
    R = mean * (Q - s.dtype(wp.static(1.0 / 6.0)) * s2) + s.dtype(0.5) * (s * s)
    y = outer_root(Q, absolute(R))
    m = positive(R, mean + y, mean - y)
    # The larger of m1^2 and m2 m3 has kept its digits, and divides s3 for the other.
    rest = s1 - m
    pair = s2 - m * rest
    larger = m * m - pair
    kept = positive(larger, m, pair)
    regained = (s * s) / kept
    product = positive(larger, regained, kept)
    two = s.dtype(2.0)
    return root(positive(larger, m, regained)) + root(rest + two * root(product))


@wp.func
def mv_value(sigma: Any, a: Any, J: Any):
    """sigma2^2 - 2 sigma1 det Jd - s2 with sigma2 = (sigma1^2 - s1) / 2: zero for the right sigma1."""
    s1, s2, s = mv_coefficients(a, J)
    sigma2 = s.dtype(0.5) * (sigma * sigma - s1)
    return sigma2 * sigma2 - s2 - s.dtype(2.0) * (sigma * s)


@wp.func
def mv_newton(sigma: Any, value: Any, a: Any, J: Any):
    """A Newton step of sigma1, so that tolerance and iterations have the same meaning as for the other solvers."""
    s1, s2, s = mv_coefficients(a, J)
    return sigma - value / (sigma * (sigma * sigma - s1) - (s + s))


@wp.func
def mv_scale(J: Any):
    """(tr Jd)^4, which the terms of the value are of the size of."""
    t = J.x.dtype(0.5) * (J.x + J.y + J.z)
    t2 = t * t
    return t2 * t2


@wp.func
def mv_excess(value: Any, a: Any, J: Any, tolerance: Any):
    """Positive where the value exceeds the tolerance, relative to J and not to |a|."""
    return absolute(value) - tolerance * mv_scale(J)


@wp.func
def mv_residual2(value: Any, a: Any, J: Any):
    """Square of the relative value."""
    v = value / mv_scale(J)
    return v * v


@wp.func
def mv_rotation(F: Any, sigma: Any, a: Any, J: Any):
    """B (F - I) = adj(Jd) + sigma1 Jd - hat(a) Jd - B, B = hat(a)^2 + Jd^2 - sigma1 hat(a) + sigma2 I."""
    s1, s2, s = mv_coefficients(a, J)
    d = half_trace_less(J)
    a2 = a * a
    A = a2.x + a2.y + a2.z
    sigma2 = a.x.dtype(0.5) * (sigma * sigma - s1)
    k = sigma2 - A
    b = d * d + a2 + vec3(k, k, k)
    t = sigma * a
    xy = a.x * a.y
    yz = a.y * a.z
    zx = a.z * a.x
    r0 = vec3(b.x, xy + t.z, zx - t.y)
    r1 = vec3(xy - t.z, b.y, yz + t.x)
    r2 = vec3(zx + t.y, yz - t.x, b.z)
    n = vec3(d.y * d.z, d.z * d.x, d.x * d.y) + sigma * d - b
    u = vec3(sigma, sigma, sigma) - d
    # The columns: hat(a) (sigma1 I - Jd) - a a^T off the diagonal.
    c0 = solve3(r0, r1, r2, vec3(n.x, a.z * u.x - xy, -(a.y * u.x) - zx))
    c1 = solve3(r0, r1, r2, vec3(-(a.z * u.y) - xy, n.y, a.x * u.y - yz))
    c2 = solve3(r0, r1, r2, vec3(a.y * u.z - zx, -(a.x * u.z) - yz, n.z))
    F.row0 = vec3(c0.x, c1.x, c2.x)
    F.row1 = vec3(c0.y, c1.y, c2.y)
    F.row2 = vec3(c0.z, c1.z, c2.z)
    return F
