"""Blocks through an executor, their parts to the keepers in the order of the blocks; with a store, from where it stopped."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.work import Work, in_order


class Progress:
    """Fraction of the vehicle-steps made so far, told by blocks from several threads."""

    def __init__(self, total: int, report: Callable[[float], None] | None):
        self._total, self._report, self._lock = total, report, threading.Lock()
        self._made: dict[int, int] = {}
        self._sum = 0

    def at(self, block: Block, vehicle_steps: int) -> None:
        """A block has made so many; a block that runs again begins anew."""
        if self._report is None:
            return
        with self._lock:
            self._sum += vehicle_steps - self._made.get(block.first, 0)
            self._made[block.first] = vehicle_steps
            self._report(self._sum / self._total)


@dataclass
class Merged:
    """Where the members end that keepers have begun to take, and have taken."""

    begun: int = 0
    done: int = 0


def run_blocks(
    work: Work,
    runs: Sequence[Block],
    executor: Executor,
    advanced: Callable[[Block, int], None],
    left: Sequence[Block] | None = None,
    enough: Callable[[int], bool] = lambda members: False,
    merged: Merged | None = None,
) -> int:
    """Run blocks and hand their parts to the keepers in order. Returns where the members end that were merged.

    merged: is told so after each block, for when an exception is what ends the run.

    left: those of the blocks that the store of the work has not, by default all. enough: asked after each block, with the
    members so far: the first yes ends the run, and blocks that are ahead of it are lost or of no account.
    """
    fresh = set(left or ())
    merged = merged or Merged()
    with contextlib.closing(_in_turn(work, runs, runs if left is None else left, executor, advanced)) as done:
        for block, parts in done:
            merged.begun = block.stop
            # Parts that come from the store may be somebody else's.
            old = work.sink if left is not None and block not in fresh else None
            with old.understood(block) if old else nullcontext():
                for keeper, part in zip(work.keepers, parts, strict=True):
                    keeper.merge(block, part)
            merged.done = block.stop
            if enough(block.stop):
                return block.stop
    return runs[-1].stop


def _in_turn(
    work: Work, runs: Sequence[Block], left: Sequence[Block], executor: Executor, advanced: Callable[[Block, int], None]
) -> Generator[tuple[Block, Any], None, None]:
    """Blocks and their parts, in order: from the store, or as they are run; nothing runs before the first is wanted."""
    wanted = {block.first for block in left}
    with contextlib.ExitStack() as stack:
        fresh: Iterator[tuple[Block, Any]] | None = None
        for block in runs:
            if block.first not in wanted:
                assert work.sink is not None
                yield block, work.sink.parts(block, work.keepers) or ()
                continue
            if fresh is None:
                work.plan.compile()
                fresh = in_order(left, stack.enter_context(contextlib.closing(executor.run(work, left, advanced))))
            yield next(fresh)
