# SPDX-License-Identifier: Apache-2.0
"""A kernel that evaluates one part of a controller alone, at ticks that are given."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.advance.examine import Examine
from lgvi_kernels.lanes.arithmetic import lane, vec3
from lgvi_kernels.lanes.packet import put
from lgvi_kernels.lanes.state import wrench_struct
from lgvi_kernels.lanes.tick import measurement_struct, reference_struct
from lgvi_kernels.maps.compose import params_of
from lgvi_kernels.maps.in_turn import ROLES, in_turn

# Vectors of a tick in `ticks[packet, column]`, three columns each; then the wanted speed, and the true position.
MEASURED = ("position", "north", "east", "down", "velocity", "water_velocity", "angular_velocity")
WANTED = ("position", "velocity", "north", "east", "down", "angular_velocity", "angular_acceleration")
DEMANDED = ("force", "torque")
SPEED = 3 * (len(MEASURED) + len(WANTED) + len(DEMANDED))
TRUE_POSITION = SPEED + 1
TICK_FIELDS = TRUE_POSITION + 3
# A tick after the part: all but the true position.
OUT_FIELDS = TRUE_POSITION


@wp.func
def three(rows: Any, i: int, at: int):
    return vec3(rows[i, at], rows[i, at + 1], rows[i, at + 2])


@wp.func
def measured_of(y: Any, ticks: Any, i: int):
    """y with what is measured."""
    y.position = three(ticks, i, 0)
    y.north = three(ticks, i, 3)
    y.east = three(ticks, i, 6)
    y.down = three(ticks, i, 9)
    y.velocity = three(ticks, i, 12)
    y.water_velocity = three(ticks, i, 15)
    y.angular_velocity = three(ticks, i, 18)
    y.b = three(ticks, i, wp.static(TRUE_POSITION))
    return y


@wp.func
def wanted_of(r: Any, ticks: Any, i: int):
    """r with what is wanted."""
    r.position = three(ticks, i, 21)
    r.velocity = three(ticks, i, 24)
    r.north = three(ticks, i, 27)
    r.east = three(ticks, i, 30)
    r.down = three(ticks, i, 33)
    r.angular_velocity = three(ticks, i, 36)
    r.angular_acceleration = three(ticks, i, 39)
    r.speed = ticks[i, wp.static(SPEED)]
    return r


@wp.func
def put_tick(out: Any, i: int, y: Any, r: Any, w: Any):
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
        # what is measured, wanted and demanded before the part; number of the tick, of its step, length of a step
        ticks: wp.array2d(dtype=Lane),
        tick: int,
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
        i = wp.tid() % ticks.shape[0]
        p = params[i % params.shape[0]]
        y = measured_of(Measurement(), ticks, i)
        y.t = real(step) * h
        y.h = h
        y.period = period
        y.step = step
        y.tick = tick
        y.table = table
        y.memory = memory
        y.packet = i
        y.entry = i % table.shape[0]
        r = wanted_of(Reference(), ticks, i)
        w = Wrench()
        w.force = three(ticks, i, 42)
        w.torque = three(ticks, i, 45)
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
        put_tick(out, i, y, r, w)

    return Examine(examine_part, Lane, Params)
