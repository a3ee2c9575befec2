# SPDX-License-Identifier: Apache-2.0
"""A steady, uniform current: in its frame nothing changes, and that frame carries the vehicle."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

FLOW = "steady"


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u = const."""
    f.velocity = f.velocity + p.velocity
    return f
