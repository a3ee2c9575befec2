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
from lgvi_kernels.laws.control.rest import ROWS as rest_rows
from lgvi_kernels.laws.control.rest import rest

# Rows of rest.py, then of one channel: its line of the pseudo-inverse (6), the wrench of a unit of effort (6), limit of the
# command, coefficient ahead and astern, dead band. Effort is thrust, force or angle; command = effort / coefficient, or the
# inverse of the thrust curve where `square`.
ROWS = 16
REST = rest_rows


@functools.cache
def params(width, real):
    """Params: first row of the table; first row of the commands; count; square: whether effort goes as the command squared."""
    return struct("PseudoInverse", first=wp.int32, commands=wp.int32, count=wp.int32, square=wp.int32)


@wp.func
def allocate(w: Any, y: Any, p: Any):
    """t = W^-1 B^T (B W^-1 B^T)^+ w; left of w are (I - B B^+) w and B times what the limits cut off of t."""
    left = rest(w, y, p.first)
    for i in range(p.count):
        at = p.first + wp.static(REST) + wp.static(ROWS) * i
        most = row1(y, at + 12)
        effort = dot(row3(y, at), w.force) + dot(row3(y, at + 3), w.torque)
        c = positive(effort, row1(y, at + 13), row1(y, at + 14))
        u = effort / c
        zero = ones(c) - ones(c)
        if p.square > 0:
            size = root(absolute(effort) / c)
            band = row1(y, at + 15)
            size = positive(size, size + band, zero)
            u = positive(effort, size, -size)
        size = absolute(u)
        u = clamp(u, -most, most)
        delivered = u * c
        if p.square > 0:
            over = greatest(most - row1(y, at + 15), zero)
            delivered = positive(effort, c * (over * over), -(c * (over * over)))
        cut = positive(size - most, effort - delivered, zero)
        remember(y, p.commands + i, u)
        left.force = left.force + cut * row3(y, at + 6)
        left.torque = left.torque + cut * row3(y, at + 9)
    return left
