"""The body's origin rises to a depth."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import lane, struct, sub  # noqa: F401


@functools.cache
def params(width, real):
    """Params: depth [m]."""
    return struct("Surface", depth=lane(width, real))


@wp.func
def distance(view: Any, p: Any):
    """Metres to go."""
    return view.b.z - p.depth
