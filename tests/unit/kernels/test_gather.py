# SPDX-License-Identifier: Apache-2.0
"""Rows at an index for each lane, three of them as a vector, and the whole numbers that such indices are, by NumPy."""

import functools

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes.arithmetic import REALS, WIDTHS, gathered3, int_lane, lane, whole
from lgvi_kernels.lanes.flags import CPU_FLAGS

pytestmark = pytest.mark.kernel

ROWS = 31


@functools.cache
def kernel(width, real):
    """Whole numbers of x, and three rows from there on: of a table of lanes, and of one of numbers that lanes share."""
    Lane, Index = lane(width, real), int_lane(width)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def evaluate(
        x: wp.array(dtype=Lane), entry: int, row: int, lanes: wp.array2d(dtype=Lane), numbers: wp.array2d(dtype=real),
        index: wp.array(dtype=Index), out: wp.array2d(dtype=Lane),
    ):  # fmt: skip
        i = wp.tid()
        at = whole(x[i])
        index[i] = at
        if entry >= 0:
            a = gathered3(x[i], lanes, entry, row, at)
            b = gathered3(x[i], numbers, entry, row, at)
            out[0, i] = a.x
            out[1, i] = a.y
            out[2, i] = a.z
            out[3, i] = b.x
            out[4, i] = b.y
            out[5, i] = b.z

    return evaluate


def read(width, real, x, entry, row, lanes, numbers):
    """Indices (packets, width) and rows (6, packets, width) at the numbers x (packets, width)."""
    made = functools.partial(wp.array, device="cpu")
    out = wp.zeros((6, len(x)), dtype=lane(width, real), device="cpu")
    index = wp.zeros(len(x), dtype=int_lane(width), device="cpu")
    given = [made(x.astype(numbers.dtype), dtype=lane(width, real)), entry, row]
    tables = [made(lanes, dtype=lane(width, real)), made(numbers, dtype=real)]
    wp.launch(kernel(width, real), len(x), inputs=[*given, *tables], outputs=[index, out], device="cpu")
    return index.numpy().reshape(x.shape), out.numpy().reshape(6, *x.shape)


@pytest.mark.ci
@pytest.mark.parametrize("real", REALS, ids=("float32", "float64"))
@pytest.mark.parametrize("width", WIDTHS)
def test_three_rows_from_each_lanes_own_index_on(width, real):
    rng = np.random.default_rng(width)
    dtype = np.dtype(real.__name__)
    # Integers: every reading tells its place. A table of numbers has one more row than is asked for.
    lanes = rng.integers(0, 1000, (2, ROWS, width)).astype(dtype)
    numbers = rng.integers(0, 1000, (2, ROWS + 1)).astype(dtype)
    row, last = 5, ROWS - 3 - 5
    at = rng.integers(0, last + 1, (40, width))
    # In one row together, the first and the last among them; and all but one lane.
    at[:3] = np.array([0, last, 7])[:, None]
    at[3:5] = 9
    at[3, 0], at[4, -1] = 2, last
    index, out = read(width, real, at + rng.uniform(0.0, 0.9, at.shape), 1, row, lanes, numbers)
    np.testing.assert_array_equal(index, at)
    for i in range(3):
        np.testing.assert_array_equal(out[i], lanes[1, row + at + i, np.arange(width)])
        np.testing.assert_array_equal(out[3 + i], numbers[1, row + at + i])


@pytest.mark.ci
@pytest.mark.parametrize("real", REALS, ids=("float32", "float64"))
@pytest.mark.parametrize("width", WIDTHS)
def test_a_whole_number_is_at_or_below_and_one_that_int32_holds(width, real):
    ends = {
        0.0: 0, 0.75: 0, -0.25: -1, -1.0: -1, 5.0: 5, -7.5: -8, 2147483520.0: 2147483520, -2147483648.0: -(2**31),
        2147483648.0: 2**31 - 1, -2147483904.0: -(2**31), 1e30: 2**31 - 1, -1e30: -(2**31), np.inf: 2**31 - 1,
        -np.inf: -(2**31),
    }  # fmt: skip
    x = np.array([*ends, np.nan])
    if real == wp.float64:
        ends |= {2147483646.5: 2**31 - 2, 2147483647.5: 2**31 - 1, -2147483647.5: -(2**31)}
        x = np.array([*ends, np.nan])
    # Each alone in a lane, with another number in the others, so that none depends on its neighbours.
    packed = np.full((len(x), width), 3.5)
    lanes_of = np.arange(len(x)) % width
    packed[np.arange(len(x)), lanes_of] = x
    dtype = np.dtype(real.__name__)
    index, _ = read(width, real, packed, -1, 0, np.zeros((1, ROWS, width), dtype), np.zeros((1, ROWS), dtype))
    want = np.full(packed.shape, 3)
    want[np.arange(len(x)), lanes_of] = [*ends.values(), -(2**31)]
    np.testing.assert_array_equal(index, want)
