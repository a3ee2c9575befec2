# SPDX-License-Identifier: Apache-2.0
"""The account of the energy that a vehicle uses, and what all but its actuators take."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

ACCOUNT = True


@functools.cache
def params(width, real):
    """Params: the hotel load [W]; where the energy used lies in the memory."""
    return struct("EnergyUse", hotel=lane(width, real), memory=wp.int32)


@wp.func
def power(watts: Any, view: Any, p: Any):
    """The hotel load."""
    return watts + p.hotel
