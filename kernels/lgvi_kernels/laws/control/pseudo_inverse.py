"""Allocation by a weighted pseudo-inverse: the efforts of least weighted squares that make the demand, as commands."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import (  # noqa: F401
    absolute,
    add,
    clamp,
    div,
    dot,
    greatest,
    least,
    mul,
    neg,
    ones,
    positive,
    remember,
    root,
    row1,
    row3,
    struct,
    sub,
)

# Rows of one channel: its line of the pseudo-inverse (6), the wrench of a unit of effort (6), limit of the command, coefficient
# ahead and astern, dead band. Effort is thrust, force or angle; command = effort / coefficient, or the inverse of the thrust
# curve where `square`.
ROWS = 16


@functools.cache
def params(width, real):
    """Params: first row of the table; first row of the commands; count; square: whether effort goes as the command squared."""
    return struct("PseudoInverse", first=wp.int32, commands=wp.int32, count=wp.int32, square=wp.int32)


@wp.func
def allocate(w: Any, y: Any, p: Any):
    """t = W^-1 B^T (B W^-1 B^T)^+ w; what is left of w is w - B t, t within what the limits allow."""
    demand = w.force
    moment = w.torque
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        most = row1(y, at + 12)
        effort = dot(row3(y, at), demand) + dot(row3(y, at + 3), moment)
        c = positive(effort, row1(y, at + 13), row1(y, at + 14))
        u = effort / c
        if p.square > 0:
            zero = ones(c) - ones(c)
            size = root(absolute(effort) / c)
            band = row1(y, at + 15)
            size = least(positive(size, size + band, zero), most)
            u = positive(effort, size, -size)
            over = greatest(size - band, zero)
            delivered = c * (over * over)
            effort = positive(u, delivered, -delivered)
        else:
            u = clamp(u, -most, most)
            effort = u * c
        remember(y, p.commands + i, u)
        w.force = w.force - effort * row3(y, at + 6)
        w.torque = w.torque - effort * row3(y, at + 9)
    return w
