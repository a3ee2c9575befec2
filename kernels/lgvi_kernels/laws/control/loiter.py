# SPDX-License-Identifier: Apache-2.0
"""Guidance round a circle about a place."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.circle import circled

# The centre; numbers of each lane, among them the sense, 1 clockwise from above or -1.
params = make_params("Loiter", vectors="center", lanes="radius speed look_ahead sense")


@wp.func
def guide(r: Any, y: Any, p: Any):
    """Onto the circle, and round it."""
    return circled(r, y, p.center, p.radius, p.look_ahead, p.speed, p.sense)
