# SPDX-License-Identifier: Apache-2.0
"""Explicit methods against the quad-precision truth: orders, tolerances, and what becomes of members that cannot meet one."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.methods.method import ORDERS
from lgvi_warp.physics.notation import hat
from tests.laws import test_parity as test_terms
from tests.laws.cases import CASES
from tests.support.tools import difference, expected, free_scene, last, one, slope

# Steps with errors above round-off and small enough for the leading term.
STEPS = {
    "rk4": (0.05, 0.025, 0.0125), "rk5": (0.1, 0.05, 0.025), "rk5_ck": (0.1, 0.05, 0.025),
    "rk8": (0.2, 0.125, 0.1, 0.0625), "cg3": (0.02, 0.01, 0.005), "rkmk4": (0.05, 0.025, 0.0125),
}  # fmt: skip


@pytest.fixture(scope="module")
def run(scene):
    """The paper's vehicle alone: the state at t1."""

    def solve(method, h, t1=5.0, **named):
        result = lw.solve(lw.Ensemble(scene), method, h=h, t1=t1, **named)
        assert result.status.counts() == {"ok": 1}
        return last(result)

    return solve


@pytest.mark.ci
@pytest.mark.slow_for("cg3", "rk5", "rk5_ck", "rk8")
@pytest.mark.parametrize("method", STEPS)
def test_order(method, run, example):
    truth = expected(example["truth"]["5"])
    errors = [difference(run(method, h), truth) for h in STEPS[method]]
    # The next term of the error shows over these factors of the step.
    assert slope(STEPS[method], errors) == pytest.approx(ORDERS[method], abs=0.15 if method != "rk8" else 0.4)


@pytest.mark.slow
def test_rk8_reaches_the_truth(run, example):
    assert difference(run("rk8", 0.025), expected(example["truth"]["5"])) < 1e-12


@pytest.fixture(scope="module")
def drift(run):
    """Distance of R from the rotations at the end."""

    def of(method, h):
        R = run(method, h)[1]
        return np.abs(R.T @ R - np.eye(3)).max()

    return of


@pytest.mark.ci
def test_R_leaves_the_group_at_the_order_of_the_method(drift):
    steps = (0.1, 0.05, 0.025)
    assert slope(steps, [drift("rk4", h) for h in steps]) > 3.85


@pytest.mark.ci
@pytest.mark.slow_but("rkmk4*")
@pytest.mark.parametrize(("method", "h"), [("rk8", 0.025), ("rkmk4", 0.1), ("cg3", 0.02)])
def test_R_stays_on_the_group(method, h, drift):
    assert drift(method, h) < 1e-13


@pytest.mark.ci
@pytest.mark.slow_for("rk5*")
@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-10])
@pytest.mark.parametrize("method", ["rk5", "rk5_ck", "rk8"])
def test_a_tolerance_is_met(method, tolerance, run, example):
    # Steps are free between samples; the error of 5 s is a few tolerances, since errors grow with time.
    end = run(lw.Method(method, rtol=tolerance, atol=tolerance), 5.0)
    assert difference(end, expected(example["truth"]["5"])) < 20.0 * tolerance


@pytest.mark.slow
def test_a_tolerance_in_float32(run, example):
    end = run(lw.Method("rk5", rtol=1e-6, atol=1e-6), 5.0, dtype="float32")
    assert difference(end, expected(example["truth"]["5"])) < 3e-5


@pytest.mark.ci
def test_steps_go_on_from_sample_to_sample(scene, example):
    method = lw.Method("rk8", rtol=1e-9, atol=1e-9)
    free, sampled = (lw.solve(lw.Ensemble(scene), method, h=h, t1=5.0) for h in (5.0, 0.5))
    assert difference(last(sampled), expected(example["truth"]["5"])) < 20e-9
    made, tried = (sampled.provenance[key] for key in ("steps_made", "steps_tried"))
    # The packet keeps its step from sample to sample: each costs one more step at most, none a search.
    assert 10 <= made <= tried <= free.provenance["steps_tried"] + 10


@pytest.mark.ci
def test_the_same_bits_for_any_number_of_threads(scene):
    fleet = lw.Ensemble(scene, 700, 3, {"start.angular_velocity": lw.distributions.Normal(relative=0.3)})
    method = lw.Method("rk8", rtol=1e-9, atol=1e-12)
    a, b = (lw.solve(fleet, method, h=0.5, t1=2.0, threads=n) for n in (1, 3))
    for name in ("position", "attitude", "velocity", "angular_velocity"):
        assert np.array_equal(getattr(a, name), getattr(b, name))


