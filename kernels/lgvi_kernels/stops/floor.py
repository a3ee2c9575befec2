# SPDX-License-Identifier: Apache-2.0
"""The body's origin sinks to the sea floor."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def distance(view: Any, p: Any):
    """Height above the floor [m]."""
    return p.depth - view.b.z
