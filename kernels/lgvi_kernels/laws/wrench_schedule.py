# SPDX-License-Identifier: Apache-2.0
"""A wrench in body axes that follows a table over time."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# First row of its tables, of force and then of torque (see view.table3), and count of knots after the first.
params = make_params("WrenchSchedule", words="first count")


@wp.func
def law(w: Any, view: Any, p: Any):
    """phi(t), tau(t): the tables' values at the view's time."""
    t = view.t * ones(view.b.x)
    w.force = w.force + table3(view, p.first, p.count, t)
    w.torque = w.torque + table3(view, p.first + 3 + 5 * p.count, p.count, t)
    return w
