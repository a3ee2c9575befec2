# SPDX-License-Identifier: Apache-2.0
"""Each row of warnings is crossed where it should be and not 5 % below; levels of checks; what a level leaves out."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.common.status import Status, Warnings
from lgvi_warp.engine import step_warnings
from lgvi_warp.engine.step_warnings import COARSE, PRECISION
from lgvi_warp.engine.survey import frame_of
from lgvi_warp.methods import limits
from lgvi_warp.methods.method import Method
from lgvi_warp.physics import hydrostatics, terms
from lgvi_warp.runs.settle import make_plan
from tests.support.tools import one, random_states, scene_of

BELOW, ABOVE = 0.95, 1.05
BOTH = np.array([BELOW, ABOVE])
# A weight and a lever along the axis that points down: they turn nothing, and all scenes have the laws of the paper's.
LAWS = {"net": 1e-9, "moment": (0.0, 0.0, -1e-9)}
MUNK = {"M": (1.0, 4.0, 4.0), "J": (1.0, 2.0, 2.5)} | LAWS
PLAIN = {"M": (2.0, 2.0, 3.0)} | LAWS


def warned(result, warning):
    """Mask of members with the warning."""
    return result.warnings.has(warning).tolist()


def munk_speed(w, scene):
    """Speed along the third axis for this frequency of the Munk moment, by the row's formula."""
    M, J = np.diag(scene.vehicle.mass_matrix), np.diag(scene.vehicle.inertia)
    p = w / np.sqrt((1.0 / M.min() - 1.0 / M.max()) / J.min())
    return p / M[2]


@pytest.mark.ci
@pytest.mark.slow_for("kl8*")
@pytest.mark.parametrize("checks", ["safe", "all"])
@pytest.mark.parametrize("method", ["psi_s", "kl8(psi_s)"])
def test_munk_at_the_start(checks, method):
    scene, h = scene_of(**MUNK), 0.1
    limit = 0.5 / max(abs(stage) for stage in Method(method).stages)
    nu = np.outer(munk_speed(limit / h * BOTH, scene), [0.0, 0.0, 1.0])
    result = lw.solve(one(scene, nu=nu), method, h=h, t1=h, checks=checks)
    assert warned(result, Warnings.MUNK_COARSE) == [False, True]
    assert result.warning_time[1] == 0.0
    assert np.isnan(result.warning_time[0])
    np.testing.assert_allclose(result.warning_value, [np.nan, limit * ABOVE], rtol=1e-12)


@pytest.mark.slow_but("psi_s*")
@pytest.mark.parametrize("method", ["phi", "psi", "psi_s", "psi_1", "psi_x"])
def test_munk_beyond_the_limit_of_the_method(method):
    scene, h = scene_of(**MUNK), 0.1
    nu = np.outer(munk_speed(limits.MUNK[method] / h * BOTH, scene), [0.0, 0.0, 1.0])
    result = lw.solve(one(scene, nu=nu), method, h=h, t1=h)
    assert warned(result, Warnings.MUNK_UNSTABLE) == [False, True]
    assert result.warnings.counts() == {"munk_coarse": 2, "munk_unstable": 1}


