"""A member's time is over."""

from typing import Any

import warp as wp

from lgvi_kernels.law import mul, ones, sub  # noqa: F401


@wp.func
def distance(view: Any, p: Any):
    """Seconds to go."""
    return p.at - view.t * ones(p.at)
