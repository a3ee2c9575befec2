# SPDX-License-Identifier: Apache-2.0
"""The launches of a run: the steps of each launch, and its samples and ticks."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels.advance.beginning import GOES_ON, STARTS
from lgvi_kernels.advance.spec import CHUNK
from lgvi_warp.methods.saveat import TimeGrid

# Limits of one launch: they keep progress current, interrupts prompt and the sample buffer small in long runs.
SEGMENT_VEHICLE_STEPS = 20_000_000
SEGMENT_SAMPLE_BYTES = 16_000_000
# What is gathered at ticks before it is reduced: it should stay in the caches.
GATHERED_BYTES = 8_000_000


@dataclass(frozen=True, eq=False)
class Launches:
    """Division of a run's steps into launches."""

    grid: TimeGrid
    lengths: tuple[tuple[float, ...], tuple[float, ...]]  # of stages and leads, in units of the step h [1]
    real: Any  # Warp's type of the kernel's numbers
    sample_bytes: int  # what the kernel writes of a sample of one member [bytes]
    bytes_at_tick: int  # the same at a tick
    width: int  # vehicles of a packet
    every: int | None  # steps between two ticks; None without a controller
    has_callback: bool  # a function of the host answers each tick
    ticks: bool  # samples are gathered at all ticks
    begins: int = STARTS  # how the first launch begins (see lgvi_kernels.advance.beginning)
    looks: int | None = None  # steps between two looks at the depth; None for a look at the end alone
    recalls: bool = False  # members go on from a tick, which is gathered again from what is remembered of it

    @property
    def goes_on(self) -> bool:
        """Whether members continue from the end of another run; its last tick was the tick at this time."""
        return self.begins != STARTS

    @property
    def goes_on_exactly(self) -> bool:
        """Whether members continue with the kernel's own states, and so with the bits of one run."""
        return self.begins == GOES_ON

    def beginning(self, k0: int) -> int:
        """Kind of start of the launch of the steps from k0 on."""
        return self.begins if k0 == self.grid.first else 0

    def looks_at(self, k: int) -> bool:
        """Whether the depth of the members is checked after k steps, independent of the launches."""
        return k == self.grid.last or (self.looks is not None and k % self.looks == 0)

    def is_tick(self, k: int) -> bool:
        """Whether the controller has a tick after k steps."""
        return self.every is not None and k % self.every == 0

    @functools.cached_property
    def gathered(self) -> TimeGrid | None:
        """The controller's ticks, if samples are taken at all of them; None without a controller or without `ticks`."""
        if not self.ticks or self.every is None:
            return None
        return self.grid.ticks(self.every, self.goes_on and not self.recalls)

    @functools.cached_property
    def times(self) -> tuple[Any, Any, Any]:
        """Kernel arguments that all blocks share: (stage_h, lead_h, sample_step).

        They are the lengths of stages and leads [s], and the numbers of steps after which samples are due.
        """
        stages, leads = (np.array(fractions) * self.grid.h for fractions in self.lengths)
        due = np.append(self.grid.sample_steps, 2**31 - 1).astype(np.int32)
        return (
            wp.array(stages, dtype=self.real, device="cpu"),
            wp.array(leads, dtype=self.real, device="cpu"),
            wp.array(due, dtype=wp.int32, device="cpu"),
        )

    def samples_due(self, k0: int, k1: int) -> tuple[int, int]:
        """Range of samples due in the launch of steps k0 to k1: s0 to s1 - 1, after step k0 and no later than step k1."""
        steps = self.grid.sample_steps
        return int(steps.searchsorted(k0, side="right")), int(steps.searchsorted(k1, side="right"))

    def tick_bytes(self, count: int) -> int:
        """Memory of the data gathered at one tick, for a block of this many members in whole packets [bytes]."""
        return self.bytes_at_tick * -(-count // self.width) * self.width

    @functools.cached_property
    def first_tick(self) -> int:
        """Number of the first tick that the kernel gathers. A Python function may answer a tick only in its own run."""
        if self.every is None:
            return 0
        if self.has_callback or self.recalls or not self.goes_on:
            return -(-self.grid.first // self.every)
        return self.grid.first // self.every + 1

    def slot_of(self, tick: int, slots: int) -> int:
        """Slot in which the kernel stores a tick of `gathered`, counted from its first tick."""
        assert self.gathered is not None
        assert self.every is not None
        return int(self.gathered.sample_steps[tick] // self.every - self.first_tick) % slots

    def ticks_held(self, count: int) -> int:
        """Number of ticks that a block of this many members gathers at once; 0 if it gathers none."""
        if self.gathered is None:
            return 0
        return max(2, min(GATHERED_BYTES // max(1, self.tick_bytes(count)), len(self.gathered.times)))

    def ticks_of(self, k0: int, k1: int) -> slice:
        """Ticks whose data are complete after the launch of steps k0 to k1.

        These are the ticks after step k0, or at the start, and no later than k1. If a Python function answers, a tick
        ends in the next launch: these are the ticks from step k0 on and before step k1, or at the end.
        """
        assert self.gathered is not None
        starts = k0 == self.grid.first and (self.recalls or not self.goes_on)
        bounds = np.array([k0 if starts else k0 + 1, k1 + 1])
        if self.has_callback:
            bounds = np.array([k0, k1 if k1 < self.grid.last else k1 + 1])
        first, stop = np.searchsorted(self.gathered.sample_steps, bounds)
        return slice(int(first), int(stop))

    def segments(self, count: int) -> Iterator[tuple[int, int]]:
        """The launches (k0, k1) of a block of this many members, each short enough for interrupts, with few samples."""
        if self.has_callback:
            yield from self._periods()
            return
        due, slots = self.grid.sample_steps, self.ticks_held(count)
        every = (self.every or 0) if self.gathered and len(self.gathered.times) > 1 else 0
        most_samples = max(1, SEGMENT_SAMPLE_BYTES // max(self.sample_bytes * count, 1))
        most_steps = max(CHUNK, SEGMENT_VEHICLE_STEPS // count // CHUNK * CHUNK)
        k = self.grid.first
        while k < self.grid.last:
            last = self.samples_due(k, k)[1] + most_samples
            k1 = min(k + most_steps, int(due[min(last, len(due)) - 1]))
            if self.looks:
                k1 = min(k1, (k // self.looks + 1) * self.looks)
            if every:
                # Up to the last tick for which there is a slot before those of earlier ones are taken again.
                next_slot = k // every + 1 - self.first_tick
                k1 = min(k1, (next_slot // slots * slots + slots - 1 + self.first_tick) * every)
            yield k, k1
            k = k1

    def _periods(self) -> Iterator[tuple[int, int]]:
        """The launches if a Python function answers each tick: one per period."""
        assert self.every is not None
        k = self.grid.first
        while k < self.grid.last:
            stop = min((k // self.every + 1) * self.every, self.grid.last)
            yield k, stop
            k = stop
