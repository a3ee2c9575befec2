# SPDX-License-Identifier: Apache-2.0
"""What a controller measures and wants at a tick: the structs that its parts hand on.

Both are in the user's body axes and about the user's origin, whatever the kernel's own are.
"""

import functools

import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, lane3
from lgvi_kernels.lanes.state import struct, table_number


@functools.cache
def measurement_struct(width, real, shared=False):
    """What sensors say: the truth at first.

    north, east, down: the inertial axes in body axes, as in a View; position [m], inertial; velocity over ground and
    water_velocity through the water [m/s], angular_velocity [rad/s], body axes.
    t, period, h [s]: time of this tick, time between ticks, step. step, tick: number of the step that begins, of this tick;
    start: the step of the first tick.
    table, memory, packet, entry: as in a View, shared too; b, the true position, is there for functions of a View.
    """
    Lane, Lane3 = lane(width, real), lane3(width, real)
    directions = {"north": Lane3, "east": Lane3, "down": Lane3, "position": Lane3, "b": Lane3}
    rates = {"velocity": Lane3, "water_velocity": Lane3, "angular_velocity": Lane3}
    times = {"t": real, "period": real, "h": real, "step": wp.int32, "tick": wp.int32, "start": wp.int32}
    table = wp.array2d(dtype=table_number(width, real, shared))
    rows = {"table": table, "memory": wp.array2d(dtype=Lane), "packet": wp.int32, "entry": wp.int32}
    return struct("Measurement", **directions, **rates, **times, **rows)


@functools.cache
def reference_struct(width, real):
    """The wanted motion.

    position [m], velocity [m/s], inertial; north, east, down: the wanted attitude, as in a View; angular_velocity [rad/s] and
    angular_acceleration [rad/s^2], in the axes of that attitude; speed [m/s], through the water ahead.
    """
    Lane3 = lane3(width, real)
    vectors = ("position", "velocity", "north", "east", "down", "angular_velocity", "angular_acceleration")
    return struct("Reference", **dict.fromkeys(vectors, Lane3), speed=lane(width, real))


@functools.cache
def held_key():
    """Where an actuator finds its commands: `row`, the first of them in the memory."""
    return struct("HeldKey", row=wp.int32)


@functools.cache
def delayed_key():
    """The same where commands arrive late.

    row: the first of the latest; old: of those before; begin: row of the step from which on the latest act.
    """
    return struct("DelayedKey", row=wp.int32, old=wp.int32, begin=wp.int32)