@pytest.mark.ci
def test_munk_that_arises_on_the_way():
    # A heavy vehicle sinks from rest along its heavy axis: p = net t, so that the row is crossed at a known time.
    scene, h = scene_of(**MUNK | {"net": 2.0}), 0.02
    crossing = 0.5 / h / np.sqrt((1.0 / 1.0 - 1.0 / 4.0) / 1.0) / 2.0
    result = lw.solve(one(scene), "psi_s", h=h, t1=1.4 * crossing, checks="all")
    assert result.warnings.counts() == {"munk_coarse": 1}
    assert crossing <= result.warning_time[0] <= crossing + 128 * h
    safe = lw.solve(one(scene), "psi_s", h=h, t1=1.4 * crossing)
    assert safe.warnings.counts() == {}
    for name in ("position", "attitude", "velocity", "angular_velocity"):
        np.testing.assert_allclose(getattr(result, name), getattr(safe, name), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(("factor", "warning"), [
    (0.5, Warnings.RESTORING_COARSE), (limits.RESTORING["psi_s"], Warnings.RESTORING_UNSTABLE),
])  # fmt: skip
def test_restoring(factor, warning):
    h = 0.1
    for part, crossed in ((BELOW, False), (ABOVE, True)):
        scene = scene_of(**PLAIN | {"moment": (0.0, 0.0, -((part * factor / h) ** 2))})
        result = lw.solve(one(scene), "psi_s", h=h, t1=h)
        assert warned(result, warning) == [crossed]
        if crossed:
            assert result.warning_value[0] == pytest.approx(part * factor)


@pytest.mark.ci
@pytest.mark.slow_for("rk4")
@pytest.mark.parametrize("method", ["rk4", "psi_x"])
def test_rotation(method):
    h = 0.1
    limit = 2.0 * np.sqrt(2.0) if method == "rk4" else limits.TURNS  # the classical method's on the imaginary axis
    Om = np.outer(limit / h * BOTH, [0.0, 0.0, 1.0])
    for checks in ("safe", "all"):
        result = lw.solve(one(scene_of(**PLAIN), Om=Om), method, h=h, t1=h, checks=checks)
        assert warned(result, Warnings.ROTATION) == [False, True]
    assert result.warning_value[1] == pytest.approx(ABOVE * limit)


@pytest.mark.ci
def test_rotation_on_the_way():
    # A steady moment about a principal axis: |Omega| = moment t / J. Looks are every 128 steps; the second is too late by 0.2.
    h, J, seen, limit = 0.01, 2.5, 256, limits.TURNS
    moment = np.array([1.2, 0.6]) * limit / h * J / (seen * h)
    scene = scene_of(**PLAIN)
    scene = lw.Scene(scene.vehicle, scene.environment, [terms.Wrench(torque=(0.0, 0.0, 1.0))])
    fleet = one(scene, parameters={"wrench.torque": np.outer(moment, [0.0, 0.0, 1.0])})
    result = lw.solve(fleet, "psi_x", h=h, t1=seen * h, checks="all")
    assert warned(result, Warnings.ROTATION) == [True, False]
    assert result.warning_time[0] == seen * h
    assert result.warning_value[0] == pytest.approx(1.2 * limit, rel=1e-12)


def test_explicit_methods_have_their_limits_on_the_imaginary_axis():
    # Orders 3 and 4 with as many stages have the exponential's series: sqrt(3) and 2 sqrt(2).
    known = {"cg3": np.sqrt(3.0), "rk4": 2.0 * np.sqrt(2.0), "rkmk4": 2.0 * np.sqrt(2.0)}
    assert {name: limits.spin_limit(name) for name in known} == pytest.approx(known, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "law"), [
    ("rk4", lambda linear, q: terms.Drag(linear=[linear] * 6, quadratic=[q] * 6)),
    ("rk4", lambda linear, q: terms.DragMatrix(linear=linear * np.eye(6), quadratic=q * np.eye(6))),
    ("psi", lambda linear, q: terms.Drag(linear=[linear] * 6, quadratic=[q] * 6)),
])  # fmt: skip
def test_stiff_drag_of_explicit_methods(method, law):
    # h (l + 2 q|v|) / I of surge, M = 2, v = 1.5.
    h, v, M = 0.1, 1.5, 2.0
    for part, crossed in ((BELOW, False), (ABOVE, True)):
        q = 1.0
        linear = part * M / h - 2.0 * q * v
        scene = scene_of((M, M, M), (30.0, 30.0, 30.0))
        scene = lw.Scene(scene.vehicle, scene.environment, terms=[law(linear, q)])
        result = lw.solve(one(scene, nu=[v, 0.0, 0.0]), method, h=h, t1=h, checks="all")
        assert warned(result, Warnings.DRAG_STIFF) == [crossed]
    assert (result.warning_time[0], result.warning_value[0]) == (0.0, pytest.approx(ABOVE))
    quiet = lw.solve(one(scene, nu=[v, 0.0, 0.0]), "psi_s", h=h, t1=h, checks="all")
    assert warned(quiet, Warnings.DRAG_STIFF) == [False]


@pytest.mark.slow
@pytest.mark.parametrize("checks", ["safe", "all"])
def test_precision_far_from_the_origin(checks):
    h, v = 0.01, 1.0
    far = PRECISION * h * v / np.finfo(np.float32).eps
    b = np.outer(far * BOTH, [0.0, 0.0, 1.0])
    fleet = one(scene_of((2.0, 2.0, 2.0)), b=b, nu=[v, 0.0, 0.0])
    assert warned(lw.solve(fleet, h=h, t1=h, dtype="float32", checks=checks), Warnings.PRECISION_LOSS) == [False, True]
    for dtype in ("float64", "float32_compensated"):
        assert lw.solve(fleet, h=h, t1=h, dtype=dtype, checks=checks).warnings.counts() == {}
    # At rest nothing is lost.
    assert (
        lw.solve(one(scene_of((2.0, 2.0, 2.0)), b=b), h=h, t1=h, dtype="float32", checks=checks).warnings.counts() == {}
    )


