# SPDX-License-Identifier: Apache-2.0
"""Notes of a controller's tick in rows of the memory: the demand, the measurement and the reference."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import element, set_element, vec3
from lgvi_kernels.lanes.functions import arctangent2

# What each tick notes in rows of the memory, in this order, and how many it takes: the demand X Y Z K M N; the measurement:
# position, attitude row by row, velocities over ground and through the water, angular velocity, heading; the reference:
# position, attitude, velocity, angular velocity, heading, speed, angular acceleration; and the wrench of the actuators, which
# is noted with where they are (see gathering.py).
NOTED = {"demand": 6, "measured": 22, "reference": 23, "exerted": 6}
# Each of these vectors where any of it is saved, or the host is asked: bits of a number of the launch say so, so that what is
# saved changes no code, and with it no bit. For each row of what is noted, the number of its bit.
BITS_OF_ROWS = {
    "demand": (0,) * 6,
    "measured": (1,) * 3 + (2,) * 9 + (3,) * 3 + (4,) * 3 + (5,) * 3 + (6,),
    "reference": (7,) * 3 + (8,) * 9 + (9,) * 3 + (10,) * 3 + (11,) + (12,) + (13,) * 3,
    "exerted": (14,) * 6,
}
ALL_NOTES = (1 << 15) - 1


def bit(group, row):
    """The bit that says whether a tick notes the vector in which this row of a group is."""
    return 1 << BITS_OF_ROWS[group][row]


# The bits of what a tick notes whose host is asked, and of what is measured and wanted.
ASKED_NOTES = ALL_NOTES & ~bit("exerted", 0)
SEEN_NOTES = ASKED_NOTES & ~bit("demand", 0)
MEASURED_ROW = NOTED["demand"]
REFERENCE_ROW = MEASURED_ROW + NOTED["measured"]
EXERTED_ROW = REFERENCE_ROW + NOTED["reference"]


@wp.func
def put3(memory: Any, i: int, row: int, v: Any):
    set_element(memory, i, row, 0, v.x)
    set_element(memory, i, row, 1, v.y)
    set_element(memory, i, row, 2, v.z)


@wp.func
def get3(memory: Any, i: int, row: int):
    return vec3(element(memory, i, row, 0), element(memory, i, row, 1), element(memory, i, row, 2))


# Not inlined: what more is computed of what is noted must not change how the compiler joins products and sums before.
@wp.func(inline=False)
def put_heading(memory: Any, i: int, attitude: int, row: int):
    """The heading of an attitude of which the rows are noted."""
    north = element(memory, i, attitude, 0)
    set_element(memory, i, row, 0, arctangent2(element(memory, i, attitude + 3, 0), north))


@wp.func
def put_attitude(a: Any, memory: Any, i: int, row: int):
    put3(memory, i, row, a.north)
    put3(memory, i, row + 3, a.east)
    put3(memory, i, row + 6, a.down)


@wp.func
def put_heading_of(a: Any, memory: Any, i: int, attitude: int, row: int):
    set_element(memory, i, attitude, 0, a.north.x)
    set_element(memory, i, attitude + 3, 0, a.east.x)
    put_heading(memory, i, attitude, row)


def make_put_measured(headings):
    """(y, memory, i, row, noting): note what is measured from `row` on, where `noting` has the bits of it."""

    @wp.func
    def put_measured(y: Any, memory: Any, i: int, row: int, noting: int):
        if (noting & wp.static(bit("measured", 0))) != 0:
            put3(memory, i, row, y.position)
        if (noting & wp.static(bit("measured", 3))) != 0:
            put_attitude(y, memory, i, row + 3)
        if (noting & wp.static(bit("measured", 12))) != 0:
            put3(memory, i, row + 12, y.velocity)
        if (noting & wp.static(bit("measured", 15))) != 0:
            put3(memory, i, row + 15, y.water_velocity)
        if (noting & wp.static(bit("measured", 18))) != 0:
            put3(memory, i, row + 18, y.angular_velocity)
        if wp.static(headings):
            if (noting & wp.static(bit("measured", 21))) != 0:
                put_heading_of(y, memory, i, row + 3, row + 21)

    return put_measured


def make_put_reference(headings):
    """(r, memory, i, row, noting): the same of the wanted motion."""

    @wp.func
    def put_reference(r: Any, memory: Any, i: int, row: int, noting: int):
        if (noting & wp.static(bit("reference", 0))) != 0:
            put3(memory, i, row, r.position)
        if (noting & wp.static(bit("reference", 3))) != 0:
            put_attitude(r, memory, i, row + 3)
        if (noting & wp.static(bit("reference", 12))) != 0:
            put3(memory, i, row + 12, r.velocity)
        if (noting & wp.static(bit("reference", 15))) != 0:
            put3(memory, i, row + 15, r.angular_velocity)
        if wp.static(headings):
            if (noting & wp.static(bit("reference", 18))) != 0:
                put_heading_of(r, memory, i, row + 3, row + 18)
        if (noting & wp.static(bit("reference", 19))) != 0:
            set_element(memory, i, row + 19, 0, r.speed)
        if (noting & wp.static(bit("reference", 20))) != 0:
            put3(memory, i, row + 20, r.angular_acceleration)

    return put_reference


@wp.func
def measured_of(y: Any, memory: Any, i: int, row: int):
    """y with the measurement that is noted from `row` on."""
    y.position = get3(memory, i, row)
    y.north = get3(memory, i, row + 3)
    y.east = get3(memory, i, row + 6)
    y.down = get3(memory, i, row + 9)
    y.velocity = get3(memory, i, row + 12)
    y.water_velocity = get3(memory, i, row + 15)
    y.angular_velocity = get3(memory, i, row + 18)
    return y


@wp.func
def wanted_of(r: Any, memory: Any, i: int, row: int):
    """r with the wanted motion that is noted from `row` on."""
    r.position = get3(memory, i, row)
    r.north = get3(memory, i, row + 3)
    r.east = get3(memory, i, row + 6)
    r.down = get3(memory, i, row + 9)
    r.velocity = get3(memory, i, row + 12)
    r.angular_velocity = get3(memory, i, row + 15)
    r.speed = element(memory, i, row + 19, 0)
    r.angular_acceleration = get3(memory, i, row + 20)
    return r
