# SPDX-License-Identifier: Apache-2.0
"""Dual lanes: overloads of the functions of lanes for lanes that carry slopes, each with its rule of differentiation.

Laws, maps, methods and controllers are written over lanes of any type: with these they carry slopes, and no line of them
changes. Plain lanes do not know this module: their text, which is a part of the hash of every kernel, stays.
"""

import functools

import warp as wp

from lgvi_kernels.lanes import noise, overloads, sums  # noqa: F401  (which declare functions of lanes as well)
from lgvi_kernels.lanes.arithmetic import (  # noqa: F401  (families, to which overloads are added by name)
    absolute,
    add,
    any_positive,
    below,
    declare_loops,
    div,
    int_lane,
    lane,
    lane3,
    largest,
    least,
    mul,
    neg,
    ones,
    positive,
    sub,
    vec3,
    whole,
)
from lgvi_kernels.lanes.functions import (  # noqa: F401
    about_inverse_root,
    arctangent2,
    clamp,
    cosine,
    decay,
    exponential,
    fused,
    greatest,
    logarithm,
    normals,
    quarter,
    root,
    rounded,
    sine,
)
from lgvi_kernels.tangents.native import DualShape, snippets

without_slopes = overloads.family("without_slopes", "The values of a, a lane or a vector, with slopes of 0.")


@functools.cache
def declare(shape: DualShape):
    """Declare the functions of dual lanes of this shape, if this is the first time; the length of such a lane.

    First as of plain lanes of that length: what is made of other functions, or moves lanes as a whole, needs no rule. What
    calculates is then replaced.
    """
    lane(shape.length, shape.real)
    code = snippets(shape)
    _declare_operators(shape, code)
    _declare_choices(shape, code)
    _declare_functions(shape, code)
    _declare_random(shape, code)
    return shape.length


def _declare_operators(shape, code):
    L, R = lane(shape.length, shape.real), shape.real

    @overloads.func_native(code["add"])
    def add(a: L, b: L) -> L: ...

    @overloads.func_native(code["sub"])
    def sub(a: L, b: L) -> L: ...

    @overloads.func_native(code["neg"])
    def neg(a: L) -> L: ...

    @overloads.func_native(code["mul"])
    def mul(a: L, b: L) -> L: ...

    @overloads.func_native(code["mul by a number"])
    def mul(s: R, a: L) -> L: ...

    @overloads.func_native(code["div"])
    def div(a: L, b: L) -> L: ...

    # Warp's own quotient of a number and a vector would divide by slopes as well.
    @overloads.func_native(code["div of a number"])
    def div(s: R, a: L) -> L: ...

    @overloads.func_native(code["fused"])
    def fused(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(code["ones"])
    def ones(like: L) -> L: ...

    declare_loops(wp.array2d(dtype=L), L)


def _declare_choices(shape, code):
    L, L3, I = lane(shape.length, shape.real), lane3(shape.length, shape.real), int_lane(shape.length)  # noqa: E741

    @overloads.func_native(code["absolute"])
    def absolute(a: L) -> L: ...

    @overloads.func_native(code["least"])
    def least(a: L, b: L) -> L: ...

    @overloads.func_native(code["largest"])
    def largest(a: L, b: L) -> L: ...

    @overloads.func_native(code["greatest"])
    def greatest(a: L, b: L) -> L: ...

    @overloads.func_native(code["clamp"])
    def clamp(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(code["positive"])
    def positive(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(code["any_positive"])
    def any_positive(a: L) -> bool: ...

    @overloads.func_native(code["whole"])
    def whole(a: L) -> I: ...

    @overloads.func_native(code["below"])
    def below(a: L) -> L: ...

    @overloads.func_native(code["rounded"])
    def rounded(a: L) -> L: ...

    @overloads.func_native(code["without_slopes"])
    def without_slopes(a: L) -> L: ...

    @overloads.func
    def without_slopes(a: L3):
        return vec3(without_slopes(a.x), without_slopes(a.y), without_slopes(a.z))


def _declare_functions(shape, code):
    L = lane(shape.length, shape.real)

    @overloads.func_native(code["root"])
    def root(a: L) -> L: ...

    @overloads.func_native(code["about_inverse_root"])
    def about_inverse_root(a: L) -> L: ...

    @overloads.func_native(code["exponential"])
    def exponential(a: L) -> L: ...

    @overloads.func_native(code["sine"])
    def sine(a: L) -> L: ...

    @overloads.func_native(code["cosine"])
    def cosine(a: L) -> L: ...

    @overloads.func_native(code["logarithm"])
    def logarithm(a: L) -> L: ...

    @overloads.func_native(code["arctangent2"])
    def arctangent2(a: L, b: L) -> L: ...

    @overloads.func_native(code["decay"])
    def decay(a: L) -> L: ...


def _declare_random(shape, code):
    L, I = lane(shape.length, shape.real), int_lane(shape.length)  # noqa: E741
    L4 = wp.types.vector(4 * shape.length, shape.real)

    @overloads.func_native(code["normals"])
    def normals(like: L, member: I, step: int, channel: int, seed0: int, seed1: int) -> L4: ...

    @overloads.func_native(code["quarter"])
    def quarter(a: L4, k: int) -> L: ...
