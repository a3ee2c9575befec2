"""Blocks on the cores of one machine: a kernel launch releases the interpreter's lock, so threads are enough."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait

from lgvi_warp.plan import Block


def run(blocks: Sequence[Block], work: Callable[[Block], None], threads: int) -> None:
    """Do the work of every block, on this many threads. The first exception stops the blocks that have not begun."""
    if threads == 1:
        for block in blocks:
            work(block)
        return
    with ThreadPoolExecutor(threads, thread_name_prefix="lgvi_warp") as pool:
        futures = [pool.submit(work, block) for block in blocks]
        try:
            wait(futures, return_when=FIRST_EXCEPTION)
        finally:
            for future in futures:
                future.cancel()
        for future in futures:
            if not future.cancelled():
                future.result()
