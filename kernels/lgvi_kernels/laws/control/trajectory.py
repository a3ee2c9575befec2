# SPDX-License-Identifier: Apache-2.0
"""A trajectory: position, heading and speed as polynomials of time, piece by piece."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.set_point import headed

# Rows of a piece: its time, then for each power of the time since position (3), heading and speed.
ROWS = 21


# First row of the table; pieces before the last one; whether headings, and speeds, are wanted.
params = make_params("Trajectory", words="first pieces turns paced")


@wp.func
def cubic(u: Any, a: Any, b: Any, c: Any, d: Any):
    """a + u (b + u (c + u d))."""
    return a + u * (b + u * (c + u * d))


@wp.func
def slope(u: Any, b: Any, c: Any, d: Any):
    """The rate of `cubic`."""
    unity = ones(u)
    return b + u * ((unity + unity) * c + u * ((unity + unity + unity) * d))


@wp.func
def guide(r: Any, y: Any, p: Any):
    """Position and velocity; heading with its rates; speed."""
    unity = ones(y.position.x)
    zero = unity - unity
    position = row3(y, p.first + 1)
    heading = row1(y, p.first + 4)
    speed = row1(y, p.first + 5)
    velocity = vec3(zero, zero, zero)
    rate = zero
    acceleration = zero
    for i in range(p.pieces + 1):
        at = p.first + wp.static(ROWS) * i
        u = y.t * unity - row1(y, at)
        # Half a step is added, since times are sums that round.
        begun = u + y.h.dtype(0.5) * y.h * unity
        position = positive(
            begun, cubic(u, row3(y, at + 1), row3(y, at + 6), row3(y, at + 11), row3(y, at + 16)), position
        )
        velocity = positive(begun, slope(u, row3(y, at + 6), row3(y, at + 11), row3(y, at + 16)), velocity)
        if p.turns > 0:
            c = row1(y, at + 14)
            d = row1(y, at + 19)
            heading = positive(begun, cubic(u, row1(y, at + 4), row1(y, at + 9), c, d), heading)
            rate = positive(begun, slope(u, row1(y, at + 9), c, d), rate)
            acceleration = positive(begun, (unity + unity) * (c + u * ((unity + unity + unity) * d)), acceleration)
        if p.paced > 0:
            speed = positive(begun, row1(y, at + 5) + u * row1(y, at + 10), speed)
    r.position = position
    r.velocity = velocity
    if p.turns > 0:
        r = headed(r, cosine(heading), sine(heading))
        r.angular_velocity = vec3(zero, zero, rate)
        r.angular_acceleration = vec3(zero, zero, acceleration)
    if p.paced == 0:
        speed = root(dot(velocity, velocity))
    r.speed = speed
    return r
