# SPDX-License-Identifier: Apache-2.0
"""Treatment of members that fail: freeze them, raise after the run, or divide the steps that have no solution."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.physics import terms
from tests.support.tools import one, random_states, scene_of

FIELDS = ("position", "attitude", "velocity", "angular_velocity")


@pytest.fixture(scope="module")
def scene():
    return scene_of((2.0, 3.0, 4.0), (1.0, 2.0, 2.5), net=-0.1, moment=(0.0, 0.0, -0.5))


def fast(n=5, spin=30.0):
    """Members of which the second and the last spin too fast for h = 0.1."""
    b, R, nu, Om = random_states(2, n, 0.5, 0.5)
    Om[[1, n - 1]] = spin * np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])
    return b, R, nu, Om


@pytest.mark.ci
def test_raise_keeps_the_result(scene):
    with pytest.raises(
        lw.MembersFailed, match=r"step_too_large, 2 of 5 members \(first: member 1 at 0 s.*Shorten"
    ) as caught:
        lw.solve(one(scene, *fast()), "psi_s", h=0.1, t1=1.0, on_failure="raise")
    frozen = lw.solve(one(scene, *fast()), "psi_s", h=0.1, t1=1.0)
    for name in (*FIELDS, "status", "failure_time", "failure_value"):
        np.testing.assert_array_equal(getattr(caught.value.result, name), getattr(frozen, name))


@pytest.mark.ci
def test_raise_is_quiet_without_failures_and_about_events(scene):
    # The kernel of test_compositions.py, test_events_change_round_off_only. Up to 5 mm in about 0.6 s.
    box = lw.events.Box(lower=[-9.0, -9.0, -0.005], upper=[9.0, 9.0, 9.0])
    result = lw.solve(one(lw.Scene(scene.vehicle, scene.environment, events=[box])), "bm4(psi_x)", h=0.1, t1=1.0,
                      on_failure="raise", width=1)  # fmt: skip
    assert result.status.counts() == {"box": 1}


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi", "psi_s"])
@pytest.mark.parametrize(("part", "parts"), [(1.2, 2), (3.0, 4), (900.0, 1024)])
def test_a_steady_spin_by_divided_steps(method, part, parts):
    # About a principal axis a step of 2 m solves turns by 2 m asin(h Om / (2 m)), m the least power of 2 that has one.
    h, steps = 0.1, 6
    Om = part * 2.0 / h
    scene = scene_of((2.0, 2.0, 2.0))
    result = lw.solve(one(scene, Om=[0.0, 0.0, Om]), method, h=h, t1=h * steps, on_failure="substep")
    assert result.status.counts() == {"ok": 1}
    assert result.substeps.tolist() == [steps]
    angle = steps * 2 * parts * np.arcsin(h * Om / (2 * parts))
    expected = lw.notation.matrix_from_rotation_vector(np.array([0.0, 0.0, np.remainder(angle, 2.0 * np.pi)]))
    # Round-off of the angle of each solve, and of as many products.
    np.testing.assert_allclose(result.attitude[-1, 0], expected, atol=1e-15 * 2 * parts * steps * 8)


@pytest.mark.ci
def test_what_no_division_helps_is_frozen(scene):
    result = lw.solve(one(scene, Om=[0.0, 0.0, 1.1 * 2048 / 0.1]), "psi_s", h=0.1, t1=0.5, on_failure="substep")
    assert list(result.status) == [Status.STEP_TOO_LARGE]
    assert (result.failure_time[0], result.substeps[0]) == (0.0, 0)
    np.testing.assert_allclose(result.failure_value, 1.1 * 1024, rtol=1e-12)


@pytest.mark.ci
@pytest.mark.slow_for("kl6*")
@pytest.mark.parametrize("method", ["psi", "psi_s", "kl6(psi_s)"])
def test_divided_steps_are_those_of_a_shorter_step(scene, method):
    # All steps of the fast members are halved: the same path as with half the step, which has the method's order.
    h = 0.1
    Om = (3.2 if method == "kl6(psi_s)" else 2.8) / h
    states = random_states(3, 2, 0.3, 0.1)
    states[3][:] = Om * np.array([[0.0, 0.0, 1.0], [0.02, 0.01, 1.0]])
    at = lw.SaveAt(every=5 * h)
    whole = lw.solve(one(scene, *states), method, h=h, t1=10 * h, save=at, on_failure="substep")
    half = lw.solve(one(scene, *states), method, h=0.5 * h, t1=10 * h, save=at)
    assert whole.status.counts() == half.status.counts() == {"ok": 2}
    assert (whole.substeps == 10).all()
    for name in FIELDS:
        np.testing.assert_allclose(getattr(whole, name), getattr(half, name), rtol=1e-10, atol=1e-10)


@pytest.mark.ci
@pytest.mark.slow_for("float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_others_keep_their_bits(scene, dtype):
    loud = lw.solve(
        one(scene, *fast()), "psi_s", h=0.1, t1=20.0, dtype=dtype, on_failure="substep", save=lw.SaveAt(every=5.0)
    )
    b, R, nu, Om = fast()
    Om[[1, 4]] *= 0.01
    quiet = lw.solve(one(scene, b, R, nu, Om), "psi_s", h=0.1, t1=20.0, dtype=dtype, on_failure="substep",
                     save=lw.SaveAt(every=5.0))  # fmt: skip
    assert loud.status.counts() == {"ok": 5}
    assert (loud.substeps[[1, 4]] == 200).all()
    assert quiet.substeps.sum() == 0 == loud.substeps[[0, 2, 3]].sum()
    plain = lw.solve(one(scene, *fast()), "psi_s", h=0.1, t1=20.0, dtype=dtype, save=lw.SaveAt(every=5.0))
    for name in FIELDS:
        assert getattr(loud, name)[:, [0, 2, 3]].tobytes() == getattr(quiet, name)[:, [0, 2, 3]].tobytes()
        tolerance = 1e-12 if dtype == "float64" else 1e-4
        np.testing.assert_allclose(
            getattr(loud, name)[:, [0, 2, 3]], getattr(plain, name)[:, [0, 2, 3]], atol=tolerance, rtol=tolerance
        )


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi", "psi_s"])
def test_symmetry_is_kept(scene, method):
    # There, all velocities turned round, and back again: a symmetric step undoes itself, divided or not.
    b, R, nu, Om = fast(spin=22.0)
    there = lw.solve(one(scene, b, R, nu, Om), method, h=0.1, t1=2.0, on_failure="substep")
    assert 0 < there.substeps[1] <= 20
    assert there.status.counts() == {"ok": 5}
    turned = (there.position[-1], there.attitude[-1], -there.velocity[-1], -there.angular_velocity[-1])
    back = lw.solve(one(scene, *turned), method, h=0.1, t1=2.0, on_failure="substep")
    same = back.substeps == there.substeps
    assert same.sum() >= 4
    for name, start in zip(FIELDS, (b, R, -nu, -Om), strict=True):
        # Round-off of 40 steps, which 44 rad of fast turning amplify by some ten times.
        np.testing.assert_allclose(getattr(back, name)[-1][same], start[same], atol=1e-11, rtol=1e-11)


@pytest.mark.slow
def test_a_solve_that_did_not_converge_is_divided(scene):
    states = random_states(3, 4, 0.5, 2.0)
    method = lw.Method("psi_s", iterations=0, tolerance=1e-9)
    frozen = lw.solve(one(scene, *states), method, h=0.1, t1=1.0)
    divided = lw.solve(one(scene, *states), method, h=0.1, t1=1.0, on_failure="substep")
    assert frozen.status.counts().get("not_converged") == 4
    assert divided.status.counts() == {"ok": 4}
    assert (divided.substeps > 0).all()
    exact = lw.solve(one(scene, *states), "psi_s", h=0.001, t1=1.0)
    coarse = lw.solve(one(scene, *states), "psi_s", h=0.1, t1=1.0)
    assert np.abs(divided.attitude - exact.attitude).max() < np.abs(coarse.attitude - exact.attitude).max()


@pytest.mark.slow
def test_forces_that_do_not_settle_are_divided():
    base = scene_of((2.0, 2.0, 2.0), (1.0, 2.0, 2.5))
    scene = lw.Scene(base.vehicle, base.environment, terms=[terms.Drag(linear=[50.0, 0.0, 0.0, 0.0, 0.0, 0.0])])
    frozen = lw.solve(one(scene, nu=[1.0, 0.0, 0.0]), "psi", h=0.4, t1=2.0)
    divided = lw.solve(one(scene, nu=[1.0, 0.0, 0.0]), "psi", h=0.4, t1=2.0, on_failure="substep")
    assert frozen.status.counts() == {"forces_not_converged": 1}
    assert divided.status.counts() == {"ok": 1}
    assert divided.substeps[0] > 0
    assert np.abs(divided.velocity[-1]).max() < 1e-3


def pushed_to_the_wall(force):
    """A body in a box, which a push moves that grows with time: events and times of laws in one kernel."""
    base = scene_of((2.0, 2.0, 2.0))
    law = terms.WrenchSchedule(times=[0.0, 2.0], force=[[0.0, 0.0, 0.0], [0.0, 0.0, force]], torque=[[0.0] * 3] * 2)
    return lw.Scene(base.vehicle, base.environment, terms=[law],
                    events=[lw.events.Box(lower=[-9.0] * 3, upper=[1.0, 9.0, 9.0])])  # fmt: skip


@pytest.mark.ci
def test_events_stop_a_divided_step():
    scene = pushed_to_the_wall(1e-30)
    fleet = one(scene, R=lw.notation.matrix_from_rotation_vector(np.array([0.0, np.pi / 2, 0.0])), b=[[0.0] * 3] * 2,
                nu=[[0.0, 0.0, 2.0]] * 2, Om=[[0.0, 0.0, 30.0], [0.0, 0.0, 1.0]])  # fmt: skip
    result = lw.solve(fleet, "psi_s", h=0.1, t1=2.0, on_failure="substep", width=2)
    # Both go north at 2 m/s, one of them by divided steps.
    assert list(result.status) == [Status.BOX, Status.BOX]
    assert (result.substeps[0], result.substeps[1]) == (5, 0)
    np.testing.assert_allclose(result.failure_time, 0.5, atol=1e-9)


@pytest.mark.ci
def test_times_of_laws_pass_in_divided_steps():
    # Divided steps see their own times.
    result = lw.solve(
        one(pushed_to_the_wall(2.0), Om=[0.0, 0.0, 30.0]), "psi_s", h=0.1, t1=2.0, on_failure="substep", width=2
    )
    # M v = t^2 / 2: exact for a kick in the middle of each part, as the law is linear in time.
    assert result.substeps[0] == 20
    np.testing.assert_allclose(result.velocity[-1, 0, 2], 1.0, rtol=1e-12)


@pytest.mark.parametrize(("method", "laws", "text"), [
    ("psi_x", [], "solves nothing"), ("rk8", [], "solves nothing"), ("gauss4", [], "stages of the last"),
    ("psi_s", [terms.WrenchNoise(force=[1.0, 0.0, 0.0], torque=[0.0] * 3)], "draws its noise once a step"),
    ("psi_s", [terms.Thrusters(position=[[0.0] * 3], direction=[[1.0, 0.0, 0.0]], coefficient=[1.0], time_constant=[1.0],
                               times=[0.0, 1.0], command_schedule=[[1.0], [1.0]])], "remembers"),
])  # fmt: skip
def test_what_cannot_be_divided_is_refused(method, laws, text):
    base = scene_of((2.0, 2.0, 2.0))
    with pytest.raises(lw.SceneError, match=text):
        lw.solve(one(lw.Scene(base.vehicle, base.environment, terms=laws)), method, h=0.1, t1=1.0, on_failure="substep")


@pytest.mark.parametrize("on_failure", ["raise", "substep"])
def test_failures_must_be_seen(scene, on_failure):
    with pytest.raises(lw.SceneError, match="does not see failures"):
        lw.solve(one(scene), h=0.1, t1=1.0, checks="none", on_failure=on_failure)
    with pytest.raises(lw.SceneError, match="Did you mean 'substep'"):
        lw.solve(one(scene), h=0.1, t1=1.0, on_failure="substeps")
