# SPDX-License-Identifier: Apache-2.0
"""The attitude from measured rates, and in the long run from a measured attitude."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.low_pass import share
from lgvi_kernels.laws.control.readings import (
    put_attitude,
    remember3,
    remembered3,
    taken_attitude,
    turn_to,
    turned,
)

# The time constant of each lane; first of its rows of the memory: attitude (9), angular velocity (3).
params = make_params("ComplementaryFilter", lanes="time_constant", words="memory")


@wp.func
def orthonormal(y: Any):
    """Without the round-off that turns add up."""
    unity = ones(y.north.x)
    y.north = (unity / root(dot(y.north, y.north))) * y.north
    y.east = y.east - dot(y.north, y.east) * y.north
    y.east = (unity / root(dot(y.east, y.east))) * y.east
    y.down = cross(y.north, y.east)
    return y


@wp.func
def measure(y: Any, p: Any):
    """R <- R exp(T (Om_old + Om) / 2), then the part 1 - exp(-T / time constant) of the turn to the measured attitude."""
    if y.step > y.start:
        z = taken_attitude(y, p.memory)
        mean = (y.h.dtype(0.5) * y.period) * (remembered3(y, p.memory + 9) + y.angular_velocity)
        z = turned(z, mean)
        y = orthonormal(turned(z, share(y, p.time_constant) * turn_to(z, y)))
    put_attitude(y, p.memory)
    remember3(y, p.memory + 9, y.angular_velocity)
    return y
