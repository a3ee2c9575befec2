"""Events: conditions that stop a member, and where in its step each stops it.

Each event is a law with `distance(view, p)`, positive while the member goes on. A step whose end has a distance of zero or
below is made again in part: the part that ends at the event is found by a root search on the method's own step, so that the
state there has the method's order.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.lanes.arithmetic import absolute, add, div, mul, neg, ones, positive, sub, vec3  # noqa: F401
from lgvi_kernels.maps.submaps import look, rotate

# Status of the first event of a scene; the next have the next numbers.
FIRST = 16

NON_FINITE = 3

# Of the search for an event: evaluations by secants, and in all; the spacing of numbers about 1.
SECANTS = 16
MOST_EVALUATIONS = 80
EPSILON = {wp.float64: 2.0**-52, wp.float32: 2.0**-23}


class Watch(NamedTuple):
    """Functions of a scene's events.

    alarm: (x, c, h) -> x with the alarm of the lanes that have reached an event; spacing: (good, x, c, h) -> what the
    position between two states is known to, about each axis; nearest: (x, c, h, spacing) -> (distance with twice the margin,
    margin, status) of the event that is nearest in each lane.
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
        """The view from the user's origin."""
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
        """Of the numbers that the position is made of."""
        b = see(x, c, h).b
        size = vec3(absolute(x.b.x), absolute(x.b.y), absolute(x.b.z))
        return size + vec3(absolute(b.x), absolute(b.y), absolute(b.z))

    @wp.func
    def spacing(good: Any, x: Any, c: Any, h: Any):
        """A position is known to the spacing of its numbers along the step."""
        return real(wp.static(EPSILON[real])) * (sizes(good, c, h) + sizes(x, c, h))

    @wp.func
    def nearest(x: Any, c: Any, h: Any, between: Any):
        """The margin of a distance is its change by a spacing of the position, along each axis."""
        return least_of(see(x, c, h), c.events, between)

    return Watch(alarm, spacing, nearest)


@wp.func
def displaced(view: Any, d: Any):
    """The view from a place d away."""
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
        code_next = d - d
        if wp.static(more):
            code_next = reached_next(view, p.rest)
        return positive(d, code_next, view.h.dtype(wp.static(float(FIRST + number))) * ones(d))

    @wp.func
    def least_of(view: Any, p: Any, spacing: Any):
        """(distance + 2 margins, margin, status)."""
        d = distance(view, p.own)
        none = d - d
        room = absolute(distance(displaced(view, vec3(spacing.x, none, none)), p.own) - d)
        room = room + absolute(distance(displaced(view, vec3(none, spacing.y, none)), p.own) - d)
        room = room + absolute(distance(displaced(view, vec3(none, none, spacing.z)), p.own) - d)
        d = d + room + room
        code = view.h.dtype(wp.static(float(FIRST + number))) * ones(d)
        if wp.static(more):
            d_next, room_next, code_next = least_of_next(view, p.rest, spacing)
            ahead = d - d_next
            d = positive(ahead, d_next, d)
            room = positive(ahead, room_next, room)
            code = positive(ahead, code_next, code)
        return d, room, code

    return reached, least_of


def make_arrival(watch, part_step, choose, water_velocity, real, width, most_parts):
    """What makes the last step of members that reach an event: the part of it that ends there.

    watch: see Watch; part_step: (x, c, k, h, part, parts, ...) -> the state after `parts` equal steps of part h from step
    k on; choose: see sums; water_velocity: (x, c, h) -> R^T u, or None where a sample tells it later too; most_parts: into
    how many a part without a solution may be divided.
    """
    # Parts of a step nearer to each other than this are one.
    spacing = 4.0 * EPSILON[real]
    moving, spacing_of, nearest = water_velocity is not None, watch.spacing, watch.nearest

    @wp.func(inline=False)
    def arrival(good: Any, x: Any, code: Any, c: Any, k: int, h: wp.float64, stage_h: Any, lead_h: Any, opening: real):
        """(state, code, part, R^T u) of the lanes whose code is that of an event: where each stops, why, the part of step k.

        good: the state before the step; x: after it. The search keeps a part before the event, `low`, and one beyond it,
        `high`: false position with halved weights (Dowell & Jarratt 1971, Illinois), then halving. It ends within a
        margin beyond the event, so that the samples, whose round-off is less, lie beyond it too.
        """
        stopped = good
        between = spacing_of(good, x, c, real(h))
        begin, begin_room, begin_code = nearest(good, c, real(h), between)
        end, end_room, end_code = nearest(x, c, real(h), between)
        parts_made = begin - begin
        still = vec3(parts_made, parts_made, parts_made)
        end_still = still
        if wp.static(moving):
            # Laws remember the end of the step here, and from the first part on what they did before it.
            end_still = water_velocity(x, c, real(h))
            begun = part_step(good, c, k, h, real(0.0), 0, stage_h, lead_h, opening, ones(begin))
            still = water_velocity(begun, c, real(h))
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
                elif low_distance <= begin_room[j]:
                    # It starts beyond the event.
                    part = real(0.0)
                    high = real(0.0)
                    code[j] = begin_code[j]
                else:
                    code[j] = end_code[j]
                    stopped = choose(lane, x, stopped)
                    still = positive(lane, end_still, still)
                    if high_distance > end_room[j]:
                        # Less than a margin beyond at the end: a little further.
                        high = wp.min(real(2.0), real(1.0) + real(2.0) * high_distance / (low_distance - high_distance))
                    tries = int(0)
                    parts = int(1)
                    side = int(0)
                    while high - low > real(wp.static(spacing)) and tries < wp.static(MOST_EVALUATIONS):
                        tries += 1
                        # The first try beyond a whole step is at `high`, all others between the two.
                        tried = high
                        if high <= real(1.0) or tries > 1:
                            tried = real(0.5) * (low + high)
                            if tries < wp.static(SECANTS):
                                tried = low + (high - low) * low_distance / (low_distance - high_distance)
                                tried = wp.clamp(tried, low + real(wp.static(spacing)), high - real(wp.static(spacing)))
                        y = part_step(good, c, k, h, tried / real(parts), parts, stage_h, lead_h, opening, lane)
                        distance, room, status = nearest(y, c, real(h), between)
                        failed = y.alarm.code[j] > real(0.0)
                        if failed and parts < wp.static(most_parts):
                            parts = 2 * parts
                        elif failed or not distance[j] == distance[j]:
                            tries = int(wp.static(MOST_EVALUATIONS))
                        elif distance[j] > room[j]:
                            low = tried
                            low_distance = distance[j]
                            if low >= high:
                                tries = int(wp.static(MOST_EVALUATIONS))
                            if side == 1:
                                high_distance = real(0.5) * high_distance
                            side = int(1)
                        else:
                            high = tried
                            part = tried
                            high_distance = distance[j]
                            code[j] = status[j]
                            stopped = choose(lane, y, stopped)
                            if wp.static(moving):
                                still = positive(lane, water_velocity(y, c, real(h)), still)
                            if high_distance >= -room[j]:
                                low = high
                            if side == -1:
                                low_distance = real(0.5) * low_distance
                            side = int(-1)
                parts_made[j] = part
        return stopped, code, parts_made, still

    return arrival