@pytest.mark.ci
def test_precision_on_the_way():
    h, v = 0.01, 1.0
    far = PRECISION * h * v / np.finfo(np.float32).eps
    fleet = one(scene_of(**PLAIN), b=[far - 3.0, 0.0, 0.0], nu=[v, 0.0, 0.0])
    result = lw.solve(fleet, h=h, t1=8.0, dtype="float32", checks="all")
    assert warned(result, Warnings.PRECISION_LOSS) == [True]
    # float32 places lie 1 mm apart there: that many come to the first look after 3 s within a few per cent.
    assert 2.8 <= result.warning_time[0] <= 3.0 + 1.28 + 0.3


@pytest.mark.ci
def test_orthogonality():
    # A row of R shrinks by (h Om)^6 / 144 of itself in a step of rk4: 128 steps cross 1e-3 at the coarser step only.
    fleet = one(scene_of(**PLAIN), Om=[0.0, 0.0, 1.0])
    coarse, fine = (lw.solve(fleet, "rk4", h=h, t1=128 * h, checks="all") for h in (0.4, 0.1))
    R = coarse.attitude[-1, 0]
    assert coarse.warnings.counts() == {"orthogonality": 1}
    assert fine.warnings.counts() == {}
    np.testing.assert_allclose(coarse.warning_value[0], np.abs(R.T @ R - np.eye(3)).max(), rtol=1e-6)


def shrunk(z, steps):
    """|R R^T - I| of a turn of z a step about a fixed axis, by the polynomial of rk4 on the imaginary axis."""
    growth = abs(1.0 + 1j * z - z**2 / 2.0 - 1j * z**3 / 6.0 + z**4 / 24.0)
    return 1.0 - growth ** (2 * steps)


@pytest.mark.ci
@pytest.mark.parametrize("kept", [
    {}, {"keep": "none", "statistics": [lw.statistics.Mean("position")]}, {"keep": [1]},
    {"save": lw.SaveAt(every=12.8)},
])  # fmt: skip
def test_an_attitude_that_is_no_rotation_is_told_by_default(kept):
    # Of two members one turns fast; the drag acts on no turn.
    scene = scene_of(**PLAIN)
    scene = lw.Scene(scene.vehicle, scene.environment, terms=[lw.terms.Drag(linear=[1e-9] * 3 + [0.0] * 3)])
    h, steps = 0.4, 128
    fleet = one(scene, Om=[[0.0, 0.0, 0.5], [0.0, 0.0, 1.0]])
    result = lw.solve(fleet, "rk4", h=h, t1=steps * h, **kept)
    assert result.warnings.counts() == {"orthogonality": 1}
    assert warned(result, Warnings.ORTHOGONALITY) == [False, True]
    np.testing.assert_allclose(result.warning_value[1], shrunk(0.4, steps), rtol=1e-4)
    np.testing.assert_allclose(result.warning_time[1], steps * h)
    assert lw.solve(fleet, "rk4", h=h, t1=steps * h, checks="none", **kept).warnings.counts() == {}


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_an_attitude_that_was_no_rotation_on_the_way_is_told(dtype):
    # float32 runs put R back each 128 steps, so that it is a rotation at the end; samples before are none.
    h = 0.4
    result = lw.solve(
        one(scene_of(**PLAIN), Om=[0.0, 0.0, 1.0]), "rk4", h=h, t1=256 * h, dtype=dtype, save=lw.SaveAt(every=32 * h)
    )
    R = result.attitude[:, 0].astype(np.float64)
    departed = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    assert departed[3] > 5.0 * step_warnings.ORTHOGONAL_TO_ERROR
    assert dtype == "float64" or departed[[4, 8]].max() < 1e-4
    assert result.warnings.counts() == {"orthogonality": 1}
    # Seen at the first look, after 128 steps; float32 rounds by 6e-8 a step.
    assert result.warning_time[0] == pytest.approx(128 * h)
    assert result.warning_value[0] == pytest.approx(shrunk(0.4, 128), rel=1e-4 if dtype == "float64" else 1e-2)


