# SPDX-License-Identifier: Apache-2.0
"""The explicit solution of equation (24) in the kernel: against its twin by eigenvectors, and where that fails."""

import numpy as np
import pytest

import lgvi_warp as lw
from benchmarks.cases.solvers import case
from lgvi_warp.common.status import Status
from lgvi_warp.reference import riccati, rotation
from tests.methods.test_kernel_and_twin import SHAPES, both
from tests.support.tools import difference, one, scene_of

# No Newton step after the explicit solution.
EXPLICIT = lw.Method("psi_1", "moser_veselov", 0, 0.5)


@pytest.mark.ci
@pytest.mark.parametrize("h", [0.01, 0.1, 0.5])
def test_one_step(h):
    kernel, eigenvectors = both("both full", "psi_s", "moser_veselov", 1, h=h)
    assert difference(kernel, both("both full", "psi_s", "quartic", 1, h=h)[1]) < 1e-14
    # Near the sphere the eigenvectors lose digits as the moments' differences: here a hundred, and more for small |a|.
    assert difference(kernel, eigenvectors) < 1e-12


@pytest.mark.ci
def test_five_seconds():
    kernel, _ = both("both full", "psi_s", "moser_veselov", 500)
    assert difference(kernel, both("both full", "psi_s", "quartic", 500)[1]) < 1e-11


@pytest.mark.ci
@pytest.mark.parametrize(("dtype", "eps"), [("float64", 2.2e-16), ("float32", 1.2e-7)])
@pytest.mark.parametrize("shape", case.SHAPES)
def test_single_solves(shape, dtype, eps):
    # The slender body's system has the condition number 1 / J1^2 = 400.
    eps *= 10 if shape == "slender" else 1
    J, u = np.array(case.SHAPES[shape]), case.directions(16)
    for fraction in (0.0, 1e-3, 0.1, 0.5, 0.9):
        rates = (fraction * u).astype(dtype).astype(float)
        F = case.by_kernel(EXPLICIT, dtype, J, rates)
        for turn, rate in zip(F, rates):
            residual, orthogonality = riccati.quality(turn, J * rate, np.diag(J))
            assert residual < 50 * eps
            assert orthogonality < 50 * eps
            np.testing.assert_allclose(turn, rotation.quartic(J * rate, np.diag(J)), atol=50 * eps)


@pytest.mark.ci
def test_a_sphere():
    rates = 0.5 * case.directions(8)
    F = case.by_kernel(EXPLICIT, "float64", np.ones(3), rates)
    exact = [rotation.newton(rate, np.eye(3)) for rate in rates]
    np.testing.assert_allclose(F, exact, atol=1e-14)


@pytest.mark.ci
def test_too_large():
    # psi_s makes two solves over half the step; weight and moment, which stay in the kernel, change nothing here.
    scene = scene_of(*SHAPES["full mass"], net=-1e-9, moment=(0.0, 0.0, -1e-9))
    fleet = one(scene, Om=[[1.98, 0.0, 0.0], [2.02, 0.0, 0.0]])
    result = lw.solve(fleet, lw.Method("psi_s", "moser_veselov"), h=1.0, t1=1.0)
    assert result.status.tolist() == [Status.OK, Status.STEP_TOO_LARGE]
