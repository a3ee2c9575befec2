# SPDX-License-Identifier: Apache-2.0
"""C++ of the functions of dual lanes: a value, and its slope by each tangent, by the rules of differentiation.

In an expression A, B, C are the vectors of the values of the lanes a, b, c; dA, dB, dC those of their slopes by one tangent;
R is the value of the result.
"""

import functools
import hashlib
import re
from typing import NamedTuple

import warp as wp

from lgvi_kernels.lanes import native, series

# Slopes are long sums of products: in any order the compiler makes two joined operations of what else are three. Values keep
# their order, in which tests for what is no number and differences of near numbers are meant.
REORDERED = '_Pragma("clang fp reassociate(on)")'

# Function -> its arguments, its value, and its slope by a tangent.
RULES = {
    "add": ("AB", "A + B", "dA + dB"),
    "sub": ("AB", "A - B", "dA - dB"),
    "neg": ("A", "-A", "-dA"),
    "mul": ("AB", "A * B", "dA * B + A * dB"),
    "mul by a number": ("A", "s * A", "s * dA"),
    # One division, which takes as long as ten products, for the value and all slopes.
    "div of a number": ("A", "s * Y", "-R * dA * Y", "V Y = (S)1 / A;"),
    "div": ("AB", "A * Y", "(dA - R * dB) * Y", "V Y = (S)1 / B;"),
    # At 0 it falls, as `positive` takes 0 for one of the others: a |a| and tanh a so have their slopes there.
    "absolute": ("A", "A < (S)0 ? -A : A", "A > (S)0 ? dA : -dA"),
    "least": ("AB", "A < B ? A : B", "A < B ? dA : dB"),
    "largest": ("AB", "A < B ? B : A", "A < B ? dB : dA"),
    "greatest": ("AB", "A > B ? A : B", "A > B ? dA : dB"),
    "clamp": ("ABC", "A < B ? B : (A > C ? C : A)", "A < B ? dB : (A > C ? dC : dA)"),
    "positive": ("ABC", "A > (S)0 ? B : C", "A > (S)0 ? dB : dC"),
    "fused": ("ABC", "__builtin_elementwise_fma(A, B, C)", "dA * B + (A * dB + dC)"),
    # Of a number that is 0 and stays 0 the slope is 0: a speed at rest is the root of a sum of squares.
    "root": ("A", "__builtin_elementwise_sqrt(A)", "dA == (S)0 ? dA : dA * ((S)0.5 / R)"),
    "ones": ("", "V() + (S)1", "V()"),
    "below": ("A", "__builtin_elementwise_floor(A)", "V()"),
    "without_slopes": ("A", "A", "V()"),
}


