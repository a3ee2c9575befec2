"""Allocation by a matrix: each command is a sum of the demand's components."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import add, clamp, dot, mul, neg, ones, remember, row1, row3, struct, sub  # noqa: F401
from lgvi_kernels.laws.control.rest import ROWS as rest_rows
from lgvi_kernels.laws.control.rest import rest

# Rows of rest.py, then of one command: what of X Y Z and of K M N it takes (6), what a unit of it delivers (6), limit.
ROWS = 13
REST = rest_rows


@functools.cache
def params(width, real):
    """Params: first row of the table; first row of the commands; count."""
    return struct("Matrix", first=wp.int32, commands=wp.int32, count=wp.int32)


@wp.func
def allocate(w: Any, y: Any, p: Any):
    """u = A w within the limits; left of w are (I - A^+ A) w and A^+ of what the limits cut off."""
    left = rest(w, y, p.first)
    for i in range(p.count):
        at = p.first + wp.static(REST) + wp.static(ROWS) * i
        most = row1(y, at + 12)
        wanted = dot(row3(y, at), w.force) + dot(row3(y, at + 3), w.torque)
        u = clamp(wanted, -most, most)
        remember(y, p.commands + i, u)
        left.force = left.force + (wanted - u) * row3(y, at + 6)
        left.torque = left.torque + (wanted - u) * row3(y, at + 9)
    return left
