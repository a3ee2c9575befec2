"""Blocks on the cores of one machine: a kernel launch releases the interpreter's lock, so threads are enough."""

from __future__ import annotations

import functools
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

from lgvi_warp.blocks import Block, Work
from lgvi_warp.executors import Advanced


@dataclass(frozen=True)
class Threads:
    """So many threads of this process."""

    threads: int

    def run(self, work: Work, blocks: Sequence[Block], advanced: Advanced) -> Generator[tuple[Block, Any], None, None]:
        """Each block and its result, as they are done.

        The first exception, an interrupt from the keyboard among them, halts what runs; blocks that have not begun are
        dropped, and the exception is raised.
        """
        stop = threading.Event()

        def one(block: Block) -> Any:
            return work(block, stop.is_set, functools.partial(advanced, block))

        if self.threads == 1:
            for block in blocks:
                yield block, one(block)
            return
        with ThreadPoolExecutor(self.threads, thread_name_prefix="lgvi_warp") as pool:
            futures = {pool.submit(one, block): block for block in blocks}
            try:
                for future in as_completed(futures):
                    yield futures.pop(future), future.result()
            except BaseException:
                stop.set()
                pool.shutdown(wait=False, cancel_futures=True)
                raise
