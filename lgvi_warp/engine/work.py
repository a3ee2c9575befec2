# SPDX-License-Identifier: Apache-2.0
"""The work on one block: advance its members through all steps and pass their samples to the keepers."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.machine import DTYPES
from lgvi_warp.control.signals import NAVIGATION_ERROR, SIGNALS
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.keepers.protocol import BlockStore, Keeper
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import TABLE, Field
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.statistics.values.samples import Fields

if TYPE_CHECKING:
    from lgvi_warp.engine.packets import Packets
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.methods.saveat import TimeGrid
    from lgvi_warp.sampling.members import Members

# Numbers of one kind at the ticks that are reduced together.
NUMBERS_AT_ONCE = 32_768

# Tells status and last own step of each member (see `Fields`).
Ends = Callable[[], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Work:
    """Work of an executor on each block: advance it, and write it to the store if there is one.

    It can be pickled. A call with a block returns the closing value of each keeper, or None if the block was halted. A
    block in the store is not run again. A copy in another process returns when its block is durable; the run waits for
    its own. A fault of a block's members is returned as an exception, which the run raises at that block's turn. With
    `until` the run may end earlier, and the result must not depend on how far threads are ahead.
    """

    plan: Plan
    keepers: tuple[Keeper, ...]
    store: BlockStore | None = None
    warned: bool = True

    def __call__(
        self,
        block: Block,
        halted: Callable[[], bool] = lambda: False,
        advanced: Callable[[int], None] = lambda vehicle_steps: None,
    ) -> tuple[Any, ...] | Exception | None:
        """Advance one block, or read it from the store: returns the value described in `Work`, or an error of its members.

        halted: called before each launch: whether to stop. advanced: called with the vehicle-steps of this block so far.
        """
        from lgvi_warp.engine.plan import NotSurveyed

        try:
            return self._closed(block, halted, advanced)
        except (SceneError, NotSurveyed) as error:
            return error

    def _closed(
        self, block: Block, halted: Callable[[], bool], advanced: Callable[[int], None]
    ) -> tuple[Any, ...] | None:
        """Closing value of each keeper."""
        steps_made = 0

        def add(vehicle_steps: int) -> None:
            nonlocal steps_made
            steps_made += vehicle_steps
            advanced(steps_made)

        if self.store is None:
            return run_block(self.plan, block, self.keepers, halted, add, self.warned)
        stored = self.store.parts(block, self.keepers)
        if stored is not None:
            return stored
        results = run_block(self.plan, block, (*self.keepers, self.store), halted, add)
        if results is None:
            return None
        self.store.finish(block, results[-1], self.keepers, results[:-1])
        return results[:-1]


def run_block(
    plan: Plan,
    block: Block,
    keepers: Sequence[Keeper],
    halted: Callable[[], bool] = lambda: False,
    advanced: Callable[[int], None] = lambda vehicle_steps: None,
    warned: bool = True,
) -> tuple[Any, ...] | None:
    """Advance a block through all steps; returns each keeper's closing value, or None if the block was halted.

    halted: called before each launch: whether to stop. advanced: called with the vehicle-steps since the last call.
    """
    from lgvi_warp.engine.host_callback import call_host
    from lgvi_warp.engine.packets import Packets

    # Members that are not finite, or exceed float32, get their status from the kernel: no warning from NumPy.
    with np.errstate(invalid="ignore", over="ignore"):
        members = plan.ensemble.select(block.first, block.stop)
        plan.check_block(block, members)
        packets = Packets.of(plan, members)
        block_keepers = [keeper.open(plan, block, members) for keeper in keepers]

        # So many numbers of each kind that what is made of them stays in the caches.
        at_once = max(1, NUMBERS_AT_ONCE // block.count)
        tick_takers = [tick_taker for keeper in block_keepers if (tick_taker := getattr(keeper, "take_ticks", None))]

        slope_takers = [
            slope_taker for keeper in block_keepers if (slope_taker := getattr(keeper, "take_slopes", None))
        ]

        def keep(when: slice, values: Mapping[str, np.ndarray], ends: Ends) -> None:
            samples = samples_of(plan, plan.grid, when, values, ends)
            for block_keeper in block_keepers:
                block_keeper.take(when, samples)

        def keep_ticks(grid: TimeGrid, ticks: slice) -> None:
            ends = functools.cache(packets.ended)
            for first in range(ticks.start, ticks.stop, at_once):
                when = slice(first, min(first + at_once, ticks.stop))
                values = divided(
                    plan.layout.tick_fields, packets.gathered(when), plan.layout.table, plan.layout.tick_entries
                )
                less_truth(values, values.get("position"))
                if warned and "position" in values:
                    packets.heights.look(values["position"][..., 2], grid.sample_steps[when])
                samples = samples_of(plan, grid, when, values, ends)
                for tick_taker in tick_takers:
                    tick_taker(when, samples)

        def keep_start() -> None:
            running = np.zeros(block.count, np.uint8), np.zeros(block.count, np.int64)
            # Members that ended before a run that goes on are not running at its start.
            ends = packets.ended if plan.launches.goes_on else lambda: running
            keep(slice(0, 1), at_start(plan, members, packets), ends)
            for slope_taker in slope_takers:
                slope_taker(slice(0, 1), slopes_at_start(packets, plan.layout.fields))

        if not plan.layout.signals:
            keep_start()
        first, callback = plan.grid.first, plan.launches.has_callback
        if callback and not plan.launches.goes_on:
            packets.advance(first, first)
        for k0, k1 in plan.launches.segments(block.count):
            if halted():
                return None
            if callback and plan.launches.is_tick(k0):
                call_host(packets, k0 * plan.grid.h)
            raw = packets.advance(k0, k1)[:, : block.count]
            if k0 == first and plan.layout.signals:
                # The first tick of a controller is a part of the first launch.
                keep_start()
            if plan.launches.gathered and (ticks := plan.launches.ticks_of(k0, k1)).start < ticks.stop:
                keep_ticks(plan.launches.gathered, ticks)
            when, values = slice(*plan.launches.samples_due(k0, k1)), dict[str, np.ndarray]()
            if when.start < when.stop and block_keepers:
                values = unpacked(plan.layout.sizes, raw, packets.frame, plan.layout.table)
                keep(when, {name: values[name] for name in plan.fields}, packets.ended)
                for slope_taker in slope_takers:
                    slope_taker(when, slopes_in_advance(packets, k0, k1))
            if warned:
                packets.look_at_depth(k1, when, values.get("position"))
            advanced(block.count * (k1 - k0))
        outcome = packets.outcome(warned)
        for block_keeper in block_keepers:
            if take_packets := getattr(block_keeper, "take_packets", None):
                take_packets(packets)
        results = tuple(block_keeper.close(outcome) for block_keeper in block_keepers)
        packets.leave()
        return results


def at_start(plan: Plan, members: Members, packets: Packets) -> dict[str, np.ndarray]:
    """Samples (1, m, ...) at t = 0 by field, in the dtype of the later samples."""
    real = np.dtype(DTYPES[plan.dtype])
    types = {"position": np.dtype(np.float64)} if plan.spec.compensated else {}
    motion = (name for name in plan.fields if name not in SIGNALS)
    states = {name: getattr(members, name)[None].astype(types.get(name, real), copy=False) for name in motion}
    if not plan.layout.signals:
        return states
    sizes = {name: plan.layout.sizes[name] for name in plan.layout.signals}
    signals = divided(sizes, packets.first_signals()[:, : members.count], plan.layout.table)
    return states | less_truth(signals, members.position)


def in_order(runs: Sequence[Block], done: Iterable[tuple[Block, Any]]) -> Iterator[tuple[Block, Any]]:
    """Sort blocks that finish in any order into their own order."""
    waiting: dict[int, Any] = {}
    position = 0
    for block, value in done:
        waiting[block.first] = value
        while position < len(runs) and runs[position].first in waiting:
            yield runs[position], waiting.pop(runs[position].first)
            position += 1


def unpacked(
    fields: Mapping[str, int], raw: np.ndarray, frame: Frame, table: Mapping[str, Field] = TABLE
) -> dict[str, np.ndarray]:
    """Convert the kernel's raw samples to fields (samples, members, ...), from its origin and axes to the user's.

    raw: (samples, members, numbers), as `Packets.advance` returns them.
    """
    samples = divided(fields, raw, table)
    if frame.turned:
        # Products of contiguous matrices take half the time, and have the same bits.
        back = np.ascontiguousarray(np.swapaxes(frame.Q, -1, -2))
        turns = {"attitude": lambda R: np.ascontiguousarray(R) @ back}
        for name in samples.keys() - {"position", *SIGNALS.loaded}:
            turn = turns.get(name, lambda v: notation.rotate_out(frame.Q, v))
            samples[name] = turn(samples[name])
    if frame.shifted:
        o = np.broadcast_to(frame.origin, (raw.shape[1], 3))
        if "position" in samples:
            samples["position"] = samples["position"] - np.einsum("knij,nj->kni", samples["attitude"], o)
        if "velocity" in samples:
            samples["velocity"] = samples["velocity"] - notation.cross(samples["angular_velocity"], o)
    return less_truth(samples, samples.get("position"))


def less_truth(samples: dict[str, np.ndarray], position: Any) -> dict[str, np.ndarray]:
    """Convert the navigation error in samples or slopes from the measured position to its difference from the truth."""
    if NAVIGATION_ERROR in samples:
        measured = samples[NAVIGATION_ERROR]
        samples[NAVIGATION_ERROR] = (measured - position).astype(measured.dtype)
    return samples


def divided(
    fields: Mapping[str, int],
    raw: np.ndarray,
    table: Mapping[str, Field],
    entries: Mapping[str, Sequence[int]] = MappingProxyType({}),
) -> dict[str, np.ndarray]:
    """Raw samples (samples, members, numbers) by field, in their own axes; views where no pairs are summed."""
    samples: dict[str, np.ndarray] = {}
    column = 0
    for name, size in fields.items():
        shape = table[name].shape
        values = raw[..., column : column + size]
        if size == 2 * math.prod(shape):
            values = np.add(*np.split(values, 2, axis=-1), dtype=np.float64)
        elif name in entries:
            # Members side by side in memory, as the kernel gathers them.
            all_numbers = np.full((len(raw), math.prod(shape), raw.shape[1]), np.nan, raw.dtype).transpose(0, 2, 1)
            all_numbers[..., list(entries[name])] = values
            values = all_numbers
        samples[name] = values.reshape(*raw.shape[:2], *shape)
        column += size
    return samples


def slopes_of_samples(
    fields: Mapping[str, int],
    raw: np.ndarray,
    raw_slope: np.ndarray,
    frame: Frame,
    turn: Any,
    table: Mapping[str, Field],
) -> dict[str, np.ndarray]:
    """Slopes of `unpacked` by one number, in the user's axes and from the user's origin.

    raw, raw_slope: (samples, members, numbers) in the kernel's axes. turn: slopes of the frame's Q and origin.
    """
    slopes = divided(fields, raw_slope, table)
    values = divided(fields, raw, table)
    Q, (dQ, d_origin) = frame.Q, turn
    if frame.turned or dQ.any():
        for name in slopes.keys() - {"position", *SIGNALS.loaded}:
            if name == "attitude":
                Qt, dQt = (np.swapaxes(q, -1, -2) for q in (Q, dQ))
                slopes[name] = slopes[name] @ Qt + values[name] @ dQt
            else:
                slopes[name] = notation.rotate_out(Q, slopes[name]) + notation.rotate_out(dQ, values[name])
    if frame.shifted or d_origin.any():
        user = unpacked(fields, raw, frame, table)
        o, do = (np.broadcast_to(v, (raw.shape[1], 3)) for v in (frame.origin, d_origin))
        if "position" in slopes:
            moved = np.einsum("knij,nj->kni", slopes["attitude"], o) + np.einsum("knij,nj->kni", user["attitude"], do)
            slopes["position"] = slopes["position"] - moved
        if "velocity" in slopes:
            turned = notation.cross(slopes["angular_velocity"], o) + notation.cross(user["angular_velocity"], do)
            slopes["velocity"] = slopes["velocity"] - turned
    return less_truth(slopes, slopes.get("position"))


def slopes_at_start(packets: Packets, fields: Sequence[str]) -> list[dict[str, np.ndarray]]:
    """Slopes, by each number, of the samples (1, m, ...) at the start."""
    layout = packets.plan.layout
    each = packets.slopes_of_start([name for name in fields if name not in SIGNALS])
    if not layout.signals:
        return each
    sizes, raw = {name: layout.sizes[name] for name in layout.signals}, packets.slopes_of_first_signals()
    truth = packets.slopes_of_start(["position"])
    signals = (divided(sizes, rows, layout.table) for rows in raw)
    return [m | less_truth(s, t["position"]) for m, s, t in zip(each, signals, truth, strict=True)]


def slopes_in_advance(packets: Packets, k0: int, k1: int) -> list[dict[str, np.ndarray]]:
    """Slopes, by each number, of the samples that the last launch wrote in these steps, in the user's axes."""
    layout = packets.plan.layout
    raw, each, turns = packets.raw_slopes(k0, k1)
    pairs = zip(each, turns, strict=True)
    return [slopes_of_samples(layout.sizes, raw, rows, packets.frame, turn, layout.table) for rows, turn in pairs]


def samples_of(plan: Plan, grid: TimeGrid, when: slice, fields: Mapping[str, np.ndarray], ends: Ends) -> Fields:
    """Fields (times, members, ...) of a block with their times, steps and terms."""
    scene = plan.ensemble.scene
    times = grid.times[when], grid.sample_steps[when]
    return Fields(fields, *times, scene.terms, ends, scene.controller, scene.events)
