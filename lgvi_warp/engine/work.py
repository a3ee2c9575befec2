"""To be said in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.machine import DTYPES
from lgvi_warp.engine.block import SHAPES, Block
from lgvi_warp.engine.keepers.protocol import BlockStore, Keeper
from lgvi_warp.physics import notation
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.statistics.samples import Fields

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.sampling.members import Members


@dataclass(frozen=True)
class Work:
    """What executors do to each block: advance it, and put it into the store if there is one. Can be pickled.

    sink: the store. Called with a block, it returns what each keeper closed with, or None if it was halted; a block that
    the store has is not run again. A copy in another process returns when its block is durable; in the run's own process
    the run waits at its end for the blocks that are not durable yet.
    advanced: called with the vehicle-steps made of this block so far.
    """

    plan: Plan
    keepers: tuple[Keeper, ...]
    sink: BlockStore | None = None

    def __call__(
        self,
        block: Block,
        halted: Callable[[], bool] = lambda: False,
        advanced: Callable[[int], None] = lambda vehicle_steps: None,
    ) -> tuple[Any, ...] | None:
        """Do the work of one block."""
        made = 0

        def add(vehicle_steps: int) -> None:
            nonlocal made
            made += vehicle_steps
            advanced(made)

        if self.sink is None:
            return run_block(self.plan, block, self.keepers, halted, add)
        there = self.sink.parts(block, self.keepers)
        if there is not None:
            return there
        parts = run_block(self.plan, block, (*self.keepers, self.sink), halted, add)
        if parts is None:
            return None
        self.sink.finish(block, parts[-1], self.keepers, parts[:-1])
        return parts[:-1]


def run_block(
    plan: Plan,
    block: Block,
    keepers: Sequence[Keeper],
    halted: Callable[[], bool] = lambda: False,
    advanced: Callable[[int], None] = lambda vehicle_steps: None,
) -> tuple[Any, ...] | None:
    """Advance a block through all steps. Returns what each keeper closed with; None if it was halted before the end.

    advanced: called with the vehicle-steps made since the last call.
    """
    from lgvi_warp.engine.packets import Packets

    # A member that is not finite, or not within float32, gets its status from the kernel; NumPy need not remark.
    with np.errstate(invalid="ignore", over="ignore"):
        members = plan.ensemble.select(block.first, block.stop)
        packets = Packets(plan, members)
        kept = [keeper.open(plan, block, members) for keeper in keepers]
        for one in kept:
            one.take(slice(0, 1), samples_of(plan, slice(0, 1), at_start(plan, members), packets.ended))
        for k0, k1 in plan.segments(block.count):
            if halted():
                return None
            raw = packets.advance(k0, k1)[:, : block.count]
            when = slice(*plan.due(k0, k1))
            if when.start < when.stop and kept:
                found = unpacked(plan.spec.sample_fields, raw, packets.frame)
                samples = samples_of(plan, when, {name: found[name] for name in plan.fields}, packets.ended)
                for one in kept:
                    one.take(when, samples)
            advanced(block.count * (k1 - k0))
        outcome = packets.outcome()
        return tuple(one.close(outcome) for one in kept)


def at_start(plan: Plan, members: Members) -> dict[str, np.ndarray]:
    """The samples at t = 0, of the type of those that follow."""
    real = np.dtype(DTYPES[plan.dtype])
    types = {"position": np.dtype(np.float64)} if plan.spec.compensated else {}
    return {name: getattr(members, name)[None].astype(types.get(name, real), copy=False) for name in plan.fields}


def in_order(runs: Sequence[Block], done: Iterable[tuple[Block, Any]]) -> Iterator[tuple[Block, Any]]:
    """Blocks that finish in any order, in theirs."""
    waiting: dict[int, Any] = {}
    place = 0
    for block, value in done:
        waiting[block.first] = value
        while place < len(runs) and runs[place].first in waiting:
            yield runs[place], waiting.pop(runs[place].first)
            place += 1


def unpacked(fields: Mapping[str, int], raw: np.ndarray, frame: Frame) -> dict[str, np.ndarray]:
    """Raw samples (samples, members, numbers) as fields, from the kernel's origin and axes to the user's.

    fields: numbers of each field; twice as many as it has for a sum of two numbers, which is made in float64.
    """
    parts: dict[str, np.ndarray] = {}
    column = 0
    for name, size in fields.items():
        shape = SHAPES[name]
        values = raw[..., column : column + size]
        if size == 2 * int(np.prod(shape)):
            values = np.add(*np.split(values, 2, axis=-1), dtype=np.float64)
        parts[name] = values.reshape(*raw.shape[:2], *shape)
        column += size
    if not np.array_equal(frame.Q, np.broadcast_to(np.eye(3), frame.Q.shape)):
        turns = {"attitude": lambda R: R @ np.swapaxes(frame.Q, -1, -2)}
        for name in parts.keys() - {"position"}:
            turn = turns.get(name, lambda v: notation.rotate_out(frame.Q, v))
            parts[name] = turn(parts[name])
    if np.any(frame.origin):
        o = np.broadcast_to(frame.origin, (raw.shape[1], 3))
        if "position" in parts:
            parts["position"] = parts["position"] - np.einsum("knij,nj->kni", parts["attitude"], o)
        if "velocity" in parts:
            parts["velocity"] = parts["velocity"] - np.cross(parts["angular_velocity"], o)
    return parts


def samples_of(
    plan: Plan, when: slice, fields: Mapping[str, np.ndarray], ends: Callable[[], tuple[np.ndarray, np.ndarray]]
) -> Fields:
    """Samples `when` of a block of this plan; ends: see Fields."""
    grid = plan.grid
    return Fields(fields, grid.times[when], grid.sample_steps[when], plan.ensemble.scene.terms, ends)
