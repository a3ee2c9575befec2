"""Blocks on the cores of one machine: a kernel launch releases the interpreter's lock, so threads are enough."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait

from lgvi_warp.plan import Block


def run(blocks: Sequence[Block], work: Callable[[Block], None], threads: int, stop: threading.Event) -> None:
    """Do the work of every block, on this many threads.

    The first exception, an interrupt from the keyboard among them, sets `stop`, which work looks at now and then; blocks
    that have not begun are dropped, and the exception is raised.
    """
    if threads == 1:
        for block in blocks:
            work(block)
        return
    with ThreadPoolExecutor(threads, thread_name_prefix="lgvi_warp") as pool:
        futures = [pool.submit(work, block) for block in blocks]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
            for future in futures:
                if future.done():
                    future.result()
        except BaseException:
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
