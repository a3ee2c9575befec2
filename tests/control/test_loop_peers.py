# SPDX-License-Identifier: Apache-2.0
"""The closed loop of benchmarks/cases/loop_peers is one loop, whichever way it is written."""

import numpy as np
import pytest

from benchmarks.cases.loop_peers import case
from benchmarks.cases.loop_peers.problem import Problem

# A period of 0.2 s and 2 s in all, in steps of 0.04 and 0.02 s; one member more than fills a packet of 8 lanes.
MEMBERS, TICKS, STEPS = 9, 10, ((5, 0.04), (10, 0.02))


# Two kernels are compiled, and numba's loop.
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def ends():
    """For each length of step the ends of each way."""
    return [case.ends_of(case.make_ways(Problem(MEMBERS, TICKS, every, h))[0]) for every, h in STEPS]


@pytest.mark.parametrize("name", case.PEERS)
def test_ways_agree_at_the_order_of_rk4(ends, name):
    if name not in ends[0]:
        pytest.skip(f"the package of {name} is missing")
    coarse, fine = (case.differences(of_step)[name] for of_step in ends)
    # Local errors (rate h)^5 / 120, at 2 rad/s: 1.4e-6 in 50 steps of 0.04 s. Half the step leaves a sixteenth of them or
    # less; 12 with what the next order adds.
    assert coarse < 1.4e-6
    assert fine < coarse / 12.0


def test_members_differ_and_move(ends):
    position, attitude = ends[1]["lanes"]
    start = Problem(MEMBERS, TICKS).numbers
    assert np.linalg.norm(position - start["b"], axis=1).min() > 0.1
    assert np.abs(attitude - start["R"]).max(axis=(1, 2)).min() > 0.1
    assert len(np.unique(position[:, 0])) == MEMBERS


def test_a_second_call_begins_at_the_start(ends):
    ways, _ = case.make_ways(Problem(MEMBERS, TICKS, *STEPS[1]))
    case.ends_of(ways)
    for name, (position, attitude) in case.ends_of(ways).items():
        assert np.array_equal(position, ends[1][name][0])
        assert np.array_equal(attitude, ends[1][name][1])
