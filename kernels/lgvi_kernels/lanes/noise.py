# SPDX-License-Identifier: Apache-2.0
"""Random numbers of a law that is noise: its key, and what the draws of one step of the run add up to.

A law may draw on a grid of its own, finer than the run's steps: then runs of all steps that are multiples of the grid's see
one path. Only the key's type says so, so that a law without a grid has no code for it.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes import overloads
from lgvi_kernels.lanes.arithmetic import add, div, int_lane, mul, ones, vec3  # noqa: F401
from lgvi_kernels.lanes.functions import fused, normals3, root
from lgvi_kernels.lanes.state import struct


@functools.cache
def noise_key(width, gridded=False):
    """The struct of a law's key: member, the halves of the seed, and the first of the law's two channels.

    gridded: with `draws`, how many a step of the run takes; without it a step takes one.
    """
    words = {"member": int_lane(width), "seed0": wp.int32, "seed1": wp.int32, "channel": wp.int32}
    return struct("GridKey", **words, draws=wp.int32) if gridded else struct("StepKey", **words)


normals_of = overloads.family(
    "normals_of", "Three standard normals of one draw; stream: 0 or 1, two that are independent."
)
normals_over = overloads.family(
    "normals_over",
    "Three standard normals for this step of the run: with a grid, the sum of its draws over the root of their number.",
)
wandered = overloads.family(
    "wandered",
    "The vector u after this step of the run: at each draw u <- decay u + spread xi, both over the time of one draw.",
)


@wp.func
def plus_times(v: Any, a: Any, b: Any):
    """v + a b, each rounded once: a sum that a compiler may join with any product has other bits where the draws are given."""
    return vec3(fused(a.x, b.x, v.x), fused(a.y, b.y, v.y), fused(a.z, b.z, v.z))


# The key's type chooses.
@functools.cache
def _declare_keys(width):
    declare_counted(noise_key(width))
    declare_counted(noise_key(width, True))
    declare_gridded(noise_key(width, True))
    StepKey = noise_key(width)

    @overloads.func
    def normals_over(view: Any, key: StepKey, stream: int):
        return normals_of(view, key, stream, view.step)

    @overloads.func
    def wandered(view: Any, key: StepKey, stream: int, u: Any, decay: Any, spread: Any):
        return plus_times(decay * u, spread, normals_of(view, key, stream, view.step))


def declare_counted(Key):
    """The normals of a key by counters."""

    @overloads.func
    def normals_of(view: Any, key: Key, stream: int, draw: int):
        return normals3(view.b.x, key.member, draw, key.channel + stream, key.seed0, key.seed1)


def declare_gridded(Key):
    """What the draws of a step add up to, for a key that says how many there are, and that has `normals_of`."""

    @overloads.func
    def normals_over(view: Any, key: Key, stream: int):
        first = view.step * key.draws
        unity = ones(view.b.x)
        part = unity / root(view.h.dtype(key.draws) * unity)
        parts = vec3(part, part, part)
        total = part * normals_of(view, key, stream, first)
        for j in range(1, key.draws):
            total = plus_times(total, parts, normals_of(view, key, stream, first + j))
        return total

    @overloads.func
    def wandered(view: Any, key: Key, stream: int, u: Any, decay: Any, spread: Any):
        first = view.step * key.draws
        for j in range(key.draws):
            u = plus_times(decay * u, spread, normals_of(view, key, stream, first + j))
        return u


@overloads.for_each_type
def _declare(width, real):
    _declare_keys(width)
