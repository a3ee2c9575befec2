"""A member's time is over."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import lane, mul, ones, struct, sub  # noqa: F401


@functools.cache
def params(width, real):
    """Params: at [s]."""
    return struct("StopTime", at=lane(width, real))


@wp.func
def distance(view: Any, p: Any):
    """Seconds to go."""
    return p.at - view.t * ones(p.at)
