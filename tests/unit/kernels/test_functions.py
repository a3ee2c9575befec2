# SPDX-License-Identifier: Apache-2.0
"""Elementary functions in lanes, against NumPy in extended precision. "eps" is the spacing of numbers at 1.

The bounds: each function rounds its last addition (1/2 eps) after a correction that is itself right to an eps or two;
twice what was measured over 4e5 arguments a range. Where long double is no longer than double (not on x86), NumPy's own
1/2 eps is within them.
"""

import functools

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes import functions as lm
from lgvi_kernels.lanes.arithmetic import REALS, WIDTHS, add, lane, vec3  # noqa: F401
from lgvi_kernels.lanes.flags import CPU_FLAGS

pytestmark = pytest.mark.kernel

NAMES = ("root", "exponential", "sine", "cosine", "logarithm", "decay", "greatest", "clamp", "arctangent2",
         "hyperbolic_tangent", "neg", "fused", "about_inverse_root", "turned_cosine", "turned_sine")  # fmt: skip
FORMATS = {"float64": (wp.float64, np.float64), "float32": (wp.float32, np.float32)}
THOROUGH = [(1, "float64"), (8, "float64"), (1, "float32"), (16, "float32")]
LARGEST = {"float64": 700.0, "float32": 87.0}
ERRORS = {
    "root": 1.0, "exponential": 2.0, "sine": 2.0, "cosine": 2.0, "logarithm": 3.0, "decay": 4.0,
    "hyperbolic_tangent": 5.0,
}  # fmt: skip
ARCTANGENT_ERROR = 3.0


@functools.cache
def kernel(width, name):
    """All functions of the arguments a: rows in the order of NAMES; greatest, arctangent2, clamp and fused with b and c.

    "neg" is the minus before a 3-vector, thrice, whose numbers are x, b and c: x of it, where the others are as they must be.
    """
    Lane = lane(width, FORMATS[name][0])

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def evaluate(a: wp.array2d(dtype=Lane), out: wp.array2d(dtype=Lane)):
        i = wp.tid()
        x = a[0, i]
        out[0, i] = lm.root(x)
        out[1, i] = lm.exponential(x)
        out[2, i] = lm.sine(x)
        out[3, i] = lm.cosine(x)
        out[4, i] = lm.logarithm(x)
        out[5, i] = lm.decay(x)
        out[6, i] = lm.greatest(x, a[1, i])
        out[7, i] = lm.clamp(x, a[1, i], a[2, i])
        out[8, i] = lm.arctangent2(x, a[1, i])
        out[9, i] = lm.hyperbolic_tangent(x)
        u = vec3(x, a[1, i], a[2, i])
        v = -(-(-u))
        # (x, b, c) . (1, 2, 4), of which no sum of two other signs is the same.
        out[10, i] = v.x + (v.y + v.y) + (v.z + v.z + v.z + v.z)
        out[11, i] = lm.fused(x, a[1, i], a[2, i])
        out[12, i] = lm.about_inverse_root(x)
        c, s = lm.turned_by(x, a[1, i], a[2, i])
        out[13, i] = c
        out[14, i] = s

    return evaluate


