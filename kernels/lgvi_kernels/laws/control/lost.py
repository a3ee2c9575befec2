# SPDX-License-Identifier: Apache-2.0
"""Changes that begin at a step: faults, and channels that a controller knows to be lost."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def since(y: Any, step: Any):
    """Above 0 from the first tick at or after a step on."""
    return (y.h.dtype(y.step) + y.h.dtype(0.5)) * ones(step) - step
