# SPDX-License-Identifier: Apache-2.0
"""A constant wrench in body axes."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def law(w: Any, view: Any, p: Any):
    """phi = force, tau = torque, whatever the state is."""
    w.force = w.force + p.force
    w.torque = w.torque + p.torque
    return w
