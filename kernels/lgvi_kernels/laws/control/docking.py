# SPDX-License-Identifier: Apache-2.0
"""Guidance into a dock along its centre line, which goes round where the vehicle leaves the funnel."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.set_point import headed

LANES = (
    *("c", "s", "speed", "contact_speed", "slowing", "look_ahead", "kappa"),
    *("approach", "judged", "mouth", "slope", "offset"),
)
# What the vehicle does, in the first row of the memory; 0 before the first tick. Then the integral of the line, and how often
# what it does has changed.
ON_LINE = 1.0
GOING_ROUND = 2.0
DOCKED = 3.0


# The dock, cosine and sine of its heading and numbers of each lane; first of three rows of the memory.
params = make_params(
    "Docking",
    vectors="position",
    lanes="c s speed contact_speed slowing look_ahead kappa approach judged mouth slope offset",
    words="memory",
)


@wp.func
def next_phase(phase: Any, left: Any, outside: Any, p: Any):
    """What the vehicle does now: left: way to the dock's plane; outside: how far it is outside the funnel."""
    unity = ones(left)
    half = unity / (unity + unity)
    line = left.dtype(wp.static(ON_LINE)) * unity
    away = left.dtype(wp.static(GOING_ROUND)) * unity
    docked = left.dtype(wp.static(DOCKED)) * unity
    # On the line: into the dock or past it, or out of the funnel.
    passed = positive(outside, away, docked)
    near = positive(left - p.judged, line, positive(outside, away, line))
    on_line = positive(left, near, passed)
    begun = positive(left, line, away)
    round_ = positive(p.approach - left, away, line)
    return positive(
        phase - half,
        positive(phase - line - half, positive(phase - away - half, docked, round_), on_line),
        begun,
    )


@wp.func
def guide(r: Any, y: Any, p: Any):
    """Along the centre line, or round to where it begins."""
    unity = ones(p.speed)
    zero = unity - unity
    half = unity / (unity + unity)
    north = y.position.x - p.position.x
    east = y.position.y - p.position.y
    left = -(north * p.c + east * p.s)
    aside = east * p.c - north * p.s
    below = y.position.z - p.position.z
    outside = root(aside * aside + below * below) - p.mouth - greatest(left, zero) * p.slope
    was = remembered(y, p.memory)
    phase = next_phase(was, left, outside, p)
    remember(y, p.memory, phase)
    changes = remembered(y, p.memory + 2)
    remember(y, p.memory + 2, changes + positive(was - half, positive(absolute(phase - was) - half, unity, zero), zero))
    line = y.h.dtype(wp.static(ON_LINE)) * unity
    going = phase - line - half
    docked = phase - line - line - half

    kept = remembered(y, p.memory + 1)
    aim = aside + p.kappa * kept
    square = p.look_ahead * p.look_ahead + aim * aim
    size = root(square)
    remember(y, p.memory + 1, positive(going, zero, kept + y.period * (p.look_ahead * aside / square)))
    # Components along the centre line and to starboard of it of the wanted heading.
    c = p.look_ahead / size
    s = -(aim / size)
    # Round: to the place abeam of the line's beginning, from the dock (-approach, offset).
    x = left - p.approach
    z = p.offset - aside
    far = root(x * x + z * z)
    c = positive(going, positive(far, x / far, unity), c)
    s = positive(going, positive(far, z / far, zero), s)
    c = positive(docked, unity, c)
    s = positive(docked, zero, s)
    r = headed(r, p.c * c - p.s * s, p.s * c + p.c * s)

    pace = p.contact_speed + clamp(left / p.slowing, zero, unity) * (p.speed - p.contact_speed)
    pace = positive(docked, zero, positive(going, p.speed, pace))
    r.velocity = pace * r.north.x * vec3(unity, zero, zero) + pace * r.east.x * vec3(zero, unity, zero)
    ahead = positive(going, zero, -left)
    place = vec3(p.position.x + ahead * p.c, p.position.y + ahead * p.s, p.position.z)
    turned = vec3(y.position.x, y.position.y, p.position.z)
    r.position = positive(docked, p.position, positive(going, turned, place))
    # The pace is over ground, the speed through the water.
    r.speed = positive(docked, zero, greatest(pace + y.water_velocity.x - y.velocity.x, zero))
    return r
