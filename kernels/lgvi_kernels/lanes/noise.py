# SPDX-License-Identifier: Apache-2.0
"""Random numbers of a law that is noise: its key, and what the draws of one step of the run add up to.

A law may draw on a grid of its own, finer than the run's steps: then runs of all steps that are multiples of the grid's see
one path. Only the key's type says so, so that a law without a grid has no code for it.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes import overloads
from lgvi_kernels.lanes.arithmetic import add, div, int_lane, mul, ones  # noqa: F401
from lgvi_kernels.lanes.functions import normals3, root
from lgvi_kernels.lanes.state import struct


@functools.cache
def noise_key(width, gridded=False):
    """The struct of a law's key: member, the halves of the seed, and the first of the law's two channels.

    gridded: with `draws`, how many a step of the run takes; without it a step takes one.
    """
    words = {"member": int_lane(width), "seed0": wp.int32, "seed1": wp.int32, "channel": wp.int32}
    return struct("GridKey", **words, draws=wp.int32) if gridded else struct("StepKey", **words)


@wp.func
def normals_of(view: Any, key: Any, stream: int, draw: int):
    """Three standard normals of one draw; stream: 0 or 1, two that are independent."""
    return normals3(view.b.x, key.member, draw, key.channel + stream, key.seed0, key.seed1)


normals_over = overloads.family(
    "normals_over",
    "Three standard normals for this step of the run: with a grid, the sum of its draws over the root of their number.",
)
wandered = overloads.family(
    "wandered",
    "The vector u after this step of the run: at each draw u <- decay u + spread xi, both over the time of one draw.",
)


# The key's type chooses.
@functools.cache
def _declare_keys(width):
    StepKey, GridKey = noise_key(width), noise_key(width, True)

    @overloads.func
    def normals_over(view: Any, key: StepKey, stream: int):
        return normals_of(view, key, stream, view.step)

    @overloads.func
    def normals_over(view: Any, key: GridKey, stream: int):
        first = view.step * key.draws
        total = normals_of(view, key, stream, first)
        for j in range(1, key.draws):
            total = total + normals_of(view, key, stream, first + j)
        unity = ones(view.b.x)
        return (unity / root(view.h.dtype(key.draws) * unity)) * total

    @overloads.func
    def wandered(view: Any, key: StepKey, stream: int, u: Any, decay: Any, spread: Any):
        return decay * u + spread * normals_of(view, key, stream, view.step)

    @overloads.func
    def wandered(view: Any, key: GridKey, stream: int, u: Any, decay: Any, spread: Any):
        first = view.step * key.draws
        for j in range(key.draws):
            u = decay * u + spread * normals_of(view, key, stream, first + j)
        return u


@overloads.for_each_type
def _declare(width, real):
    _declare_keys(width)
