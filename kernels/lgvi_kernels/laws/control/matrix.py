"""Allocation by a matrix: each command is a sum of the demand's components."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import add, clamp, dot, mul, neg, ones, positive, remember, row1, row3, struct, sub  # noqa: F401
from lgvi_kernels.laws.control.lost import since

# Rows of one command: what of X Y Z and of K M N it takes (6), what a unit of it delivers (6), limit, and the time from which it
# is known to be lost.
ROWS = 14


@functools.cache
def params(width, real):
    """Params: first row of the table; first row of the commands; count."""
    return struct("Matrix", first=wp.int32, commands=wp.int32, count=wp.int32)


@functools.cache
def made(features):
    """The allocation; of the features "all" and "lost" the latter says that channels may be known to be lost."""
    loses = "lost" in features

    @wp.func
    def allocate_by_matrix(w: Any, y: Any, p: Any):
        """u = A w within the limits; what is left of w is w - A^+ u."""
        demand = w.force
        moment = w.torque
        for i in range(p.count):
            at = p.first + wp.static(ROWS) * i
            most = row1(y, at + 12)
            u = clamp(dot(row3(y, at), demand) + dot(row3(y, at + 3), moment), -most, most)
            if wp.static(loses):
                u = positive(since(y, row1(y, at + 13)), u - u, u)
            remember(y, p.commands + i, u)
            w.force = w.force - u * row3(y, at + 6)
            w.torque = w.torque - u * row3(y, at + 9)
        return w

    return device(__name__, features, params=params, allocate=allocate_by_matrix)
