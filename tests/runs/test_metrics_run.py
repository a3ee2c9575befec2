# SPDX-License-Identifier: Apache-2.0
"""Metrics in whole runs: those of the twin on kept paths, at all ticks whatever is kept, in stores, of members that end."""

import gc
from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import stop_time
from lgvi_warp.engine import launches, work
from lgvi_warp.engine.keepers.observation import Observation
from lgvi_warp.engine.packets import Packets
from lgvi_warp.reference import metrics as twin
from lgvi_warp.runs.settle import make_plan
from tests.conftest import ROOT

pytestmark = pytest.mark.kernel

FIELDS = ("position", "attitude", "velocity", "angular_velocity", "command", "actuator", "demand", "unmet", "exerted")
FIELDS += tuple(f"reference_{name}" for name in ("depth", "heading", "speed", "position", "velocity", "attitude"))
FIELDS += tuple(f"measured_{name}" for name in ("depth", "water_velocity"))
T1, TICK = 12.0, 0.1
BOTH = ("depth", "heading")
COARSE = {"t1": T1, "save": lw.SaveAt(every=4.0)}


def deepest(state, tick):
    depth = tick["position"][:, 2]
    return depth if state is None else np.maximum(state, depth)


def metrics():
    each = {"then": [lw.statistics.Mean(), lw.statistics.MemberValues()]}
    return [
        *(kind(of, **each) for of in BOTH for kind in (lw.metrics.Overshoot, lw.metrics.Undershoot, lw.metrics.Peak,
                                                       lw.metrics.PeakTime, lw.metrics.RiseTime)),
        lw.metrics.SettlingTime("heading", within=0.2, **each), lw.metrics.SettlingTime("depth", **each),
        lw.metrics.SteadyStateError("depth", **each),
        *(kind(of, **each) for of in BOTH for kind in (lw.metrics.IAE, lw.metrics.ISE, lw.metrics.ITAE,
                                                       lw.metrics.RMSError, lw.metrics.MaxError)),
        lw.metrics.IAE("depth", measured=True, name="measured", **each), lw.metrics.MaxError("speed", **each),
        lw.metrics.MaxError("position", **each),
        lw.metrics.MaxError("attitude", **each), lw.metrics.CrossTrack(**each), lw.metrics.Effort(**each),
        lw.metrics.Effort("command[1]", **each),
        lw.metrics.Travel(**each), lw.metrics.SaturationShare(**each), lw.metrics.ActuatorEnergy(**each),
        lw.metrics.TimeToFailure(),
        lw.metrics.CustomMetric(deepest, fields=("position",), **each),
    ]  # fmt: skip


@pytest.fixture(scope="module")
def fleet():
    """300 vehicles in two blocks, of which some come to the floor: an event stops them."""
    path = ROOT / "examples" / "scenes" / "remus_100_autopilot.toml"
    scene = lw.Scene.load(path, {"start.position": [0.0, 0.0, 3.0], "run.save_every": 4.0})
    # All that metrics are of is wanted: a place and a speed too, which no law of this loop follows.
    wishes = [lw.control.SetPoint(position=[20.0, 5.0, 10.0], heading=0.5, speed=1.5), *scene.controller.guidance[1:]]
    scene = replace(scene, events=[lw.events.Floor(depth=8.5)], controller=replace(scene.controller, guidance=wishes))
    vary = {
        "vehicle.buoyancy": lw.distributions.Uniform(low=297.0, high=310.0),
        "start.position[2]": lw.distributions.Uniform(low=7.8, high=8.45),
    }
    return lw.Ensemble(scene, 300, seed=1, vary=vary | {"heading_pid.kp": lw.distributions.Uniform(low=0.7, high=60.0)})


@pytest.fixture(scope="module")
def coarse(fleet):
    return lw.solve(fleet, **COARSE, statistics=metrics())


@pytest.fixture(scope="module")
def paths(fleet):
    return lw.solve(fleet, t1=T1, save=lw.SaveAt(every=TICK, fields=FIELDS), statistics=metrics())


