# SPDX-License-Identifier: Apache-2.0
"""A member that fails keeps its last good state, its time and the value that crossed; its neighbours notice nothing."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.reference import advance as twin
from lgvi_warp.reference import rotation
from tests.support.tools import METHODS, PAIRS, body_of, one, random_states, scene_of, to_state

SOLVES_HALF = ("psi", "psi_s")


@pytest.fixture(scope="module")
def scene():
    # A lever that hardly turns anything: the laws, and so the kernels, are those of the paper's scene.
    return scene_of((2.0, 3.0, 4.0), (1.0, 2.0, 2.5), net=-0.1, moment=(0.0, 0.0, -1e-9))


@pytest.mark.ci
@pytest.mark.parametrize(("method", "solver"), PAIRS)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_step_too_large(scene, method, solver, axis):
    # On a principal axis equation (24) is solvable up to |J^-1 a| = 1: h Om = 1, or 2 for the methods of two half steps.
    h = 0.1
    limit = (2.0 if method in SOLVES_HALF else 1.0) / h
    Om = np.outer([0.97 * limit, 1.01 * limit, 3.0 * limit], np.eye(3)[axis])
    result = lw.solve(one(scene, Om=Om), lw.Method(method, solver), h=h, t1=h)
    assert list(result.status) == [Status.OK, Status.STEP_TOO_LARGE, Status.STEP_TOO_LARGE]
    np.testing.assert_allclose(result.failure_value[1:], [1.01, 3.0], rtol=1e-9)
    assert result.failure_time[1] == 0.0
    assert np.isnan(result.failure_time[0])
    np.testing.assert_array_equal(result.angular_velocity[1, 1:], Om[1:])


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_x", pytest.param("psi_x8", marks=pytest.mark.slow)])
def test_turns_too_large(scene, method):
    # Half the angle of a turn, h Om / 4, stays below 1; the tangent's series is
    # wrong beyond, and shears by it multiply rounding errors.
    h, axis = 0.1, 0
    Om = np.outer([3.99 / h, 4.01 / h, 1e6], np.eye(3)[axis])
    result = lw.solve(one(scene, Om=Om), method, h=h, t1=h)
    assert list(result.status) == [Status.OK, Status.STEP_TOO_LARGE, Status.STEP_TOO_LARGE]
    np.testing.assert_allclose(result.failure_value[1:], 0.25 * h * Om[1:, axis], rtol=1e-9)
    np.testing.assert_array_equal(result.angular_velocity[1, 1:], Om[1:])


def test_the_twin_agrees_on_what_is_solvable(scene):
    # Kernel and twin: the twin finds no solution on a principal axis beyond the bound.
    J = scene.vehicle.inertia
    for solver in (rotation.newton, rotation.cayley, rotation.quartic):
        assert rotation.residual(solver(J @ [0.9, 0.0, 0.0], J), J @ [0.9, 0.0, 0.0], J) < 1e-12
        with pytest.raises(rotation.NoSolution):
            solver(J @ [0.0, 1.05, 0.0], J)


@pytest.mark.ci
@pytest.mark.parametrize("method", METHODS)
def test_the_twin_stops_where_the_kernel_does(scene, method):
    # On principal axes, where |J^-1 a| < 1 is sharp, the twin's step raises for the members that the kernel freezes.
    h = 0.1
    Om = np.outer([0.7, 0.97, 1.03, 1.9, 2.06], [0.0, 0.0, 1.0 / h])
    status = lw.solve(one(scene, Om=Om), method, h=h, t1=h).status
    body = body_of(scene)
    for spin, code in zip(Om, status, strict=True):
        x = to_state(body, np.zeros(3), np.eye(3), np.zeros(3), spin)
        if code == Status.OK:
            twin.step(x, body, PROGRAMS[method], h)
        else:
            with pytest.raises(rotation.NoSolution):
                twin.step(x, body, PROGRAMS[method], h)
    assert 0 < np.count_nonzero(status) < len(status)


def test_failure_on_the_way(scene):
    # A top-heavy pendulum that falls: its rate grows until h Om / 2 reaches 1 some steps after the start.
    scene = scene_of((2.0, 2.0, 3.0), (1.0, 2.0, 2.5), net=1e-9, moment=(0.0, 0.0, 400.0))
    fleet = one(scene, R=lw.notation.matrix_from_rotation_vector(np.array([0.05, 0.0, 0.0])), Om=[0.0, 0.0, 0.0])
    h = 0.1
    result = lw.solve(fleet, "psi_s", h=h, t1=5.0, save=lw.SaveAt(every=h))
    assert result.status.counts() == {"step_too_large": 1}
    t = result.failure_time[0]
    assert 0.0 < t < 5.0
    assert result.failure_value[0] >= 1.0
    good = lw.solve(fleet, "psi_s", h=h, t1=t)
    k = int(np.searchsorted(result.time, t - 0.5 * h))
    assert good.status.counts() == {"ok": 1}
    for name in FIELDS:
        frozen = getattr(result, name)
        np.testing.assert_array_equal(frozen[k], getattr(good, name)[-1])
        np.testing.assert_array_equal(frozen[k:], np.broadcast_to(frozen[k], frozen[k:].shape))
        assert np.abs(np.diff(frozen[: k + 1], axis=0)).max() > 0.0 or name in ("position", "velocity")


@pytest.mark.ci
def test_not_converged(scene):
    states = random_states(3, 9, 0.5, 3.0)
    rough = lw.solve(one(scene, *states), lw.Method("psi_s", iterations=0), h=0.2, t1=1.0)
    loose = lw.solve(one(scene, *states), lw.Method("psi_s", iterations=0, tolerance=0.1), h=0.2, t1=1.0)
    settled = lw.solve(one(scene, *states), lw.Method("psi_s"), h=0.2, t1=1.0)
    assert rough.status.counts() == {"not_converged": 9}
    assert (rough.failure_value > 1e-12).all()
    assert (rough.failure_value < 0.1).all()
    assert loose.status.counts() == settled.status.counts() == {"ok": 9}


@pytest.mark.parametrize("field", ["position", "attitude", "velocity", "angular_velocity"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_non_finite_start(scene, field, bad):
    names = ("position", "attitude", "velocity", "angular_velocity")
    states = dict(zip(names, random_states(1, 7), strict=True))
    states[field][4].flat[1] = bad
    result = lw.solve(lw.Ensemble.from_states(scene, *states.values()), h=0.01, t1=0.1)
    assert result.status[4] in (Status.NON_FINITE, Status.STEP_TOO_LARGE)
    assert (np.delete(result.status, 4) == 0).all()
    assert result.failure_time[4] == 0.0
    assert all(np.isfinite(np.delete(getattr(result, name), 4, axis=1)).all() for name in names)


@pytest.mark.ci
@pytest.mark.parametrize("n", [1, 7, 8, 9, 257])
def test_ragged_packets(scene, n):
    states = random_states(8, n)
    result = lw.solve(lw.Ensemble.from_states(scene, *states), h=0.01, t1=0.1)
    assert result.position.shape == (2, n, 3)
    assert result.status.counts() == {"ok": n}


@pytest.mark.ci
def test_checks_none_leaves_the_code_out(scene):
    states = random_states(8, 9)
    checked = lw.solve(one(scene, *states), h=0.01, t1=0.5)
    bare = lw.solve(one(scene, *states), h=0.01, t1=0.5, checks="none")
    np.testing.assert_allclose(bare.position, checked.position, rtol=0, atol=1e-13)
    spinning = lw.solve(one(scene, Om=[1e3, 0.0, 0.0]), h=0.1, t1=0.1, checks="none")
    assert spinning.status.counts() == {"ok": 1}


def test_every_status_says_what_to_do():
    assert all(len(status.text) > 10 for status in Status)


def test_codes_are_those_of_the_kernel():
    from lgvi_kernels.lanes import packet
    from lgvi_kernels.maps import solve

    kernel = (solve.STEP_TOO_LARGE, packet.STEP_TOO_LARGE, solve.NOT_CONVERGED, packet.NON_FINITE)
    assert kernel == (Status.STEP_TOO_LARGE, Status.STEP_TOO_LARGE, Status.NOT_CONVERGED, Status.NON_FINITE)
