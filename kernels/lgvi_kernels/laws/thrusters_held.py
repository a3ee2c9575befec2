# SPDX-License-Identifier: Apache-2.0
"""Thrusters whose commands are held: what they push never changes in body axes, so the host has summed it."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import add, lane, lane3, struct  # noqa: F401
from lgvi_kernels.laws.wrench import law


@functools.cache
def params(width, real):
    """Params: the sum of all thrusters' forces, and of their torques, in the kernel's axes."""
    return struct("ThrustersHeld", force=lane3(width, real), torque=lane3(width, real))


@functools.cache
def powered_params(width, real):
    """Params: also the power of all thrusters."""
    return struct("ThrustersHeldPowered", force=lane3(width, real), torque=lane3(width, real), power=lane(width, real))


@wp.func
def held_power(watts: Any, view: Any, p: Any):
    """The power that never changes either."""
    return watts + p.power


@functools.cache
def made(features):
    """The same thrusters with "power"."""
    return device(__name__, features, params=powered_params, law=law, power=held_power)