@pytest.mark.ci
@pytest.mark.parametrize("checks", ["safe", pytest.param("all", marks=pytest.mark.slow)])
def test_an_attitude_of_a_member_that_stopped_is_told_of_where_it_stopped(tmp_path, checks):
    scene = scene_of(**PLAIN)
    scene = lw.Scene(scene.vehicle, scene.environment, events=[lw.events.StopTime(at=20.0)])
    fleet = one(scene, Om=[[0.0, 0.0, 1.0]] * 5)
    in_memory = lw.solve(fleet, "rk4", h=0.4, t1=80.0, checks=checks)
    stored = lw.solve(fleet, "rk4", h=0.4, t1=80.0, checks=checks, store=tmp_path / "run.zarr")
    for result in (in_memory, stored, lw.open_run(tmp_path / "run.zarr")):
        # 50 whole steps; the event ends the last one, which shrinks R by less than a whole one does.
        assert result.warnings.counts() == {"orthogonality": 5}
        assert shrunk(0.4, 49) < result.warning_value[0] <= shrunk(0.4, 50) * (1.0 + 1e-9)
        assert 19.5 < result.warning_time[0] <= 20.0


@pytest.mark.ci
@pytest.mark.parametrize("checks", ["safe", "all"])
@pytest.mark.parametrize("method", ["psi_x", pytest.param("psi_w", marks=pytest.mark.slow)])
def test_stiff_drag_of_splittings(method, checks):
    # h (l + 2 q|v|) / I of surge, M = 2; the speed is that through the water, whose current is a third of it.
    h, v, M, q = 0.1, 1.5, 2.0, 1.0
    scene = scene_of((M, M, M), (30.0, 30.0, 30.0))
    for part in BOTH:
        linear = part * step_warnings.SPLIT_DRAG_NUMBER * M / h - 2.0 * q * v
        laws = [terms.Drag(linear=[linear] * 6, quadratic=[q] * 6), lw.terms.Current(velocity=[0.5, 0.0, 0.0])]
        stiff = lw.Scene(scene.vehicle, scene.environment, terms=laws)
        result = lw.solve(one(stiff, nu=[v + 0.5, 0.0, 0.0]), method, h=h, t1=h, checks=checks)
        assert warned(result, Warnings.DRAG_STIFF) == [part > 1.0]
        if part > 1.0:
            value = part * step_warnings.SPLIT_DRAG_NUMBER
            assert (result.warning_time[0], result.warning_value[0]) == (0.0, pytest.approx(value))


def rates_of_a_body(M, J, linear):
    """y' of R row by row, nu and Om, with drag along the axes and no other force: Kirchhoff's equations."""

    def rates(t, y):
        R, nu, Om = y[:9].reshape(3, 3), y[9:12], y[12:]
        hat = np.array([[0.0, -Om[2], Om[1]], [Om[2], 0.0, -Om[0]], [-Om[1], Om[0], 0.0]])
        force = np.cross(M * nu, Om) - linear[:3] * nu
        torque = np.cross(J * Om, Om) + np.cross(M * nu, nu) - linear[3:] * Om
        return np.concatenate([(R @ hat).ravel(), force / M, torque / J])

    return rates


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", "psi_x", "psi_w"])
def test_a_splitting_loses_order_where_its_drag_is_called_stiff(method):
    M, J, nu, Om = np.array([32.0, 55.0, 60.0]), np.array([0.6, 2.4, 2.7]), [0.8, -0.6, 0.5], [0.4, -0.3, 0.6]
    h, orders = 0.1, {}
    for number in (2.0, 80.0):
        linear = number / h * np.array([0.9 * 32.0] * 3 + [0.6] + [0.0, 0.0])
        start = np.concatenate([np.eye(3).ravel(), nu, Om])
        truth = solve_ivp(rates_of_a_body(M, J, linear), (0.0, 2.0), start, "Radau", rtol=1e-10, atol=1e-12).y[:9, -1]
        body = lw.Vehicle(30.0, inertia=J, added_mass=M - 30.0, buoyancy=0.0)
        scene = lw.Scene(body, lw.Environment(gravity=0.0), terms=[lw.terms.Drag(linear=linear)])
        runs = [lw.solve(one(scene, nu=nu, Om=Om), method, h=step, t1=2.0) for step in (h, h / 2.0, h / 4.0)]
        assert [warned(run, Warnings.DRAG_STIFF) for run in runs] == [[number / n > 5.0] for n in (1, 2, 4)]
        errors = [np.abs(run.attitude[-1, 0].ravel() - truth).max() for run in runs]
        orders[number] = np.log2(np.divide(errors[:-1], errors[1:]))
    # Order 2, as it should be, and less than 1.5 in stiff drag.
    assert (np.abs(orders[2.0] - 2.0) < 0.25).all(), orders
    assert (orders[80.0] < 1.5).all(), orders


