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


@wp.func
def lagged(n: Any, start: Any, end: Any, mean_part: Any, end_part: Any):
    """Behind a straight command by a lag: n less the command decays, and falls behind its slope; parts: of left_along."""
    return fused(end_part, n - start, fused(-mean_part, end - start, end))


@wp.func
def command_ends(memory: Any, packet: int, at: int, i: int, first_part: Any, last_part: Any):
    """The commands of channel i at these two parts of the piece in use, whose rows are at `at`."""
    value = element(memory, packet, at + 2 * i, 0)
    change = element(memory, packet, at + 2 * i + 1, 0)
    return fused(first_part, change, value), fused(last_part, change, value)


@wp.func
def turned_towards(n: Any, start: Any, end: Any, length: Any, rate: Any):
    """Along a straight command: at the rate until n meets it, then with it, or after it where it is faster."""
    unity = ones(n)
    gap = start - n
    ahead = positive(gap, unity, -unity)
    most = length * rate
    closing = most - ahead * (end - start)
    part = positive(closing, least(absolute(gap) / closing, unity), unity)
    met = n + (ahead * part) * most
    left = (unity - part) * most
    return met + clamp(end - met, -left, left)


# Rows of one piece: the time at which it ends, 1 / its length, and for each channel its command at the begin, and the change.
# The first piece lasts until the first time of the schedule and the last one for ever, and nothing changes in them.
PIECE = 2
# Rows to work with: of the piece in use its begin, its end, 1 / its length, and the part of it that has passed; then for each
# channel as above. As long as all lanes stay in their pieces, nothing is searched.
IN_USE = 4
LONG_AGO = -1e30


