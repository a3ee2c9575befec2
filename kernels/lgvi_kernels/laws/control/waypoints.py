# SPDX-License-Identifier: Apache-2.0
"""Waypoints: legs one after another, and the heading along each by line of sight."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.set_point import headed

ILOS = 1
ALOS = 2


@functools.cache
def params(width, real):
    """Params: numbers of each lane; first row of the points; first of two rows of the memory, the leg and J or beta.

    Then how many legs; method; whether to stop at the end.
    """
    numbers = dict.fromkeys(("speed", "look_ahead", "radius", "kappa", "gamma"), lane(width, real))
    return struct("Waypoints", **numbers, **dict.fromkeys(("first", "memory", "legs", "method", "stops"), wp.int32))


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
    leg = positive(greatest(near, -ahead), least(leg + unity, last), leg)
    remember(y, p.memory, leg)
    begin, end = leg_at(y, p, leg)
    tx, ty, length, along, aside = way_along(begin, end, y.position)
    finished = leg - legs + half

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
    if p.method == wp.static(ILOS):
        change = y.period * (p.look_ahead * aside / square)
        remember(y, p.memory + 1, positive(finished, kept, kept + change))
    if p.method == wp.static(ALOS):
        beta = positive(finished, zero, kept)
        c = ahead * cosine(beta) - aim * sine(beta)
        s = -(aim * cosine(beta)) - ahead * sine(beta)
        change = y.period * (p.gamma * (p.look_ahead * aside / size))
        remember(y, p.memory + 1, positive(finished, kept, kept + change))
    r = headed(r, tx * c - ty * s, ty * c + tx * s)

    share = positive(length, along / length, zero)
    drop = end.z - begin.z
    depth = begin.z + clamp(share, zero, unity) * drop
    slope = positive(share * (unity - share), drop / length, zero)
    pace = p.speed / root(unity + slope * slope)
    r.position = positive(finished, end, vec3(begin.x + along * tx, begin.y + along * ty, depth))
    r.velocity = positive(finished, vec3(zero, zero, zero), vec3(pace * tx, pace * ty, pace * slope))
    r.speed = positive(finished, zero, p.speed)
    return r
