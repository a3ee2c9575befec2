"""The body's origin sinks to the sea floor."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, sub  # noqa: F401
from lgvi_kernels.lanes.state import struct


@functools.cache
def params(width, real):
    """Params: depth [m]."""
    return struct("Floor", depth=lane(width, real))


@wp.func
def distance(view: Any, p: Any):
    """Metres to go."""
    return p.depth - view.b.z