def test_inertia_that_no_rigid_body_has():
    J = np.array([[1.0, 2.0, 2.9], [1.0, 2.0, 3.1]])
    scene = scene_of(**PLAIN)
    fleet = lw.Ensemble.from_states(scene, *random_states(1, 2, 0.1, 0.1), {"vehicle.inertia": J})
    result = lw.solve(fleet, h=0.01, t1=0.01)
    assert warned(result, Warnings.INERTIA) == [False, True]
    assert result.warning_value[1] == pytest.approx(3.1 / 3.0)
    rigid = np.diag([10.0, 10.0, 10.0, 1.0, 2.0, 3.1])
    with pytest.raises(lw.SceneError, match="two of which sum to less than the third"):
        lw.Vehicle(rigid_body_mass_matrix=rigid)
    good = lw.Scene(lw.Vehicle(rigid_body_mass_matrix=np.diag([10.0, 10.0, 10.0, 1.0, 2.0, 2.9])))
    with pytest.raises(lw.SceneError, match=r"rigid_body_mass_matrix of member 1.*unphysical \(1 of 2"):
        lw.Ensemble.from_states(
            good, *random_states(1, 2), {"vehicle.rigid_body_mass_matrix": [good.vehicle.rigid_body_mass_matrix, rigid]}
        )
    added = np.diag([0.0, 0.0, 0.0, 0.0, 0.0, 0.2])
    assert lw.Vehicle(rigid_body_mass_matrix=rigid - added, added_mass_matrix=added).full


# Far too long a step: on a spring, beyond h w = 2, energy explodes and nothing else tells.
@pytest.fixture(scope="module")
def unstable():
    free = scene_of((30.0, 30.0, 31.0), **LAWS)
    # Of water that is nearly the same everywhere, so that the kernel is that of the test of the result's energy.
    laws = [terms.Tether(anchor=[0.0, 0.0, 0.0], stiffness=1.0), lw.terms.Stratification(gradient=1e-12)]
    scene = lw.Scene(free.vehicle, free.environment, terms=laws)
    b, R = np.array([[1.0, 0.0, 0.0]] * 2), np.broadcast_to(np.eye(3), (2, 3, 3))
    stiffness = 30.0 * np.array([0.5, 2.1]) ** 2
    return lw.Ensemble.from_states(scene, b, R, 0.0 * b, 0.0 * b, {"tether.stiffness": stiffness})


@pytest.mark.ci
@pytest.mark.slow_for("float32*")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_energy_that_explodes_is_a_failure(unstable, dtype):
    result = lw.solve(unstable, "psi_s", h=1.0, t1=3000.0, save=lw.SaveAt(every=4.0), dtype=dtype)
    assert list(result.status) == [Status.OK, Status.ENERGY_GREW]
    assert result.failure_value[1] > 100.0
    # Frozen at the last good state: its energy is below the limit, and samples stay from there on.
    k = int(np.searchsorted(result.time, result.failure_time[1]))
    created = (result.energy[:, 1] - result.energy[0, 1]) / result.energy[0, 1]
    assert 0.5 < created[k:].max() <= 100.0
    assert np.ptp(created[k:]) < 1e-5
    alone = lw.solve(unstable.subset([0]), "psi_s", h=1.0, t1=3000.0, save=lw.SaveAt(every=4.0), dtype=dtype)
    for name in ("position", "attitude", "velocity", "angular_velocity"):
        assert getattr(alone, name)[:, 0].tobytes() == getattr(result, name)[:, 0].tobytes()


@pytest.mark.ci
def test_energy_is_warned_of_before(unstable):
    result = lw.solve(unstable, "psi_s", h=1.0, t1=128.0, checks="all")
    assert warned(result, Warnings.ENERGY) == [False, result.status[1] == Status.OK]
    assert result.warnings.worst()[0] <= Warnings.MUNK_COARSE * 4


@pytest.mark.slow
def test_energy_of_healthy_scenes_is_quiet():
    # Falls from rest with and without a spring, a swing, drag: no look may take exchange for creation.
    vehicle = scene_of((1.0, 2.0, 3.0), (1.0, 2.0, 2.5), net=0.5, moment=(0.0, 0.0, -0.3))
    R = lw.notation.matrix_from_rotation_vector(np.array([0.5, 0.2, 0.0]))
    tether = terms.Tether(anchor=[0.0, 0.0, 0.0], stiffness=0.2, rest_length=1.0)
    for laws in ([], [tether], [terms.Drag(linear=[0.1] * 6)], [terms.Current(velocity=[0.3, 0.0, 0.0])]):
        scene = lw.Scene(vehicle.vehicle, vehicle.environment, terms=laws)
        for dtype in ("float64", "float32"):
            result = lw.solve(one(scene, R=R), "psi_s", h=0.05, t1=50.0, dtype=dtype, checks="all")
            assert result.status.counts() == {"ok": 1}
            assert not warned(result, Warnings.ENERGY)[0]
            assert not warned(result, Warnings.ORTHOGONALITY)[0]


