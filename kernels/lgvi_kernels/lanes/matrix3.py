# SPDX-License-Identifier: Apache-2.0
"""3x3 matrices of a packet, kept as rows, and the 6x6 systems that are made of four of them."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, div, dot, mul, ones, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.state import matrix3_struct, struct


@functools.cache
def factor_struct(width, real):
    """A 6x6 matrix [[A, B], [C, D]], ready for solve6: A^-1, A^-1 B, C and (D - C A^-1 B)^-1."""
    Matrix3 = matrix3_struct(width, real)
    return struct("Factor", inverse=Matrix3, upper=Matrix3, lower=Matrix3, schur=Matrix3)


@wp.func
def apply(m: Any, v: Any):
    """m v."""
    return vec3(dot(m.row0, v), dot(m.row1, v), dot(m.row2, v))


@wp.func
def transpose_times(m: Any, v: Any):
    """m^T v."""
    return v.x * m.row0 + v.y * m.row1 + v.z * m.row2


@wp.func
def product(a: Any, b: Any):
    """a b."""
    row0 = transpose_times(b, a.row0)
    row1 = transpose_times(b, a.row1)
    row2 = transpose_times(b, a.row2)
    a.row0 = row0
    a.row1 = row1
    a.row2 = row2
    return a


@wp.func
def combine(a: Any, s: Any, b: Any):
    """a + s b, s one number of each vehicle."""
    a.row0 = a.row0 + s * b.row0
    a.row1 = a.row1 + s * b.row1
    a.row2 = a.row2 + s * b.row2
    return a


@wp.func
def plus(a: Any, b: Any):
    """a + b."""
    a.row0 = a.row0 + b.row0
    a.row1 = a.row1 + b.row1
    a.row2 = a.row2 + b.row2
    return a


@wp.func
def difference(a: Any, b: Any):
    """a - b."""
    a.row0 = a.row0 - b.row0
    a.row1 = a.row1 - b.row1
    a.row2 = a.row2 - b.row2
    return a


@wp.func
def symmetric(m: Any, s: Any):
    """A symmetric matrix (diagonal and off-diagonal 23, 31, 12) as rows, written into m."""
    d = s.diagonal
    o = s.off_diagonal
    m.row0 = vec3(d.x, o.z, o.y)
    m.row1 = vec3(o.z, d.y, o.x)
    m.row2 = vec3(o.y, o.x, d.z)
    return m


@wp.func
def transposed(m: Any):
    """m^T."""
    a = m.row0
    b = m.row1
    c = m.row2
    m.row0 = vec3(a.x, b.x, c.x)
    m.row1 = vec3(a.y, b.y, c.y)
    m.row2 = vec3(a.z, b.z, c.z)
    return m


@wp.func
def inverse(m: Any):
    """m^-1 by cofactors: the columns are cross products of the rows."""
    x = cross(m.row1, m.row2)
    y = cross(m.row2, m.row0)
    z = cross(m.row0, m.row1)
    r = ones(x.x) / dot(m.row0, x)
    m.row0 = r * vec3(x.x, y.x, z.x)
    m.row1 = r * vec3(x.y, y.y, z.y)
    m.row2 = r * vec3(x.z, y.z, z.z)
    return m


@wp.func
def factorise(f: Any, a: Any, b: Any, c: Any, d: Any):
    """Block elimination of [[a, b], [c, d]], without pivots: inertia plus damping is positive, so its blocks are regular."""
    f.inverse = inverse(a)
    f.upper = product(f.inverse, b)
    f.lower = c
    f.schur = inverse(difference(d, product(c, f.upper)))
    return f


@wp.func
def solve6(f: Any, force: Any, torque: Any):
    """(x, y) with [[a, b], [c, d]] (x; y) = (force; torque)."""
    x = apply(f.inverse, force)
    y = apply(f.schur, torque - apply(f.lower, x))
    return x - apply(f.upper, y), y
