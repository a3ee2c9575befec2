# SPDX-License-Identifier: Apache-2.0
"""An ideal actuator: the wrench that a controller demands, within limits."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws.driven import make_driven

CHANNELS = 6
# Rows of one channel: force and torque of 1 N or 1 N m (6), limit, 1 / lag, limit of the rate.
ROWS = 9


@functools.cache
def made(features):
    """The law of an ideal actuator with these features: "driven", always, "lag", "rate"."""
    driven = make_driven(f"ControlWrench_{'_'.join(features)}", ROWS, 6, 7, 8, features)
    place = driven.place

    @wp.func
    def actuator_law(w: Any, view: Any, p: Any):
        """The sum of the channels' wrenches."""
        for i in range(wp.static(CHANNELS)):
            at = p.first + wp.static(ROWS) * i
            n = place(view, p, i)
            w.force = w.force + n * row3(view, at)
            w.torque = w.torque + n * row3(view, at + 3)
        return w

    roles = {"evolve": driven.evolve, "follow": driven.follow, "report": driven.report}
    return device(__name__, features, params=driven.params, law=actuator_law, **roles)
