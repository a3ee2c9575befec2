# SPDX-License-Identifier: Apache-2.0
"""Guidance has reached the last of its points."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# Of the rows by which guidance tells that it is done, and since when, the first.
params = make_params("MissionDone", words="done")
# Time that is left of a mission under way [s].
LONG = 1.0e9


@wp.func
def distance(view: Any, p: Any):
    """Time left until the tick at which the mission was done [s]; long before that."""
    done = remembered(view, p.done)
    half = view.h.dtype(0.5) * ones(done)
    since = remembered(view, p.done + 1)
    return positive(done - half, since - view.t * ones(done), view.h.dtype(wp.static(LONG)) * ones(done))
