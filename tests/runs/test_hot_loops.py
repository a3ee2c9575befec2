# SPDX-License-Identifier: Apache-2.0
"""No loop over steps has grown, and no kernel takes longer to compile, than was recorded, by what the compiler produced.

After a change that is meant: `python -m tests.support.hot_loops --write`.
"""

import platform

import pytest

from benchmarks import own_process
from tests.support import hot_loops

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the objects are for x86-64"),
    pytest.mark.skipif(hot_loops.disassembler() is None, reason="no objdump"),
]


@pytest.mark.parametrize("scene", hot_loops.SCENES)
def test_a_step_is_no_more_work_than_recorded(scene):
    found, recorded = own_process.call(hot_loops.figures, scene), hot_loops.recorded()[scene]
    for method in hot_loops.METHODS:
        now, then = found[method], recorded[method]
        assert now["work"] < hot_loops.MARGIN * then["work"], f"{method}: {now} where {then} was recorded"
        assert now["compile"] < hot_loops.COMPILE_MARGIN * then["compile"], f"{method}: {now}, recorded {then}"
        # A figure that has fallen so far guards nothing: record it anew.
        assert now["work"] > then["work"] / hot_loops.MARGIN, f"{method}: {now} where {then} was recorded: record anew"


def test_a_law_that_does_its_work_twice_is_noticed():
    doubled = own_process.call(hot_loops.work_repeated, "remus_100", "rk4", 2)
    assert doubled > hot_loops.MARGIN * hot_loops.recorded()["remus_100"]["rk4"]["work"]
