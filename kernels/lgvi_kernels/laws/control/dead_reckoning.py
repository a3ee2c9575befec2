# SPDX-License-Identifier: Apache-2.0
"""The position from measured attitude and velocity."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.readings import remember3, remembered3


@functools.cache
def params(width, real):
    """Params: error of the start; weights of the last velocity and of this; what it takes; first of its rows of memory.

    These are position (3) and velocity (3), inertial.
    """
    words = dict.fromkeys(("memory", "through_water", "measured_depth"), wp.int32)
    return struct("DeadReckoning", start_error=lane3(width, real), weight=real, weight_now=real, **words)


@wp.func
def measure(y: Any, p: Any):
    """b <- b + T (weight R nu of the last tick + weight_now R nu), from the position that is measured at the first tick."""
    v = to_inertial(y, y.velocity)
    if p.through_water > 0:
        v = to_inertial(y, y.water_velocity)
    b = y.position + p.start_error
    if y.step > y.start:
        last = remembered3(y, p.memory + 3)
        b = remembered3(y, p.memory) + (y.period * p.weight) * last + (y.period * p.weight_now) * v
    remember3(y, p.memory, b)
    remember3(y, p.memory + 3, v)
    if p.measured_depth > 0:
        b = vec3(b.x, b.y, y.position.z)
    y.position = b
    return y
