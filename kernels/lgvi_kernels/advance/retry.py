# SPDX-License-Identifier: Apache-2.0
"""Steps that are made again: in equal parts, where a step has no solution; up to an event, where it stops a member.

Both are rare, so their functions are not inlined: the loop over steps keeps its registers. They take references, since a
state or constants by value are copied for each call.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.advance.events import FIRST, make_arrival
from lgvi_kernels.advance.rows import make_rows
from lgvi_kernels.advance.spec import make_types
from lgvi_kernels.advance.stepping import make_stepping
from lgvi_kernels.lanes.arithmetic import add, any_positive, mul, neg, ones, positive, sub  # noqa: F401
from lgvi_kernels.lanes.packet import failures, turned_too_far
from lgvi_kernels.lanes.sums import at_rest, choose, settled
from lgvi_kernels.maps.accounting import account_of, put_account

# A step without a solution is divided into at most so many parts.
MOST_PARTS = 1024


class Retry(NamedTuple):
    """retried: makes a step without solution in more and more parts; arrival: makes a part of a step, up to an event."""

    retried: Any
    arrival: Any


def make_in_parts(spec):
    """The function that makes a step in equal parts of any length."""
    types, stepping, real = make_types(spec), make_stepping(spec), spec.real
    Lane, State, Alarm, Constants = types.Lane, types.State, types.Alarm, types.Constants
    step, lead, has_lead = stepping.method.step, stepping.method.lead, spec.lead is not None
    at_step, opened = stepping.at_step, stepping.opened
    composed, paired, compensated, remembers = spec.composed, spec.paired, spec.compensated, spec.memory
    paced, turned = spec.paced, spec.turned
    _, _, back_up = make_rows(Lane, State, paced, compensated)

    @wp.func(inline=False)
    def in_parts(start: wp.ref[State], c: wp.ref[Constants], k: int, h: wp.float64, part: real, parts: int,
                 stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), opening: real, among: Lane):  # fmt: skip
        """The state after `parts` equal parts of step k, each `part` of its length.

        The state comes and goes with the lead of a whole step: here that lead is undone, and the lead of a part made.
        among: the lanes that count; a packet that chooses its steps asks for the tolerance in them alone.
        """
        stages = lead_h.shape[0] - 1
        x = start
        x.prepared = 0
        x.alarm = Alarm()
        if wp.static(paced):
            x.alarm.code = ones(among) - among
            x.pace.stride = real(0.0)
            x.pace.before = real(0.0)
        if wp.static(remembers):
            back_up(c.memory, c.packet, 1, 0)
        x = at_step(x, k, h)
        x = opened(opened(x, c, -opening), c, part * opening)
        for _ in range(parts):
            for g in range(stages):
                if wp.static(paired):
                    x = step(x, c, part * stage_h[2 * g], part * stage_h[2 * g + 1])
                else:
                    x = step(x, c, part * stage_h[g])
                if wp.static(has_lead):
                    if wp.static(composed):
                        x = lead(x, c, part * lead_h[g])
                    else:
                        x = lead(x, c, part * (opening + opening))
            if wp.static(compensated):
                x = settled(x)
        if wp.static(turned):
            x.alarm = turned_too_far(x.alarm)
        return opened(opened(x, c, -(part * opening)), c, opening)

    return in_parts


@functools.cache
def make_retry(spec):
    """The functions that make a step again; those that this Spec does not ask for are called nowhere."""
    types, stepping, real, width = make_types(spec), make_stepping(spec), spec.real, spec.width
    Lane, State, Constants = types.Lane, types.State, types.Constants
    method, watch, watched, in_parts = stepping.method, stepping.watch, spec.watched, make_in_parts(spec)
    to_event, accounted = watch.alarm if watched else method.step, spec.accounted

    @wp.func(inline=False)
    def retried(good: wp.ref[State], x: wp.ref[State], codes: wp.ref[Lane], c: wp.ref[Constants], k: int, h: wp.float64,
                stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), opening: real):  # fmt: skip
        """Make step k again where it had no solution, by 2, 4, ... equal parts, as soon as those have one."""
        unity = ones(codes)
        zero = unity - unity
        pending = zero
        # 1, 2, 4: a step too large, (24) or the forces not converged: equations that are easier for a shorter step.
        for j in range(wp.static(width)):
            if codes[j] == real(1.0) or codes[j] == real(2.0) or codes[j] == real(4.0):
                pending[j] = real(1.0)
        if wp.static(accounted):
            used, low = account_of(c, 0)
        parts = int(1)
        while parts < wp.static(MOST_PARTS) and any_positive(pending):
            parts = 2 * parts
            # Lanes that need no part wait at rest.
            y = choose(pending, good, at_rest(good))
            y = in_parts(y, c, k, h, real(1.0) / real(parts), parts, stage_h, lead_h, opening, pending)
            if wp.static(watched):
                y = to_event(y, c, real(h))
            new_codes = failures(y, unity - pending)
            solved = unity - unity
            for j in range(wp.static(width)):
                # An event is no failure: the step is made, and the lane's code is the event's.
                if pending[j] > real(0.0) and (
                    new_codes[j] <= real(0.0) or new_codes[j] >= real(wp.static(float(FIRST)))
                ):
                    solved[j] = real(1.0)
                    pending[j] = real(0.0)
                    codes[j] = new_codes[j]
            x = choose(solved, y, x)
            if wp.static(accounted):
                new, new_low = account_of(c, 0)
                used = positive(solved, new, used)
                low = positive(solved, new_low, low)
        if wp.static(accounted):
            put_account(c, 0, used, low)

    arrival = method.step
    if watched:
        water = method.water_velocity if spec.still else None
        most_parts = MOST_PARTS if spec.substep else 1
        arrival = make_arrival(types, watch, in_parts, choose, water, real, width, most_parts, accounted)
    return Retry(retried, arrival)
