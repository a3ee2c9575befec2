# SPDX-License-Identifier: Apache-2.0
"""Thrusters whose commands are held: what they push never changes in body axes, so the host has summed it."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import add, make_params  # noqa: F401
from lgvi_kernels.laws.wrench import law

# The sum of all thrusters' forces, and of their torques, in the kernel's axes.
params = make_params("ThrustersHeld", vectors="force torque")


# Also the power of all thrusters.
powered_params = make_params("ThrustersHeldPowered", vectors="force torque", lanes="power")


@wp.func
def held_power(watts: Any, view: Any, p: Any):
    """The power that never changes either."""
    return watts + p.power


@functools.cache
def made(features):
    """The same thrusters with "power"."""
    return device(__name__, features, params=powered_params, law=law, power=held_power)
