# SPDX-License-Identifier: Apache-2.0
"""Readings of a sensor, as numbers that a part may change: a scalar or a 3-vector of the Measurement."""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.law import *

# Numbers of what can be read.
COUNTS = {
    "depth": 1,
    "heading": 1,
    "position": 3,
    "attitude": 3,
    "velocity": 3,
    "water_velocity": 3,
    "angular_velocity": 3,
}


class Reading(NamedTuple):
    """Functions of one thing that can be read.

    values: y -> a 3-vector, whose first `count` numbers are the reading; with_values: (y, v) -> y that reads v.
    shifted: (y, e) -> y whose reading has the error e.
    put: (y, row) writes it into `rows` rows of the memory; taken: (y, row) -> y that reads what is there.
    """

    count: int
    rows: int
    values: Any
    with_values: Any
    shifted: Any
    put: Any
    taken: Any


@wp.func
def remember3(y: Any, row: int, v: Any):
    """Write three rows of the memory."""
    remember(y, row, v.x)
    remember(y, row + 1, v.y)
    remember(y, row + 2, v.z)


@wp.func
def remembered3(y: Any, row: int):
    """Three rows of the memory."""
    return vec3(remembered(y, row), remembered(y, row + 1), remembered(y, row + 2))


@wp.func
def heading(y: Any):
    """The heading, from the forward axis alone, in [-pi, pi]."""
    return arctangent2(y.east.x, y.north.x)


@wp.func(inline=False)
def headed(y: Any, e: Any):
    """The attitude turned by e about the vertical."""
    c = cosine(e)
    s = sine(e)
    north = c * y.north - s * y.east
    y.east = s * y.north + c * y.east
    y.north = north
    return y


@wp.func
def rotated(v: Any, w: Any):
    """exp(-hat(w)) v, Rodrigues' formula: a direction of space, in the axes of a body that has turned by w."""
    unity = ones(v.x)
    half = v.x.dtype(0.5)
    # n of w = 0 is so small that the quotients of sines are 1.
    n = greatest(root(dot(w, w)), v.x.dtype(1e-18) * unity)
    sinc_half = sine(half * n) / (half * n)
    inner = cross(w, v)
    return v - (sine(n) / n) * inner + (half * sinc_half * sinc_half) * cross(w, inner)


@wp.func(inline=False)
def turned(y: Any, w: Any):
    """R exp(hat(w)): the attitude turned by a rotation vector of the body's axes."""
    y.north = rotated(y.north, w)
    y.east = rotated(y.east, w)
    y.down = rotated(y.down, w)
    return y


@wp.func(inline=False)
def turn_to(y: Any, z: Any):
    """The rotation vector w with R_z = R_y exp(hat(w)); 0 where they are half a turn apart, since there it is not unique."""
    half = y.north.x.dtype(0.5)
    v = half * (cross(z.north, y.north) + cross(z.east, y.east) + cross(z.down, y.down))
    unity = ones(v.x)
    cosine_of = half * (dot(y.north, z.north) + dot(y.east, z.east) + dot(y.down, z.down) - unity)
    size = root(dot(v, v))
    angle = arctangent2(size, cosine_of)
    floor = v.x.dtype(1e-18) * unity
    return positive(size - floor, angle / greatest(size, floor), unity) * v


@wp.func
def put_attitude(y: Any, row: int):
    """Write the attitude into nine rows of the memory."""
    remember3(y, row, y.north)
    remember3(y, row + 3, y.east)
    remember3(y, row + 6, y.down)


@wp.func
def taken_attitude(y: Any, row: int):
    """With the attitude of nine rows of the memory."""
    y.north = remembered3(y, row)
    y.east = remembered3(y, row + 3)
    y.down = remembered3(y, row + 6)
    return y


@wp.func(inline=False)
def angles(y: Any):
    """Roll, pitch and yaw."""
    level = root(y.north.x * y.north.x + y.east.x * y.east.x)
    return vec3(arctangent2(y.down.y, y.down.z), arctangent2(-y.down.x, level), heading(y))


@wp.func(inline=False)
def with_angles(y: Any, v: Any):
    """With the attitude of roll, pitch and yaw."""
    cr = cosine(v.x)
    sr = sine(v.x)
    cp = cosine(v.y)
    sp = sine(v.y)
    cy = cosine(v.z)
    sy = sine(v.z)
    y.north = vec3(cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr)
    y.east = vec3(sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr)
    y.down = vec3(-sp, cp * sr, cp * cr)
    return y


@wp.func
def depth_of(y: Any):
    zero = ones(y.position.x) - ones(y.position.x)
    return vec3(y.position.z, zero, zero)


@wp.func
def with_depth(y: Any, v: Any):
    y.position = vec3(y.position.x, y.position.y, v.x)
    return y


@wp.func
def heading_of(y: Any):
    zero = ones(y.position.x) - ones(y.position.x)
    return vec3(heading(y), zero, zero)


@wp.func
def with_heading(y: Any, v: Any):
    return headed(y, v.x - heading(y))


@wp.func
def shifted_heading(y: Any, e: Any):
    return headed(y, e.x)


@wp.func
def position_of(y: Any):
    return y.position


@wp.func
def with_position(y: Any, v: Any):
    y.position = v
    return y


@wp.func
def velocity_of(y: Any):
    return y.velocity


@wp.func
def with_velocity(y: Any, v: Any):
    y.velocity = v
    return y


@wp.func
def water_velocity_of(y: Any):
    return y.water_velocity


@wp.func
def with_water_velocity(y: Any, v: Any):
    y.water_velocity = v
    return y


@wp.func
def angular_velocity_of(y: Any):
    return y.angular_velocity


@wp.func
def with_angular_velocity(y: Any, v: Any):
    y.angular_velocity = v
    return y


_VALUES = {
    "depth": (depth_of, with_depth),
    "heading": (heading_of, with_heading),
    "position": (position_of, with_position),
    "attitude": (angles, with_angles),
    "velocity": (velocity_of, with_velocity),
    "water_velocity": (water_velocity_of, with_water_velocity),
    "angular_velocity": (angular_velocity_of, with_angular_velocity),
}


@functools.cache
def make_reading(of):
    """The Reading of a name in COUNTS."""
    count, (values, with_values) = COUNTS[of], _VALUES[of]
    if of == "attitude":
        return Reading(count, 9, values, with_values, turned, put_attitude, taken_attitude)

    @wp.func
    def moved(y: Any, e: Any):
        return with_values(y, values(y) + e)

    @wp.func
    def put(y: Any, row: int):
        if wp.static(count == 1):
            remember(y, row, values(y).x)
        else:
            remember3(y, row, values(y))

    @wp.func
    def taken(y: Any, row: int):
        v = values(y)
        if wp.static(count == 1):
            v.x = remembered(y, row)
        else:
            v = remembered3(y, row)
        return with_values(y, v)

    return Reading(count, count, values, with_values, shifted_heading if of == "heading" else moved, put, taken)
