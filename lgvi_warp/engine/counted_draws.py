# SPDX-License-Identifier: Apache-2.0
"""Standard normals that counters give to members, with the same bits as in a kernel's run."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.lanes.arithmetic import int_lane, lane
from lgvi_kernels.packing.counted_draws import make_counted_draws
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.engine import kernel_cache
from lgvi_warp.engine.arrays import put
from lgvi_warp.physics.given_draws import DrawLayout, NoiseDraws
from lgvi_warp.physics.terms.noisy import normals_at_start, words_of

# Numbers that are drawn at once: what lies in lanes is turned into rows in pieces that stay in the caches.
AT_ONCE = 1_000_000


def dtype_of(layout: DrawLayout, real: Any) -> Any:
    """NumPy type that holds the normals without loss: the kernel's type, or float64 for draws on the host."""
    of_host = any(entry.source.at_start for entry in layout)
    return np.float64 if of_host or real == wp.float64 else np.float32


def counted_draws(layout: DrawLayout, seed: int, members: np.ndarray, width: int, real: Any) -> np.ndarray:
    """The normals (n, m) of members (n,) of a seed, for a kernel of this width and type."""
    values = np.empty((len(members), layout.count), dtype_of(layout, real))
    for entry in layout:
        columns = values[:, entry.columns]
        if entry.source.at_start:
            columns[:] = normals_at_start(seed, entry.of, members)
            continue
        at_once = max(1, AT_ONCE // entry.numbers // width) * width
        for first in range(0, len(members), at_once):
            some = slice(first, first + at_once)
            columns[some] = _of_stream(entry, seed, members[some], width, real)
    return values


def _of_stream(entry: NoiseDraws, seed: int, members: np.ndarray, width: int, real: Any) -> np.ndarray:
    """Normals (n, numbers) of one stream."""
    packets, words = -(-len(members) // width), words_of(seed, entry.of)
    keys = wp.zeros(packets, dtype=int_lane(width), device="cpu")
    put(keys.numpy().reshape(packets, width), members.astype(np.int32))
    counter = wp.vec4i(entry.count, words["channel"] + entry.source.number, words["seed0"], words["seed1"])
    out = wp.empty((packets, entry.numbers), dtype=lane(width, real), device="cpu")
    inputs = [keys, counter, wp.vec2i(entry.source.place, entry.size), out]
    kernel = _kernel(width, real)
    with build_lock:
        wp.launch(kernel, dim=packets, inputs=inputs, device="cpu")
    lanes = out.numpy().reshape(packets, entry.numbers, width)
    return np.asarray(lanes.transpose(0, 2, 1).reshape(packets * width, entry.numbers)[: len(members)])


@functools.cache
def _kernel(width: int, real: Any) -> Any:
    """The kernel that draws, loaded, and compiled first if Warp's cache does not have it."""
    with build_lock:
        kernel = make_counted_draws(width, real)
        kernel_cache.load(kernel.module)
    return kernel
