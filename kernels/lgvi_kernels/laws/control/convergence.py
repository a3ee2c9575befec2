# SPDX-License-Identifier: Apache-2.0
"""Convergence of what a tick solves by iterations: tolerances by the number format, and an account of unfinished ticks."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def by_digits(y: Any, fine: Any, coarse: Any):
    """The first number in float64, the second in float32."""
    one = y.h.dtype(1.0)
    return wp.where(one + y.h.dtype(1e-10) > one, fine, coarse)


@wp.func
def count_unconverged(y: Any, row: int, left: Any):
    """Count the lanes above 0 in a row of the bus; the next row holds the time of the first one, a period later."""
    unity = ones(left)
    zero = unity - unity
    first = remembered(y, row + 1)
    now = positive(left, (y.t + y.period) * unity, zero)
    remember(y, row, remembered(y, row) + positive(left, unity, zero))
    remember(y, row + 1, positive(first, first, now))


@wp.func
def clear(y: Any, first: int, last: int, zero: Any):
    """Leave nothing in scratch rows from first up to last: a lane shows nothing that others made it calculate."""
    row = int(first)
    while row < last:
        remember(y, row, zero)
        row += 1
