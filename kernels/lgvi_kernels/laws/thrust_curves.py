# SPDX-License-Identifier: Apache-2.0
"""Thrust as a function of a command: its square, a polynomial or a table, and the inverse of each.

Each curve takes (view, p, first, w): the law's numbers, the row where those of the curve begin, and the command less the dead
band. Inverses take the thrust ahead or astern, without its sign, and the same of one side.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.functions import about_inverse_root
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


def make_side_row(sided):
    """(view, row, astern, side) -> the number ahead where side > 0, else that `astern` rows behind; sided: see make_horner."""

    @wp.func
    def side_row(view: Any, row: int, astern: int, side: Any):
        value = row1(view, row) * ones(side)
        if wp.static(sided):
            value = positive(side, value, row1(view, row + astern))
        return value

    return side_row


def make_derived(terms, powers, side_row):
    """(view, row, z, side) -> c1 + c2 z + ..., coefficients every second row, its slope, and half of that of its slope."""

    @wp.func
    def derived(view: Any, row: int, z: Any, side: Any):
        value = side_row(view, row + wp.static(2 * (terms - 1)), wp.static(powers), side)
        slope = z - z
        bend = slope
        for k in range(wp.static(terms - 1)):
            bend = fused(bend, z, slope)
            slope = fused(slope, z, value)
            value = fused(value, z, side_row(view, row + wp.static(2 * (terms - 2)) - 2 * k, wp.static(powers), side))
        return value, slope, bend

    return derived


@functools.cache
def make_polynomial_inverses(powers, sided, odd):
    """(view, first, polynomials, t, u, side, other) -> the places where a rising polynomial has the values t and u.

    Beyond the largest value it is the place of that. It begins with a polynomial in s, t = (largest value) (1 - (1 - s^2)^2),
    in which the inverse is smooth where t begins as a square and where it turns; a step of Halley's follows.
    Both values go through this side by side: what one waits for costs no time. first: rows of the inverse; polynomials: first
    row of the one ahead, with so many powers; side, other: of t and u; sided: whether it is another one astern; odd: whether
    it has odd powers alone, which changes no bit.
    """
    sixteen, side_row = make_estrin(sided), make_side_row(sided)
    of_odd, of_even = (make_derived(max(terms, 1), powers, side_row) for terms in (powers - powers // 2, powers // 2))

    @wp.func
    def begun(view: Any, first: int, t: Any, side: Any):
        """The start of the inverse."""
        astern = wp.static(INVERSE_ROWS)
        unity = ones(t)
        part = least(t * side_row(view, first, astern, side), unity)
        # s^2 = part / (1 + v), v^2 = 1 - part, which loses no digits near 0. At the turn, v = 0, it counts little how far v is
        # off, and much how far s is: hence a step of Newton's.
        half = view.h.dtype(0.5) * unity
        rest = unity - part
        square = part * fused(rest, about_inverse_root(rest), unity)
        inverse = about_inverse_root(square)
        s = part * fused(inverse, fused(half * square, -(inverse * inverse), half), inverse)
        w = sixteen(view, first + 4, astern, side, fused(s, unity + unity, -unity))
        return clamp(w, unity - unity, side_row(view, first + 2, astern, side))

    @wp.func
    def stepped(view: Any, first: int, polynomials: int, t: Any, w: Any, side: Any):
        """w after a step of Halley's towards t."""
        astern = wp.static(INVERSE_ROWS)
        half = view.h.dtype(0.5)
        # The polynomial is w a(z) + z b(z), z = w^2: its value over w, its slope, and half of the slope of that. Products
        # are joined with sums here, and not by the compiler, which may choose otherwise where a curve is odd.
        z = w * w
        a, a_slope, a_bend = of_odd(view, polynomials, z, side)
        twice = a_bend + a_bend
        over = a
        slope = fused(z + z, a_slope, a)
        bend = w * fused(z, twice + twice, a_slope + a_slope + a_slope)
        if wp.static(powers > 1 and not odd):
            # Of an odd curve this adds exactly 0.
            b, b_slope, b_bend = of_even(view, polynomials + 1, z, side)
            twice = b_bend + b_bend
            more = fused(z, twice + twice, b_slope + b_slope + b_slope + b_slope + b_slope)
            over = fused(w, b, a)
            slope = fused(w + w, fused(z, b_slope, b), slope)
            bend = fused(z, more, bend) + b
        slope = greatest(slope, side_row(view, first + 3, astern, side))
        short = fused(w, -over, t)
        # slope^2 + short slope' / 2, which is positive near a solution.
        below = greatest(fused(short, bend, slope * slope), half * slope * slope)
        w = w + short * slope / below
        return clamp(w, w - w, side_row(view, first + 2, astern, side))

    @wp.func
    def polynomial_inverses(view: Any, first: int, polynomials: int, t: Any, u: Any, side: Any, other: Any):
        astern = wp.static(INVERSE_ROWS)
        t = least(t, side_row(view, first + 1, astern, side))
        u = least(u, side_row(view, first + 1, astern, other))
        v = begun(view, first, t, side)
        w = begun(view, first, u, other)
        v = stepped(view, first, polynomials, t, v, side)
        w = stepped(view, first, polynomials, u, w, other)
        return v, w

    return polynomial_inverses
