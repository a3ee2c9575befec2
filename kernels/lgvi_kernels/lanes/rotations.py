# SPDX-License-Identifier: Apache-2.0
"""Rotations close to the identity, and systems of three equations."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, div, dot, lane3, mul, neg, ones, sub, vec3  # noqa: F401


@functools.cache
def rotation_struct(width, real):
    """A rotation F of each vehicle, kept as the rows of F - I.

    F - I is of the size of the step, so its rounding errors are too: applying F rounds a vector once, not three times.
    """
    Lane3 = lane3(width, real)

    @wp.struct
    class Rotation:
        row0: Lane3
        row1: Lane3
        row2: Lane3

    return Rotation


@wp.func
def transpose_apply(F: Any, v: Any):
    """F^T v, which is also the row vector v^T F."""
    return v + v.x * F.row0 + v.y * F.row1 + v.z * F.row2


@wp.func
def rodrigues(F: Any, v: Any, alpha: Any, beta: Any):
    """F = I + alpha hat(v) + beta hat(v)^2, where hat(v)^2 = v v^T - (v.v) I."""
    m = beta * v
    w = alpha * v
    xx = v.x * m.x
    yy = v.y * m.y
    zz = v.z * m.z
    xy = v.x * m.y
    xz = v.x * m.z
    yz = v.y * m.z
    F.row0 = vec3(-(yy + zz), xy - w.z, xz + w.y)
    F.row1 = vec3(xy + w.z, -(zz + xx), yz - w.x)
    F.row2 = vec3(xz - w.y, yz + w.x, -(xx + yy))
    return F


@wp.func
def solve3(r0: Any, r1: Any, r2: Any, v: Any):
    """x with A x = v, for the 3x3 matrix A with rows r0, r1, r2 (Cramer's rule)."""
    c0 = cross(r1, r2)
    return (ones(v.x) / dot(r0, c0)) * (v.x * c0 + v.y * cross(r2, r0) + v.z * cross(r0, r1))
