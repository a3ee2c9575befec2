"""A member's time is over."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, mul, ones, sub  # noqa: F401
from lgvi_kernels.lanes.state import struct


@functools.cache
def params(width, real):
    """Params: at [s]."""
    return struct("StopTime", at=lane(width, real))


@wp.func
def distance(view: Any, p: Any):
    """Seconds to go."""
    return p.at - view.t * ones(p.at)
