# SPDX-License-Identifier: Apache-2.0
"""Every peer of benchmarks/peers solves the problem that lgvi_warp solves: rates and short runs against the NumPy twin."""

import importlib
import shutil

import numpy as np
import pytest

from benchmarks.peers import plot, problem, reference, tableaus
from lgvi_warp.reference import classical
from lgvi_warp.reference.submaps import Body
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight

# 2 s, 9 members: one more than fill a packet of 8 lanes.
MEMBERS, T1 = 9, 2.0
NEEDS = {
    "lgvi_warp": (), "warp_ordinary": (), "heyoka": ("heyoka",), "numba": ("numba",), "numba_simd": ("numba",),
    "hand_lanes": (), "jax": ("jax",), "diffrax": ("jax", "diffrax"), "mujoco": ("mujoco",), "newton": ("newton",),
}  # fmt: skip
# Largest error of the best setting over 2 s: round-off for high orders, else the truncation of the finest step: of order 4
# and of order 2 at 1/256 s, of order 1 at 1/128 s.
LIMITS = {"numba": 1e-10, "warp_ordinary": 1e-5, "newton": 1e-3}


@pytest.fixture(scope="module", params=["vehicle", "rigid"])
def small(request):
    return problem.make_problem(MEMBERS, T1, request.param)


@pytest.fixture(scope="module")
def truth():
    return {name: reference.solve(problem.make_problem(MEMBERS, T1, name)) for name in ("vehicle", "rigid")}


def twin(single):
    """The problem's body for the reference."""
    return Body(np.diag(single.M), np.diag(single.J), (Weight(net=single.net), Restoring(moment=single.d)))


def test_rates(small):
    # About 50 operations on numbers near 1.
    body, R = twin(small), small.R
    quaternion = np.array(problem.make_rates(small)(tuple(small.state().T)))
    matrix = np.array(problem.make_matrix_rates(small)(tuple(small.matrix_state().T)))
    for i in range(MEMBERS):
        b_rate, nu_rate, Om_rate = classical.rates(small.b[i], R[i], small.nu[i], small.Om[i], body)
        expected = np.concatenate([b_rate, nu_rate, Om_rate])
        assert np.abs(quaternion[[0, 1, 2, 7, 8, 9, 10, 11, 12], i] - expected).max() < 1e-13
        assert np.abs(matrix[[0, 1, 2, 12, 13, 14, 15, 16, 17], i] - expected).max() < 1e-13
        hat = classical.hat(small.Om[i])
        assert np.abs(matrix[3:12, i].reshape(3, 3) - R[i] @ hat).max() < 1e-13


def test_quaternion_rates_turn_the_matrix(small):
    # A central difference over 2e-6 s: 1e-12 of the rates' third derivative, 1e-10 of round-off.
    q, rate = small.state()[:, 3:7], np.array(problem.make_rates(small)(tuple(small.state().T)))[3:7].T
    after, before = (problem.notation.matrix_from_quaternion(q + s * 1e-6 * rate) for s in (1.0, -1.0))
    expected = np.array([R @ classical.hat(Om) for R, Om in zip(small.R, small.Om, strict=True)])
    assert np.abs((after - before) / 2e-6 - expected).max() < 1e-9


@pytest.mark.parametrize("method, rate", [("rk4", 8), ("dp5", 8), ("ck5", 8), ("dop853", 4)])
def test_tableaus_have_their_orders(truth, method, rate):
    # With half the step the error falls by 2^order, up to what the next order adds.
    one, errors = problem.make_problem(MEMBERS, T1), []
    for steps in (round(T1 * rate), round(2 * T1 * rate)):
        y = tuple(one.state().T.astype(np.longdouble))
        for _ in range(steps):
            y = tableaus.step(problem.make_rates(one, np.longdouble), y, T1 / steps, tableaus.TABLEAUS[method])
        errors.append(problem.error(reference.end(np.array(y).T), truth["vehicle"])["error_max"])
    assert np.log2(errors[0] / errors[1]) > tableaus.ORDERS[method] - 0.5


def test_reference_agrees_with_the_twin(truth):
    # RKMK4 at h = 1/128 s: about 1e-9 by its order.
    one = problem.make_problem(MEMBERS, T1)
    motion = one.b[0], one.R[0], one.nu[0], one.Om[0]
    for _ in range(256):
        motion = classical.rkmk4(*motion, twin(one), 1.0 / 128.0)
    assert np.abs(motion[0] - truth["vehicle"][0][0]).max() < 1e-8
    assert np.abs(motion[1] - truth["vehicle"][1][0]).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("name", NEEDS)
def test_short_run(truth, name):
    for package in NEEDS[name]:
        pytest.importorskip(package)
    module = importlib.import_module(f"benchmarks.peers.peer_{name}")
    if name == "hand_lanes" and not shutil.which("g++") and not shutil.which("clang++"):
        pytest.skip("no C++ compiler")
    kind = getattr(module, "PROBLEMS", ("vehicle",))[0]
    best, methods = np.inf, {}
    for run in module.runs(problem.make_problem(MEMBERS, T1, kind), threads=1):
        run.call()
        first = [x.copy() for x in run.end()]
        run.call()
        # A call starts from the start, whatever came before.
        assert all(np.array_equal(x, y, equal_nan=True) for x, y in zip(first, run.end(), strict=True))
        found = problem.error(first, truth[kind])["error_max"]
        methods.setdefault((run.method, run.dtype), []).append(found)
        best = min(best, found)
    assert best < LIMITS.get(name, 1e-11)
    # Every method converges to the same end, even one of order 1 or in single precision.
    assert all(min(errors) < min(1e-3, errors[0]) for errors in methods.values())


def test_cost_is_interpolated_in_logarithms():
    points = [(1e-2, 1.0), (1e-4, 10.0)]
    assert plot.cost(points, 1e-3) == pytest.approx(10.0**0.5)
    assert (plot.cost(points, 1e-1), plot.cost(points, 1e-5)) == (1.0, np.inf)
