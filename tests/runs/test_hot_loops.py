# SPDX-License-Identifier: Apache-2.0
"""No loop over steps has grown, and no kernel takes longer to compile, than was recorded, by what the compiler produced.

After a change that is meant: `python -m tests.support.hot_loops --write`.
"""

import platform

import pytest

from benchmarks import own_process
from tests.support import hot_loops

ELSEWHERE = platform.machine() not in ("x86_64", "AMD64")


def test_loops_are_found_and_weighed():
    # 1 to 3 is a loop, with 2 as a loop of its own, and 5 cannot be reached.
    after = {0: [1], 1: [2, 4], 2: [2, 3], 3: [1], 4: [], 5: [1]}
    blocks = {one: hot_loops.Block(arithmetic=work, after=after[one]) for one, work in enumerate((50, 6, 2, 4, 9, 9))}
    loops = hot_loops.loops_of(blocks)
    assert loops == {1: {1, 2, 3}, 2: {2}}
    assert hot_loops.loop_over_steps(blocks, loops) == 1
    assert hot_loops.work_of(blocks) == 6 + 4 + hot_loops.ROUNDS * 2
    # With most of the arithmetic, the inner one is the loop over steps.
    blocks[2].arithmetic, blocks[2].calls = 40, 1
    assert hot_loops.loop_over_steps(blocks, loops) == 2
    assert hot_loops.work_of(blocks) == 40 + hot_loops.OUTSIDE


@pytest.mark.slow
@pytest.mark.guard
@pytest.mark.skipif(ELSEWHERE, reason="the objects are for x86-64")
@pytest.mark.skipif(hot_loops.disassembler() is None, reason="no objdump")
@pytest.mark.parametrize("scene", hot_loops.SCENES)
def test_a_step_is_no_more_work_than_recorded(scene):
    found, recorded = own_process.call(hot_loops.figures, scene), hot_loops.recorded()[scene]
    for method in hot_loops.METHODS:
        now, then = found[method], recorded[method]
        assert now["work"] < hot_loops.MARGIN * then["work"], f"{method}: {now} where {then} was recorded"
        assert now["compile"] < hot_loops.COMPILE_MARGIN * then["compile"], f"{method}: {now}, recorded {then}"
        # A figure that has fallen so far guards nothing: record it anew.
        assert now["work"] > then["work"] / hot_loops.MARGIN, f"{method}: {now} where {then} was recorded: record anew"


@pytest.mark.slow
@pytest.mark.guard
@pytest.mark.skipif(ELSEWHERE, reason="the objects are for x86-64")
@pytest.mark.skipif(hot_loops.disassembler() is None, reason="no objdump")
def test_a_law_that_does_its_work_twice_is_noticed():
    doubled = own_process.call(hot_loops.work_repeated, "remus_100", "rk4", 2)
    assert doubled > hot_loops.MARGIN * hot_loops.recorded()["remus_100"]["rk4"]["work"]