@pytest.mark.ci
def test_a_swing_from_rest_is_no_failure():
    # Nothing moves at the start, and Phi's energy swings by more than what was put in: bounded, and told of.
    scene = scene_of((2.0, 2.0, 2.0), (1.0, 1.0, 1.0), moment=(0.0, 0.0, -(1.3**2)))
    R = lw.notation.matrix_from_rotation_vector(np.array([0.3, 0.0, 0.0]))
    for every in (1.0, 500.0):
        result = lw.solve(one(scene, R=R), "phi", h=1.0, t1=500.0, save=lw.SaveAt(every=every), checks="all")
        assert result.status.counts() == {"ok": 1}
        assert np.abs(result.angular_velocity[-1]).max() < 1.0


@pytest.mark.ci
@pytest.mark.slow_for("psi_x", "rk4*")
@pytest.mark.parametrize("method", ["psi_s", "psi_x", "rk4"])
def test_energy_is_that_of_the_result(method, monkeypatch):
    # Kernel against host: with a limit that round-off alone crosses, the value noted is that of the samples.
    monkeypatch.setattr(step_warnings, "ENERGY", 1e-12)
    base = scene_of((1.0, 2.0, 3.0), (1.0, 2.0, 2.5), net=0.5, moment=(0.1, 0.0, -0.3))
    laws = [terms.Tether(anchor=[0.0, 0.0, 0.5], stiffness=0.4, rest_length=0.7, attachment=[0.1, 0.0, 0.05]),
            lw.terms.Stratification(gradient=0.2, reference_depth=0.3)]  # fmt: skip
    scene = lw.Scene(base.vehicle, base.environment, terms=laws)
    h = 0.1
    fleet = one(scene, *random_states(11, 6, 0.4, 0.4))
    result = lw.solve(fleet, method, h=h, t1=10 * 128 * h, save=lw.SaveAt(every=128 * h), checks="all")
    M, J = np.diag(scene.vehicle.mass_matrix), np.diag(scene.vehicle.inertia)
    T = 0.5 * ((M * result.velocity**2).sum(-1) + (J * result.angular_velocity**2).sum(-1))
    U = result.energy - T
    # To exchange: T, the springs' and the restoring moment's energy above their least, and what weight gives in the time.
    net, moment = 0.5, np.linalg.norm([0.1, 0.0, -0.3])
    supply = T[0] + U[0] + net * result.position[0, :, 2] + moment
    created = (result.energy - result.energy[0]) / (supply + 0.5 * (1.0 / M).sum() * (net * result.time[:, None]) ** 2)
    crossed = (created > 1e-9).argmax(axis=0)
    seen = result.warnings.has(Warnings.ENERGY) & (created > 1e-9).any(axis=0)
    assert seen.sum() >= 3
    # Of a member that rises above the surface, too, the time is that of the more serious warning.
    alone = seen & ~result.warnings.has(Warnings.ABOVE_SURFACE)
    assert alone.sum() > 1
    np.testing.assert_allclose(result.warning_time[alone], result.time[crossed[alone]], rtol=1e-12)
    np.testing.assert_allclose(result.warning_value[alone], created[crossed[alone], alone.nonzero()[0]], rtol=1e-5)


@pytest.mark.slow
def test_energy_where_the_forces_have_another_origin(monkeypatch):
    # psi_x keeps a coupled vehicle about one point and its forces act about another: U is that of the forces.
    monkeypatch.setattr(step_warnings, "ENERGY", 1e-12)
    named = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.5})
    scene = lw.Scene(named.vehicle, named.environment)
    fleet = one(scene, *random_states(5, 16, 0.5, 0.5))
    plan = make_plan(fleet, "psi_x", h=0.02, t1=1.0)
    frame, _, _ = frame_of(plan.method, fleet.parameters(0, 1))
    assert np.any(frame.origin != frame.forces)
    assert "origin" in plan.spec.parts
    result = lw.solve(fleet, "psi_x", h=0.02, t1=128 * 0.02, checks="all")
    nu = np.concatenate([result.velocity, result.angular_velocity], axis=-1)
    I6 = scene.vehicle.rigid_body_mass_matrix + scene.vehicle.added_mass_matrix
    T = 0.5 * np.einsum("kni,ij,knj->kn", nu, I6, nu)
    E = result.energy
    p = result.parameters
    net = hydrostatics.net(p)[0]
    moment = (hydrostatics.moment(p) + net * frame.forces)[0]
    supply = T[0] + result.attitude[0, :, 2] @ moment + np.linalg.norm(moment)
    weight = 0.5 * np.trace(np.linalg.inv(frame.M[0])) * (net * result.time[1]) ** 2
    created = (E[1] - E[0]) / (supply + weight)
    grew = created > 1e-9
    np.testing.assert_array_equal(result.warnings.has(Warnings.ENERGY), grew)
    assert 3 < grew.sum() < 16
    np.testing.assert_allclose(result.warning_value[grew], created[grew], rtol=1e-5)


