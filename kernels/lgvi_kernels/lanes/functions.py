# SPDX-License-Identifier: Apache-2.0
"""Elementary functions and normal random numbers in lanes, written like the operators of arithmetic.py. C++: series.py."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes import native, overloads, series
from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    absolute,
    add,
    div,
    int_lane,
    lane,
    mul,
    neg,
    ones,
    positive,
    sub,
    vec3,
)

greatest = overloads.family("greatest", "The larger of a and b; b where one is no number.")
clamp = overloads.family("clamp", "a kept between b and c; NaN stays NaN.")
fused = overloads.family("fused", "a b + c, rounded once (with one lane, where the compiler joins them).")
root = overloads.family("root", "Square root.")
about_inverse_root = overloads.family(
    "about_inverse_root", "1 / sqrt(a) to 7e-6 of a positive a, without a division; of 0 a large number."
)
rounded = overloads.family("rounded", "The nearest whole number; of two the even one.")
exponential = overloads.family("exponential", "e^a, to 2 eps; 0 and inf beyond the format's range.")
sine = overloads.family("sine", "sin a, to 2 eps for |a| <= 1e5 rad.")
cosine = overloads.family(
    "cosine", "cos a, to 2 eps for |a| <= 1e5 rad. With sine of the same a it costs next to nothing."
)
logarithm = overloads.family("logarithm", "ln a of a normal number a, to 2 eps; not a number where a <= 0.")
arctangent2 = overloads.family(
    "arctangent2", "The angle of the point (b, a), in [-pi, pi], to 2 eps; 0 for the origin. Of (0, b < 0) it is pi."
)
decay = overloads.family("decay", "(1 - e^-a) / a, 1 at a = 0, to 3 eps for every a > -700 (float32: -87).")
normals = overloads.family(
    "normals",
    "Four independent standard normals in each lane, side by side: a function of the arguments alone. Philox4x32-10 "
    "with counter (member, step, channel, 0) and key (seed0, seed1), then Box & Muller's map.",
)
quarter = overloads.family("quarter", "Lane k, 0 to 3, of the four lanes side by side in a.")
normals3 = overloads.family("normals3", "A 3-vector of the first three of `normals`.")


@overloads.for_each_type
def _declare_functions(width, real):
    L = lane(width, real)
    code, body = functools.partial(native.code, width, real), functools.partial(series.function, width, real)

    @overloads.func_native(code("AB", "A > B ? A : B"))
    def greatest(a: L, b: L) -> L: ...

    @overloads.func_native(code("ABC", "B > (C < A ? C : A) ? B : (C < A ? C : A)"))
    def clamp(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(code("ABC", "A * B + C" if width == 1 else "__builtin_elementwise_fma(A, B, C)"))
    def fused(a: L, b: L, c: L) -> L: ...

    @overloads.func_native(code("A", series.root(width).format("A")))
    def root(a: L) -> L: ...

    @overloads.func_native(body("A", series.about_inverse_root(real)))
    def about_inverse_root(a: L) -> L: ...

    @overloads.func_native(body("A", series.nearest(real)))
    def rounded(a: L) -> L: ...

    @overloads.func_native(body("A", series.exponential(real)))
    def exponential(a: L) -> L: ...

    @overloads.func_native(body("A", series.sine(real, "N"), "Y"))
    def sine(a: L) -> L: ...

    @overloads.func_native(body("A", series.sine(real, "N + 1"), "Y"))
    def cosine(a: L) -> L: ...

    @overloads.func_native(body("A", series.logarithm(real)))
    def logarithm(a: L) -> L: ...

    @overloads.func_native(body("AB", series.arctangent2(real)))
    def arctangent2(a: L, b: L) -> L: ...

    @overloads.func_native(body("A", series.decay(real)))
    def decay(a: L) -> L: ...


@overloads.for_each_type
def _declare_normals(width, real):
    # Four lanes side by side are kept together, not calculated with: no function of lanes knows their type.
    L, I, L4 = lane(width, real), int_lane(width), wp.types.vector(4 * width, real)  # noqa: E741

    @overloads.func_native(series.normals(width, real))
    def normals(like: L, member: I, step: int, channel: int, seed0: int, seed1: int) -> L4: ...

    @overloads.func_native(
        f"wp::vec_t<{width}, wp::{real.__name__}> r; memcpy(&r, &a[k * {width}], sizeof(r)); return r;"
    )
    def quarter(a: L4, k: int) -> L: ...

    @overloads.func
    def normals3(like: L, member: I, step: int, channel: int, seed0: int, seed1: int):
        four = normals(like, member, step, channel, seed0, seed1)
        return vec3(quarter(four, 0), quarter(four, 1), quarter(four, 2))


# The largest angle of `turned_by` [rad].
SMALL_TURN = 0.0625


@wp.func
def turned_by(c: Any, s: Any, x: Any):
    """(cos, sin) of an angle x more than that of which c and s are, to 2 eps for |x| <= SMALL_TURN."""
    z = x * x
    # sin x, and 1 - cos x, by their series.
    sine_x = x.dtype(wp.static(1.0 / 120.0)) * ones(x) - x.dtype(wp.static(1.0 / 5040.0)) * z
    sine_x = x + (x * z) * (z * sine_x - x.dtype(wp.static(1.0 / 6.0)) * ones(x))
    less = x.dtype(wp.static(1.0 / 720.0)) * ones(x) - x.dtype(wp.static(1.0 / 40320.0)) * z
    less = z * (x.dtype(0.5) * ones(x) + z * (z * less - x.dtype(wp.static(1.0 / 24.0)) * ones(x)))
    return c - (c * less + s * sine_x), s + (c * sine_x - s * less)


@wp.func
def hyperbolic_tangent(a: Any):
    """tanh a, to 4 eps: 1 - e^-x = x decay(x) has no cancellation, and tanh a = (1 - e^-x) / (1 + e^-x) with x = 2 |a|."""
    unity = ones(a)
    x = clamp(absolute(a + a), unity - unity, a.dtype(80.0) * unity)
    d = x * decay(x)
    t = d / (unity + unity - d)
    return positive(a, t, -t)
