# SPDX-License-Identifier: Apache-2.0
"""A current that varies with depth: u(b3) by linear interpolation of a table, constant above and below it."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

FLOW = "varying"


# First row of its table and count of knots after the first; rows as for view.table3.
params = make_params("CurrentProfile", words="first count")


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u and du/db3, which within a segment is its slope."""
    depth = view.b.z
    unity = ones(depth)
    zero = unity - unity
    u = row3(view, p.first)
    for i in range(p.count):
        at = p.first + 3 + 5 * i
        part = ramp(view, at, depth)
        change = row3(view, at + 2)
        u = u + part * change
        inside = positive(part, positive(unity - part, row1(view, at + 1), zero), zero)
        f.by_depth = f.by_depth + inside * change
    f.velocity = f.velocity + u
    return f
