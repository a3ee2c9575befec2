# SPDX-License-Identifier: Apache-2.0
"""The body's origin leaves a box."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def distance(view: Any, p: Any):
    """Distance to the nearest face [m], negative outside the box."""
    a = view.b - p.lower
    z = p.upper - view.b
    return least(least(least(a.x, a.y), a.z), least(least(z.x, z.y), z.z))
