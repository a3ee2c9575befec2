# SPDX-License-Identifier: Apache-2.0
"""Density of the water by depth: a table of rho / rho0, linear between its depths and constant outside, and its integral.

Rows: those of lgvi_kernels' `table1`, then the integral from the surface to the first depth [m].
"""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def relative_density(view: Any, first: int, count: int, depth: Any):
    """rho / rho0 at a depth."""
    return table1(view, first, count, depth)


@wp.func
def column(view: Any, first: int, count: int, depth: Any):
    """Integral of rho / rho0 from the surface to a depth [m]: the water above, as a column of density rho0."""
    unity = ones(depth)
    zero = unity - unity
    total = row1(view, first) * depth + row1(view, first + 1 + 3 * count)
    for i in range(count):
        at = first + 1 + 3 * i
        inverse = row1(view, at + 1)
        part = (depth - row1(view, at)) * inverse
        inside = clamp(part, zero, unity)
        swept = depth.dtype(0.5) * (inside * inside) + greatest(part - unity, zero)
        total = total + (row1(view, at + 2) / inverse) * swept
    return total