def by_twin(paths, limit):
    """The number of each metric and member, from the kept paths."""
    s, time = paths.samples, paths.time
    goals = {"depth": 10.0, "heading": 0.5}
    heading = np.arctan2(s["attitude"][..., 1, 0], s["attitude"][..., 0, 0])
    y = {"depth": s["position"][..., 2], "heading": heading}
    wrap = lambda a: (a + np.pi) % (2.0 * np.pi) - np.pi  # noqa: E731
    away = s["reference_position"] - s["position"]
    v = s["reference_velocity"][..., :2]
    pace = np.linalg.norm(v, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        aside = np.abs(away[..., 1] * v[..., 0] - away[..., 0] * v[..., 1]) / pace
    cross = np.where(pace > 0.0, aside, np.linalg.norm(away[..., :2], axis=-1))
    between = np.einsum("knji,knjl->knil", s["reference_attitude"], s["attitude"])
    angle = np.arccos(np.clip((np.trace(between, axis1=2, axis2=3) - 1.0) / 2.0, -1.0, 1.0))
    errors = {of: wrap(s[f"reference_{of}"] - y[of]) for of in y}
    expected, ends = {}, stop_time(paths)
    for m in range(paths.members):
        end = ends[m]
        k = int(np.sum(time <= end * (1.0 + 1e-12)))
        t, numbers = time[:k], {}
        for of, goal in goals.items():
            for kind in (twin.overshoot, twin.undershoot, twin.peak, twin.peak_time, twin.rise_time):
                numbers[f"{kind.__name__} {of}"] = kind(t, y[of][:k, m], goal)
            for kind in (twin.iae, twin.ise, twin.itae, twin.rms, twin.max_error):
                numbers[f"{kind.__name__} {of}"] = kind(t, errors[of][:k, m])
        step = abs(10.0 - y["depth"][0, m])
        numbers["settling_time depth"] = twin.settling_time(t, y["depth"][:k, m], 10.0, 0.02 * step)
        numbers["settling_time heading"] = twin.settling_time(t, heading[:k, m], 0.5, 0.2)
        numbers["steady_state_error depth"] = twin.steady_state_error(t, errors["depth"][:k, m], T1)
        numbers["measured"] = twin.iae(t, (s["reference_depth"] - s["measured_depth"])[:k, m])
        numbers["max_error speed"] = twin.max_error(
            t, (s["reference_speed"] - s["measured_water_velocity"][..., 0])[:k, m]
        )
        numbers["max_error position"] = twin.max_error(t, np.linalg.norm(away, axis=-1)[:k, m])
        numbers["max_error attitude"] = twin.max_error(t, angle[:k, m])
        numbers["cross_track"] = twin.max_error(t, cross[:k, m])
        numbers["effort"] = twin.effort(t, s["command"][:k, m])
        numbers["effort command[1]"] = twin.effort(t, s["command"][:k, m, 1:2])
        numbers["travel"] = twin.travel(t, s["actuator"][:k, m])
        numbers["saturation_share"] = twin.saturation_share(t, s["command"][:k, m], limit)
        numbers["energy"] = twin.energy(t, s["exerted"][:k, m], s["velocity"][:k, m], s["angular_velocity"][:k, m])
        numbers["time_to_failure"] = end
        numbers["deepest"] = np.max(y["depth"][:k, m])
        for name, value in numbers.items():
            expected.setdefault(name, []).append(value)
    return expected


@pytest.mark.ci
def test_metrics_are_the_twins(fleet, paths):
    limit = next(term.limit for term in fleet.scene.terms if term.key == "control_fins")
    expected = by_twin(paths, limit)
    assert 20 < np.count_nonzero(paths.status) < 280
    share = np.array(expected["saturation_share"])
    assert np.any(share > 0.0)
    assert np.isinf(expected["settling_time heading"]).any()
    for name, numbers in expected.items():
        found = paths.statistics[f"each {name}"].value[0, 0]
        # Sums of 120 terms in another order; a settled angle of 1e-3 rad by the trace has 1e-13 / 1e-3 of round-off.
        tolerance = 1e-9 if name == "max_error attitude" else 1e-11
        np.testing.assert_allclose(found, numbers, rtol=tolerance, atol=tolerance, err_msg=name)
    assert {name.removeprefix("each ") for name in paths.statistics if name.startswith("each ")} == expected.keys()
    finite = np.array(expected["iae depth"])
    assert paths.statistics["mean iae depth"].value[0, 0] == pytest.approx(finite.mean(), rel=1e-12)


@pytest.mark.ci
def test_ticks_do_not_depend_on_what_is_kept(coarse, paths):
    assert coarse.time.tolist() == [0.0, 4.0, 8.0, 12.0]
    assert coarse.position.tobytes() == np.ascontiguousarray(paths.position[::40]).tobytes()
    for name, estimate in paths.statistics.items():
        assert estimate.value.tobytes() == coarse.statistics[name].value.tobytes(), name


@pytest.mark.ci
def test_other_statistics_are_of_the_samples_that_are_kept(fleet, coarse):
    asked = [lw.statistics.Mean("depth"), lw.statistics.PathMaximum("depth"), *metrics()]
    both = lw.solve(fleet, **COARSE, keep="none", statistics=asked)
    alone = coarse.position[..., 2]
    np.testing.assert_allclose(both.statistics["mean depth"].value[:, 0], alone.mean(axis=1), rtol=1e-13)
    assert both.statistics["mean path_maximum depth"].value[0, 0] == pytest.approx(alone.max(axis=0).mean(), rel=1e-13)
    assert both.statistics["mean iae depth"].value == coarse.statistics["mean iae depth"].value


@pytest.mark.ci
def test_a_store_that_goes_on_has_the_same_numbers(fleet, coarse, tmp_path):
    asked = [
        lw.metrics.Overshoot("depth", then=[lw.statistics.Mean(), lw.statistics.MemberValues()]),
        lw.metrics.Overshoot("heading"),
        lw.metrics.Travel(),
    ]
    with pytest.raises(RuntimeError):
        lw.solve(fleet, **COARSE, statistics=asked, store=tmp_path / "run.zarr", threads=1, progress=stop)
    result = lw.resume(tmp_path / "run.zarr")
    assert len(result.time) == 4
    assert {"mean overshoot depth", "mean travel"} <= result.statistics.keys()
    for name in result.statistics:
        assert result.statistics[name].value.tobytes() == coarse.statistics[name].value.tobytes()
    again = lw.open_run(tmp_path / "run.zarr").statistics
    assert again["each overshoot depth"].value.tobytes() == coarse.statistics["each overshoot depth"].value.tobytes()


def stop(share):
    if share > 0.6:
        raise RuntimeError("enough")


@pytest.mark.ci
def test_predict_and_prepare_take_ticks(fleet):
    assert lw.predict(fleet, t1=T1, statistics=metrics(), keep="none").memory > 0


def test_a_scene_without_a_controller_is_told(fleet):
    scene = lw.Scene.named("remus_100", run={"step": 0.01, "duration": 1.0, "method": "psi_x"})
    with pytest.raises(lw.SceneError, match="signal of a controller"):
        lw.solve(scene, statistics=[lw.metrics.IAE("depth")])


@pytest.mark.ci
def test_numbers_do_not_depend_on_how_many_ticks_are_gathered_at_once(fleet, coarse, monkeypatch):
    monkeypatch.setattr(launches, "GATHERED_BYTES", 1)
    monkeypatch.setattr(work, "NUMBERS_AT_ONCE", 1)
    by_tick = lw.solve(fleet, **COARSE, statistics=metrics())
    assert by_tick.position.tobytes() == coarse.position.tobytes()
    for name, estimate in coarse.statistics.items():
        assert estimate.value.tobytes() == by_tick.statistics[name].value.tobytes(), name


@pytest.mark.ci
def test_so_it_is_where_members_fill_no_packet(fleet, monkeypatch):
    # Three members take the memory of a whole packet: what is held there at once is counted for it, and for them alike.
    few = lw.Ensemble(fleet.scene, 3, seed=1, vary=fleet.vary)
    settings = {"t1": T1, "keep": "none", "statistics": [lw.metrics.IAE("depth", then=[lw.statistics.MemberValues()])]}
    at_once = lw.solve(few, **settings).statistics["each iae depth"].value
    # Of 121 ticks some are held at once, and more of three members than of a packet.
    monkeypatch.setattr(launches, "GATHERED_BYTES", 3_000)
    assert lw.solve(few, **settings).statistics["each iae depth"].value.tobytes() == at_once.tobytes()


@pytest.mark.ci
def test_metrics_change_no_bit_of_the_run(fleet, coarse):
    # The same kernel, which gathers nothing.
    fields = ("position", "reference_heading", "actuator", "demand")
    without = lw.solve(fleet, **COARSE | {"save": lw.SaveAt(every=4.0, fields=fields)})
    assert without.position.tobytes() == coarse.position.tobytes()
    assert without.status.tobytes() == coarse.status.tobytes()


@pytest.mark.slow
def test_metrics_change_no_bit_beside_the_bare_kernel(fleet, coarse):
    bare = lw.solve(fleet, **COARSE)
    for name in ("position", "attitude", "velocity", "angular_velocity", "status"):
        assert getattr(bare, name).tobytes() == getattr(coarse, name).tobytes(), name


@pytest.mark.slow
def test_the_arrays_of_a_run_are_freed_at_its_end(fleet):
    def alive():
        return {id(one) for one in gc.get_objects() if type(one) is Packets}

    before = alive()
    gc.disable()
    try:
        lw.solve(fleet, **COARSE, statistics=metrics(), keep="none")
        assert alive() <= before
    finally:
        gc.enable()


def test_metrics_of_what_no_guidance_wants_are_refused(fleet):
    controller = fleet.scene.controller
    few = replace(controller, guidance=[lw.control.SetPoint(depth=10.0, heading=0.5), *controller.guidance[1:]])
    for run in (lw.solve, lw.predict):
        with pytest.raises(
            lw.SceneError, match=r"statistics = 'iae speed' is of the speed, and no guidance .* wants a speed"
        ):
            run(
                replace(fleet.scene, controller=few),
                t1=1.0,
                statistics=[lw.metrics.IAE("depth"), lw.metrics.IAE("speed")],
            )


@pytest.mark.ci
@pytest.mark.slow_for("float32_compensated")
@pytest.mark.parametrize("dtype", ["float64", "float32_compensated"])
def test_numbers_do_not_depend_on_what_else_is_read_at_ticks(dtype, fleet, coarse):
    each = {"then": [lw.statistics.MemberValues()]}
    few = [
        lw.metrics.Overshoot("depth", **each),
        lw.metrics.IAE("heading", **each),
        lw.metrics.MaxError("depth", **each),
    ]
    alone = lw.solve(fleet, **COARSE, statistics=few, keep="none", dtype=dtype)
    whole = coarse if dtype == "float64" else lw.solve(fleet, **COARSE, statistics=metrics(), keep="none", dtype=dtype)
    for name in ("each overshoot depth", "each iae heading", "each max_error depth"):
        np.testing.assert_array_equal(alone.statistics[name].value, whole.statistics[name].value)


def test_a_tick_gathers_only_the_numbers_that_are_read(fleet):
    def gathered(*statistics):
        observed = Observation(statistics, keep="none")
        return make_plan(fleet, t1=1.0, observed=observed).layout.tick_fields

    assert gathered(lw.metrics.IAE("depth"), lw.metrics.RMSError("depth")) == {"position": 1, "reference_depth": 1}
    assert gathered(lw.metrics.IAE("depth"), lw.metrics.IAE("heading")) == {
        "position": 1, "attitude": 2, "reference_depth": 1, "reference_heading": 1}  # fmt: skip
    assert gathered(lw.metrics.IAE("north"), lw.metrics.IAE("east"))["position"] == 2
    assert gathered(lw.metrics.IAE("depth"), lw.metrics.MaxError("position"))["position"] == 3


@pytest.mark.ci
@pytest.mark.parametrize("keep", ["none", "all"])
def test_a_metric_may_read_nothing_at_ticks(keep, fleet, coarse):
    alone = lw.solve(fleet, **COARSE, statistics=[lw.metrics.TimeToFailure()], keep=keep)
    name = "each time_to_failure"
    np.testing.assert_array_equal(alone.statistics[name].value, coarse.statistics[name].value)


def test_samples_at_all_ticks_give_the_metrics_of_the_run(paths, coarse):
    """Samples at every tick equal the run's own view, but for round-off.

    The kernel moves ticks to the user's origin, and the host samples: by a sum of three products of some metres.
    """
    gathered = lw.gather(paths, metrics())
    for name, estimate in paths.statistics.items():
        for key, values in estimate.arrays.items():
            np.testing.assert_allclose(gathered[name][key], values, rtol=1e-13, atol=1e-13, err_msg=f"{name}: {key}")
    with pytest.raises(lw.SceneError, match=r"every tick of the controller.*save=lw.SaveAt\(every=0.1"):
        lw.gather(coarse, [lw.metrics.IAE("depth")])
