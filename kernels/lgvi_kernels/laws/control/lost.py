"""Channels that a controller knows to be lost, from a time on."""

from typing import Any

import warp as wp

from lgvi_kernels.law import add, mul, ones, sub  # noqa: F401


@wp.func
def since(y: Any, time: Any):
    """Above 0 from the first look at or after a time on."""
    # Half a step is added, since times are sums that round.
    return (y.t + y.h.dtype(0.5) * y.h) * ones(time) - time
