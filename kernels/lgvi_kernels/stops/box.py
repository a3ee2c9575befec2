"""The body's origin leaves a box."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import lane3, least, struct, sub  # noqa: F401


@functools.cache
def params(width, real):
    """Params: lower and upper corner [m, inertial]."""
    Lane3 = lane3(width, real)
    return struct("Box", lower=Lane3, upper=Lane3)


@wp.func
def distance(view: Any, p: Any):
    """Metres to the nearest face."""
    a = view.b - p.lower
    z = p.upper - view.b
    return least(least(least(a.x, a.y), a.z), least(least(z.x, z.y), z.z))
