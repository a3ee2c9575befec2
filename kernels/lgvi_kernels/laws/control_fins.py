# SPDX-License-Identifier: Apache-2.0
"""Control fins: fins that turn about their span to a command, within a limit and no faster than a rate."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws import fins
from lgvi_kernels.laws.fins import add_fins, lift_and_drag, note_lift_and_drag, push_fin, speed_along
from lgvi_kernels.laws.scheduled import make_commanded

# Rows of one fin: those of fins.ROWS, limit, and limit of the rate.
LIMIT = fins.ROWS
RATE = fins.ROWS + 1
ROWS = fins.ROWS + 2


# Count of fins and of knots of their commands; first row of the table and of the memory.
# Rows: for each fin ROWS numbers, then for each its table of commands over time (see view.table1).
# Memory: one row a fin, its deflection; none unless `limited`. Work: two rows a fin.
params = make_params("ControlFins", words="first memory work count knots limited")


schedule, commanded = make_commanded(ROWS, LIMIT)


@wp.func
def turned_towards(angle: Any, start: Any, end: Any, length: Any, rate: Any):
    """Along a straight command: at the rate until the fin meets it, then with it, or after it where it is faster."""
    unity = ones(angle)
    gap = start - angle
    ahead = positive(gap, unity, -unity)
    most = length * rate
    closing = most - ahead * (end - start)
    part = positive(closing, least(absolute(gap) / closing, unity), unity)
    met = angle + (ahead * part) * most
    left = (unity - part) * most
    return met + clamp(end - met, -left, left)


turning = make_pursuit(turned_towards)


@wp.func
def follow(state: Any, view: Any, p: Any):
    """|deflection'| <= rate: towards the command, piece by piece, from view.h before to view.t."""
    if p.limited > 0:
        for i in range(p.count):
            at = p.first + wp.static(ROWS) * i
            limit = row1(view, at + wp.static(LIMIT))
            rate = row1(view, at + wp.static(RATE))
            angle = remembered(view, p.memory + i)
            remember(view, p.memory + i, turning(view, angle, schedule(p, i), p.knots, limit, rate))
    return state


@wp.func
def evolve(state: Any, view: Any, p: Any):
    """The same over the half of a kick that ends in its middle, or begins there."""
    t, half = end_of_half(view)
    view.t = t
    view.h = half
    return follow(state, view, p)


@wp.func
def angle_of(view: Any, p: Any, i: int):
    """The deflection of fin i."""
    angle = ones(view.b.x) - ones(view.b.x)
    if p.limited > 0:
        angle = remembered(view, p.memory + i)
    else:
        angle = commanded(view, p, i, view.t)
    return angle


@wp.func
def damping(D: Any, view: Any, p: Any):
    """D = sum over fins, each seen from its turned axes c' = cos c + sin n, n' = cos n - sin c.

    S and W are those of the axes that are not turned: lift and drag are across and along the flow, so of a fin's angle
    they feel l and d alone.
    """
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        angle = angle_of(view, p, i)
        c = cosine(angle)
        s = sine(angle)
        along = speed_along(view, at)
        across = speed_along(view, at + 6)
        note_lift_and_drag(view, at, c * along + s * across, c * across - s * along, p.work + 2 * i)
    return add_fins(D, view, p.first, wp.static(ROWS), p.count, p.work)


@wp.func
def push(w: Any, view: Any, p: Any):
    """w and the wrench of each fin, its lift and drag those of its turned axes."""
    for i in range(p.count):
        at = p.first + wp.static(ROWS) * i
        angle = angle_of(view, p, i)
        c = cosine(angle)
        s = sine(angle)
        along = speed_along(view, at)
        across = speed_along(view, at + 6)
        lift, drag = lift_and_drag(view, at, c * along + s * across, c * across - s * along)
        w = push_fin(w, view, at, along, across, lift, drag)
    return w
