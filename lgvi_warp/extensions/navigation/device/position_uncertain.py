# SPDX-License-Identifier: Apache-2.0
"""A filter knows the position less well than a limit."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.stops.mission_done import LONG

params = make_params("PositionUncertain", lanes="sigma", words="watched")


@wp.func
def distance(view: Any, p: Any):
    """Time left until the tick at which the standard deviation was above the limit [s]; long before that."""
    spread = remembered(view, p.watched)
    since = remembered(view, p.watched + 1)
    return positive(spread - p.sigma, since - view.t * ones(spread), view.h.dtype(wp.static(LONG)) * ones(spread))
