# SPDX-License-Identifier: Apache-2.0
"""Guidance round a circle about a place."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.circle import circled


@functools.cache
def params(width, real):
    """Params: the centre; numbers of each lane, among them the sense, 1 clockwise from above or -1."""
    numbers = dict.fromkeys(("radius", "speed", "look_ahead", "sense"), lane(width, real))
    return struct("Loiter", center=lane3(width, real), **numbers)


@wp.func
def guide(r: Any, y: Any, p: Any):
    """Onto the circle, and round it."""
    return circled(r, y, p.center, p.radius, p.look_ahead, p.speed, p.sense)
