# SPDX-License-Identifier: Apache-2.0
"""With many laws, a method of many stages calls their code, in place of code for each stage."""

import numpy as np
import pytest

import lgvi_warp as lw
from benchmarks import problems
from lgvi_warp.runs.settle import make_plan
from tests.support.tools import generated, last

pytestmark = pytest.mark.slow


def test_called_rates_move_as_inlined_ones():
    scene = problems.all_terms(noise=False)
    ends = [last(lw.solve(scene, method, h=h, t1=0.1)) for method, h in (("rk8", 0.01), ("rk4", 0.0005))]
    # The laws change with |v|, so orders are lower than the methods'; the steps of rk4 leave 1e-9 of motions of order 1.
    for value, wanted in zip(*ends, strict=True):
        np.testing.assert_allclose(value, wanted, rtol=0.0, atol=1e-8 * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize(
    ("method", "scene", "called"),
    [("rk8", problems.all_terms(noise=False), True), ("rk8", lw.Scene.named("remus_100"), False),
     ("rk4", problems.all_terms(noise=False), False)],
    ids=["many laws, many stages", "few laws", "few stages"],
)  # fmt: skip
def test_laws_are_called_where_they_are_many(method, scene, called, tmp_path):
    text = generated(make_plan(lw.Ensemble(scene), method, h=0.02, t1=0.1), tmp_path)
    assert ("make_called" in text) == called