def evaluate(width, name, a, b=0.0, c=0.0):
    """{function: its values at the numbers a, b, c} by a kernel of this width and type."""
    real, dtype = FORMATS[name]
    arguments = np.stack([np.broadcast_to(x, np.shape(a)) for x in (a, b, c)]).astype(dtype)
    packets = -(-arguments.shape[1] // width)
    padded = np.pad(arguments, ((0, 0), (0, packets * width - arguments.shape[1])), constant_values=1.0)
    out = wp.zeros((len(NAMES), packets), dtype=lane(width, real), device="cpu")
    given = wp.array(padded.reshape(3, packets, width), dtype=lane(width, real), shape=(3, packets), device="cpu")
    wp.launch(kernel(width, name), packets, inputs=[given], outputs=[out], device="cpu")
    return dict(zip(NAMES, out.numpy().reshape(len(NAMES), -1)[:, : arguments.shape[1]]))


def exact_decay(x):
    """(1 - e^-x) / x."""
    return np.divide(-np.expm1(-x), x, out=np.ones_like(x), where=x != 0.0)


EXACT = {
    "root": np.sqrt, "exponential": np.exp, "sine": np.sin, "cosine": np.cos, "logarithm": np.log, "decay": exact_decay,
    "hyperbolic_tangent": np.tanh,
}  # fmt: skip


def arguments(function, name):
    """Arguments of one function: wide, near its zeros and where it changes branch."""
    rng, n, top = np.random.default_rng(1), 20_000, LARGEST[name]
    tiny = 10.0 ** rng.uniform(-30.0, 0.0, n)
    if function in ("sine", "cosine"):
        turns = np.arange(-63000, 63000, 7) * (np.pi / 2)
        spread = [rng.uniform(-reach, reach, n) for reach in (1.0, 10.0, 1e3, 1e5)]
        return np.concatenate([*spread, turns, turns + np.pi / 4, tiny, -tiny])
    if function == "hyperbolic_tangent":
        sizes = np.concatenate([tiny, rng.uniform(0.0, 25.0, n), rng.uniform(0.0, 1.0, n), [1e6]])
        return np.concatenate([sizes, -sizes])
    if function == "exponential":
        halves = (np.arange(-100, 100) + 0.5) * np.log(2.0)
        return np.concatenate([rng.uniform(-top, top, n), rng.uniform(-1.0, 1.0, n), halves, tiny, -tiny])
    if function == "decay":
        large = 10.0 ** rng.uniform(0.0, 6.0, n)
        return np.concatenate([rng.uniform(-3.0, 3.0, n), large, -rng.uniform(0.0, top, n), tiny, -tiny, [0.0, 1e6]])
    near_one = 1.0 + rng.uniform(-1.0, 1.0, n) * 10.0 ** rng.uniform(-12.0, -0.5, n)
    return np.concatenate([np.exp(rng.uniform(-top, top, n)), near_one])


def errors(function, name, width):
    """Errors [eps] at all arguments: absolute ones of sine and cosine, relative ones of the others."""
    dtype = FORMATS[name][1]
    x = arguments(function, name).astype(dtype)
    if function == "logarithm":
        # ln 1 = 0 has no relative error: it is among the special values.
        x = x[x != 1.0]
    exact = EXACT[function](x.astype(np.longdouble))
    scale = 1.0 if function in ("sine", "cosine") else np.abs(exact)
    return np.abs(evaluate(width, name, x)[function] - exact) / scale / np.finfo(dtype).eps


@pytest.mark.ci
@pytest.mark.parametrize("function", ERRORS)
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_function(function, width, name):
    # A number that is not one fails the comparison too.
    assert errors(function, name, width).max() < ERRORS[function]


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_arctangent2(width, name):
    rng, n, dtype = np.random.default_rng(4), 40_000, FORMATS[name][1]
    # All around, near the axes and the diagonals, where it changes branch, and points of all sizes.
    eighths = np.arange(16) * np.pi / 8
    near = (
        eighths[:, None] + rng.choice([-1.0, 1.0], (16, 2000)) * 10.0 ** rng.uniform(-12.0, -0.5, (16, 2000))
    ).ravel()
    angles = np.concatenate([rng.uniform(-np.pi, np.pi, n), near])
    sizes = 10.0 ** rng.uniform(-15.0, 15.0, len(angles))
    y, x = (sizes * np.sin(angles)).astype(dtype), (sizes * np.cos(angles)).astype(dtype)
    exact = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble))
    error = np.abs(evaluate(width, name, y, x)["arctangent2"] - exact) / np.abs(exact) / np.finfo(dtype).eps
    assert error.max() < ARCTANGENT_ERROR


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_special_values_of_the_arctangent(width, name):
    nan = np.nan
    y = [0.0, 1.0, -1.0, 0.0, 0.0, 1.0, -1.0, nan, 1.0, nan, 0.0]
    x = [0.0, 0.0, 0.0, 1.0, -1.0, -1.0, -1.0, 1.0, nan, nan, nan]
    quarter = np.pi / 4
    expected = [0.0, 2 * quarter, -2 * quarter, 0.0, 4 * quarter, 3 * quarter, -3 * quarter, nan, nan, nan, nan]
    np.testing.assert_allclose(evaluate(width, name, y, x)["arctangent2"], expected, rtol=4e-7)


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_minus_of_a_vector(width, name):
    a, b, c = np.random.default_rng(5).integers(-9, 10, (3, 1000)).astype(float)
    np.testing.assert_array_equal(evaluate(width, name, a, b, c)["neg"], -(a + 2 * b + 4 * c))


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_fused_rounds_once(width, name):
    # (1 + 2^-k)(1 - 2^-k) - 1 = -2^-2k, where the product alone is rounded to 1.
    k = 30 if name == "float64" else 14
    part = 2.0**-k
    assert evaluate(width, name, [1.0 + part], 1.0 - part, -1.0)["fused"] == [-(part**2)]


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_about_one_over_a_root(width, name):
    # A guess to 0.035 leaves e = 0.07 of the square; the series stops at its fourth power, of which 35/128 are missing.
    x = np.exp(np.random.default_rng(6).uniform(-80.0, 80.0, 20_000)).astype(FORMATS[name][1])
    got = evaluate(width, name, x)["about_inverse_root"]
    assert np.abs(got * np.sqrt(x.astype(np.longdouble)) - 1.0).max() < 7e-6
    zero, none = evaluate(width, name, [0.0, np.nan])["about_inverse_root"]
    assert 0.0 * zero == 0.0
    assert np.isnan(none)


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_special_values(width, name):
    nan, inf = np.nan, np.inf
    x = [0.0, inf, -inf, nan, -1.0, 1e4, -1e4, 1.0]
    got = evaluate(width, name, x)
    expected = {
        "root": [0.0, inf, nan, nan, nan, 100.0, nan, 1.0],
        "exponential": [1.0, inf, 0.0, nan, np.exp(-1.0), inf, 0.0, np.e],
        "sine": [0.0, nan, nan, nan, np.sin(-1.0), np.sin(1e4), np.sin(-1e4), np.sin(1.0)],
        "cosine": [1.0, nan, nan, nan, np.cos(1.0), np.cos(1e4), np.cos(1e4), np.cos(1.0)],
        "logarithm": [nan, None, nan, nan, nan, np.log(1e4), nan, 0.0],
        "decay": [1.0, 0.0, None, nan, np.e - 1.0, 1e-4, None, 1.0 - np.exp(-1.0)],
        "hyperbolic_tangent": [0.0, 1.0, -1.0, nan, -np.tanh(1.0), 1.0, -1.0, np.tanh(1.0)],
    }
    for function, values in expected.items():
        # None: outside the function's range.
        kept = [i for i, value in enumerate(values) if value is not None]
        np.testing.assert_allclose(got[function][kept], [values[i] for i in kept], rtol=4e-7, err_msg=function)


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_the_exponential_ends_where_the_format_does(width, name):
    dtype = FORMATS[name][1]
    info = np.finfo(dtype)
    last = np.log(np.longdouble(info.max)).astype(dtype) * (1.0 - info.eps)
    first = np.log(np.longdouble(info.smallest_subnormal)).astype(dtype)
    with np.errstate(over="ignore", under="ignore"):
        x = np.array([last, last * dtype(1.0 + 1e-5), first, first * dtype(1.01), 0.99 * first], dtype)
        got = evaluate(width, name, x)["exponential"]
        exact = np.exp(x.astype(np.longdouble)).astype(dtype)
    assert np.isfinite(got[0])
    assert (got[1], got[3]) == (np.inf, 0.0)
    # Below the normal numbers, the spacing is that of the smallest.
    np.testing.assert_allclose(got[[0, 2, 4]], exact[[0, 2, 4]], rtol=2 * info.eps, atol=info.smallest_subnormal)


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_clamp_and_greatest(width, name):
    rng = np.random.default_rng(2)
    a, b, c = rng.normal(size=(3, 1000)).astype(FORMATS[name][1])
    low, high = np.minimum(b, c), np.maximum(b, c)
    got = evaluate(width, name, a, low, high)
    np.testing.assert_array_equal(got["greatest"], np.maximum(a, low))
    np.testing.assert_array_equal(got["clamp"], np.clip(a, low, high))
    assert np.isnan(evaluate(width, name, [np.nan], [-1.0], [1.0])["clamp"]).all()


