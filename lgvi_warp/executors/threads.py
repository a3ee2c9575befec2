"""Blocks on the cores of one machine: a kernel launch releases the interpreter's lock, so threads are enough."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

from lgvi_warp.blocks import Block


def run(
    blocks: Sequence[Block], work: Callable[[Block], Any], threads: int, stop: threading.Event
) -> Generator[tuple[Block, Any], None, None]:
    """Do the work of every block, on this many threads; each block and its result, as they are done.

    The first exception, an interrupt from the keyboard among them, sets `stop`, which work looks at now and then; blocks
    that have not begun are dropped, and the exception is raised.
    """
    if threads == 1:
        for block in blocks:
            yield block, work(block)
        return
    with ThreadPoolExecutor(threads, thread_name_prefix="lgvi_warp") as pool:
        futures = {pool.submit(work, block): block for block in blocks}
        try:
            for future in as_completed(futures):
                yield futures.pop(future), future.result()
        except BaseException:
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
