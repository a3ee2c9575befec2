# SPDX-License-Identifier: Apache-2.0
"""Threads that run blocks: what is at work when a run ends early is halted, and what is whole is not lost."""

import threading
import time

import pytest

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.executors.threads import Threads

BLOCKS = [Block(0, 1), Block(1, 2)]
SECONDS = 20.0


class Work:
    """Its first block ends when the second is at work, its second when it is halted, or after a while."""

    def __init__(self):
        self.halted, self.begun, self.ended = False, threading.Event(), threading.Event()

    def __call__(self, block, halted, advanced):
        if not block.first:
            assert self.begun.wait(SECONDS)
            return 0
        self.begun.set()
        until = time.monotonic() + SECONDS
        while not halted() and time.monotonic() < until:
            time.sleep(0.001)
        self.halted = halted()
        self.ended.set()
        return 1


@pytest.mark.parametrize("kind", [KeyboardInterrupt, RuntimeError])
def test_a_run_that_ends_early_halts_what_is_at_work(kind):
    work = Work()
    running = Threads(2).run(work, BLOCKS, lambda *_: None)
    assert next(running) == (BLOCKS[0], 0)
    if kind is KeyboardInterrupt:
        # A block that ended nevertheless is not lost.
        assert running.throw(kind()) == (BLOCKS[1], 1)
    with pytest.raises(kind):
        next(running) if kind is KeyboardInterrupt else running.throw(kind())
    assert work.ended.wait(SECONDS)
    assert work.halted


def test_an_exception_of_one_block_halts_the_other():
    work = Work()

    def fails(block, halted, advanced):
        value = work(block, halted, advanced)
        if not block.first:
            raise ValueError("no number")
        return value

    with pytest.raises(ValueError, match="no number"):
        list(Threads(2).run(fails, BLOCKS, lambda *_: None))
    assert work.ended.wait(SECONDS)
    assert work.halted
