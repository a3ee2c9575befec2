"""The unit of work: a run of members through all steps, and what is kept of it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from lgvi_warp import notation
from lgvi_warp.inertia import Frame
from lgvi_warp.machine import DTYPES
from lgvi_warp.status import failed

if TYPE_CHECKING:
    from lgvi_warp.ensemble import Members
    from lgvi_warp.packets import Outcome
    from lgvi_warp.plan import Plan
    from lgvi_warp.store import Sink

SHAPES: dict[str, tuple[int, ...]] = {
    "position": (3,),
    "attitude": (3, 3),
    "velocity": (3,),
    "angular_velocity": (3,),
}


@dataclass(frozen=True)
class Block:
    """A run of members, first to stop: the unit of work."""

    first: int
    stop: int

    @property
    def count(self) -> int:
        """Members in it."""
        return self.stop - self.first


def blocks(members: int) -> list[Block]:
    """Runs of 256 to 4096 members, a power of two. Depends on the number of members only, so bits and files do too."""
    size = 256
    while size < 4096 and size * 64 <= members:
        size *= 2
    return [Block(i, min(i + size, members)) for i in range(0, members, size)]


class Fields(dict[str, np.ndarray]):
    """Samples of a block by field, (k times, n members, ...), and what else is known of its members at these times.

    time (k,) [s]; terms: those of the scene.
    """

    def __init__(self, fields: Mapping[str, np.ndarray], plan: Plan, when: slice, outcome: Callable[[], Outcome]):
        super().__init__(fields)
        self.time, self.terms = plan.grid.times[when], plan.ensemble.scene.terms
        self._steps, self._outcome, self._plan, self._when = plan.grid.sample_steps[when], outcome, plan, when

    def last(self) -> Fields:
        """The last of these samples alone."""
        stop = self._when.stop
        return Fields({n: a[-1:] for n, a in self.items()}, self._plan, slice(stop - 1, stop), self._outcome)

    @functools.cached_property
    def _ends(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Status of each member and the step after which it is no more its own; None if all still are."""
        outcome = self._outcome()
        return (outcome.status, outcome.failed_step) if np.any(outcome.status) else None

    def good(self, held: bool = True) -> np.ndarray | None:
        """(k, n), which members had not failed by each time; None: none had. held: one that an event stopped has not."""
        if self._ends is None:
            return None
        status, step = self._ends
        ended = failed(status) if held else status != 0
        if not ended.any():
            return None
        return np.asarray(~ended | (self._steps[:, None] <= step))


class BlockKeeper(Protocol):
    """What is kept of one block, where that block runs."""

    def take(self, when: slice, samples: Fields) -> None:
        """Samples `when` (of all times) by field, (times, members of the block, ...): each time once, in order."""

    def close(self, outcome: Outcome) -> Any:
        """What the run is to have of this block: small, and picklable."""


class Keeper(Protocol):
    """What a run keeps of its members: all samples, statistics, files."""

    def open(self, plan: Plan, block: Block, members: Members) -> BlockKeeper:
        """Before a block's first step, in the thread or process that runs it."""

    def merge(self, block: Block, part: Any) -> None:
        """What a block's keeper closed with; in the order of the blocks, in the thread that asked for the run."""


@runtime_checkable
class PartKeeper(Keeper, Protocol):
    """A keeper whose parts a store can hold, so that a run that goes on later has those of its finished blocks."""

    @property
    def name(self) -> str:
        """What its parts are called by: unlike those of any other keeper of the run."""

    def to_arrays(self, part: Any) -> tuple[dict[str, np.ndarray], Any]:
        """A part as arrays by name, and what JSON holds."""

    def from_arrays(self, arrays: dict[str, np.ndarray], content: Any) -> Any:
        """The part again, with the same bits."""


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
    sink: Sink | None = None

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
    from lgvi_warp.packets import Packets

    # A member that is not finite, or not within float32, gets its status from the kernel; NumPy need not remark.
    with np.errstate(invalid="ignore", over="ignore"):
        members = plan.ensemble.select(block.first, block.stop)
        packets = Packets(plan, members)
        kept = [keeper.open(plan, block, members) for keeper in keepers]
        for one in kept:
            one.take(slice(0, 1), Fields(at_start(plan, members), plan, slice(0, 1), packets.outcome))
        for k0, k1 in plan.segments(block.count):
            if halted():
                return None
            raw = packets.advance(k0, k1)[:, : block.count]
            when = slice(*plan.due(k0, k1))
            if when.start < when.stop and kept:
                found = unpacked(plan.spec.sample_fields, raw, packets.frame)
                samples = Fields({name: found[name] for name in plan.fields}, plan, when, packets.outcome)
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
