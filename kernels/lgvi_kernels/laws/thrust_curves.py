# SPDX-License-Identifier: Apache-2.0
"""How thrust follows from a command: its square, a polynomial or a table, and the inverse of each.

Each curve takes (view, p, first, w): the law's numbers, the row where those of the curve begin, and the command less the dead
band. Inverses take the thrust ahead or astern, without its sign, and the same of one side.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

# Coefficients of the start of a polynomial's inverse, and rows of one side of it: 1 / its largest value, that value, its
# place, the least slope, and the coefficients from the lowest power up.
START_SIZE = 16
INVERSE_ROWS = 4 + START_SIZE
NEWTON_STEPS = 2


@wp.func
def beyond(n: Any, band: Any):
    """The command less the dead band, on either side."""
    return n - clamp(n, -band, band)


@wp.func
def square_curve(view: Any, p: Any, first: int, w: Any):
    """w |w|."""
    return w * absolute(w)


@wp.func
def table_curve(view: Any, p: Any, first: int, w: Any):
    """Linear between the knots, constant outside."""
    return table1(view, first, p.size, w)


@wp.func
def row_of_side(view: Any, row: int, astern: int, side: Any):
    """A number of the curve ahead where side > 0, else of that astern, `astern` rows behind; 0: both are the same."""
    value = row1(view, row)
    if astern > 0:
        value = positive(side, value, row1(view, row + astern))
    return value


def make_horner(count, sided):
    """(view, row, astern, side, z) -> c1 + c2 z + ... with so many coefficients, by Horner's rule.

    sided: whether those astern are others, `astern` rows behind.
    """

    @wp.func
    def horner(view: Any, row: int, astern: int, side: Any, z: Any):
        value = row1(view, row + wp.static(count - 1))
        if wp.static(sided):
            value = positive(side, value, row1(view, row + astern + wp.static(count - 1)))
        for k in range(wp.static(count - 1)):
            c = row1(view, row + wp.static(count - 2) - k)
            if wp.static(sided):
                c = positive(side, c, row1(view, row + astern + wp.static(count - 2) - k))
            value = fused(value, z, c)
        return value

    return horner


@functools.cache
def make_polynomial_curve(powers, odd):
    """f(w) ahead and -f(-w) astern, f = p1 w + p2 w^2 + ... with so many powers, and another f astern.

    f is w times a polynomial in w^2, and |w| w times another one: rows of the odd powers, of the even ones, and the same
    astern. odd: whether the even ones are 0 and both sides the same. What is left out then adds exactly 0.
    """
    half = powers - powers // 2
    of_odd, of_even = make_horner(half, not odd), make_horner(powers // 2, not odd)

    @wp.func
    def polynomial_curve(view: Any, p: Any, first: int, w: Any):
        z = w * w
        value = of_odd(view, first, wp.static(powers), w, z)
        if wp.static(powers > 1 and not odd):
            value = fused(absolute(w), of_even(view, first + wp.static(half), wp.static(powers), w, z), value)
        return value * w

    return polynomial_curve


# A polynomial by Estrin's scheme, whose sums need not wait for each other.
@wp.func
def two(view: Any, row: int, astern: int, side: Any, z: Any):
    """a + b z."""
    return row_of_side(view, row, astern, side) + row_of_side(view, row + 1, astern, side) * z


@wp.func
def four(view: Any, row: int, astern: int, side: Any, z: Any, z2: Any):
    """A polynomial with four coefficients."""
    return two(view, row, astern, side, z) + two(view, row + 2, astern, side, z) * z2


@wp.func
def sixteen(view: Any, row: int, astern: int, side: Any, z: Any):
    """A polynomial with sixteen coefficients, from the lowest power up."""
    z2 = z * z
    z4 = z2 * z2
    low = four(view, row, astern, side, z, z2) + four(view, row + 4, astern, side, z, z2) * z4
    high = four(view, row + 8, astern, side, z, z2) + four(view, row + 12, astern, side, z, z2) * z4
    return low + high * (z4 * z4)


@wp.func
def polynomial_inverse(view: Any, first: int, size: int, powers: int, t: Any, side: Any, sided: int):
    """The w at which a polynomial, which rises up to a largest value, has the value t or that largest one.

    It begins with a polynomial in s, t = (largest value) (1 - (1 - s^2)^2), in which w is smooth where t begins as a square
    and where it turns; Newton's steps follow. powers: first row of the polynomial; sided: whether it is another one astern.
    """
    unity = ones(t)
    zero = unity - unity
    astern = sided * wp.static(INVERSE_ROWS)
    highest = row_of_side(view, first + 2, astern, side)
    slope_floor = row_of_side(view, first + 3, astern, side)
    value = least(t, row_of_side(view, first + 1, astern, side))
    part = least(value * row_of_side(view, first, astern, side), unity)
    s = root(part / (unity + root(unity - part)))
    z = s + s - unity
    w = clamp(sixteen(view, first + 4, astern, side, z), zero, highest)
    for step in range(wp.static(NEWTON_STEPS)):
        # The polynomial is w g, and its slope g + w g'.
        g = row_of_side(view, powers + size - 1, sided * size, side)
        g_slope = zero
        for i in range(size - 1):
            g_slope = g_slope * w + g
            g = g * w + row_of_side(view, powers + size - 2 - i, sided * size, side)
        slope = greatest(g + w * g_slope, slope_floor)
        w = clamp(w + (value - w * g) / slope, zero, highest)
    return w
