# SPDX-License-Identifier: Apache-2.0
"""Waypoints: legs one after another, and the heading along each by line of sight; on time, and with circles at points."""

import functools
import math
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.circle import circled
from lgvi_kernels.laws.control.set_point import headed

ILOS = 1
ALOS = 2
# Rows of the memory: the leg, J or beta; with circles whether it circles, the angle turned so far, since when, the bearing.
CIRCLING = 2
TURN = 2.0 * math.pi


@wp.func
def leg_at(y: Any, p: Any, leg: Any):
    """Begin and end of a leg; of the last one beyond it."""
    begin = row3(y, p.first)
    end = row3(y, p.first + 3)
    for i in range(1, p.legs):
        later = leg - (y.h.dtype(i) - y.h.dtype(0.5)) * ones(leg)
        begin = positive(later, row3(y, p.first + 3 * i), begin)
        end = positive(later, row3(y, p.first + 3 * i + 3), end)
    return begin, end


@wp.func
def at_end_of(y: Any, p: Any, row: int, leg: Any):
    """Of numbers of the points that of the end of a leg; of the last one beyond it."""
    value = row1(y, row + 1)
    for i in range(1, p.legs):
        later = leg - (y.h.dtype(i) - y.h.dtype(0.5)) * ones(leg)
        value = positive(later, row1(y, row + 1 + i), value)
    return value


@wp.func
def way_along(begin: Any, end: Any, position: Any):
    """Direction (x, y) and length of a leg on the map, and how far the position is along and to starboard of it."""
    unity = ones(begin.x)
    x = end.x - begin.x
    y = end.y - begin.y
    length = root(x * x + y * y)
    # A leg straight down has no direction: north.
    tx = positive(length, x / length, unity)
    ty = positive(length, y / length, unity - unity)
    along = (position.x - begin.x) * tx + (position.y - begin.y) * ty
    aside = (position.y - begin.y) * tx - (position.x - begin.x) * ty
    return tx, ty, length, along, aside


@wp.func
def in_time(y: Any, p: Any, row: int, leg: Any, distance: Any):
    """The pace that makes a distance by the time of the end of a leg, up to the speed; 0 before the first time."""
    zero = p.speed - p.speed
    left = at_end_of(y, p, row, leg) - y.t * ones(p.speed)
    pace = least(greatest(distance, zero) / greatest(left, y.period * ones(p.speed)), p.speed)
    # Half a step is added, since times are sums that round.
    begun = y.t * ones(p.speed) + y.h.dtype(0.5) * y.h * ones(p.speed) - row1(y, row)
    return positive(begun, pace, zero)


@wp.func
def circle_on(y: Any, p: Any, row: int, leg: Any, end: Any, arrived: Any):
    """(circling, done) at this tick: whether it circles about the end of the leg, and whether the leg is done, 1 or -1.

    arrived: positive where the end is reached.
    """
    unity = ones(arrived)
    zero = unity - unity
    k = p.legs + 1
    turns = y.h.dtype(wp.static(TURN)) * at_end_of(y, p, row, leg)
    time = at_end_of(y, p, row + k, leg)
    at = p.memory + wp.static(CIRCLING)
    was = remembered(y, at) - y.h.dtype(0.5) * unity
    bearing = arctangent2(y.position.y - end.y, y.position.x - end.x)
    change = bearing - remembered(y, at + 3)
    change = p.sense * arctangent2(sine(change), cosine(change))
    angle = positive(was, remembered(y, at + 1) + change, zero)
    since = positive(was, remembered(y, at + 2) + y.period * unity, zero)
    # Half a step is added, since times are sums that round. Neither is asked for less than it is: both are 0 without a circle.
    left = greatest(turns - angle, time - since - y.h.dtype(0.5) * y.h * unity)
    asked = greatest(turns, time)
    begins = least(arrived, asked)
    circling = positive(was, positive(left, unity, zero), positive(begins, unity, zero))
    done = positive(was, positive(left, -unity, unity), positive(asked, -unity, positive(arrived, unity, -unity)))
    remember(y, at, circling)
    remember(y, at + 1, angle)
    remember(y, at + 2, since)
    remember(y, at + 3, bearing)
    return circling, done


@wp.func
def chosen(which: Any, a: Any, b: Any):
    """The wanted motion a where which is positive, else b."""
    r = b
    r.position = positive(which, a.position, b.position)
    r.velocity = positive(which, a.velocity, b.velocity)
    r.north = positive(which, a.north, b.north)
    r.east = positive(which, a.east, b.east)
    r.down = positive(which, a.down, b.down)
    r.angular_velocity = positive(which, a.angular_velocity, b.angular_velocity)
    r.speed = positive(which, a.speed, b.speed)
    return r


