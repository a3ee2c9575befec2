# SPDX-License-Identifier: Apache-2.0
"""Actuators that follow a schedule with a lag and at a limited rate, both at once."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.driven import Driven, approached


@wp.func
def chased(n: Any, start: Any, end: Any, length: Any, pace: Any):
    """n' = (command - n) lag, no faster than the rate, along a straight command; pace: lag and rate.

    The gap between command and n has gap' = slope - clamp(lag gap, -rate, rate). So it goes one way, through three pieces at
    most: at the rate, by the lag, at the rate.
    """
    lag = pace.x
    rate = pace.y
    unity = ones(n)
    zero = unity - unity
    slope = (end - start) / length
    gap = start - n
    band = rate / lag
    side = positive(gap, unity, -unity)
    closing = rate - side * slope
    outside = absolute(gap) - band
    before = positive(outside, positive(closing, least(outside / closing, length), length), zero)
    gap = gap + before * (slope - side * rate)
    time_left = length - before
    gap = positive(time_left, clamp(gap, -band, band), gap)
    # Where the command is faster than the rate, the lag holds until the gap has the band's width again.
    side = positive(slope, unity, -unity)
    faster = absolute(slope) - rate
    growth = greatest((absolute(slope) - lag * (side * gap)) / faster, unity)
    within = positive(faster, logarithm(growth) / lag, time_left)
    within = clamp(within, zero, time_left)
    x = lag * within
    gap = exponential(-x) * gap + slope * (within * decay(x))
    gap = gap + (time_left - within) * (slope - side * rate)
    return end - gap


chasing = make_pursuit(chased)


def make_commanded(rows, limit):
    """(schedule, commanded) of an actuator with `rows` rows a channel, its limit among them, with tables of commands behind.

    schedule: (p, i) -> the first row of the table of channel i; commanded: (view, p, i, t) -> its command within its limit.
    """

    @wp.func
    def schedule(p: Any, i: int):
        return p.first + wp.static(rows) * p.count + i * (1 + 3 * p.knots)

    @wp.func
    def commanded(view: Any, p: Any, i: int, t: Any):
        most = row1(view, p.first + wp.static(rows) * i + wp.static(limit))
        return command(view, schedule(p, i), p.knots, most, t)

    return schedule, commanded


def make_scheduled(name, rows, limit, lag, rate):
    """As make_driven, for an actuator with a table of commands over time for each channel, behind the rows of all channels."""
    schedule, commanded = make_commanded(rows, limit)

    def params(width, real):
        """Params: first row of the table, of the memory if `moving`; count of channels and of knots of their commands."""
        words = ("first", "memory", "work", "count", "moving", "knots", "shared", "size")
        return struct(name, **dict.fromkeys(words, wp.int32))

    @wp.func
    def place(view: Any, p: Any, i: int):
        n = ones(view.b.x)
        if p.moving > 0:
            n = remembered(view, p.memory + i)
        else:
            n = commanded(view, p, i, view.t)
        return n

    @wp.func
    def evolve(state: Any, view: Any, p: Any):
        """Over half a kick, towards the command of the middle of that half."""
        if p.moving > 0:
            t = middle_of_half(view)
            for i in range(p.count):
                at = p.first + wp.static(rows) * i
                n = remembered(view, p.memory + i)
                half = view.h.dtype(0.5) * view.h * ones(n)
                lag_here = row1(view, at + wp.static(lag))
                n = approached(n, commanded(view, p, i, t), half, lag_here, row1(view, at + wp.static(rate)))
                remember(view, p.memory + i, n)
        return state

    @wp.func
    def follow(state: Any, view: Any, p: Any):
        """Exactly, piece by piece of the command, from view.h before to view.t."""
        if p.moving > 0:
            for i in range(p.count):
                at = p.first + wp.static(rows) * i
                n = remembered(view, p.memory + i)
                lag_here = row1(view, at + wp.static(lag))
                pace = vec3(lag_here, row1(view, at + wp.static(rate)), lag_here)
                most = row1(view, at + wp.static(limit))
                remember(view, p.memory + i, chasing(view, n, schedule(p, i), p.knots, most, pace))
        return state

    return Driven(params, place, evolve, follow, None)
