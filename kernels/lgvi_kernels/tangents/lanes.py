# SPDX-License-Identifier: Apache-2.0
"""Dual lanes: overloads of the functions of lanes for the lengths that native.py gives, each with its rule for slopes.

Laws, maps, methods and controllers are written over lanes of any type: with these they carry slopes, and no line of them
changes. Plain lanes do not know this module: their text, which is a part of the hash of every kernel, stays.
"""

import hashlib
from pathlib import Path

import warp as wp

from lgvi_kernels.lanes import arithmetic, noise, overloads, sums
from lgvi_kernels.lanes.arithmetic import (  # noqa: F401  (families, to which overloads are added by name)
    absolute,
    add,
    any_positive,
    below,
    div,
    element,
    entry_of,
    gathered,
    int_lane,
    lane3,
    largest,
    least,
    mul,
    neg,
    ones,
    own_rows,
    positive,
    set_element,
    sub,
    vec3,
    whole,
)
from lgvi_kernels.lanes.functions import (  # noqa: F401
    arctangent2,
    clamp,
    cosine,
    decay,
    exponential,
    fused,
    greatest,
    logarithm,
    normals,
    normals3,
    quarter,
    root,
    rounded,
    sine,
)
from lgvi_kernels.tangents import native
from lgvi_kernels.tangents.native import Shape

without_slopes = overloads.family("without_slopes", "The values of a, a lane or a vector, with slopes of 0.")

# What a kernel with dual lanes is hashed by, since overloads do not count (see lanes/overloads.py).
DIGEST = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))).hexdigest()[
    :16
]

# Function -> its arguments, its value, and its slope by a tangent (see native.py).
RULES = {
    "add": ("AB", "A + B", "dA + dB"),
    "sub": ("AB", "A - B", "dA - dB"),
    "neg": ("A", "-A", "-dA"),
    "mul": ("AB", "A * B", "dA * B + A * dB"),
    # One division, which takes as long as ten products, for the value and all slopes.
    "div": ("AB", "A * Y", "(dA - R * dB) * Y", "V Y = (S)1 / B;"),
    # At 0 it falls, as `positive` takes 0 for one of the others: a |a| and tanh a so have their slopes there.
    "absolute": ("A", "A < (S)0 ? -A : A", "A > (S)0 ? dA : -dA"),
    "least": ("AB", "A < B ? A : B", "A < B ? dA : dB"),
    "largest": ("AB", "A < B ? B : A", "A < B ? dB : dA"),
    "greatest": ("AB", "A > B ? A : B", "A > B ? dA : dB"),
    "clamp": ("ABC", "A < B ? B : (A > C ? C : A)", "A < B ? dB : (A > C ? dC : dA)"),
    "positive": ("ABC", "A > (S)0 ? B : C", "A > (S)0 ? dB : dC"),
    "fused": ("ABC", "__builtin_elementwise_fma(A, B, C)", "dA * B + (A * dB + dC)"),
}


def declare(width, tangents, real):
    """Declare the functions of dual lanes of this shape, if this is the first time; the length of such a lane."""
    shape = Shape(width, tangents, real)
    with overloads._lock:
        if (shape.length, real) not in overloads._types:
            # From here on a lane of this length is a type like any other, which nobody else declares.
            overloads._types.append((shape.length, real))
            for part in (_declare_rules, _declare_functions, _declare_vectors, _declare_rows, _declare_normals):
                part(shape)
            for generic in (noise._declare, sums._declare_plain):
                generic(shape.length, real)
    return shape.length


