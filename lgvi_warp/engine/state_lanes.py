# SPDX-License-Identifier: Apache-2.0
"""The states of a block's members in lanes: written by a kernel if that is faster, else in NumPy with the same bits."""

from __future__ import annotations

import contextlib
import functools
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.advance.rows import STATE_FIELDS
from lgvi_kernels.advance.spec import Spec
from lgvi_kernels.lanes.arithmetic import lane
from lgvi_kernels.packing.states import PEAKS, PLACES, make_pack_states
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.engine import kernel_cache
from lgvi_warp.engine.arrays import PLAIN, Lanes, Writing
from lgvi_warp.engine.states import Starts, momenta, write_rows

# Members of a run for which it pays to load the kernel, which takes some tens of milliseconds once it is compiled.
MANY = 50_000
# Fewer members that are packed once take less time than a launch takes to be recorded.
FEW = 256


class StateLanes(Lanes):
    """The states of a block's members, (packets, fields of a state) of lanes.

    kernel: as in `kernel_for`. peaks: numbers of the starts for warnings, per packet and lane (see PEAKS); None if
        NumPy wrote the states.
    """

    def __init__(self, spec: Spec, packets: int, kernel: Any = None, writing: Writing = PLAIN):
        super().__init__(packets, spec.state_fields, lane(spec.lanes, spec.real))
        self._spec, self._put_rows = spec, writing.put_rows
        self._kernel, self._packets = kernel, packets
        self._launch: Any = None
        self._starts: Any = None
        self.peaks: np.ndarray | None = None

    def _record(self, kernel: Any, packets: int) -> None:
        """Record a launch of the kernel; at each launch it reads the addresses of all numbers again."""
        places = wp.zeros((len(PLACES), 3), dtype=wp.int64, device="cpu")
        peaks = wp.zeros((packets, PEAKS), dtype=lane(self._spec.width, wp.float64), device="cpu")
        inputs = [places, self.array, peaks]
        with build_lock:
            self._launch = wp.launch(kernel, dim=packets, inputs=inputs, device="cpu", record_cmd=True)
        # The arrays that were packed last, and what was copied of them to lie as the kernel reads it.
        self._arrays: list[Any] = [None] * (len(PLACES) - 1)
        self._copies: list[Any] = [None] * (len(PLACES) - 1)
        self._places, self.peaks = places.numpy(), peaks.numpy().reshape(packets, PEAKS, self._spec.width)

    def write(self, starts: Starts, members: int) -> None:
        """Write the states of some members; lanes beyond the last member get its state."""
        first, self._starts, self._members = self._starts is None, starts, members
        if self._kernel is None or (first and members < FEW):
            self._put_rows(self.view, self.rows())
            return
        if self._launch is None:
            self._record(self._kernel, self._packets)
        for i, values in enumerate(starts[:-1]):
            # What all calls share lies where it lay.
            if values is not self._arrays[i] or self._copies[i] is not values:
                self._arrays[i] = values
                self._places[i], self._copies[i] = _place(values)
        self._places[-1] = members, starts.inertial, STATE_FIELDS if self._spec.compensated else 0
        self._launch.launch()

    def rows(self) -> np.ndarray:
        """The last written states, (members, fields of a state), before any step."""
        rows = np.empty((self._members, self._spec.state_fields))
        write_rows(self._starts, rows, self._spec.compensated)
        return rows

    def momenta(self) -> np.ndarray:
        """The momenta p of the last written states, (1 or members, 3)."""
        return momenta(self._starts)[1]


_loaded: set[tuple[int, Any]] = set()


def kernel_for(spec: Spec, members: int) -> Any:
    """The kernel that packs the states of a run of this many members; None if NumPy should do it."""
    if spec.tangents or ((spec.width, spec.real) not in _loaded and members < MANY):
        return None
    with contextlib.suppress(OSError):  # a cache that cannot be written, and has no such kernel
        return kernel_of(spec.width, spec.real)
    return None


@functools.cache
def kernel_of(width: int, real: Any) -> Any:
    """The kernel that packs states, loaded, and compiled first if Warp's cache does not have it."""
    with build_lock:
        kernel = make_pack_states(width, real)
        kernel_cache.load(kernel.module)
        _loaded.add((width, real))
    return kernel


def _place(values: np.ndarray | None) -> tuple[tuple[int, int, int], Any]:
    """Memory layout of numbers: address, and the strides in bytes between members and between numbers; and the array."""
    if values is None:
        return (0, 0, 0), None
    if values.dtype != np.float64:
        values = values.astype(np.float64)
    if values.ndim == 3 and values.strides[1] != values.shape[2] * values.strides[2]:
        values = np.ascontiguousarray(values)
    step = values.strides[0] if len(values) > 1 else 0
    return (values.__array_interface__["data"][0], step, values.strides[-1] if values.ndim > 1 else 0), values
