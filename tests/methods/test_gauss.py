# SPDX-License-Identifier: Apache-2.0
"""Gauss collocation in the kernel against its twin, against the truth, and where it fails."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.methods.gauss import gauss
from lgvi_warp.methods.method import GAUSS
from lgvi_warp.reference import collocation
from lgvi_warp.reference.terms.wrench import Wrench
from tests.methods.test_kernel_and_twin import SHAPES, STATE
from tests.support.tools import (
    body_of,
    difference,
    expected,
    free_scene,
    from_state,
    last,
    one,
    scene_of,
    slope,
    to_state,
)

STEPS = 10


def both(name, h, dtype="float64", terms=(), laws=(), shape="diagonal"):
    """The state after some steps by the kernel and by the twin."""
    scene = scene_of(*SHAPES[shape], net=-2.56, moment=(0.3, -0.2, -8.5))
    body = body_of(scene)
    body = type(body)(body.M, body.J, (*body.terms, *laws))
    scene = lw.Scene(scene.vehicle, scene.environment, terms=list(terms))
    result = lw.solve(one(scene, **STATE), name, h=h, t1=STEPS * h, dtype=dtype)
    assert result.status.counts() == {"ok": 1}
    x = to_state(body, *(np.array(value) for value in STATE.values()))
    x, _ = collocation.advance(x, body, h, STEPS, GAUSS[name])
    return last(result), from_state(body, x)


@pytest.mark.parametrize("s", range(2, 7))
def test_coefficients(s):
    twin = collocation.gauss(s)
    for mine, printed in zip(gauss(s), (twin.a, twin.b, twin.c, twin.ahead), strict=True):
        np.testing.assert_allclose(mine, printed, atol=1e-13)


@pytest.mark.ci
@pytest.mark.slow_but("gauss6")
@pytest.mark.parametrize("name", GAUSS)
def test_some_steps(name):
    # Both stop where a change is below 1e-14 of the state, a factor above what is left.
    assert difference(*both(name, 0.1)) < 2e-13


@pytest.mark.ci
def test_float32():
    assert difference(*both("gauss6", 0.1, "float32")) < 5e-6


@pytest.mark.ci
def test_forces_of_position_and_time():
    force, torque = [3.0, -2.0, 1.0], [0.3, 0.1, -0.2]
    term, law = lw.terms.Wrench(force=force, torque=torque), Wrench(force=np.array(force), torque=np.array(torque))
    assert difference(*both("gauss6", 0.1, terms=[term], laws=[law], shape="both full")) < 2e-13


def run(scene, name, h, **named):
    return lw.solve(lw.Ensemble(scene, members=1), name, h=h, t1=5.0, save=lw.SaveAt(every=5.0), **named)


@pytest.mark.ci
@pytest.mark.slow_but("gauss6*")
@pytest.mark.parametrize(("name", "steps"), [("gauss4", (0.1, 0.05, 0.025)), ("gauss6", (0.25, 0.2, 0.1)),
                                             ("gauss12", (1.0, 0.5))])  # fmt: skip
def test_order(name, steps, scene, example):
    truth = expected(example["truth"]["5"])
    errors = [difference(last(run(scene, name, h)), truth) for h in steps]
    order = 2 * GAUSS[name]
    assert slope(np.array(steps), errors) == pytest.approx(order, abs=0.1 * order)
    assert lw.Method(name).order == order


@pytest.mark.slow
def test_gauss_12_reaches_the_truth(scene, example):
    assert difference(last(run(scene, "gauss12", 0.25)), expected(example["truth"]["5"])) < 1e-12


@pytest.mark.ci
def test_a_fixed_number_of_iterations(scene, example):
    # Ten are not enough for the strict tolerance of a fixed number, and said so; with a loose one the error shows.
    few = run(scene, lw.Method("gauss6", iterations=3), 0.1)
    assert few.status.tolist() == [Status.NOT_CONVERGED]
    loose = run(scene, lw.Method("gauss6", iterations=3, tolerance=0.1), 0.1)
    exact = run(scene, "gauss6", 0.1)
    assert 1e-10 < difference(last(loose), last(exact)) < 1e-3


@pytest.mark.slow
def test_each_iteration_gains_an_order(scene):
    # The first step begins with the slopes at the start: after n iterations a step is wrong by h^(n + 1).
    method = lw.Method("gauss6", iterations=2, tolerance=0.99)
    errors = []
    for h in (0.1, 0.05):
        ends = [last(lw.solve(scene, name, h=h, t1=h)) for name in (method, "gauss6")]
        errors.append(difference(*ends))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3.0, abs=0.1)


@pytest.mark.ci
def test_steps_that_do_not_contract(scene):
    # One member spins so fast that its iteration diverges; the other's bits do not change.
    spins = np.array([[0.3, 0.2, 0.1], [30.0, 20.0, 10.0]])
    alone = lw.solve(one(free_scene(), Om=spins[:1]), "gauss6", h=0.2, t1=2.0)
    beside = lw.solve(one(free_scene(), Om=spins), "gauss6", h=0.2, t1=2.0)
    assert beside.status.tolist() == [Status.OK, Status.NOT_CONVERGED]
    assert np.array_equal(alone.attitude[-1, 0], beside.attitude[-1, 0])


@pytest.mark.ci
def test_any_number_of_segments_gives_the_same_bits(scene):
    whole = lw.solve(lw.Ensemble(scene, members=3), "gauss6", h=0.1, t1=5.0, save=lw.SaveAt(every=5.0))
    sampled = lw.solve(lw.Ensemble(scene, members=3), "gauss6", h=0.1, t1=5.0, save=lw.SaveAt(every=0.1))
    assert np.array_equal(whole.attitude[-1], sampled.attitude[-1])
