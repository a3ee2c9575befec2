# SPDX-License-Identifier: Apache-2.0
"""Events: conditions that stop a member, and where in its step each stops it.

An event is a module of stops with `distance(view, p)`, positive while the member goes on. A step whose end has a distance of
zero or below is made again in part: a root search finds the part of the step that ends at the event. It makes that part with
the method itself, not by interpolation, so that the state there has the method's order.

The search keeps a part before the event, `low`, and one beyond it, `high`: false position with halved weights (Dowell &
Jarratt 1971, Illinois), then halving. It ends one to three margins beyond the event, so that samples, whose round-off is less
than a margin, lie beyond it too. Each lane is searched for by itself: no result depends on neighbours that stop as well.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.lanes.arithmetic import absolute, add, div, mul, neg, ones, positive, sub, vec3  # noqa: F401
from lgvi_kernels.maps.accounting import account_of, put_account
from lgvi_kernels.maps.submaps import look, rotate

# Status of the first event of a scene; the next have the next numbers.
FIRST = 16

NON_FINITE = 3

# The search for an event: its evaluations by secants, and in all. EPSILON: the spacing of numbers at 1.
SECANTS = 16
MOST_EVALUATIONS = 80
EPSILON = {wp.float64: 2.0**-52, wp.float32: 2.0**-23}
# Parts of a step that are no further from each other than so many EPSILONs are one.
SPACINGS = 4.0


class Watch(NamedTuple):
    """Functions of a scene's events.

    alarm: (x, c, h) -> x with the alarm of the lanes that have reached an event; spacing: (good, x, c, h) -> the round-off of
    a position between two states, along each axis; nearest: (x, c, h, spacing) -> (distance plus two margins, margin,
    status) of the event that is nearest in each lane.
    """

    alarm: Any
    spacing: Any
    nearest: Any


def make_watch(events, View, shifted, real):
    """A Watch of these events, each a module with `distance`; their parameters are nested in `c.events`.

    shifted: the user's origin, which events look at, is not that of the state.
    """
    reached, least_of = _chain(events, 0)

    @wp.func
    def see(x: Any, c: Any, h: Any):
        """The View from the user's origin."""
        view = look(View(), x, c, h)
        if wp.static(shifted):
            view.b = view.b + rotate(x, c.inertia.user_origin)
        return view

    @wp.func
    def alarm(x: Any, c: Any, h: Any):
        """Raise the alarm of the lanes where a distance is no longer positive: the number of the event."""
        code = reached(see(x, c, h), c.events)
        x.alarm.code = positive(x.alarm.code, x.alarm.code, code)
        return x

    @wp.func
    def sizes(x: Any, c: Any, h: Any):
        """Per axis, the size of the numbers whose sum is the position: they set its round-off."""
        b = see(x, c, h).b
        size = vec3(absolute(x.b.x), absolute(x.b.y), absolute(x.b.z))
        return size + vec3(absolute(b.x), absolute(b.y), absolute(b.z))

    @wp.func
    def spacing(good: Any, x: Any, c: Any, h: Any):
        """The round-off of a position on the step: the spacing of its numbers."""
        return real(wp.static(EPSILON[real])) * (sizes(good, c, h) + sizes(x, c, h))

    @wp.func
    def nearest(x: Any, c: Any, h: Any, between: Any):
        """The margin of a distance is its change by a spacing of the position, along each axis."""
        return least_of(see(x, c, h), c.events, between)

    return Watch(alarm, spacing, nearest)


@wp.func
def displaced(view: Any, d: Any):
    """The view from a position d away."""
    view.b = view.b + d
    return view


