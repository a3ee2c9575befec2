# SPDX-License-Identifier: Apache-2.0
"""Only what a scene has is compiled; a second solve builds nothing; memory follows the samples kept."""

import dataclasses
import pickle
from itertools import combinations

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels.advance.kernel import make_advance
from lgvi_kernels.laws import restoring, weight
from lgvi_warp.engine.arrays import put_rows
from lgvi_warp.engine.block import blocks, parts, shares
from lgvi_warp.engine.launches import SEGMENT_SAMPLE_BYTES
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.survey import shape_of_mass
from lgvi_warp.methods.method import Method
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.runs.settle import make_plan
from tests.support.refusals import says
from tests.support.tools import TURN, generated, one, scene_of


def plan_of(scene, **named):
    return make_plan(one(scene), h=0.01, t1=1.0, **named)


def test_an_absent_term_is_no_code(tmp_path):
    both = generated(plan_of(scene_of(net=1.0, moment=(0.0, 0.0, 1.0))), tmp_path / "both")
    weight = generated(plan_of(scene_of(net=1.0)), tmp_path / "weight")
    none = generated(plan_of(scene_of()), tmp_path / "none")
    says(both, "Weight", "Restoring")
    assert "Weight" in weight
    assert "Restoring" not in weight
    assert "Weight" not in none
    assert "Restoring" not in none


def test_terms_are_those_of_the_scene():
    assert plan_of(scene_of()).spec.laws == ()
    assert plan_of(scene_of(net=1.0)).spec.laws == (weight,)
    assert plan_of(scene_of(moment=(0.0, 0.0, 1.0))).spec.laws == (restoring,)
    assert plan_of(scene_of(net=1.0, moment=(0.0, 0.0, 1.0))).spec.laws == (weight, restoring)


def test_an_absent_term_is_no_parameter():
    def names(struct):
        return set(struct.numpy_dtype()["names"])

    assert names(plan_of(scene_of()).kernel.advance.types.Params) == {"unused"}
    params = plan_of(scene_of(net=1.0)).kernel.advance.types.Params
    assert np.zeros(1, params.numpy_dtype())["own"].dtype.names == ("net",)


def test_munk_moment_only_for_anisotropic_mass():
    isotropic, diagonal = plan_of(scene_of((2.0, 2.0, 2.0), net=1.0)), plan_of(scene_of((1.0, 2.0, 3.0)))
    assert isotropic.spec.mass == "isotropic"
    assert "anisotropy" not in isotropic.kernel.advance.types.Inertia.numpy_dtype()["names"]
    assert {letter for letter, _ in (*isotropic.spec.maps, isotropic.spec.lead)} == {"Ab", "D", "K"}
    assert (diagonal.spec.mass, diagonal.spec.lead) == ("diagonal", ("T", 0.5))
    assert plan_of(scene_of(TURN @ np.diag((1.0, 2.0, 3.0)) @ TURN.T)).spec.mass == "full"


def test_shape_of_mass():
    assert shape_of_mass(np.eye(3)[None]) == "isotropic"
    assert shape_of_mass(np.stack([np.eye(3), np.diag([1.0, 1.0, 2.0])])) == "diagonal"
    assert shape_of_mass((np.eye(3) + 0.1)[None]) == "full"


@pytest.mark.ci
def test_a_second_solve_builds_no_kernel():
    scene = scene_of(net=1.0)
    lw.solve(one(scene), h=0.01, t1=0.1)
    before = make_advance.cache_info().misses
    lw.solve(one(scene_of((1.0, 2.0, 4.0), net=3.0), nu=[1.0, 0.0, 0.0]), h=0.02, t1=0.2)
    assert make_advance.cache_info().misses == before


@pytest.mark.ci
@pytest.mark.parametrize("names", [("su4(psi_s)", "kl6(psi_s)", "su8_15(psi_s)"), ("bm4(psi_x)", "bm6(psi_x)")])
def test_compositions_of_a_method_share_its_kernel(names):
    """Their coefficients are numbers that the kernel gets, unless a law asks for the time within a step."""
    plain, held = scene_of(net=1.0), lw.terms.Wrench(force=[1.0, 0.0, 0.0])
    schedule = lw.terms.WrenchSchedule(times=(0.0, 1.0), force=((0.0,) * 3, (1.0,) * 3), torque=((0.0,) * 3,) * 2)
    for terms, kernels in (([], 1), ([held], 1), ([schedule], len(names))):
        scene = lw.Scene(plain.vehicle, plain.environment, terms)
        plans = [make_plan(one(scene), name, h=0.01, t1=1.0) for name in names]
        assert len({plan.kernel.hash for plan in plans}) == kernels


def test_varying_a_parameter_compiles_nothing_else(scene):
    shared = make_plan(lw.Ensemble(scene, 16), h=0.01, t1=1.0)
    varied = make_plan(
        lw.Ensemble(scene, 16, vary={"vehicle.mass": lw.distributions.Normal(relative=0.01)}), h=0.01, t1=1.0
    )
    assert shared.spec == varied.spec
    assert shared.kernel.advance is varied.kernel.advance


