# SPDX-License-Identifier: Apache-2.0
"""The body's origin rises to a depth."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

params = make_params("numbers_surface", lanes="depth")


@wp.func
def distance(view: Any, p: Any):
    """Distance below the depth at which the member stops [m]."""
    return view.b.z - p.depth
