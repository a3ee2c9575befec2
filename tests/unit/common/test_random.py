# SPDX-License-Identifier: Apache-2.0
"""Random numbers from counters: the generator's published answers, the kernel against its twin, and their statistics.

Statistics are compared within 5 standard errors (a chance of 6e-7 for a right code, and the seeds are fixed: a failure
means a changed law).
"""

import functools

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes import functions as lm
from lgvi_kernels.lanes.arithmetic import WIDTHS, int_lane, lane
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_warp.reference import random

N = 250_000
ERRORS = 5.0
FORMATS = {"float64": wp.float64, "float32": wp.float32}
# float64: the sine's argument is rounded otherwise, up to 2 pi at 1e-16, and the radius is at most 6.8.
# float32: the same at 6e-8, with the twin's words rounded to 24 bits.
ROUND = {"float64": 1e-14, "float32": 3e-6}


# The twin ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("counter", "key", "answer"), [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
])  # fmt: skip
def test_known_answers(counter, key, answer):
    """Random123, file kat_vectors, philox4x32 10."""
    counter, key, answer = ([int(word, 16) for word in words.split()] for words in (counter, key, answer))
    got = random.philox4x32(counter, key)
    assert got.dtype == np.uint32
    np.testing.assert_array_equal(got, answer)
    np.testing.assert_array_equal(random.philox4x32([[counter] * 2] * 3, key), [[answer] * 2] * 3)


def test_normals_are_those_of_the_words():
    words = random.philox4x32([5, 7, 11, 0], [1, 2])
    u = [(int(word) + 0.5) / 2**32 for word in words]
    r = np.sqrt(-2.0 * np.log([u[0], u[2]]))
    expected = [r[0] * np.cos(2 * np.pi * u[1]), r[0] * np.sin(2 * np.pi * u[1])]
    expected += [r[1] * np.cos(2 * np.pi * u[3]), r[1] * np.sin(2 * np.pi * u[3])]
    np.testing.assert_allclose(random.normals(1, 2, 5, 7, 11), expected, rtol=0, atol=1e-15)


def test_arguments_are_broadcast():
    got = random.normals(1, 2, np.arange(6)[:, None], np.arange(3), 0)
    assert got.shape == (6, 3, 4)
    np.testing.assert_array_equal(got[4, 1], random.normals(1, 2, 4, 1, 0))


@pytest.fixture(scope="module")
def draws():
    """1e6 normals, shape (N, 4)."""
    return random.normals(3, 4, np.arange(N), 0, 0)


def test_moments(draws):
    z = draws.ravel()
    # The moments of order k have sampling variances (E x^2k - (E x^k)^2) / n: 1, 2, 15, 96 over n.
    for power, mean, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert abs(np.mean(z**power) - mean) < ERRORS * np.sqrt(variance / z.size), power


def test_distribution(draws):
    # Kolmogorov: P(sqrt(n) D > 2.5) = 2 exp(-2 * 2.5^2) = 7e-6. The levels are those of scipy's normal law.
    from scipy.special import ndtr

    levels, grid = np.sort(ndtr(draws.ravel())), (np.arange(draws.size) + 0.5) / draws.size
    assert np.sqrt(draws.size) * np.abs(levels - grid).max() < 2.5


def uncorrelated(x, y):
    """Whether x and y, and their squares, are uncorrelated: coefficients have a standard error of 1/sqrt(n)."""
    bound = ERRORS / np.sqrt(x.size)
    return all(abs(np.corrcoef(x.ravel() ** k, y.ravel() ** k)[0, 1]) < bound for k in (1, 2))


def test_the_four_are_independent(draws):
    assert all(uncorrelated(draws[:, i], draws[:, j]) for i in range(4) for j in range(i))


@pytest.mark.parametrize(
    "second",
    [
        {"member": np.arange(N) + 1},
        {"step": 1},
        {"channel": 1},
        {"seed0": 4},
        {"seed1": 5},
        {"member": 0, "step": np.arange(N)},
        {"member": 0, "step": 0, "channel": np.arange(N)},
    ],
    ids=["member", "step", "channel", "seed0", "seed1", "steps", "channels"],
)
def test_streams_are_independent(draws, second):
    stream = random.normals(**{"seed0": 3, "seed1": 4, "member": np.arange(N), "step": 0, "channel": 0} | second)
    assert not (stream == draws)[1:].any()
    assert uncorrelated(stream, draws)


# The kernel --------------------------------------------------------------------------------------------------------


@functools.cache
def kernel(width, name):
    """normals and normals3 of a packet of members: seven rows."""
    Lane, IntLane = lane(width, FORMATS[name]), int_lane(width)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def draw(
        member: wp.array(dtype=IntLane), step: int, channel: int, seed0: int, seed1: int, out: wp.array2d(dtype=Lane)
    ):
        i = wp.tid()
        four = lm.normals(out[0, i], member[i], step, channel, seed0, seed1)
        for k in range(4):
            out[k, i] = lm.quarter(four, k)
        v = lm.normals3(out[0, i], member[i], step, channel, seed0, seed1)
        out[4, i] = v.x
        out[5, i] = v.y
        out[6, i] = v.z

    return draw


def drawn(width, name, member, step, channel, seed0, seed1):
    """Draws of the kernel for the members: shape (n, 7)."""
    packets = len(member) // width
    given = wp.array(member.astype(np.int32).reshape(packets, width), dtype=int_lane(width), device="cpu")
    out = wp.zeros((7, packets), dtype=lane(width, FORMATS[name]), device="cpu")
    wp.launch(kernel(width, name), packets, [given, step, channel, seed0, seed1], [out], device="cpu")
    return out.numpy().reshape(7, -1).T


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize(("width", "name"), [(1, "float64"), (8, "float64"), (1, "float32"), (16, "float32")])
@pytest.mark.parametrize(
    ("step", "channel", "seed0", "seed1"), [(0, 0, 0, 0), (2**31 - 1, 3, -1, 12345), (77, -5, 99, -(2**31))]
)
def test_kernel_and_twin(width, name, step, channel, seed0, seed1):
    member = np.arange(N - N % 16) - N // 2
    got = drawn(width, name, member, step, channel, seed0, seed1)
    expected = random.normals(seed0, seed1, member, step, channel)
    np.testing.assert_allclose(got[:, :4], expected, rtol=0, atol=ROUND[name])
    np.testing.assert_array_equal(got[:, 4:], got[:, :3])


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize(("name", "widths"), [
    ("float64", (1, 8)), ("float32", (1, 16)),
    *(pytest.param(name, WIDTHS, marks=pytest.mark.slow) for name in FORMATS),
])  # fmt: skip
def test_every_width_gives_the_same_bits(name, widths):
    member = np.arange(1024) * 7919
    first, *others = (drawn(width, name, member, 5, 1, 2, 3) for width in widths)
    for other in others:
        np.testing.assert_array_equal(other, first)


@pytest.mark.ci
@pytest.mark.kernel
def test_small_radii_in_float32():
    """Uniform numbers next to 1 give radii next to 0: they are drawn from the word, so float32 does not lose them."""
    member = np.arange(1 << 21)
    expected = random.normals(8, 9, member, 0, 0)
    small = np.hypot(expected[:, 0], expected[:, 1]) < 0.01
    assert small.sum() > 50
    rows = np.resize(member[small], 16 * (small.sum() // 16 + 1))
    got = drawn(16, "float32", rows, 0, 0, 8, 9)[: small.sum(), :2]
    np.testing.assert_allclose(got, expected[small, :2], rtol=0, atol=1e-8)
