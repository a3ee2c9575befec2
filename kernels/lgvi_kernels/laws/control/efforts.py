# SPDX-License-Identifier: Apache-2.0
"""From the effort of a channel to its command: what allocations by efforts have in common.

Efforts are "linear" in the command, its "square", a polynomial ("powers9" with nine powers) or a "table". Rows of a channel:
the wrench of a unit of effort (6), limit of the command, coefficient ahead and astern, dead band, the time from which it is
known to be lost, what this adds to the number of a set of lost channels, and the largest effort ahead and astern, without the
coefficient.
"""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.thrust_curves import make_polynomial_inverse

ROWS = 14


def make_size_for(features):
    """(y, p, i, t, side) -> the size of the command, less the dead band, for an effort of size t; side: above 0 for ahead."""
    linear, tables = "linear" in features, "table" in features
    powers = sum(int(word.removeprefix("powers")) for word in features if word.startswith("powers"))
    alike, apart = (make_polynomial_inverse(powers, sided) for sided in (False, True)) if powers else (None, None)

    @wp.func
    def size_for(y: Any, p: Any, i: int, t: Any, side: Any):
        w = t
        if wp.static(powers > 0):
            first = p.first + p.shared
            if p.sided > 0:
                w = apart(y, first + wp.static(2 * powers), first, t, side)
            else:
                w = alike(y, first + wp.static(2 * powers), first, t, side)
        elif wp.static(tables):
            inverse = p.first + p.shared + (p.count + 2 * i) * (1 + 3 * p.size)
            w = positive(side, table1(y, inverse, p.size, t), table1(y, inverse + 1 + 3 * p.size, p.size, t))
        elif wp.static(not linear):
            w = root(t)
        return w

    return size_for