def _declare_rules(shape):
    L, R = wp.types.vector(shape.length, shape.real), shape.real
    rule = {name: native.function(shape, *parts) for name, parts in RULES.items()}

    @overloads.func_native(rule["add"])
    def add(a: L, b: L) -> L: ...

    @overloads.func_native(rule["sub"])
    def sub(a: L, b: L) -> L: ...

    @overloads.func_native(rule["neg"])
    def neg(a: L) -> L: ...

    @overloads.func_native(rule["mul"])
    def mul(a: L, b: L) -> L: ...

    @overloads.func_native(native.function(shape, "A", "s * A", "s * dA"))
    def mul(s: R, a: L) -> L: ...

    @overloads.func_native(rule["div"])
    def div(a: L, b: L) -> L: ...

    @overloads.func_native(rule["absolute"])
    def absolute(a: L) -> L: ...

    @overloads.func_native(rule["least"])
    def least(a: L, b: L) -> L: ...

    @overloads.func_native(rule["largest"])
    def largest(a: L, b: L) -> L: ...

    @overloads.func_native(rule["greatest"])
    def greatest(a: L, b: L) -> L: ...

    @overloads.func_native(rule["clamp"])
    def clamp(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(rule["positive"])
    def positive(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(rule["fused"])
    def fused(a: L, b: L, c: L) -> L: ...


def _declare_functions(shape):
    L, I = wp.types.vector(shape.length, shape.real), int_lane(shape.length)  # noqa: E741
    arithmetic._declare_integers(shape.length)
    floor = "__builtin_elementwise_floor(A)"

    @overloads.func_native(native.function(shape, "", "V() + (S)1", "V()"))
    def ones(like: L) -> L: ...

    @overloads.func_native(native.any_positive(shape))
    def any_positive(a: L) -> bool: ...

    @overloads.func_native(native.whole(shape))
    def whole(a: L) -> I: ...

    @overloads.func_native(native.function(shape, "A", floor, "V()"))
    def below(a: L) -> L: ...

    @overloads.func_native(native.function(shape, "A", "A", "V()"))
    def without_slopes(a: L) -> L: ...

    @overloads.func_native(native.root(shape))
    def root(a: L) -> L: ...

    @overloads.func_native(native.rounded(shape))
    def rounded(a: L) -> L: ...

    @overloads.func_native(native.exponential(shape))
    def exponential(a: L) -> L: ...

    @overloads.func_native(native.sine(shape))
    def sine(a: L) -> L: ...

    @overloads.func_native(native.cosine(shape))
    def cosine(a: L) -> L: ...

    @overloads.func_native(native.logarithm(shape))
    def logarithm(a: L) -> L: ...

    @overloads.func_native(native.arctangent2(shape))
    def arctangent2(a: L, b: L) -> L: ...

    @overloads.func_native(native.decay(shape))
    def decay(a: L) -> L: ...


def _declare_rows(shape):
    size, real = shape.length, shape.real
    L, I = wp.types.vector(size, real), int_lane(size)  # noqa: E741
    Rows, Numbers = wp.array2d(dtype=L), wp.array2d(dtype=real)
    OwnLanes, OwnNumbers = own_rows(L), own_rows(real)
    read = "memcpy(&r, place, sizeof(r)); return r;"
    write = "memcpy(place, &value, sizeof(r));"
    read_own = arithmetic.native.own(size, real, "memcpy(&r, place, sizeof(r));") + " return r;"

    @overloads.func_native(arithmetic.native.element(size, real, read))
    def element(rows: Rows, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(arithmetic.native.element(size, real, read))
    def entry_of(like: L, rows: Rows, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(native.shared(shape))
    def entry_of(like: L, rows: Numbers, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(arithmetic.native.element(size, real, write))
    def set_element(rows: Rows, entry: int, row: int, offset: int, value: L): ...

    @overloads.func_native(read_own)
    def element(rows: OwnLanes, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(read_own)
    def entry_of(like: L, rows: OwnLanes, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(native.own_shared(shape))
    def entry_of(like: L, rows: OwnNumbers, entry: int, row: int, offset: int) -> L: ...

    @overloads.func_native(arithmetic.native.own(size, real, write))
    def set_element(rows: OwnLanes, entry: int, row: int, offset: int, value: L): ...

    @overloads.func_native(native.gather(shape, False))
    def gathered(like: L, rows: OwnLanes, entry: int, row: int, offset: int, index: I) -> L: ...

    @overloads.func_native(native.gather(shape, True))
    def gathered(like: L, rows: OwnNumbers, entry: int, row: int, offset: int, index: I) -> L: ...

    arithmetic._declare_pieces(L)
    arithmetic._declare_pieces(real)


def _declare_vectors(shape):
    arithmetic._declare_vectors(shape.length, shape.real)
    L3 = lane3(shape.length, shape.real)

    @overloads.func
    def without_slopes(a: L3):
        return vec3(without_slopes(a.x), without_slopes(a.y), without_slopes(a.z))


def _declare_normals(shape):
    L, I = wp.types.vector(shape.length, shape.real), int_lane(shape.length)  # noqa: E741
    L4 = wp.types.vector(4 * shape.length, shape.real)

    @overloads.func_native(native.normals(shape))
    def normals(like: L, member: I, step: int, channel: int, seed0: int, seed1: int) -> L4: ...

    @overloads.func_native(native.quarter(shape))
    def quarter(a: L4, k: int) -> L: ...

    @overloads.func
    def normals3(like: L, member: I, step: int, channel: int, seed0: int, seed1: int):
        four = normals(like, member, step, channel, seed0, seed1)
        return vec3(quarter(four, 0), quarter(four, 1), quarter(four, 2))
