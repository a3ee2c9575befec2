"""Control fins: fins that turn about their span to a command, within a limit and no faster than a rate."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lane_math import clamp, cosine, sine
from lgvi_kernels.lanes import add, mul, neg, ones, sub  # noqa: F401
from lgvi_kernels.state import struct
from lgvi_kernels.terms.fins import add_fin, speed_along
from lgvi_kernels.view import row1, table1

# Rows of one fin: those of fins.ROWS, limit, and limit of the rate.
ROWS = 17


@functools.cache
def params(width, real):
    """Params: count of fins and of knots of their commands; first row of the table and of the memory.

    Rows: for each fin ROWS numbers, then for each its table of commands over time (see view.table1).
    Memory: one row a fin, its deflection; none unless `limited`.
    """
    return struct("ControlFins", first=wp.int32, memory=wp.int32, count=wp.int32, knots=wp.int32, limited=wp.int32)


@wp.func
def commanded(view: Any, p: Any, i: int, t: Any):
    """The command of fin i at time t, within its limit."""
    first = p.first + wp.static(ROWS) * p.count + i * (1 + 3 * p.knots)
    limit = row1(view, p.first + wp.static(ROWS) * i + 15)
    return clamp(table1(view, first, p.knots, t), -limit, limit)


@wp.func
def evolve(state: Any, view: Any, p: Any):
    """|deflection'| <= rate: towards the command over half a kick, the command that of the middle of that half."""
    if p.limited > 0:
        quarter = view.h.dtype(0.25) * view.h
        t = view.t - quarter
        if view.second > 0:
            t = view.t + quarter
        for i in range(p.count):
            angle = view.memory[view.packet, p.memory + i] * view.h.dtype(1.0)
            change = commanded(view, p, i, t * ones(angle)) - angle
            most = (quarter + quarter) * row1(view, p.first + wp.static(ROWS) * i + 16)
            view.memory[view.packet, p.memory + i] = angle + clamp(change, -most, most)
    return state


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = sum over fins, each seen from its turned axes c' = cos c + sin n, n' = cos n - sin c."""
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        angle = ones(view.b.x) - ones(view.b.x)
        if p.limited > 0:
            angle = view.memory[view.packet, p.memory + i] * view.h.dtype(1.0)
        else:
            angle = commanded(view, p, i, view.t * ones(angle))
        c = cosine(angle)
        s = sine(angle)
        along = speed_along(view, at)
        across = speed_along(view, at + 6)
        D = add_fin(D, view, at, c * along + s * across, c * across - s * along)
    return D
