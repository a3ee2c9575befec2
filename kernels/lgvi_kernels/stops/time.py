# SPDX-License-Identifier: Apache-2.0
"""A member reaches the time at which it stops."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def distance(view: Any, p: Any):
    """Time left [s]."""
    return p.at - view.t * ones(p.at)
