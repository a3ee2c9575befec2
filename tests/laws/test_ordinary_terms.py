# SPDX-License-Identifier: Apache-2.0
"""The benchmark's peer with all terms does the same work: its states are lw.solve's. And its scenes run."""

import numpy as np
import pytest

import lgvi_warp as lw
from benchmarks import problems
from benchmarks.cases.ordinary_terms.kernel import command
from tests.support.tools import difference, last


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "bound"), [(1, 1e-12), (100, 1e-9)])
def test_ordinary_kernel(steps, bound):
    scene, h = problems.all_terms(noise=False), 0.01
    start = lw.Ensemble(scene).select(0, 1)
    states = [np.repeat(x, 3, 0) for x in (start.position, start.attitude, start.velocity, start.angular_velocity)]
    arrays, run = command(scene, states, h, steps)
    run()
    result = lw.solve(scene, "psi_s", h=h, t1=steps * h)
    assert result.status.counts() == {"ok": 1}
    assert difference([array.numpy()[1] for array in arrays], last(result)) < bound
