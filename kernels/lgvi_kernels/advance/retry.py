"""Steps that are made again: in equal parts where a step has no solution, and in part where an event stops a member."""

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

# A step without a solution is divided into at most so many.
MOST_PARTS = 1024


class Retry(NamedTuple):
    """retried: a step by more and more parts, where it had no solution; arrival: the part of a step that ends at an event."""

    retried: Any
    arrival: Any


@functools.cache
def make_retry(spec):
    """What makes a step again; functions that this Spec does not ask for are called nowhere."""
    types, stepping, real, width = make_types(spec), make_stepping(spec), spec.real, spec.width
    Lane, State, Alarm, Constants = types.Lane, types.State, types.Alarm, types.Constants
    method, watch, at_step, opened = stepping.method, stepping.watch, stepping.at_step, stepping.opened
    step, lead, has_lead = method.step, method.lead, spec.lead is not None
    composed, paired, compensated, remembers = spec.composed, spec.paired, spec.compensated, spec.memory
    paced, turned, watched = spec.paced, spec.turned, spec.watched
    to_event = watch.alarm if watched else step
    _, _, back_up = make_rows(Lane, State, paced, compensated)

    @wp.func(inline=False)
    def in_parts(x: State, c: Constants, k: int, h: wp.float64, part: real, parts: int, stage_h: wp.array(dtype=real),
                 lead_h: wp.array(dtype=real), opening: real, among: Lane):  # fmt: skip
        """So many equal parts of step k, `part` of its length each, from and to a state that the lead has opened for h.

        among: the lanes that are looked at; what a packet that chooses its steps does depends on them alone.
        """
        stages = lead_h.shape[0] - 1
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

    @wp.func(inline=False)
    def retried(good: State, x: State, code: Lane, c: Constants, k: int, h: wp.float64, stage_h: wp.array(dtype=real),
                lead_h: wp.array(dtype=real), opening: real):  # fmt: skip
        """(state, code) after step k: where it had no solution, by 2, 4, ... equal parts, as soon as those have one."""
        unity = ones(code)
        zero = unity - unity
        remaining = code + zero
        pending = zero
        for j in range(wp.static(width)):
            if code[j] == real(1.0) or code[j] == real(2.0) or code[j] == real(4.0):
                pending[j] = real(1.0)
        parts = int(1)
        while parts < wp.static(MOST_PARTS) and any_positive(pending):
            parts = 2 * parts
            y = choose(pending, good, at_rest(good))
            y = in_parts(y, c, k, h, real(1.0) / real(parts), parts, stage_h, lead_h, opening, pending)
            if wp.static(watched):
                y = to_event(y, c, real(h))
            wrong = failures(y, unity - pending)
            solved = unity - unity
            for j in range(wp.static(width)):
                # An event is no failure, but what becomes of the lane.
                if pending[j] > real(0.0) and (wrong[j] <= real(0.0) or wrong[j] >= real(wp.static(float(FIRST)))):
                    solved[j] = real(1.0)
                    pending[j] = real(0.0)
                    remaining[j] = wrong[j]
            x = choose(solved, y, x)
        return x, remaining

    arrival = step
    if watched:
        water = method.water_velocity if spec.still else None
        arrival = make_arrival(watch, in_parts, choose, water, real, width, MOST_PARTS if spec.substep else 1)
    return Retry(retried, arrival)
