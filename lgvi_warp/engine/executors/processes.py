"""Blocks in processes of one machine, each started afresh (spawn). When one dies, Python ends all of them: it costs the
blocks that these were at."""

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
from lgvi_warp.engine.executors.base import MOST_DEATHS, Advanced, deaf, ended, received, sent
from lgvi_warp.engine.work import Work

# How often progress is looked at [s].
PERIOD = 0.2
HALT = -1


@dataclass(frozen=True)
class Processes:
    """So many processes, one thread each. The kernel is compiled here, and loaded from Warp's cache there."""

    workers: int

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Each block and its result, as they are done. Raises SceneError for work that cannot be sent."""
        data = sent(work, "processes")
        left = dict(enumerate(blocks))
        deaths: Counter[int] = Counter()
        while left:
            before = len(left)
            yield from self._until_death(data, left, advanced, deaths)
            if len(left) == before and left and min(deaths[i] for i in left) >= MOST_DEATHS:
                raise RuntimeError(
                    f"worker processes died {MOST_DEATHS} times without finishing a block: too little memory, or killed "
                    "from outside; use fewer threads, or the executor threads"
                )

    def _until_death(
        self, data: bytes, left: dict[int, Block], advanced: Advanced, deaths: Counter[int]
    ) -> Generator[tuple[Block, Any], None, None]:
        """Run the blocks that are left until all are done or a process died; what is done leaves `left`."""
        context = multiprocessing.get_context("spawn")
        # Steps made of each block, and a word to all. Without a lock: a process that is killed holds none.
        made = context.RawArray("q", max(left) + 2)
        with deaf():  # Python's tracker of resources is a process too
            pool = ProcessPoolExecutor(
                min(self.workers, len(left)), mp_context=context, initializer=_begin, initargs=(data, made)
            )
        waiting: dict[Future[Any], int] = {}
        try:
            with deaf():
                for i, block in left.items():
                    waiting[pool.submit(_work, i, block)] = i
            while waiting:
                done, _ = wait(waiting, PERIOD, FIRST_COMPLETED)
                for i in waiting.values():
                    advanced(left[i], made[i])
                for future in done:
                    value = future.result()
                    block = left.pop(waiting.pop(future))
                    yield block, value
        except BrokenProcessPool:
            # What was finished in the same moment is kept, the rest runs again in a new pool.
            for future, i in waiting.items():
                if future.done() and future.exception() is None:
                    yield left.pop(i), future.result()
                else:
                    deaths[i] += 1
        except KeyboardInterrupt:
            made[HALT] = 1
            pool.shutdown(wait=True, cancel_futures=True)
            yield from ended({future: left[i] for future, i in waiting.items()})
            raise
        finally:
            made[HALT] = 1
            pool.shutdown(wait=True, cancel_futures=True)


_state: dict[str, Any] = {}


def _begin(data: bytes, made: Any) -> None:
    """In a new process: take the work, leave interrupts to the parent, and end when it ends."""
    for name in ("SIGINT", "SIGHUP"):  # by SIGTERM a broken pool ends what is left of it
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _state["made"] = made
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
    made = _state["made"]
    return _state["work"](block, lambda: bool(made[HALT]), functools.partial(made.__setitem__, i))
