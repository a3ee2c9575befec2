# SPDX-License-Identifier: Apache-2.0
"""C++ of the functions of dual lanes: a value, and its slope by each tangent, by the rules of differentiation.

In an expression A, B, C are the vectors of the values of the lanes a, b, c; dA, dB, dC those of their slopes by one tangent;
R is the value of the result.
"""

import re
from typing import NamedTuple

import warp as wp

from lgvi_kernels.lanes import native, series

# Slopes are long sums of products: in any order the compiler makes two joined operations of what else are three. Values keep
# their order, in which tests for what is no number and differences of near numbers are meant.
REORDERED = '_Pragma("clang fp reassociate(on)")'

# Most tangents of one kernel: with more, the numbers of a step no longer fit into the registers.
MOST = 2


class Shape(NamedTuple):
    """The shape of a dual lane: how many vehicles, how many tangents, and the type of the numbers."""

    width: int
    tangents: int
    real: type

    @property
    def length(self):
        return length(self.width, self.tangents)


def length(width, tangents):
    """How many numbers a lane of `width` vehicles is to Warp: the values, the slopes by each tangent, and what pads them.

    By its length alone Warp tells a dual lane from a plain one, a power of two long, and from one with more tangents. So with
    one tangent half a width more follows, which nothing reads: 5 times a power of two; with two it is 3 times one.
    """
    return width * (1 + tangents) + (width // 2 if tangents == 1 else 0)


def function(shape, arguments, value, slope, statements=""):
    """C++ of a function of the lanes a, b, c: its value, and its slope by a tangent, as expressions (see the module)."""
    load, store = [], []
    for t in range(1, shape.tangents + 1):
        load += [f"V {v}{t}; memcpy(&{v}{t}, &{v.lower()}.c[{t * shape.width}], sizeof(V));" for v in arguments]
        store += [f"V R{t} = {of_tangent(slope, t)}; memcpy(&r.c[{t * shape.width}], &R{t}, sizeof(V));"]
    value = f"V R = {value};" if value else ""
    begin = f"{series._types(shape.width, shape.real, arguments)} {' '.join(load)} {statements} {value}"
    slopes = f"{{ {REORDERED} {' '.join(store)} }}"
    return f"{begin} wp::vec_t<{shape.length}, S> r; memcpy(&r, &R, sizeof(V)); {slopes} return r;"


def of_tangent(expression, tangent):
    """The expression for one tangent: dA becomes A1."""
    return re.sub(r"\bd([A-C])\b", rf"\g<1>{tangent}", expression)


def exponential(shape):
    return function(shape, "A", "", "dA * R", series.exponential(shape.real))


def _waves(shape, value, slope):
    """C++ of a function of A whose value and slope are the sine after so many quarter turns."""
    reduced = series.sine(shape.real, value)
    turned = f"{series._turned('D', slope)} V O = Y;"
    # `series` calls the reduced angle R.
    return function(shape, "A", "", "dA * D", f"{reduced} {turned} R = O;")


def sine(shape):
    return _waves(shape, "N", "N + 1")


def cosine(shape):
    return _waves(shape, "N + 1", "N + 2")


def logarithm(shape):
    return function(shape, "A", "", "dA / A", series.logarithm(shape.real))


def arctangent2(shape):
    # Without a slope of either there is none, also at the origin, where else there is no number.
    still = "((dA == (S)0) & (dB == (S)0))"
    slope = f"{still} ? V() : (B * dA - A * dB) / (A * A + B * B)"
    return function(shape, "AB", "", slope, series.arctangent2(shape.real))


def decay(shape):
    """The slope of (1 - e^-a) / a: (1 - f) / a - f, and near 0, where that cancels, its Taylor series."""
    terms = 16 if shape.real == wp.float64 else 8
    near = series._horner("A", [(-1.0) ** (k + 1) * (k + 1) / series._factorial(k + 2) for k in range(terms)])
    by_a = f"V E = A < (S)0 ? -A : A; V D = E < (S)0.5 ? {near} : ((S)1 - R) / (E < (S)0.5 ? V() + (S)1 : A) - R;"
    return function(shape, "A", "", "dA * D", f"{series.decay(shape.real)} {by_a}")


def root(shape):
    # Of a number that is 0 and stays 0 the slope is 0: a speed at rest is the root of a sum of squares.
    slope = "dA == (S)0 ? dA : dA * ((S)0.5 / R)"
    return function(shape, "A", series.root(shape.width).format("A"), slope)


def rounded(shape):
    return function(shape, "A", "", "V()", series.nearest(shape.real))


def any_positive(shape):
    """C++ of: some value is positive."""
    return native.any_positive(shape.width, shape.real)


def spread(shape, number):
    """C++ of a number in all values, without slopes."""
    return f"for (int j = 0; j < {shape.width}; ++j) r[j] = {number};"


def shared(shape):
    """C++ that reads one number of a two-dimensional array into all lanes."""
    name = f"wp::{shape.real.__name__}"
    place = f"(({name}*)rows.data)[(wp::int64)(entry * rows.shape[1] + row) + offset]"
    return f"wp::vec_t<{shape.length}, {name}> r; {spread(shape, place)} return r;"


def own_shared(shape):
    """C++ that reads one number, of a row that a law may see, into all lanes."""
    name = f"wp::{shape.real.__name__}"
    number = f"(({name}*)rows.rows.data)[(wp::int64)entry * rows.rows.shape[1] + at]"
    kind = f"wp::vec_t<{shape.length}, {name}>"
    return f"{kind} r; {native._OWN_ROW} if (at <= last) {spread(shape, number)} return r;"


def gather(shape, is_shared):
    """C++ that reads, for each vehicle, the row of its own index among those that a law may see, with its slopes."""
    name = f"wp::{shape.real.__name__}"
    kind = f"wp::vec_t<{shape.length}, {name}>"
    each = f"r[j] = (({name}*)rows.rows.data)[begin + at];"
    if not is_shared:
        each = f"for (int t = 0; t <= {shape.tangents}; ++t) r[j + t * {shape.width}] = (({kind}*)rows.rows.data)[begin + at]"
        each += f"[j + t * {shape.width}];"
    row = native._OWN_ROW.replace("offset", "offset + step")
    begin = "const wp::int64 begin = (wp::int64)entry * rows.rows.shape[1];"
    loop = (
        f"for (int j = 0; j < {shape.width}; ++j) {{ const int step = index[j]; {row} if (at <= last) {{ {each} }} }}"
    )
    return f"{kind} r; {begin} {loop} return r;"


def whole(shape):
    """C++ of the whole numbers at or below the values (see native.whole), which have no slopes."""
    of_values = native.whole(shape.width, shape.real)
    kind = f"wp::vec_t<{shape.width}, wp::int32> r;"
    assert kind in of_values
    return of_values.replace(kind, f"wp::vec_t<{shape.length}, wp::int32> r;")


def normals(shape):
    """C++ of `series.normals` of the vehicles, in a vector of four dual lanes' length; random numbers have no slopes."""
    of_values = series.normals(shape.width, shape.real)
    kind = f"wp::vec_t<{4 * shape.width}, S> r;"
    assert kind in of_values
    return of_values.replace(kind, f"wp::vec_t<{4 * shape.length}, S> r;")


def quarter(shape):
    """C++ of one of four lanes of random numbers."""
    kind = f"wp::vec_t<{shape.length}, wp::{shape.real.__name__}>"
    size = f"{shape.width} * sizeof(wp::{shape.real.__name__})"
    return f"{kind} r; memcpy(&r, &a.c[k * {shape.width}], {size}); return r;"