@functools.cache
def _chain(events, number):
    """(reached, least_of): the first event that is reached as a status (0: none); the least distance of all."""
    distance = events[0].distance
    more = len(events) > 1
    reached_next, least_of_next = _chain(events[1:], number + 1) if more else (None, None)

    @wp.func
    def reached(view: Any, p: Any):
        d = distance(view, p.own)
        later = d - d
        if wp.static(more):
            later = reached_next(view, p.rest)
        return positive(d, later, view.h.dtype(wp.static(float(FIRST + number))) * ones(d))

    @wp.func
    def least_of(view: Any, p: Any, spacing: Any):
        """(distance + 2 margins, margin, status)."""
        d = distance(view, p.own)
        zero = d - d
        margin = absolute(distance(displaced(view, vec3(spacing.x, zero, zero)), p.own) - d)
        margin = margin + absolute(distance(displaced(view, vec3(zero, spacing.y, zero)), p.own) - d)
        margin = margin + absolute(distance(displaced(view, vec3(zero, zero, spacing.z)), p.own) - d)
        # With two margins more, the search's root lies two margins beyond the event (see arrival).
        d = d + margin + margin
        code = view.h.dtype(wp.static(float(FIRST + number))) * ones(d)
        if wp.static(more):
            other_d, other_margin, other_code = least_of_next(view, p.rest, spacing)
            ahead = d - other_d
            d = positive(ahead, other_d, d)
            margin = positive(ahead, other_margin, margin)
            code = positive(ahead, other_code, code)
        return d, margin, code

    return reached, least_of


def make_trial(real):
    """The function that says which part of a step to try: the first beyond a whole step is `high`, all others lie between."""
    spacing = SPACINGS * EPSILON[real]

    @wp.func(inline=True)
    def trial_between(low: real, high: real, low_distance: real, high_distance: real, evaluations: int):
        trial = high
        if high <= real(1.0) or evaluations > 1:
            trial = real(0.5) * (low + high)
            if evaluations < wp.static(SECANTS):
                trial = low + (high - low) * low_distance / (low_distance - high_distance)
                trial = wp.clamp(trial, low + real(wp.static(spacing)), high - real(wp.static(spacing)))
        return trial

    return trial_between


def make_water_around(types, water_velocity, part_step, real):
    """(good, x, c, k, h, stage_h, lead_h, opening) -> R^T u at the start and at the end of a step, zero for water at rest."""
    State, Constants, Lane, moving = types.State, types.Constants, types.Lane, water_velocity is not None

    @wp.func(inline=True)
    def water_around(good: wp.ref[State], x: wp.ref[State], c: wp.ref[Constants], k: int, h: wp.float64,
                     stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), opening: real, zero: Lane):  # fmt: skip
        still = vec3(zero, zero, zero)
        end_still = still
        if wp.static(moving):
            # Before the first part: the laws' memory is here that of the step's end, and every part sets it back.
            end_still = water_velocity(x, c, real(h))
            begun = part_step(good, c, k, h, real(0.0), 0, stage_h, lead_h, opening, ones(zero))
            still = water_velocity(begun, c, real(h))
        return still, end_still

    return water_around


