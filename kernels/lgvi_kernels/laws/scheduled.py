# SPDX-License-Identifier: Apache-2.0
"""Actuators that follow a schedule, with a lag and at a limited rate.

The schedule of all channels is one table of pieces, over which all commands go straight: piece by piece, not channel by
channel, so that what depends on the time alone is calculated once. The host has cut commands at their limits, which adds
pieces.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import any_positive, element, entry_of, set_element
from lgvi_kernels.law import *
from lgvi_kernels.laws.driven import Driven


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


@wp.func
def left_along(length: Any, lag: Any):
    """The mean part of a gap that is left over a time, and the part at its end; as left_after, whatever comes after it."""
    x = fused(length, lag, length - length)
    mean = decay(x)
    return mean, fused(-x, mean, ones(x))


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


# Rows of one piece: the time at which it ends, 1 / its length, and for each channel its command at the begin, and the change.
# The first piece lasts until the first time of the schedule and the last one for ever, and nothing changes in them.
PIECE = 2


def make_scheduled(name, rows, limit, lag, rate, features=("lag", "rate"), words=()):
    """Device code like make_driven's, for an actuator whose commands are a table of pieces, behind the rows of all channels.

    `knots` counts the times of the schedule but for the first, so that there are knots + 2 pieces.
    """
    lags, limited = "lag" in features, "rate" in features
    moves = lags or limited
    # Not inlined where it is long, for the sake of the compiler: a method calls it at each stage.
    outline = False if limited else None

    def params(width, real):
        """Params: first row of the table, of the memory if `moving`; count of channels and of knots; alike: one lag."""
        fields = ("first", "memory", "work", "count", "moving", "alike", "knots", "shared", "size", *words)
        return struct(name, **dict.fromkeys(fields, wp.int32))

    @wp.func
    def commanded(view: Any, p: Any, i: int, t: Any):
        """The command of channel i: a sum over all pieces, of which each lane may be in one of its own."""
        row = p.first + wp.static(rows) * p.count
        u = row1(view, row + wp.static(PIECE) + 2 * i)
        unity = ones(u)
        for j in range(p.knots):
            begin = row1(view, row)
            row += wp.static(PIECE) + 2 * p.count
            part = clamp((t * unity - begin) * row1(view, row + 1), unity - unity, unity)
            u = fused(part, row1(view, row + wp.static(PIECE) + 2 * i + 1), u)
        most = row1(view, p.first + wp.static(rows) * i + wp.static(limit))
        return clamp(u, -most, most)

    @wp.func
    def place(view: Any, p: Any, i: int):
        n = ones(view.b.x)
        if wp.static(moves):
            if p.moving > 0:
                n = remembered(view, p.memory + i)
            else:
                n = commanded(view, p, i, view.t)
        else:
            n = commanded(view, p, i, view.t)
        return n

    @wp.func(inline=outline)
    def walk(table: Any, entry: int, memory: Any, packet: int, p: Any, t: Any, time: Any):
        """Let all channels follow their commands, exactly, over a time that ends at t."""
        unity = ones(time)
        zero = unity - unity
        # Times count back from t: within one piece its length is then the whole time, to the last digit.
        time_left = time
        row = p.first + wp.static(rows) * p.count
        since = zero
        for j in range(p.knots + 2):
            ended = t * unity - entry_of(time, table, entry, row, 0)
            end = clamp(ended, zero, time_left)
            length = time_left - end
            if any_positive(length):
                steepness = entry_of(time, table, entry, row, 1)
                first_part = clamp((since - time_left) * steepness, zero, unity)
                last_part = clamp((since - end) * steepness, zero, unity)
                mean = length
                left = length
                if wp.static(not limited):
                    mean, left = left_along(length, entry_of(time, table, entry, p.first + wp.static(lag), 0))
                for i in range(p.count):
                    at = p.first + wp.static(rows) * i
                    value = entry_of(time, table, entry, row + wp.static(PIECE) + 2 * i, 0)
                    change = entry_of(time, table, entry, row + wp.static(PIECE) + 2 * i, 1)
                    start = fused(first_part, change, value)
                    stop = fused(last_part, change, value)
                    lag_here = entry_of(time, table, entry, at, wp.static(lag))
                    n = element(memory, packet, p.memory + i, 0)
                    after = n
                    if wp.static(limited):
                        pace = vec3(lag_here, entry_of(time, table, entry, at, wp.static(rate)), lag_here)
                        after = chased(n, start, stop, length, pace)
                    else:
                        # n less the command decays, and falls behind its slope.
                        if p.alike == 0:
                            mean, left = left_along(length, lag_here)
                        after = fused(left, n - start, fused(-mean, stop - start, stop))
                    # Lanes without this piece keep their bits, whatever their neighbours have.
                    set_element(memory, packet, p.memory + i, 0, positive(length, after, n))
            since = ended
            time_left = end
            row += wp.static(PIECE) + 2 * p.count

    @wp.func
    def evolve(state: Any, view: Any, p: Any):
        """Exactly, over the half of a kick that ends in its middle, or begins there."""
        if wp.static(moves):
            if p.moving > 0:
                t, half = end_of_half(view)
                walk(view.table, view.entry, view.memory, view.packet, p, t, half * ones(view.b.x))
        return state

    @wp.func
    def follow(state: Any, view: Any, p: Any):
        """Exactly, piece by piece of the commands, from view.h before to view.t."""
        if wp.static(moves):
            if p.moving > 0:
                walk(view.table, view.entry, view.memory, view.packet, p, view.t, view.h * ones(view.b.x))
        return state

    @wp.func
    def look_up(view: Any, p: Any):
        """Let `found` know the commands of all channels at view.t."""
        like = view.b.x
        unity = ones(like)
        zero = unity - unity
        row = p.first + wp.static(rows) * p.count
        since = zero
        waiting = unity
        for j in range(p.knots + 2):
            ended = view.t * unity - row1(view, row)
            # Above 0 in those lanes that are in this piece.
            here = positive(-ended, waiting, zero)
            if any_positive(here):
                part = clamp(since * row1(view, row + 1), zero, unity)
                for i in range(p.count):
                    value = row + wp.static(PIECE) + 2 * i
                    u = fused(part, row1(view, value + 1), row1(view, value))
                    remember(view, p.work + i, positive(here, u, remembered(view, p.work + i)))
            waiting = waiting - here
            since = ended
            row += wp.static(PIECE) + 2 * p.count

    @wp.func
    def found(view: Any, p: Any, i: int):
        return remembered(view, p.work + i)

    if moves:
        return Driven(params, place, evolve, follow, None, commanded=commanded)
    return Driven(params, place, None, None, None, look_up, found, commanded)