@pytest.mark.ci
def test_varied_parameters_act_on_their_member():
    # A free fall in vacuum: v = net t / M, member by member.
    scene = scene_of((2.0, 2.0, 2.0), net=1.0)
    n = 11
    buoyancy = scene.vehicle.buoyancy * np.linspace(0.5, 1.5, n)
    states = [np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 3))]
    fleet = lw.Ensemble.from_states(scene, *states, {"vehicle.buoyancy": buoyancy})
    result = lw.solve(fleet, h=0.01, t1=1.0)
    net = scene.vehicle.mass * 9.8 - buoyancy
    np.testing.assert_allclose(result.velocity[-1, :, 2], net / 2.0, rtol=1e-12)


def test_pack_fills_up_with_the_last_member():
    rows, packed = np.arange(10.0).reshape(5, 2), np.full((2, 2, 4), np.nan)
    put_rows(packed, rows)
    np.testing.assert_array_equal(packed[0], rows[:4].T)
    np.testing.assert_array_equal(packed[1], [[8.0] * 4, [9.0] * 4])
    put_rows(packed, rows[:1])
    np.testing.assert_array_equal(packed, np.broadcast_to(rows[0][:, None], (2, 2, 4)))


@pytest.mark.parametrize("threads", [1, 2, 7, 64])
@pytest.mark.parametrize("steps", [1, 300, 10**6])
@pytest.mark.parametrize("n", [1, 256, 257, 5000, 1_000_000])
def test_shares_keep_all_threads_at_work(n, steps, threads):
    size = shares(n, threads, steps)
    runs = parts(n, steps, threads, apart=False)
    assert size % 256 == 0
    assert 256 <= size <= 16_384
    assert {run.count for run in runs[:-1]} <= {size}
    assert (runs[0].first, runs[-1].stop) == (0, n)
    # Blocks of 256 are the smallest; else a block is a few million steps of vehicles, or a quarter of a thread's members.
    assert size == 256 or (size - 256) * steps < 4_000_000
    assert threads == 1 or size == 256 or len(runs) >= 4 * threads * (1 - 256 / size)
    assert parts(n, steps, threads, apart=True) == blocks(n)


def test_segments_are_contiguous_and_their_buffer_is_bounded(scene):
    plan = make_plan(lw.Ensemble(scene, 4096), h=0.01, t1=1000.0, save=lw.SaveAt(every=0.01))
    segments = list(plan.launches.segments(4096))
    samples = [plan.launches.samples_due(k0, k1) for k0, k1 in segments]
    assert (segments[0][0], segments[-1][1]) == (0, plan.grid.steps)
    assert samples[-1][1] == len(plan.grid.times)
    assert all(a[1] == b[0] for runs in (segments, samples) for a, b in zip(runs, runs[1:], strict=False))
    assert max(s1 - s0 for s0, s1 in samples) * 4096 * 18 * 8 <= SEGMENT_SAMPLE_BYTES


def test_segments_change_no_bit(scene, monkeypatch):
    fleet = lw.Ensemble(scene, 16, vary={"start.angular_velocity": lw.distributions.Normal(std=0.1)})
    whole = lw.solve(fleet, h=0.01, t1=2.0, save=lw.SaveAt(every=0.5))
    monkeypatch.setattr("lgvi_warp.engine.launches.SEGMENT_VEHICLE_STEPS", 16 * 48)
    monkeypatch.setattr("lgvi_warp.engine.launches.SEGMENT_SAMPLE_BYTES", 1)
    pieces = lw.solve(fleet, h=0.01, t1=2.0, save=lw.SaveAt(every=0.5))
    assert whole.position.tobytes() == pieces.position.tobytes()


def test_any_choice_of_fields_takes_the_same_kernel_and_its_own_memory(scene):
    fleet, sizes = lw.Ensemble(scene, 4), {"position": 3, "attitude": 9, "velocity": 3, "angular_velocity": 3}
    full = lw.solve(fleet, h=0.01, t1=0.1, save=lw.SaveAt(every=0.05))
    for count in range(1, len(FIELDS) + 1):
        for fields in combinations(FIELDS, count):
            save = lw.SaveAt(fields=fields, every=0.05)
            plan = make_plan(fleet, h=0.01, t1=0.1, save=save)
            assert plan.kernel.advance is make_plan(fleet, h=0.01, t1=0.1).kernel.advance
            raw = Packets(plan, fleet.select(0, 4)).launch(0, 10)
            assert raw.shape == (1, 2, sum(sizes[name] for name in fields), plan.spec.width)
            result = lw.solve(fleet, h=0.01, t1=0.1, save=save)
            assert list(result.samples) == list(fields)
            assert all(values.tobytes() == full.samples[name].tobytes() for name, values in result.samples.items())
    with pytest.raises(AttributeError, match="SaveAt"):
        _ = lw.solve(fleet, h=0.01, t1=0.1, save=lw.SaveAt(fields=("velocity",))).position


