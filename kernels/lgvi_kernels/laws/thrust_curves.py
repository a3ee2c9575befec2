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


def make_estrin(sided):
    """(view, row, astern, side, z) -> a polynomial with sixteen coefficients, whose sums need not wait for each other.

    It goes by Estrin's scheme, from the lowest power up; sided: see make_horner.
    """

    @wp.func
    def two(view: Any, row: int, astern: int, side: Any, z: Any):
        """a + b z."""
        a = row1(view, row)
        b = row1(view, row + 1)
        if wp.static(sided):
            a = positive(side, a, row1(view, row + astern))
            b = positive(side, b, row1(view, row + 1 + astern))
        return a + b * z

    @wp.func
    def four(view: Any, row: int, astern: int, side: Any, z: Any, z2: Any):
        """A polynomial with four coefficients."""
        return two(view, row, astern, side, z) + two(view, row + 2, astern, side, z) * z2

    @wp.func
    def sixteen(view: Any, row: int, astern: int, side: Any, z: Any):
        z2 = z * z
        z4 = z2 * z2
        low = four(view, row, astern, side, z, z2) + four(view, row + 4, astern, side, z, z2) * z4
        high = four(view, row + 8, astern, side, z, z2) + four(view, row + 12, astern, side, z, z2) * z4
        return low + high * (z4 * z4)

    return sixteen


@functools.cache
def make_polynomial_inverse(powers, sided):
    """(view, first, polynomials, t, side) -> the w at which a polynomial, which rises up to a largest value, has the value t.

    Beyond the largest value it is where that is. It begins with a polynomial in s, t = (largest value) (1 - (1 - s^2)^2), in
    which w is smooth where t begins as a square and where it turns; a step of Halley's follows, with one division. first: rows
    of the inverse; polynomials: first row of the one ahead, with so many powers; sided: whether it is another one astern.
    """
    sixteen = make_estrin(sided)

    @wp.func
    def side_row(view: Any, row: int, astern: int, side: Any):
        """A number ahead where side > 0, else the one astern."""
        value = row1(view, row)
        if wp.static(sided):
            value = positive(side, value, row1(view, row + astern))
        return value

    @wp.func
    def polynomial_inverse(view: Any, first: int, polynomials: int, t: Any, side: Any):
        unity = ones(t)
        zero = unity - unity
        half = view.h.dtype(0.5)
        astern = wp.static(INVERSE_ROWS)
        highest = side_row(view, first + 2, astern, side) * unity
        slope_floor = side_row(view, first + 3, astern, side) * unity
        value = least(t, side_row(view, first + 1, astern, side) * unity)
        part = least(value * side_row(view, first, astern, side), unity)
        # Round-off of s near 0 is repaired by the step.
        s = root(unity - root(unity - part))
        w = clamp(sixteen(view, first + 4, astern, side, s + s - unity), zero, highest)
        # The polynomial is w g, its slope g + w g', and that of the slope 2 (g' + w g''/2).
        g = side_row(view, polynomials + wp.static(powers - 1), wp.static(powers), side) * unity
        g_slope = zero
        g_bend = zero
        for i in range(wp.static(powers - 1)):
            g_bend = fused(g_bend, w, g_slope)
            g_slope = fused(g_slope, w, g)
            g = fused(g, w, side_row(view, polynomials + wp.static(powers - 2) - i, wp.static(powers), side) * unity)
        slope = greatest(fused(w, g_slope, g), slope_floor)
        short = value - w * g
        # slope^2 + short slope' / 2, which is positive near a solution.
        below = greatest(fused(short, fused(w, g_bend, g_slope), slope * slope), half * slope * slope)
        return clamp(w + short * slope / below, zero, highest)

    return polynomial_inverse