@pytest.mark.ci
def test_one_that_fails_leaves_the_others(scene):
    # Member 3 turns so fast that 100,000 steps do not end one h; member 5 overflows. Both are in the first packet.
    n = 8
    rng = np.random.default_rng(1)
    R = lw.notation.matrix_from_rotation_vector(rng.normal(size=(n, 3)))
    b, nu, Om = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), 0.3 * rng.normal(size=(n, 3))
    method = lw.Method("rk8", rtol=1e-8, atol=1e-8)

    def solve(Om, nu):
        return lw.solve(lw.Ensemble.from_states(scene, b, R, nu, Om), method, h=1.0, t1=3.0, save=lw.SaveAt(every=1.0))

    healthy = solve(Om, nu)
    bad_Om, bad_nu = Om.copy(), nu.copy()
    bad_Om[3], bad_nu[5] = 1e5, 1e200
    result = solve(bad_Om, bad_nu)
    assert (result.status[3], result.status[5]) == (Status.STEP_TOO_SMALL, Status.NON_FINITE)
    assert np.array_equal(result.attitude[-1, [3, 5]], R[[3, 5]])
    assert np.all(result.failure_time[[3, 5]] == 0.0)
    # The step at which it was given up: 100,000 of its mean length are one h of 1 s.
    assert 1e-7 < result.failure_value[3] < 1e-4
    well = [i for i in range(n) if i not in (3, 5)]
    assert np.all(result.status[well] == Status.OK)
    for i in well:
        assert difference(last(result, i), last(healthy, i)) < 1e-6
    assert "tolerance" in Status.STEP_TOO_SMALL.text


@pytest.mark.slow
def test_an_event_is_seen_at_the_end_of_h(scene):
    stopped = lw.Scene(scene.vehicle, scene.environment, start=scene.start, events=[lw.events.StopTime(at=1.3)])
    method = lw.Method("rk5", rtol=1e-8, atol=1e-8)
    result = lw.solve(stopped, method, h=0.5, t1=3.0)
    assert result.status[0] == Status.TIME
    assert result.failure_time[0] == pytest.approx(1.3)


@pytest.mark.ci
@pytest.mark.slow_for("1*")
@pytest.mark.parametrize(("width", "dtype"), [(1, "float64"), (2, "float32")])
def test_narrow_packets(width, dtype, run, example):
    end = run("rk4", 0.02, dtype=dtype, width=width)
    assert difference(end, expected(example["truth"]["5"])) < (1e-6 if dtype == "float64" else 2e-5)


@pytest.mark.slow
def test_water_is_taken_at_the_users_origin():
    # A center of gravity beside the origin: every method but psi_x moves its own origin away from the user's.
    arm = hat(np.array([0.0, 0.0, 0.3]))
    rigid = np.block([[20.0 * np.eye(3), -20.0 * arm], [20.0 * arm, np.diag([1.5, 4.0, 4.5]) - 20.0 * arm @ arm]])
    vehicle = lw.Vehicle(
        rigid_body_mass_matrix=rigid, added_mass_matrix=np.zeros((6, 6)), weight=196.0, buoyancy=198.0,
        center_of_gravity=(0.0, 0.0, 0.3), center_of_buoyancy=(0.0, 0.0, 0.0),
    )  # fmt: skip
    scene = lw.Scene(vehicle, lw.Environment(gravity=9.8), terms=list(CASES["current profile"].terms))
    start = {"b": (0.4, -0.3, 8.0), "nu": (1.2, 0.3, -0.2), "Om": (0.3, -0.4, 0.5)}
    truth = last(lw.solve(one(scene, **start), "rk4", h=0.01, t1=1.0))
    assert difference(last(lw.solve(one(scene, **start), "psi", h=0.001, t1=1.0)), truth) < 1e-5


@pytest.mark.ci
def test_momentum_without_forces():
    free, method = free_scene((25.0, 42.0, 45.0), (1.5, 4.0, 4.5)), lw.Method("rk8", rtol=1e-9, atol=1e-9)
    end = lw.solve(one(free, **test_terms.STATE), method, h=0.02, t1=2.0)
    first, final = (end.attitude[k, 0] @ free.vehicle.mass_matrix @ end.velocity[k, 0] for k in (0, -1))
    assert np.abs(first - final).max() < 1e-11