@pytest.mark.ci
def test_progress_reaches_one(scene):
    seen = []
    lw.solve(lw.Ensemble(scene, 300), h=0.01, t1=0.5, threads=1, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


@pytest.mark.parametrize(("named", "text"), [
    ({"dtype": "float16"}, "dtype"), ({"width": 3}, "width"), ({"checks": "some"}, "checks"), ({"method": "psy_s"}, "psi_s"),
    ({"h": -0.1}, "h = -0.1"), ({"t1": 0.0}, "t1 = 0.0"), ({"threads": 0}, "threads"), ({"method": "kl6(phi)"}, "symmetric"),
    ({"h": float("nan")}, "h = nan"), ({"save": lw.SaveAt(every=20.0)}, "save.every"),
    ({"save": lw.SaveAt(at=[2.0])}, "beyond"),
])  # fmt: skip
def test_settings_are_refused(scene, named, text):
    with pytest.raises(lw.SceneError, match=text):
        lw.solve(lw.Ensemble(scene), **({"h": 0.01, "t1": 1.0} | named))


@pytest.mark.ci
@pytest.mark.parametrize("threads", [1, 3])
def test_an_exception_on_the_way_stops_the_run(scene, threads):
    seen = []

    def interrupt(fraction):
        seen.append(fraction)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lw.solve(lw.Ensemble(scene, 5000), h=0.01, t1=0.1, threads=threads, progress=interrupt)
    # Each thread meets it at most once and takes up no further block; 20 blocks are there.
    assert len(seen) <= 2 * threads


@pytest.mark.ci
def test_solve_prints_nothing(scene, capfd):
    lw.solve(lw.Ensemble(scene, 3), h=0.013, t1=0.1)
    lw.solve(scene_of(), h=0.01, t1=0.1)
    assert capfd.readouterr() == ("", "")


def test_method_is_data():
    settings = {"solver": "quartic", "iterations": None, "tolerance": None, "alpha": 0.5, "beta": 0.5}
    settings |= {"rtol": None, "atol": None, "reason": ""}
    assert dataclasses.asdict(Method()) == {"name": "psi_s"} | settings
    assert Method("kl8(psi_1)").order == 8
    assert len(Method("kl8(psi_1)").stages) == 17
    for name in ("tj4", "su4", "kl6", "kl8"):
        stages = Method(f"{name}(psi_s)").stages
        assert sum(stages) == pytest.approx(1.0, abs=1e-14)
        assert stages == stages[::-1]


@pytest.mark.ci
@pytest.mark.slow_for("cayley*")
@pytest.mark.parametrize(("solver", "h", "n"), [("quartic", 1e-4, 0), ("quartic", 0.01, 1), ("cayley", 0.1, 2)])
def test_as_many_newton_steps_as_the_start_needs(scene, solver, h, n):
    fleet = lw.Ensemble(scene, 20, 1, {"start.angular_velocity": lw.distributions.Normal(relative=0.1)})
    chosen = lw.solve(fleet, lw.Method("psi_s", solver, "auto"), h=h, t1=10 * h, save=lw.SaveAt())
    assert chosen.provenance["method"]["iterations"] == n
    assert str(n) in chosen.messages[0]
    assert chosen.status.counts() == {"ok": 20}
    # Each of 20 solves leaves a residual below 1e-12 of a turn of h |Omega| / 2 < 0.02 rad.
    exact = lw.solve(fleet, lw.Method("psi_s", solver), h=h, t1=10 * h, save=lw.SaveAt())
    np.testing.assert_allclose(chosen.attitude, exact.attitude, rtol=0, atol=20 * 1e-12)


@pytest.mark.slow
def test_a_member_that_spins_up_is_told():
    # At rest no Newton step is needed; 2 rad/s later, at h = 0.1 s, one would be.
    body = lw.Vehicle(20.0, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=0.0)
    resting = lw.Scene(body, lw.Environment(gravity=0.0), [lw.terms.Wrench(torque=(1.5, 3.0, 4.0))])
    result = lw.solve(resting, lw.Method("psi_s", iterations="auto"), h=0.1, t1=5.0)
    assert result.status.counts() == {"not_converged": 1}
    assert 0.0 < result.failure_time[0] < 5.0


def test_a_plan_from_another_process_has_the_same_kernel():
    plan = plan_of(scene_of(net=1.0), dtype="float32", checks="all")
    again = pickle.loads(pickle.dumps(plan))
    assert (again.spec, again.width_source) == (plan.spec, plan.width_source)
    assert (again.fields, again.checks, again.surveyed_all) == (plan.fields, plan.checks, plan.surveyed_all)