def make_scheduled(name, rows, limit, lag, rate, features=("lag", "rate"), words=(), count=0):
    """Device code like make_driven's, for an actuator whose commands are a table of pieces, behind the rows of all channels.

    `knots` counts the times of the schedule but for the first, so that there are knots + 2 pieces.
    """
    lags, limited = "lag" in features, "rate" in features
    moves = lags or limited
    # Not inlined where it is long, for the sake of the compiler: a method calls it at each stage.
    outline = False if limited else None

    def params(width, real):
        """Params: first row of the table, of the memory; count of channels and of knots; alike: one lag."""
        fields = ("first", "memory", "work", "count", "alike", "knots", "shared", "size", *words)
        return struct(name, **dict.fromkeys(fields, wp.int32))

    @wp.func
    def behind(p: Any):
        """The first row to work with that is the law's own."""
        return p.work + wp.static(IN_USE) + 2 * p.count

    @wp.func
    def outside(memory: Any, packet: int, p: Any, begin: Any, end: Any):
        """Above 0 in lanes in which the time from begin to end is not within the piece in use."""
        unity = ones(begin)
        later = positive(element(memory, packet, p.work + 1, 0) - end, unity - unity, unity)
        return positive(element(memory, packet, p.work, 0) - begin, unity, later)

    @wp.func(inline=False)
    def take_up(table: Any, entry: int, memory: Any, packet: int, p: Any, t: Any):
        """Find each lane's piece at the time t, and put it into the rows of that in use."""
        unity = ones(t)
        zero = unity - unity
        row = p.first + wp.static(rows) * p.count
        begin = t.dtype(wp.static(LONG_AGO)) * unity
        waiting = unity
        for j in range(p.knots + 2):
            end = entry_of(t, table, entry, row, 0) * unity
            # Above 0 in those lanes that are in this piece.
            here = positive(end - t, waiting, zero)
            if any_positive(here):
                at = p.work
                set_element(memory, packet, at, 0, positive(here, begin, element(memory, packet, at, 0)))
                set_element(memory, packet, at + 1, 0, positive(here, end, element(memory, packet, at + 1, 0)))
                steepness = entry_of(t, table, entry, row, 1) * unity
                set_element(memory, packet, at + 2, 0, positive(here, steepness, element(memory, packet, at + 2, 0)))
                at += wp.static(IN_USE)
                for i in range(2 * p.count):
                    value = entry_of(t, table, entry, row + wp.static(PIECE) + i, 0) * unity
                    set_element(memory, packet, at + i, 0, positive(here, value, element(memory, packet, at + i, 0)))
            waiting = waiting - here
            begin = end
            row += wp.static(PIECE) + 2 * p.count

    @wp.func
    def look_up(view: Any, p: Any):
        """Let `found` know the commands of all channels at view.t."""
        unity = ones(view.b.x)
        t = view.t * unity
        if any_positive(outside(view.memory, view.packet, p, t, t)):
            take_up(view.table, view.entry, view.memory, view.packet, p, t)
        since = t - remembered(view, p.work)
        remember(view, p.work + 3, clamp(since * remembered(view, p.work + 2), unity - unity, unity))

    @wp.func
    def found(view: Any, p: Any, i: int):
        value = p.work + wp.static(IN_USE) + 2 * i
        return fused(remembered(view, p.work + 3), remembered(view, value + 1), remembered(view, value))

    @wp.func
    def place(view: Any, p: Any, i: int):
        """The place of channel i, after look_up."""
        n = ones(view.b.x)
        if wp.static(moves):
            n = remembered(view, p.memory + i)
        else:
            n = found(view, p, i)
        return n

    @wp.func
    def follow_piece(
        table: Any, entry: int, memory: Any, packet: int, p: Any, i: int, start: Any, stop: Any, length: Any
    ):
        """Let channel i follow a straight command over a time."""
        at = p.first + wp.static(rows) * i
        lag_here = entry_of(length, table, entry, at, wp.static(lag))
        n = element(memory, packet, p.memory + i, 0)
        after = n
        if wp.static(limited and not lags):
            after = turned_towards(n, start, stop, length, entry_of(length, table, entry, at, wp.static(rate)))
        elif wp.static(limited):
            pace = vec3(lag_here, entry_of(length, table, entry, at, wp.static(rate)), lag_here)
            after = chased(n, start, stop, length, pace)
        else:
            mean, left = left_along(length, lag_here)
            after = lagged(n, start, stop, mean, left)
        # Lanes without this piece keep their bits, whatever their neighbours have.
        set_element(memory, packet, p.memory + i, 0, positive(length, after, n))

    @wp.func
    def walk(table: Any, entry: int, memory: Any, packet: int, p: Any, t: Any, time: Any):
        """Let all channels follow their commands, exactly, over a time that ends at t, through several pieces."""
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
                for i in range(p.count):
                    value = entry_of(time, table, entry, row + wp.static(PIECE) + 2 * i, 0)
                    change = entry_of(time, table, entry, row + wp.static(PIECE) + 2 * i, 1)
                    start = fused(first_part, change, value)
                    stop = fused(last_part, change, value)
                    follow_piece(table, entry, memory, packet, p, i, start, stop, length)
            since = ended
            time_left = end
            row += wp.static(PIECE) + 2 * p.count

    @wp.func(inline=outline)
    def advance(table: Any, entry: int, memory: Any, packet: int, p: Any, t: Any, time: Any):
        """Let all channels follow their commands, exactly, over a time that ends at t."""
        unity = ones(time)
        now = t * unity
        if any_positive(outside(memory, packet, p, now - time, now)):
            walk(table, entry, memory, packet, p, t, time)
            take_up(table, entry, memory, packet, p, now)
        else:
            since = now - element(memory, packet, p.work, 0)
            steepness = element(memory, packet, p.work + 2, 0)
            first_part = clamp((since - time) * steepness, unity - unity, unity)
            last_part = clamp(since * steepness, unity - unity, unity)
            at = p.work + wp.static(IN_USE)
            # A loop of its own: an exponential within a condition would be computed for each channel, and dropped.
            if wp.static(not limited) and p.alike > 0:
                mean, left = left_along(time, entry_of(time, table, entry, p.first + wp.static(lag), 0))
                for i in range(wp.static(count) if wp.static(count > 0) else p.count):
                    start, stop = command_ends(memory, packet, at, i, first_part, last_part)
                    n = element(memory, packet, p.memory + i, 0)
                    after = lagged(n, start, stop, mean, left)
                    set_element(memory, packet, p.memory + i, 0, positive(time, after, n))
            else:
                for i in range(p.count):
                    start, stop = command_ends(memory, packet, at, i, first_part, last_part)
                    follow_piece(table, entry, memory, packet, p, i, start, stop, time)

    @wp.func
    def evolve(state: Any, view: Any, p: Any):
        """Exactly, over the half of a kick that ends in its middle, or begins there."""
        t, half = end_of_half(view)
        advance(view.table, view.entry, view.memory, view.packet, p, t, half * ones(view.b.x))
        return state

    @wp.func
    def follow(state: Any, view: Any, p: Any):
        """Exactly, piece by piece of the commands, from view.h before to view.t."""
        advance(view.table, view.entry, view.memory, view.packet, p, view.t, view.h * ones(view.b.x))
        return state

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

    if moves:
        return Driven(params, behind, place, evolve, follow, commanded=commanded)
    return Driven(params, behind, place, look_up=look_up, commanded=commanded)
