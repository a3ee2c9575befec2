# SPDX-License-Identifier: Apache-2.0
"""The loop over blocks hears an interrupt that comes while its last blocks end."""

from types import SimpleNamespace

import pytest

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.loop import Merged, run_blocks

BLOCKS = [Block(0, 256), Block(256, 512), Block(512, 600)]


class Interrupted:
    """An executor whose blocks all end, after an interrupt that it raises when they are told."""

    def run(self, work, blocks, advanced):
        for block in reversed(blocks):
            yield block, ()
        raise KeyboardInterrupt


def test_an_interrupt_is_heard_though_every_block_ended():
    work = SimpleNamespace(keepers=(), store=None, plan=SimpleNamespace(compile=lambda: None))
    merged = Merged()
    with pytest.raises(KeyboardInterrupt):
        run_blocks(work, BLOCKS, Interrupted(), lambda block, steps: None, merged=merged)
    assert merged.begun == merged.done == 600
