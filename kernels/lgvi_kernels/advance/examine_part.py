# SPDX-License-Identifier: Apache-2.0
"""A kernel that evaluates one part of a controller alone, at looks that are given."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.advance.examine import Examine
from lgvi_kernels.lanes.arithmetic import lane, vec3
from lgvi_kernels.lanes.look import measurement_struct, reference_struct
from lgvi_kernels.lanes.packet import put
from lgvi_kernels.lanes.state import wrench_struct
from lgvi_kernels.maps.compose import params_of
from lgvi_kernels.maps.in_turn import ROLES, in_turn

# Vectors of a look in `looks[packet, column]`, three columns each; then the wanted speed, and the true position.
MEASURED = ("position", "north", "east", "down", "velocity", "water_velocity", "angular_velocity")
WANTED = ("position", "velocity", "north", "east", "down", "angular_velocity", "angular_acceleration")
DEMANDED = ("force", "torque")
SPEED = 3 * (len(MEASURED) + len(WANTED) + len(DEMANDED))
TRUE_POSITION = SPEED + 1
LOOK_FIELDS = TRUE_POSITION + 3
# A look after the part: all but the true position.
OUT_FIELDS = TRUE_POSITION


@wp.func
def three(rows: Any, i: int, at: int):
    return vec3(rows[i, at], rows[i, at + 1], rows[i, at + 2])


@wp.func
def measured_of(y: Any, looks: Any, i: int):
    """y with what is measured."""
    y.position = three(looks, i, 0)
    y.north = three(looks, i, 3)
    y.east = three(looks, i, 6)
    y.down = three(looks, i, 9)
    y.velocity = three(looks, i, 12)
    y.water_velocity = three(looks, i, 15)
    y.angular_velocity = three(looks, i, 18)
    y.b = three(looks, i, wp.static(TRUE_POSITION))
    return y


@wp.func
def wanted_of(r: Any, looks: Any, i: int):
    """r with what is wanted."""
    r.position = three(looks, i, 21)
    r.velocity = three(looks, i, 24)
    r.north = three(looks, i, 27)
    r.east = three(looks, i, 30)
    r.down = three(looks, i, 33)
    r.angular_velocity = three(looks, i, 36)
    r.angular_acceleration = three(looks, i, 39)
    r.speed = looks[i, wp.static(SPEED)]
    return r


@wp.func
def put_look(out: Any, i: int, y: Any, r: Any, w: Any):
    """Write what is measured, wanted and demanded after the part."""
    put(out, i, 0, y.position)
    put(out, i, 3, y.north)
    put(out, i, 6, y.east)
    put(out, i, 9, y.down)
    put(out, i, 12, y.velocity)
    put(out, i, 15, y.water_velocity)
    put(out, i, 18, y.angular_velocity)
    put(out, i, 21, r.position)
    put(out, i, 24, r.velocity)
    put(out, i, 27, r.north)
    put(out, i, 30, r.east)
    put(out, i, 33, r.down)
    put(out, i, 36, r.angular_velocity)
    put(out, i, 39, r.angular_acceleration)
    put(out, i, 42, w.force)
    put(out, i, 45, w.torque)
    out[i, wp.static(SPEED)] = r.speed


@functools.cache
def make_examine_part(module, numbers, width, real):
    """Build (without compiling) the kernel that calls this module's functions of all roles, one after another."""
    Lane, Params = lane(width, real), params_of((module,), (numbers,), width, real)
    Measurement, Reference, Wrench = (
        measurement_struct(width, real),
        reference_struct(width, real),
        wrench_struct(width, real),
    )
    measure, guide, act, allocate, send = (in_turn((module,), role) for role in ROLES)

    @wp.kernel(module="unique", enable_backward=False)
    def examine_part(
        # the part's numbers
        params: wp.array(dtype=Params),
        table: wp.array2d(dtype=Lane),
        # what is measured, wanted and demanded before the part; number of the look, of its step, length of a step
        looks: wp.array2d(dtype=Lane),
        look: int,
        step: int,
        h: real,
        period: real,
        # whether the part acts, or nothing does
        acts: int,
        # in and out
        memory: wp.array2d(dtype=Lane),
        # out
        out: wp.array2d(dtype=Lane),
    ):
        i = wp.tid() % looks.shape[0]
        p = params[i % params.shape[0]]
        y = measured_of(Measurement(), looks, i)
        y.t = real(step) * h
        y.h = h
        y.period = period
        y.step = step
        y.look = look
        y.table = table
        y.memory = memory
        y.packet = i
        y.entry = i % table.shape[0]
        r = wanted_of(Reference(), looks, i)
        w = Wrench()
        w.force = three(looks, i, 42)
        w.torque = three(looks, i, 45)
        if acts > 0:
            if wp.static(measure is not None):
                y = measure(y, r, y, p)
            if wp.static(guide is not None):
                r = guide(r, r, y, p)
            if wp.static(act is not None):
                w = act(w, r, y, p)
            if wp.static(allocate is not None):
                w = allocate(w, r, y, p)
            if wp.static(send is not None):
                y = send(y, r, y, p)
        put_look(out, i, y, r, w)

    return Examine(examine_part, Lane, Params)
