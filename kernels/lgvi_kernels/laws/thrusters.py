# SPDX-License-Identifier: Apache-2.0
"""Thrusters: quadratic thrust curve with dead band and saturation, after a first-order lag."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.scheduled import make_commanded

# Rows of one thruster: force and torque per newton (6), coefficient forward and backward, dead band, limit, 1 / lag.
ROWS = 11
LIMIT = 9


@functools.cache
def params(width, real):
    """Params: count of thrusters and of knots of their commands; first row of the table and of the memory.

    Rows: for each thruster ROWS numbers, then for each its table of commands over time (see view.table1).
    Memory: one row a thruster, its lagged command.
    """
    return struct("Thrusters", first=wp.int32, memory=wp.int32, count=wp.int32, knots=wp.int32, lagged=wp.int32)


schedule, commanded = make_commanded(ROWS, LIMIT)


@wp.func
def evolve(state: Any, view: Any, p: Any):
    """n' = (command - n) / time constant, exactly over half a kick, the command held at the middle of that half."""
    if p.lagged > 0:
        t = middle_of_half(view)
        half = view.h.dtype(0.5) * view.h
        for i in range(p.count):
            n = remembered(view, p.memory + i)
            u = commanded(view, p, i, t)
            rate = row1(view, p.first + wp.static(ROWS) * i + 10)
            remember(view, p.memory + i, u + exponential(-half * rate) * (n - u))
    return state


@wp.func
def lagged(n: Any, start: Any, end: Any, length: Any, rate: Any):
    """n' = rate (command - n) along a straight command: n less the command decays, and falls behind its slope."""
    x = length * rate
    return end + exponential(-x) * (n - start) - decay(x) * (end - start)


lagging = make_pursuit(lagged)


@wp.func
def lag_behind_command(state: Any, view: Any, p: Any):
    """n' = (command - n) / time constant, exactly, from view.h before to view.t."""
    if p.lagged > 0:
        for i in range(p.count):
            at = p.first + wp.static(ROWS) * i
            n = remembered(view, p.memory + i)
            n = lagging(view, n, schedule(p, i), p.knots, row1(view, at + 9), row1(view, at + 10))
            remember(view, p.memory + i, n)
    return state


follow = lag_behind_command


@wp.func
def place_of(view: Any, p: Any, i: int):
    """Where thruster i is."""
    n = ones(view.b.x) - ones(view.b.x)
    if p.lagged > 0:
        n = remembered(view, p.memory + i)
    else:
        n = commanded(view, p, i, view.t)
    return n


@wp.func
def law(w: Any, view: Any, p: Any):
    """Thrust = c+ max(n - band, 0)^2 - c- max(-n - band, 0)^2 along each thruster."""
    zero = ones(view.b.x) - ones(view.b.x)
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        n = place_of(view, p, i)
        band = row1(view, at + 8)
        ahead = greatest(n - band, zero)
        astern = greatest(-n - band, zero)
        thrust = row1(view, at + 6) * (ahead * ahead) - row1(view, at + 7) * (astern * astern)
        w.force = w.force + thrust * row3(view, at)
        w.torque = w.torque + thrust * row3(view, at + 3)
    return w
