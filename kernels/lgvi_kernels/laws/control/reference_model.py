# SPDX-License-Identifier: Apache-2.0
"""A reference model of third order: what is wanted, led smoothly from the measured state."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import remember3, remembered3

# Rows of a number that is filtered: its map over a period, line by line, and the limit of its rate.
ROWS = 10


# First row of the table; first row of the memory, x, x' and x'' of each number; how many, 2 or 4.
params = make_params("ReferenceModel", words="first memory count")


@wp.func
def led(y: Any, p: Any, i: int, start: Any, rate: Any):
    """x, x' and x'' of number i; at the first tick those of the measured state."""
    z = remembered3(y, p.memory + 3 * i)
    if y.step == y.start:
        z = vec3(start, rate, ones(start) - ones(start))
    return z


@wp.func
def lead(y: Any, p: Any, i: int, z: Any, target: Any):
    """Move number i on to the next tick, with its target held."""
    at = p.first + wp.static(ROWS) * i
    gap = z.x - target
    x = target + (row1(y, at) * gap + row1(y, at + 1) * z.y + row1(y, at + 2) * z.z)
    rate = row1(y, at + 3) * gap + row1(y, at + 4) * z.y + row1(y, at + 5) * z.z
    change = row1(y, at + 6) * gap + row1(y, at + 7) * z.y + row1(y, at + 8) * z.z
    limit = row1(y, at + 9)
    over = absolute(rate) - limit
    rate = clamp(rate, -limit, limit)
    x = positive(over, z.x + y.period * rate, x)
    change = positive(over, ones(x) - ones(x), change)
    remember3(y, p.memory + 3 * i, vec3(x, rate, change))
    return z


@wp.func
def guide(r: Any, y: Any, p: Any):
    """The wanted depth and heading, and where four are filtered the position, with their rates."""
    velocity = to_inertial(y, y.velocity)
    down = led(y, p, p.count - 2, y.position.z, velocity.z)
    down = lead(y, p, p.count - 2, down, r.position.z)
    position = vec3(r.position.x, r.position.y, down.x)
    rates = vec3(r.velocity.x, r.velocity.y, down.y)
    if p.count > 2:
        north = led(y, p, 0, y.position.x, velocity.x)
        north = lead(y, p, 0, north, r.position.x)
        east = led(y, p, 1, y.position.y, velocity.y)
        east = lead(y, p, 1, east, r.position.y)
        position = vec3(north.x, east.x, down.x)
        rates = vec3(north.y, east.y, down.y)
    r.position = position
    r.velocity = rates
    heading = led(y, p, p.count - 1, arctangent2(y.east.x, y.north.x), y.angular_velocity.z)
    c = cosine(heading.x)
    s = sine(heading.x)
    e = arctangent2(r.east.x * c - r.north.x * s, r.north.x * c + r.east.x * s)
    heading = lead(y, p, p.count - 1, heading, heading.x + e)
    # The wanted attitude, turned back by e about the vertical.
    c = cosine(e)
    s = sine(e)
    north_axis = c * r.north + s * r.east
    r.east = c * r.east - s * r.north
    r.north = north_axis
    r.angular_velocity = heading.y * r.down
    r.angular_acceleration = heading.z * r.down
    return r
