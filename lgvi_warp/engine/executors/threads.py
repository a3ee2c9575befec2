# SPDX-License-Identifier: Apache-2.0
"""Blocks in threads of one process: a kernel launch releases the interpreter's lock, so threads are enough."""

from __future__ import annotations

import functools
import queue
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from lgvi_warp.common import machine
from lgvi_warp.engine.block import Block, default_threads
from lgvi_warp.engine.executors.base import Advanced, finished_blocks
from lgvi_warp.engine.work import Work

# Longest delay of a signal that arrives just before the main thread begins to wait [s].
PERIOD = 0.2


class ThisThread:
    """Runs blocks in the calling thread, which uses its CPU time and receives interrupts between two launches."""

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Run all blocks and yield each with its result."""
        for block in blocks:
            yield block, work(block, lambda: False, functools.partial(advanced, block))


def threads_for(plan: Any) -> int:
    """Default number of threads for the run of a plan."""
    return default_threads(plan.ensemble.members, plan.grid.steps, machine.thread_count())


@dataclass(frozen=True)
class Threads:
    """Runs blocks in threads of this process.

    threads: number of threads; None: chosen by the amount of work (see `default_threads`).
    """

    threads: int | None = None

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Run all blocks and yield each with its result.

        The first exception halts running blocks, drops blocks that have not begun, and is raised. After an interrupt
        from the keyboard, blocks that still finish are yielded first, since a launch cannot be aborted.
        """
        # The main thread waits, so that blocks at work come to their end when it hears an interrupt. One block alone would
        # be lost in any thread.
        threads = self.threads or threads_for(work.plan)
        if len(blocks) == 1 or (threads == 1 and threading.current_thread() is not threading.main_thread()):
            yield from ThisThread().run(work, blocks, advanced)
            return
        stop = threading.Event()

        def run_one(block: Block) -> Any:
            return work(block, stop.is_set, functools.partial(advanced, block))

        with ThreadPoolExecutor(threads, thread_name_prefix="lgvi_warp") as pool:
            futures: dict[Future[Any], Block] = {}
            done: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
            try:
                for block in blocks:
                    future = pool.submit(run_one, block)
                    futures[future] = block
                    future.add_done_callback(done.put)
                while futures:
                    try:
                        future = done.get(timeout=PERIOD)
                    except queue.Empty:
                        continue
                    value = future.result()
                    yield futures.pop(future), value
            except KeyboardInterrupt:
                stop.set()
                pool.shutdown(wait=True, cancel_futures=True)
                yield from finished_blocks(futures)
                raise
            except BaseException:
                stop.set()
                pool.shutdown(wait=False, cancel_futures=True)
                raise