def make_arrival(types, watch, part_step, choose, water_velocity, real, width, most_parts, accounted):
    """The function that makes the last step of members that reach an event: the part of it that ends there.

    part_step: (x, c, k, h, part, parts, ...) -> the state after `parts` equal steps of part h from step k on; water_velocity:
    (x, c, h) -> R^T u, or None where a sample can compute it later; most_parts: how many parts one without a solution gets.
    accounted: the energy used is remembered, and an event may look at it. That of the lanes that stop goes into the memory's
    second half, which holds what was remembered before the step.
    """
    State, Constants, Lane = types.State, types.Constants, types.Lane
    spacing, spacing_of, nearest = SPACINGS * EPSILON[real], watch.spacing, watch.nearest
    trial_between, water_around = make_trial(real), make_water_around(types, water_velocity, part_step, real)

    @wp.func(inline=False)
    def arrival(good: wp.ref[State], x: wp.ref[State], stopped: wp.ref[State], code: wp.ref[Lane], c: wp.ref[Constants],
                k: int, h: wp.float64, stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real),
                opening: real):  # fmt: skip
        """(part, R^T u) where each lane stops: `part` of the step k from good, before it, to x.

        The states there go into `stopped`, and why they stop into `code`.
        """
        stopped = good
        between = spacing_of(good, x, c, real(h))
        begin, begin_margin, begin_code = nearest(good, c, real(h), between)
        end, end_margin, end_code = nearest(x, c, real(h), between)
        part_of_step = begin - begin
        if wp.static(accounted):
            half = c.memory.shape[1] // 2
            end_used, end_low = account_of(c, 0)
            used, used_low = account_of(c, half)
        still, end_still = water_around(good, x, c, k, h, stage_h, lead_h, opening, part_of_step)
        if wp.static(accounted):
            # A part without length: the memory is then that of the step's begin.
            begun = part_step(good, c, k, h, real(0.0), 0, stage_h, lead_h, opening, ones(begin))
            begin, begin_margin, begin_code = nearest(begun, c, real(h), between)
        for j in range(wp.static(width)):
            if code[j] >= real(wp.static(float(FIRST))):
                lane = ones(begin) - ones(begin)
                lane[j] = real(1.0)
                low = real(0.0)
                high = real(1.0)
                low_distance = begin[j]
                high_distance = end[j]
                part = real(1.0)
                if not high_distance == high_distance:
                    code[j] = real(wp.static(float(NON_FINITE)))
                elif low_distance <= begin_margin[j]:
                    part = real(0.0)  # the step starts beyond the event
                    high = real(0.0)
                    code[j] = begin_code[j]
                else:
                    code[j] = end_code[j]
                    stopped = choose(lane, x, stopped)
                    still = positive(lane, end_still, still)
                    if wp.static(accounted):
                        used = positive(lane, end_used, used)
                        used_low = positive(lane, end_low, used_low)
                    if high_distance > end_margin[j]:
                        # The step ends less than a margin beyond the event: search a little further than its end.
                        high = wp.min(real(2.0), real(1.0) + real(2.0) * high_distance / (low_distance - high_distance))
                    evaluations = int(0)
                    parts = int(1)
                    side = int(0)
                    while high - low > real(wp.static(spacing)) and evaluations < wp.static(MOST_EVALUATIONS):
                        evaluations += 1
                        trial = trial_between(low, high, low_distance, high_distance, evaluations)
                        y = part_step(good, c, k, h, trial / real(parts), parts, stage_h, lead_h, opening, lane)
                        distance, margin, status = nearest(y, c, real(h), between)
                        failed = y.alarm.code[j] > real(0.0)
                        if failed and parts < wp.static(most_parts):
                            parts = 2 * parts
                        elif failed or not distance[j] == distance[j]:
                            # Ends the search with the last part that reached the event.
                            evaluations = int(wp.static(MOST_EVALUATIONS))
                        elif distance[j] > margin[j]:
                            low = trial
                            low_distance = distance[j]
                            if low >= high:
                                evaluations = int(wp.static(MOST_EVALUATIONS))
                            # The same end moved twice: half the weight of the other one draws the next trial to it.
                            if side == 1:
                                high_distance = real(0.5) * high_distance
                            side = int(1)
                        else:
                            high = trial
                            part = trial
                            high_distance = distance[j]
                            code[j] = status[j]
                            stopped = choose(lane, y, stopped)
                            if wp.static(water_velocity is not None):
                                still = positive(lane, water_velocity(y, c, real(h)), still)
                            if wp.static(accounted):
                                new, new_low = account_of(c, 0)
                                used = positive(lane, new, used)
                                used_low = positive(lane, new_low, used_low)
                            if high_distance >= -margin[j]:
                                low = high
                            if side == -1:
                                low_distance = real(0.5) * low_distance
                            side = int(-1)
                part_of_step[j] = part
        if wp.static(accounted):
            put_account(c, half, used, used_low)
        return part_of_step, still

    return arrival