@pytest.mark.ci
@pytest.mark.parametrize(("name", "widths"), [
    ("float64", (1, 8)),
    ("float32", (1, 16)),
    *(pytest.param(name, WIDTHS, marks=pytest.mark.slow) for name in FORMATS),
])  # fmt: skip
def test_every_width_gives_the_same_bits(name, widths):
    x = np.concatenate([np.random.default_rng(3).uniform(0.01, 80.0, 4096), [0.0, np.inf, np.nan]])
    first, *others = (evaluate(width, name, x, 1.0, 2.0) for width in widths)
    for other in others:
        for function in NAMES:
            np.testing.assert_array_equal(other[function], first[function], err_msg=function)


def test_every_type_was_tested():
    assert {FORMATS[name][0] for name in FORMATS} == set(REALS)


@pytest.mark.ci
@pytest.mark.parametrize(("width", "name"), THOROUGH)
def test_a_small_turn(width, name):
    rng, dtype = np.random.default_rng(5), FORMATS[name][1]
    angles = rng.uniform(-np.pi, np.pi, 20_000)
    turns = rng.uniform(-lm.SMALL_TURN, lm.SMALL_TURN, 20_000).astype(dtype)
    turns[:3] = 0.0, lm.SMALL_TURN, -lm.SMALL_TURN
    c, s = np.cos(angles).astype(dtype), np.sin(angles).astype(dtype)
    found, x = evaluate(width, name, c, s, turns), turns.astype(np.longdouble)
    exact = {"turned_cosine": c * np.cos(x) - s * np.sin(x), "turned_sine": s * np.cos(x) + c * np.sin(x)}
    for function, values in exact.items():
        # Two products and sums of numbers of at most 1, and the next terms of the series, 1e-17 and less.
        assert np.abs(found[function] - values).max() < 2.0 * np.finfo(dtype).eps
