# SPDX-License-Identifier: Apache-2.0
"""Thrusters whose commands are held: what they push never changes in body axes, so the host has summed it."""

import functools

from lgvi_kernels.law import lane3, struct
from lgvi_kernels.laws.wrench import law  # noqa: F401


@functools.cache
def params(width, real):
    """Params: the sum of all thrusters' forces, and of their torques, in the kernel's axes."""
    return struct("ThrustersHeld", force=lane3(width, real), torque=lane3(width, real))
