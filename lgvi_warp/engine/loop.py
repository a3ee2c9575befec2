# SPDX-License-Identifier: Apache-2.0
"""The loop of a run: blocks run by an executor or are read from a store; keepers receive results in block order."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.work import Work, in_order


class RunProgress:
    """Fraction [1] of a run's vehicle-steps made so far, reported from any thread at each advance."""

    def __init__(self, total: int, report: Callable[[float], None] | None):
        self._total, self._report, self._lock = total, report, threading.Lock()
        self._made: dict[int, int] = {}
        self._sum = 0

    def at(self, block: Block, vehicle_steps: int) -> None:
        """Record the progress of a block; a block that runs again starts from zero."""
        if self._report is None:
            return
        with self._lock:
            self._sum += vehicle_steps - self._made.get(block.first, 0)
            self._made[block.first] = vehicle_steps
            self._report(self._sum / self._total)


@dataclass
class Merged:
    """Number of members that the keepers have received: up to the block being merged, and completely merged."""

    begun: int = 0
    done: int = 0


def run_blocks(
    work: Work,
    runs: Sequence[Block],
    executor: Executor,
    advanced: Callable[[Block, int], None],
    remaining: Sequence[Block] | None = None,
    enough: Callable[[int], bool] = lambda members: False,
    merged: Merged | None = None,
    after: Callable[[Block], None] | None = None,
) -> int:
    """Run blocks and merge their results into the keepers, in block order; returns the number of merged members.

    remaining: blocks that the store does not have yet; None (default) for all.
    enough: function of the members so far, called after each block: whether the run may end; later blocks are then dropped.
    after: function that is called with each merged block.
    """
    fresh = set(remaining or ())
    merged = merged or Merged()
    with contextlib.closing(_in_turn(work, runs, runs if remaining is None else remaining, executor, advanced)) as done:
        for block, results in done:
            if isinstance(results, Exception):
                raise results
            merged.begun = block.stop
            # Results from the store may not be this run's own: errors in them are reported as faults of the store.
            source = work.store if remaining is not None and block not in fresh else None
            with source.understood(block) if source else contextlib.nullcontext():
                for keeper, result in zip(work.keepers, results, strict=True):
                    keeper.merge(block, result)
            merged.done = block.stop
            if after:
                after(block)
            if enough(block.stop):
                return block.stop
    return runs[-1].stop


def _in_turn(
    work: Work,
    runs: Sequence[Block],
    remaining: Sequence[Block],
    executor: Executor,
    advanced: Callable[[Block, int], None],
) -> Generator[tuple[Block, Any], None, None]:
    """Blocks and their results in order, from the store or from the executor; no block runs before it is needed."""
    wanted = {block.first for block in remaining}
    with contextlib.ExitStack() as stack:
        fresh: Iterator[tuple[Block, Any]] | None = None
        for block in runs:
            if block.first not in wanted:
                assert work.store is not None
                yield block, work.store.parts(block, work.keepers) or ()
                continue
            if fresh is None:
                work.plan.compile()
                fresh = in_order(
                    remaining, stack.enter_context(contextlib.closing(executor.run(work, remaining, advanced)))
                )
            yield next(fresh)
        # An executor raises an interrupt after the blocks that ended all the same: it is to be heard after the last one too.
        for _ in fresh or ():
            pass
