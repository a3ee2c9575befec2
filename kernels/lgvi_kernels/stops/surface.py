"""The body's origin rises to a depth."""

from typing import Any

import warp as wp

from lgvi_kernels.law import sub  # noqa: F401


@wp.func
def distance(view: Any, p: Any):
    """Metres to go."""
    return view.b.z - p.depth
