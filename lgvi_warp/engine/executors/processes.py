# SPDX-License-Identifier: Apache-2.0
"""Blocks in processes of one machine, each started new (spawn).

When a process dies, Python ends all of them, and their current blocks run again.
"""

from __future__ import annotations

import functools
import multiprocessing
import os
import signal
import threading
from collections import Counter
from collections.abc import Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.executors.base import MOST_DEATHS, Advanced, deaf, finished_blocks, received, sent
from lgvi_warp.engine.work import Work

# How often progress is looked at [s].
PERIOD = 0.2
HALT = -1


@dataclass(frozen=True)
class Processes:
    """Runs blocks in processes of one thread each; the kernel is compiled here, and loaded there from Warp's cache."""

    workers: int

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Run all blocks and yield each with its result."""
        data = sent(work, "processes")
        unfinished = dict(enumerate(blocks))
        deaths: Counter[int] = Counter()
        while unfinished:
            before = len(unfinished)
            yield from self._until_death(data, unfinished, advanced, deaths)
            if len(unfinished) == before and unfinished and min(deaths[i] for i in unfinished) >= MOST_DEATHS:
                raise RuntimeError(
                    f"worker processes died {MOST_DEATHS} times without finishing a block: too little memory, or killed "
                    "from outside. Use fewer threads, or the executor threads"
                )

    def _until_death(
        self, data: bytes, unfinished: dict[int, Block], advanced: Advanced, deaths: Counter[int]
    ) -> Generator[tuple[Block, Any], None, None]:
        """Run blocks until all are done or a process died; finished blocks are removed from `unfinished`."""
        context = multiprocessing.get_context("spawn")
        # Steps made of each block, and a flag that halts all. No lock: a killed process could hold it for ever.
        steps_made = context.RawArray("q", max(unfinished) + 2)
        with deaf():  # Python's tracker of resources is a process too
            count = min(self.workers, len(unfinished))
            pool = ProcessPoolExecutor(count, context, initializer=_begin, initargs=(data, steps_made))
        waiting: dict[Future[Any], int] = {}
        try:
            with deaf():
                for i, block in unfinished.items():
                    waiting[pool.submit(_work, i, block)] = i
            while waiting:
                done, _ = wait(waiting, PERIOD, FIRST_COMPLETED)
                for i in waiting.values():
                    advanced(unfinished[i], steps_made[i])
                for future in done:
                    value = future.result()
                    block = unfinished.pop(waiting.pop(future))
                    yield block, value
        except BrokenProcessPool:
            # Blocks that finished at the same moment are kept, the others run again in a new pool.
            for future, i in waiting.items():
                if future.done() and future.exception() is None:
                    yield unfinished.pop(i), future.result()
                else:
                    deaths[i] += 1
        except KeyboardInterrupt:
            steps_made[HALT] = 1
            pool.shutdown(wait=True, cancel_futures=True)
            yield from finished_blocks({future: unfinished[i] for future, i in waiting.items()})
            raise
        finally:
            steps_made[HALT] = 1
            pool.shutdown(wait=True, cancel_futures=True)


_state: dict[str, Any] = {}


def _begin(data: bytes, steps_made: Any) -> None:
    """In a new process: unpickle the work, leave interrupts to the parent, and end when the parent ends."""
    for name in ("SIGINT", "SIGHUP"):  # by SIGTERM a broken pool ends what is left of it
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _state["made"] = steps_made
    try:
        _state["work"] = received(data, "processes")
    except Exception as error:  # told with the first block, instead of a pool that only says that it broke
        _state["error"] = error


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(i: int, block: Block) -> Any:
    if "error" in _state:
        raise _state["error"]
    steps_made = _state["made"]
    return _state["work"](block, lambda: bool(steps_made[HALT]), functools.partial(steps_made.__setitem__, i))
