# SPDX-License-Identifier: Apache-2.0
"""The benchmark's peer does the same work: its states are the paper example's."""

import numpy as np
import pytest

from benchmarks.cases.ordinary.kernel import command
from tests.support.tools import difference, expected


@pytest.mark.ci
@pytest.mark.slow_for("*-psi-*")
@pytest.mark.parametrize(("method", "key"), [("psi", "Psi_h0.01"), ("psi_s", "PsiS_h0.01")])
@pytest.mark.parametrize(("steps", "when", "bound"), [(1, "one_step", 1e-13), (500, "5", 1e-11)])
def test_ordinary_kernel(method, key, steps, when, bound, example, body):
    start = expected(example["params"]["x0"])
    states = [np.repeat(np.asarray(x)[None], 3, axis=0) for x in start]
    weight, restoring = body.terms
    arrays, run = command(states, body.M, body.J, weight.net, restoring.moment, 0.01, steps, method)
    run()
    assert difference([array.numpy()[1] for array in arrays], expected(example[key][when])) < bound