class DualShape(NamedTuple):
    """The shape of a dual lane: how many vehicles, how many tangents, and the type of the numbers."""

    width: int
    tangents: int
    real: type

    @property
    def length(self):
        """Length of a lane for Warp: the values, the slopes by each tangent, and what pads them.

        By its length alone Warp tells a dual lane from a plain one, a power of two long, and from one with more tangents. So
        with one tangent half a width more follows, which nothing reads: 5 times a power of two; with two it is 3 times one.
        """
        return self.width * (1 + self.tangents) + (self.width // 2 if self.tangents == 1 else 0)

    @property
    def kind(self):
        """C++ of the lane's type."""
        return f"wp::vec_t<{self.length}, wp::{self.real.__name__}>"


def function(shape, arguments, value, slope, statements=""):
    """C++ of a function of the lanes a, b, c: its value, and its slope by a tangent, as expressions (see the module).

    statements: come before the value; without a value they leave it in R.
    """
    load, store = [], []
    for t in range(1, shape.tangents + 1):
        load += [f"V {v}{t}; memcpy(&{v}{t}, &{v.lower()}.c[{t * shape.width}], sizeof(V));" for v in arguments]
        store += [f"V R{t} = {of_tangent(slope, t)}; memcpy(&r.c[{t * shape.width}], &R{t}, sizeof(V));"]
    value = f"V R = {value};" if value else ""
    finish = f"{shape.kind} r; memcpy(&r, &R, sizeof(V)); {{ {REORDERED} {' '.join(store)} }} return r;"
    begin = f"{native.head(shape.width, shape.real, arguments)} {integers(shape)} {' '.join(load)}"
    return f"{begin} {statements} {value} {finish}"


def integers(shape):
    """C++ of vectors of integers of the numbers' size, as `series` names them: I with sign, U without."""
    bits = 64 if shape.real == wp.float64 else 32
    size = shape.width * bits // 8
    return "".join(
        f"typedef wp::{word}{bits} {name} __attribute__((vector_size({size})));"
        for name, word in (("I", "int"), ("U", "uint"))
    )


def of_tangent(expression, tangent):
    """The expression for one tangent: dA becomes A1."""
    return re.sub(r"\bd([A-C])\b", rf"\g<1>{tangent}", expression)


def waves(shape, quadrant, next_quadrant):
    """C++ of the sine of A after so many quarter turns, whose slope is that after one more; what both share is made once."""
    # In braces, since `series` has names of its own, R among them.
    each = (
        f"{{ {series.sine(shape.real, turns)} {to} = Y; }}" for turns, to in ((quadrant, "O"), (next_quadrant, "D"))
    )
    return function(shape, "A", "", "dA * D", f"V O, D; {' '.join(each)} V R = O;")


def arctangent2(shape):
    # Without a slope of either there is none, also at the origin, where else there is no number.
    still = "((dA == (S)0) & (dB == (S)0))"
    slope = f"{still} ? V() : (B * dA - A * dB) / (A * A + B * B)"
    return function(shape, "AB", "", slope, series.arctangent2(shape.real))


def decay(shape):
    """The slope of f = (1 - e^-a) / a: (1 - f) / a - f, and near 0, where that cancels, its Taylor series."""
    near, factorial = "(S)0", 1.0
    terms = []
    for k in range(16 if shape.real == wp.float64 else 8):
        factorial *= k + 2
        terms.append((-1.0) ** (k + 1) * (k + 1) / factorial)
    for term in reversed(terms):
        near = f"((S){term!r} + A * {near})"
    by_a = f"V E = A < (S)0 ? -A : A; V D = E < (S)0.5 ? {near} : ((S)1 - R) / (E < (S)0.5 ? V() + (S)1 : A) - R;"
    return function(shape, "A", "", "dA * D", f"{series.decay(shape.real)} {by_a}")


def whole(shape):
    """C++ of the whole numbers at or below the values (see native.whole), which the places of the slopes repeat.

    So a row that a vehicle gathers by its own index is gathered with its slopes.
    """
    repeats = 1 + shape.tangents
    return native.whole(shape.width, shape.real, repeats, shape.length - repeats * shape.width)


def normals(shape):
    """C++ of `series.normals` of the vehicles, in a vector of four dual lanes' length; random numbers have no slopes."""
    of_values = series.normals(shape.width, shape.real)
    plain = f"wp::vec_t<{4 * shape.width}, S> r;"
    assert plain in of_values
    return of_values.replace(plain, f"wp::vec_t<{4 * shape.length}, S> r;")


def quarter(shape):
    """C++ of one of four lanes of random numbers."""
    size = f"{shape.width} * sizeof(wp::{shape.real.__name__})"
    return f"{shape.kind} r; memcpy(&r, &a.c[k * {shape.width}], {size}); return r;"


@functools.cache
def snippets(shape):
    """C++ of all that has a rule of its own, by name."""
    own = {name: function(shape, *parts) for name, parts in RULES.items()}
    return own | {
        "any_positive": native.any_positive(shape.width, shape.real),
        "rounded": function(shape, "A", "", "V()", series.nearest(shape.real)),
        "exponential": function(shape, "A", "", "dA * R", series.exponential(shape.real)),
        # As of a root: of a number that is 0 and stays 0 the slope is 0.
        "about_inverse_root": function(
            shape, "A", "", "dA == (S)0 ? dA : dA * ((S)-0.5 * R * R * R)", series.about_inverse_root(shape.real)
        ),
        "logarithm": function(shape, "A", "", "dA / A", series.logarithm(shape.real)),
        "sine": waves(shape, "N", "N + 1"),
        "cosine": waves(shape, "N + 1", "N + 2"),
        "arctangent2": arctangent2(shape),
        "decay": decay(shape),
        "whole": whole(shape),
        "normals": normals(shape),
        "quarter": quarter(shape),
    }


@functools.cache
def digest(shape):
    """Hash of a kernel with dual lanes, since overloads do not count (see lanes/overloads.py)."""
    return hashlib.sha256("".join(f"{name} {text}" for name, text in snippets(shape).items()).encode()).hexdigest()[:16]
