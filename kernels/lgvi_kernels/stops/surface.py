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
    """Distance below the depth at which the member stops [m]."""
    return view.b.z - p.depth
