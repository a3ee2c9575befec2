"""A steady, uniform current: in its frame nothing changes, and that frame carries the vehicle."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import add, lane3, struct  # noqa: F401

FLOW = "steady"


@functools.cache
def params(width, real):
    """Params: velocity [m/s], inertial."""
    return struct("Current", velocity=lane3(width, real))


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u = const."""
    f.velocity = f.velocity + p.velocity
    return f
