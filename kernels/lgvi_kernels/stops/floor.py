"""The body's origin sinks to the sea floor."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import lane, struct, sub  # noqa: F401


@functools.cache
def params(width, real):
    """Params: depth [m]."""
    return struct("Floor", depth=lane(width, real))


@wp.func
def distance(view: Any, p: Any):
    """Metres to go."""
    return p.depth - view.b.z
