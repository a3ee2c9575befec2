"""How thrust follows from a command: its square, a polynomial or a table, and the inverse of each.

Each curve takes (view, first, size, w): the row where its numbers begin, how many there are of a kind, and the command less
the dead band. Inverses take the thrust ahead or astern, without its sign, and the same of one side.
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.functions import PI
from lgvi_kernels.law import (  # noqa: F401
    absolute,
    add,
    arctangent2,
    clamp,
    div,
    greatest,
    least,
    mul,
    neg,
    ones,
    root,
    row1,
    sub,
    table1,
)

# Knots of the inverse of a polynomial less one, and rows of one side of it: 1 / its largest value, that value, its place,
# the least slope, and the table.
INVERSE_KNOTS = 12
INVERSE_ROWS = 4 + 1 + 3 * INVERSE_KNOTS


@wp.func
def beyond(n: Any, band: Any):
    """The command less the dead band, on either side."""
    zero = ones(n) - ones(n)
    return greatest(n - band, zero) - greatest(-n - band, zero)


@wp.func
def square_curve(view: Any, first: int, size: int, w: Any):
    """w |w|."""
    return w * absolute(w)


@wp.func
def powers_of(view: Any, first: int, size: int, w: Any):
    """p1 w + p2 w^2 + ..., by Horner's rule."""
    value = w - w
    for i in range(size):
        value = (value + row1(view, first + size - 1 - i)) * w
    return value


@wp.func
def polynomial_curve(view: Any, first: int, size: int, w: Any):
    """One polynomial ahead and one astern."""
    zero = ones(w) - ones(w)
    ahead = powers_of(view, first, size, greatest(w, zero))
    return ahead - powers_of(view, first + size, size, greatest(-w, zero))


@wp.func
def table_curve(view: Any, first: int, size: int, w: Any):
    """Linear between the knots, constant outside."""
    return table1(view, first, size, w)


@wp.func
def polynomial_inverse(view: Any, first: int, size: int, powers: int, t: Any):
    """The w at which a polynomial, which rises up to a largest value, has the value t or that largest one.

    From a table over x, t = (largest value) sin^2(pi x / 2), by three steps of Newton's. powers: first row of the polynomial.
    """
    unity = ones(t)
    zero = unity - unity
    highest = row1(view, first + 2)
    value = least(t, row1(view, first + 1))
    part = least(value * row1(view, first), unity)
    x = t.dtype(wp.static(2.0 / PI)) * arctangent2(root(part), root(unity - part))
    w = table1(view, first + 4, wp.static(INVERSE_KNOTS), x)
    for step in range(3):
        f = zero
        slope = zero
        for i in range(size):
            # f = w g, f' = g + w g'
            g = f + row1(view, powers + size - 1 - i)
            slope = slope * w + g
            f = g * w
        w = clamp(w + (value - f) / greatest(slope, row1(view, first + 3)), zero, highest)
    return w
