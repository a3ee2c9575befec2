# SPDX-License-Identifier: Apache-2.0
"""Actuators that a controller drives: how each follows the command that is held, and where it is."""

from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.lanes.held import held_command
from lgvi_kernels.law import *


class Driven(NamedTuple):
    """Functions of an actuator.

    params: the struct of its numbers; behind: (p) -> the first row to work with that is the law's own. place: (view, p, i) ->
    where channel i is; look_up: (view, p), called before places are read, or None where none is needed. evolve, follow,
    report: roles of its law. commanded: (view, p, i, t) -> the command of a schedule; None behind a controller. held: whether
    channels are where a controller commands them, which is the same over a step.
    """

    params: Any
    behind: Any
    place: Any
    evolve: Any = None
    follow: Any = None
    report: Any = None
    look_up: Any = None
    commanded: Any = None
    held: bool = False


@wp.func
def left_after(length: Any, lag: Any):
    """The part of a gap that is left after a time.

    The product is rounded by itself, whatever comes after it: an actuator whose channels all have one lag computes this once,
    with the same bits.
    """
    return exponential(-fused(length, lag, length - length))


@wp.func
def approached(n: Any, u: Any, length: Any, lag: Any, rate: Any):
    """n' = (u - n) lag, no faster than the rate, after a time in which u is held: at the rate, then by the exponential."""
    unity = ones(n)
    zero = unity - unity
    gap = u - n
    size = absolute(gap)
    # How long the rate limits; where it is 0 it does so for ever.
    fast = positive(rate, (size - rate / lag) / positive(rate, rate, unity), length)
    fast = positive(size, least(greatest(fast, zero), length), zero)
    gap_left = size - fast * rate
    gap_left = gap_left * exponential(-((length - fast) * lag))
    return u - positive(gap, gap_left, -gap_left)


def make_driven(name, rows, limit, lag, rate, features, words=(), count=0):
    """The functions of an actuator with `rows` rows a channel; limit, lag and rate: places of 1 / lag and of two limits.

    features: "lag" where some channel lags, "rate" where the rate of some is limited; with neither it is where it is
    commanded. Rows that all channels share follow from `first + shared` on; `size` says how many there are of a kind.
    words: further whole numbers that the actuator's law reads. count: of channels, where the code is written out for each.
    """
    lags, limited = "lag" in features, "rate" in features
    moves = lags or limited

    def params(width, real, commands):
        """Params: commands, see lanes/tick.py; first rows of the table, the memory, the report; count; alike: one lag."""
        places = {"first": wp.int32, "memory": wp.int32, "work": wp.int32, "report": wp.int32}
        places |= dict.fromkeys(("count", "alike", "shared", "size", *words), wp.int32)
        return struct(name, commands=commands, **places)

    @wp.func
    def behind(p: Any):
        return p.work

    @wp.func
    def wanted(view: Any, p: Any, i: int):
        """The command of channel i within its limit."""
        most = row1(view, p.first + wp.static(rows) * i + wp.static(limit))
        return clamp(held_command(view, p.commands, i), -most, most)

    @wp.func
    def place(view: Any, p: Any, i: int):
        n = ones(view.b.x)
        if wp.static(moves):
            n = remembered(view, p.memory + i)
        else:
            n = wanted(view, p, i)
        return n

    @wp.func
    def step_to(view: Any, p: Any, i: int, time: Any):
        """Let channel i follow its command over a time."""
        at = p.first + wp.static(rows) * i
        n = remembered(view, p.memory + i)
        u = wanted(view, p, i)
        if wp.static(lags and limited):
            n = approached(n, u, time, row1(view, at + wp.static(lag)), row1(view, at + wp.static(rate)))
        elif wp.static(limited):
            most = time * row1(view, at + wp.static(rate))
            n = n + clamp(u - n, -most, most)
        else:
            n = fused(left_after(time, row1(view, at + wp.static(lag))), n - u, u)
        remember(view, p.memory + i, n)

    @wp.func
    def move(state: Any, view: Any, p: Any, length: Any):
        time = length * ones(view.b.x)
        # A loop of its own: an exponential within a condition would be computed for each channel, and dropped.
        if wp.static(not limited) and p.alike > 0:
            remaining = left_after(time, row1(view, p.first + wp.static(lag)))
            for i in range(wp.static(count) if wp.static(count > 0) else p.count):
                u = wanted(view, p, i)
                remember(view, p.memory + i, fused(remaining, remembered(view, p.memory + i) - u, u))
        else:
            for i in range(p.count):
                step_to(view, p, i, time)
        return state

    @wp.func
    def evolve(state: Any, view: Any, p: Any):
        return move(state, view, p, view.h.dtype(0.5) * view.h)

    @wp.func
    def follow(state: Any, view: Any, p: Any):
        return move(state, view, p, view.h)

    @wp.func
    def report(state: Any, view: Any, p: Any):
        for i in range(p.count):
            remember(view, p.report + i, place(view, p, i))
        return state

    if not moves:
        return Driven(params, behind, place, report=report, held=True)
    return Driven(params, behind, place, evolve, follow, report)