@functools.cache
def made(features):
    """The device code of "legs": "timed", with "circles" about points, or where an event "ends" the way."""
    timed, circles, ends = "timed" in features, "circles" in features, "ends" in features

    def params(width, real):
        """Params: numbers of each lane; first row of the points; first row of the memory.

        Then how many legs; method; whether to stop at the end; and to circle there. Behind the points are times, then turns
        and times of circles, as far as there are any.
        """
        names = ("speed", "look_ahead", "radius", "kappa", "gamma", *(("circle", "sense") if circles else ()))
        words = (
            "first",
            "memory",
            "legs",
            "method",
            "stops",
            *(("circles",) if circles else ()),
            *(("done",) if ends else ()),
        )
        numbers = dict.fromkeys(names, lane(width, real))
        return struct("Waypoints", **numbers, **dict.fromkeys(words, wp.int32))

    @wp.func
    def guide(r: Any, y: Any, p: Any):
        """Change the leg where this one is done, then head along it."""
        unity = ones(p.speed)
        zero = unity - unity
        half = y.h.dtype(0.5) * unity
        leg = remembered(y, p.memory)
        begin, end = leg_at(y, p, leg)
        tx, ty, length, along, aside = way_along(begin, end, y.position)
        ahead = length - along
        # Positive where the end is within the radius, or abeam.
        near = p.radius * p.radius - ahead * ahead - aside * aside
        legs = y.h.dtype(p.legs) * unity
        last = legs - unity
        if p.stops > 0:
            last = legs
        done = greatest(near, -ahead)
        table = p.first + 3 * p.legs + 3
        circling = zero
        centre = end
        if wp.static(circles):
            rows = table
            if wp.static(timed):
                rows = table + p.legs + 1
            circling, done = circle_on(y, p, rows, leg, end, positive(leg - legs + half, -unity, done))
        leg = positive(done, least(leg + unity, last), leg)
        remember(y, p.memory, leg)
        begin, end = leg_at(y, p, leg)
        tx, ty, length, along, aside = way_along(begin, end, y.position)
        finished = leg - legs + half
        if wp.static(circles):
            if p.circles > 0:
                circling = positive(finished, unity, circling)

        kept = remembered(y, p.memory + 1)
        aim = aside
        if p.method == wp.static(ILOS):
            aim = aside + p.kappa * kept
        square = p.look_ahead * p.look_ahead + aim * aim
        size = root(square)
        aim = positive(finished, zero, aim / size)
        ahead = positive(finished, unity, p.look_ahead / size)
        c = ahead
        s = -aim
        still = finished
        if wp.static(circles):
            still = greatest(finished, circling)
        if p.method == wp.static(ILOS):
            change = y.period * (p.look_ahead * aside / square)
            remember(y, p.memory + 1, positive(still, kept, kept + change))
        if p.method == wp.static(ALOS):
            beta = positive(finished, zero, kept)
            c = ahead * cosine(beta) - aim * sine(beta)
            s = -(aim * cosine(beta)) - ahead * sine(beta)
            change = y.period * (p.gamma * (p.look_ahead * aside / size))
            remember(y, p.memory + 1, positive(still, kept, kept + change))
        before = r
        r = headed(r, tx * c - ty * s, ty * c + tx * s)

        share = positive(length, along / length, zero)
        drop = end.z - begin.z
        depth = begin.z + clamp(share, zero, unity) * drop
        slope = positive(share * (unity - share), drop / length, zero)
        speed = p.speed
        if wp.static(timed):
            steep = positive(length, drop / length, zero)
            speed = in_time(y, p, table, leg, (length - along) * root(unity + steep * steep))
        pace = speed / root(unity + slope * slope)
        r.position = positive(finished, end, vec3(begin.x + along * tx, begin.y + along * ty, depth))
        r.velocity = positive(finished, vec3(zero, zero, zero), vec3(pace * tx, pace * ty, pace * slope))
        if wp.static(timed):
            # The way is over ground, the speed through the water.
            speed = positive(speed, greatest(speed + y.water_velocity.x - y.velocity.x, zero), zero)
        r.speed = positive(finished, zero, speed)
        if wp.static(circles):
            if any_positive(circling):
                where = positive(finished, end, centre)
                r = chosen(circling, circled(before, y, where, p.circle, p.look_ahead, p.speed, p.sense), r)
        return r

    @wp.func
    def guide_and_note(r: Any, y: Any, p: Any):
        """The same; notes that the last point is reached, and since when."""
        r = guide(r, y, p)
        unity = ones(p.speed)
        half = y.h.dtype(0.5) * unity
        was = remembered(y, p.done)
        finished = remembered(y, p.memory) - y.h.dtype(p.legs) * unity + half
        remember(y, p.done + 1, positive(was - half, remembered(y, p.done + 1), y.t * unity))
        remember(y, p.done, positive(finished, unity, was))
        return r

    return device(__name__, features, params=params, guide=guide_and_note if ends else guide)
