"""Allocation by a weighted pseudo-inverse: the efforts of least weighted squares that make the demand, as commands."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import (  # noqa: F401
    absolute,
    add,
    clamp,
    div,
    dot,
    greatest,
    least,
    mul,
    neg,
    ones,
    positive,
    remember,
    root,
    row1,
    row3,
    struct,
    sub,
    table1,
)
from lgvi_kernels.laws import thrust_curves
from lgvi_kernels.laws.control.lost import since
from lgvi_kernels.laws.thrust_curves import INVERSE_ROWS, beyond, polynomial_inverse

# Rows of one channel: its line of the pseudo-inverse (6), the wrench of a unit of effort (6), limit of the command, coefficient
# ahead and astern, dead band, the time from which it is known to be lost, and the number that this adds to the set of lines.
ROWS = 18


@functools.cache
def params(width, real):
    """Params: first row of the table; first row of the commands; count; sets of lines; shared, size: of the curves and their
    inverses, which lie behind the channels' rows and the lines of further sets.
    """
    words = ("first", "commands", "count", "sets", "shared", "size")
    return struct("PseudoInverse", **dict.fromkeys(words, wp.int32))


@functools.cache
def made(features):
    """The allocation for efforts that are "linear" in the command, its "square", a "polynomial" or a "table"; "lost": channels
    may be known to be lost.
    """
    loses, tables, polynomials = "lost" in features, "table" in features, "polynomial" in features
    linear = "linear" in features
    shape = "table" if tables else "polynomial" if polynomials else "square"
    curve = getattr(thrust_curves, f"{shape}_curve")

    @wp.func
    def size_for(y: Any, p: Any, i: int, t: Any, ahead: Any):
        """The size of the command, less the dead band, for a thrust of size t on one side."""
        w = root(t)
        if wp.static(polynomials):
            first = p.first + p.shared
            inverse = first + 2 * p.size
            fore = polynomial_inverse(y, inverse, p.size, first, t)
            aft = polynomial_inverse(y, inverse + wp.static(INVERSE_ROWS), p.size, first + p.size, t)
            w = positive(ahead, fore, aft)
        if wp.static(tables):
            inverse = p.first + p.shared + (p.count + 2 * i) * (1 + 3 * p.size)
            fore = table1(y, inverse, p.size, t)
            aft = table1(y, inverse + 1 + 3 * p.size, p.size, t)
            w = positive(ahead, fore, aft)
        return w

    @wp.func
    def allocate_efforts(w: Any, y: Any, p: Any):
        """t = W^-1 B^T (B W^-1 B^T)^+ w; what is left of w is w - B t, t what the commands within their limits give."""
        demand = w.force
        moment = w.torque
        unity = ones(demand.x)
        zero = unity - unity
        chosen = zero
        if wp.static(loses):
            for i in range(p.count):
                at = p.first + wp.static(ROWS) * i
                chosen = chosen + positive(since(y, row1(y, at + 16)), row1(y, at + 17), zero)
        for i in range(p.count):
            at = p.first + wp.static(ROWS) * i
            most = row1(y, at + 12)
            effort = dot(row3(y, at), demand) + dot(row3(y, at + 3), moment)
            if wp.static(loses):
                for s in range(1, p.sets):
                    line = p.first + wp.static(ROWS) * p.count + 6 * (p.count * (s - 1) + i)
                    other = dot(row3(y, line), demand) + dot(row3(y, line + 3), moment)
                    apart = absolute(chosen - y.h.dtype(s) * unity)
                    effort = positive(y.h.dtype(0.5) * unity - apart, other, effort)
            c = positive(effort, row1(y, at + 13), row1(y, at + 14))
            # A side without thrust has the coefficient 0, and gets no command.
            t = positive(c, absolute(effort) / c, zero)
            if wp.static(linear):
                size = least(t, most)
                t = size
            else:
                band = row1(y, at + 15)
                size = least(positive(t, size_for(y, p, i, t, effort) + band, zero), most)
                first = p.first + p.shared
                if wp.static(tables):
                    first += i * (1 + 3 * p.size)
                t = absolute(curve(y, first, p.size, beyond(positive(effort, size, -size), band)))
            remember(y, p.commands + i, positive(effort, size, -size))
            delivered = positive(effort, c * t, -(c * t))
            w.force = w.force - delivered * row3(y, at + 6)
            w.torque = w.torque - delivered * row3(y, at + 9)
        return w

    return device(__name__, features, params=params, allocate=allocate_efforts)
