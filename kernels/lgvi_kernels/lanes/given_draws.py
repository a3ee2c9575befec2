# SPDX-License-Identifier: Apache-2.0
"""Standard normals that a call gives in place of those of counters: rows of a law in the table, and the keys that find them.

Only a kernel whose run is given its draws imports this file.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes import overloads
from lgvi_kernels.lanes.arithmetic import add, mul, ones, struct, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.noise import declare_gridded, normals_of
from lgvi_kernels.lanes.view import row1, row3


@functools.cache
def given_key():
    """The struct of a law's key, in place of those of lanes/noise.py.

    row: of its first normal; apart: rows from there to those of stream 1; draws: how many a step of the run takes.
    """
    return struct("GivenKey", row=wp.int32, apart=wp.int32, draws=wp.int32)


@functools.cache
def given_ticks():
    """The struct of a sensor's key. row: of its first normal; the others: rows from there to those of each stream."""
    names = ("row", "noise", "drift", "dropout", "outlier", "outlier_std")
    return struct("GivenTicks", **dict.fromkeys(names, wp.int32))


GivenKey = given_key()


@overloads.func
def normals_of(view: Any, key: GivenKey, stream: int, draw: int):  # noqa: F811
    return row3(view, key.row + stream * key.apart + 3 * draw)


# Without a grid a step takes one draw: 1 times it over the root of 1.
declare_gridded(GivenKey)


@wp.func
def scalar_of_tick(y: Any, first: int):
    """The one normal of this tick, of those from row `first` on."""
    return row1(y, first + y.tick)


@wp.func
def vector_of_tick(y: Any, first: int):
    """The three normals of this tick."""
    return row3(y, first + 3 * y.tick)


@wp.func
def first_of_tick(y: Any, first: int):
    """The one normal of this tick as a 3-vector."""
    x = row1(y, first + y.tick)
    zero = ones(x) - ones(x)
    return vec3(x, zero, zero)