@pytest.mark.parametrize(("laws", "conservative"), [
    ([], True), ([terms.Drag(linear=[0.1] * 6)], True), ([terms.Wrench(force=[1.0, 0.0, 0.0])], False),
    ([terms.Current(velocity=[1.0, 0.0, 0.0])], True), ([terms.Current(velocity=[1.0, 0.0, 0.1])], False),
    ([terms.Current(velocity=[1.0, 0.0, 0.0]), terms.Tether(anchor=[0.0] * 3, stiffness=1.0)], False),
    ([terms.BodyLift(matrix=np.eye(6))], False), ([lw.terms.Stratification(gradient=0.01)], True),
])  # fmt: skip
def test_energy_is_watched_where_no_force_creates_any(laws, conservative):
    base = scene_of((2.0, 2.0, 2.0))
    plan = make_plan(one(lw.Scene(base.vehicle, base.environment, terms=laws)), h=0.01, t1=0.1)
    assert plan.spec.energy == conservative


@pytest.mark.slow
def test_drag_that_arises_in_backward_stages():
    # From rest, so that nothing is refused; thrust then drives it to where the stages that go back lose their meaning.
    base = scene_of((2.0, 2.0, 2.0), (1.0, 2.0, 2.5))
    law = terms.Drag(quadratic=[2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    scene = lw.Scene(base.vehicle, base.environment, terms=[law, terms.Wrench(force=[40.0, 0.0, 0.0])])
    back = 0.70624617255763935981
    h = 0.4
    result = lw.solve(one(scene), "kl6(psi_s)", h=h, t1=10.0, save=lw.SaveAt(every=h))
    assert list(result.status) == [Status.BACKWARD_DRAG]
    speed = np.abs(result.velocity[:, 0, 0]).max()
    assert back * h * 2.0 * speed / 2.0 <= 0.5 < result.failure_value[0]
    plain = lw.solve(one(scene), "psi_s", h=h, t1=10.0)
    assert plain.status.counts() == {"ok": 1}


@pytest.mark.ci
def test_a_neighbour_that_warns_or_fails_changes_no_bit():
    scene = scene_of(**MUNK | {"net": 0.3})
    b, R, nu, Om = random_states(4, 8, 0.3, 0.3)
    quiet = lw.solve(one(scene, b, R, nu, Om), "psi_s", h=0.1, t1=30.0, checks="all")
    nu[3] *= 300.0
    Om[5] *= 300.0
    loud = lw.solve(one(scene, b, R, nu, Om), "psi_s", h=0.1, t1=30.0, checks="all")
    assert loud.status[5] != 0
    assert loud.warnings[3] != 0
    well = [0, 1, 2, 4, 6, 7]
    for name in ("position", "attitude", "velocity", "angular_velocity"):
        assert getattr(quiet, name)[:, well].tobytes() == getattr(loud, name)[:, well].tobytes()
    for name in ("warnings", "warning_time", "warning_value", "status"):
        np.testing.assert_array_equal(getattr(quiet, name)[well], getattr(loud, name)[well])


@pytest.mark.ci
def test_warnings_do_not_depend_on_what_is_kept():
    scene = scene_of(**MUNK | {"net": 2.0})
    runs = [
        lw.solve(one(scene), "psi_s", h=0.02, t1=20.0, save=lw.SaveAt(every=every), checks="all")
        for every in (0.1, 20.0)
    ]
    assert runs[0].warning_time[0] == runs[1].warning_time[0]
    assert runs[0].warnings[0] == runs[1].warnings[0] != 0


@pytest.mark.ci
def test_checks_none_warns_of_nothing():
    scene = scene_of(**MUNK)
    result = lw.solve(one(scene, nu=[0.0, 0.0, 1e3]), h=0.1, t1=0.1, checks="none")
    assert result.warnings.counts() == {}
    assert np.isnan(result.warning_time).all()


def test_every_warning_says_what_to_do():
    for one_of in Warnings:
        assert len(one_of.text) > 40
        assert one_of.value_name
    both = Warnings.ENERGY | Warnings.INERTIA
    assert both.text.count(";") >= 2
    assert both.value_name == Warnings.ENERGY.value_name


def test_bits_and_codes_are_those_of_the_kernel():
    from lgvi_kernels.advance import monitor

    names = {"precision": "PRECISION_LOSS", "drag": "DRAG_STIFF"}
    for row, bit in monitor.BITS.items():
        assert Warnings[names.get(row, row.upper())] == 1 << bit
    assert (monitor.ENERGY_GREW, monitor.BACKWARD_DRAG) == (Status.ENERGY_GREW, Status.BACKWARD_DRAG)


def test_every_method_has_its_limits():
    from lgvi_warp.methods.method import COMPOSITIONS, GAUSS, HALVES, PROGRAMS, RUNGE_KUTTA, TWO_PART

    composed = [f"{name}({base})" for name in COMPOSITIONS | HALVES for base in ("psi_s", "psi_x", "psi_1", "psi")]
    for name in (*PROGRAMS, *RUNGE_KUTTA, *TWO_PART, *GAUSS, *composed):
        try:
            method = Method(name)
        except lw.SceneError:
            continue
        for table in (limits.MUNK, limits.RESTORING):
            assert limits.oscillation_limit(method, table) > COARSE / limits.longest_stage(method)


def test_a_result_keeps_its_warnings(tmp_path):
    scene = scene_of(**MUNK)
    result = lw.solve(one(scene, nu=[[0.0, 0.0, 1e3], [0.0, 0.0, 0.0]]), h=0.1, t1=0.1)
    again = lw.Result.load(result.save(tmp_path / "result.npz"))
    assert again.warnings.counts() == result.warnings.counts() != {}
    for name in ("warnings", "warning_time", "warning_value", "substeps", "status", "failure_time"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))


FORM = lw.terms.QuadraticForm(products=["X_u|u|", "Z_uw", "M_uq"], values=[-500.0, -20.0, -10.0])


@pytest.mark.ci
@pytest.mark.parametrize(("term", "axis"), [(FORM, 0), (lw.terms.Polar(drag_by_attack=60.0), 2)])
def test_stiff_drag_is_warned_of_where_it_does_not_grow_with_sizes_and_speeds(term, axis):
    """A form brakes where its coefficients are negative; a glider's polar less at an angle of attack than across the flow."""
    scene = lw.Scene(lw.Vehicle(mass=10.0, inertia=[1.0, 2.0, 2.5]), terms=[term])
    run = lw.prepare(scene, [f"start.velocity[{axis}]"], method="psi_x", h=0.1, t1=0.1)
    for speeds in ([2.0], [0.01] * 299 + [2.0]):
        for _ in range(2):  # few members are packed by the kernel, on which bounds rest, from the second time on
            stiff = run(np.array(speeds)[:, None]).warnings & np.uint16(Warnings.DRAG_STIFF) > 0
            np.testing.assert_array_equal(stiff, np.array(speeds) == 2.0)


def test_a_motion_that_diverges_into_an_event():
    # h c / m = 6 and more, far beyond rk4's 2.79: within a few steps members are so fast that they are past the floor. A scene
    # that is pushed has no energy to look at.
    scene = lw.Scene(
        lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0), added_mass=(5.0, 15.0, 10.0), buoyancy=98.0),
        terms=[lw.terms.Drag(linear=(600.0, 600.0, 600.0, 1.0, 1.0, 1.0)), lw.terms.Wrench(force=(0.0, 0.0, 1.0))],
        events=[lw.events.Floor(depth=10.0), lw.events.Surface()], start=lw.Start(position=(0.0, 0.0, 5.0)),
    )  # fmt: skip
    fleet = lw.Ensemble(scene, 40, 3, {"start.velocity": lw.distributions.Uniform(low=-0.5, high=0.5)})
    floor = lw.statistics.Outcome("floor")
    at_once = {"method": "rk4", "h": 0.25, "t1": 10.0}
    *_, kept = lw.solve(fleet, **at_once, save=lw.SaveAt(every=0.25)).messages
    assert "m/s on the way is beyond 30 m/s" in kept
    for how in ({}, {"statistics": [floor]}, {"statistics": [floor], "executor": "processes", "threads": 2}):
        *_, text = lw.solve(fleet, **at_once, keep="none", **how).messages
        assert "m/s or more at the end is beyond 30 m/s" in text
        assert text.partition(" (")[2] == kept.partition(" (")[2]
    assert not lw.solve(fleet, "rk4", h=0.01, t1=1.0, keep="none").messages
