"""Allocation by a matrix: each command is a sum of the demand's components."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import add, clamp, dot, mul, neg, ones, remember, row1, row3, struct, sub  # noqa: F401

# Rows of one command: what of X Y Z and of K M N it takes (6), what a unit of it delivers (6), limit.
ROWS = 13


@functools.cache
def params(width, real):
    """Params: first row of the table; first row of the commands; count."""
    return struct("Matrix", first=wp.int32, commands=wp.int32, count=wp.int32)


@wp.func
def allocate(w: Any, y: Any, p: Any):
    """u = A w within the limits; what is left of w is w - A^+ u."""
    demand = w.force
    moment = w.torque
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        most = row1(y, at + 12)
        u = clamp(dot(row3(y, at), demand) + dot(row3(y, at + 3), moment), -most, most)
        remember(y, p.commands + i, u)
        w.force = w.force - u * row3(y, at + 6)
        w.torque = w.torque - u * row3(y, at + 9)
    return w
