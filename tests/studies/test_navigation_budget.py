# SPDX-License-Identifier: Apache-2.0
"""Navigation errors by their name, through every study: against closed forms of dead reckoning by compass and log."""

import json
import re

import numpy as np
import pytest
from scipy.stats import norm

import lgvi_warp as lw
from lgvi_warp import cli
from tests.support.pages import blocks

PACE, T1, DRIFT, S = 4.12, 100.0, 0.3, np.radians(2.0)
D = PACE * T1
RUN = dict(method="psi_s", h=1.0, t1=T1, threads=1)
ERROR = "norm(navigation_error)"
SAVED = ("position", "measured_position", "navigation_error")
SAVE = lw.SaveAt(every=10.0, fields=SAVED)
GOES_ON = lw.SaveAt(every=10.0, fields=(*SAVED, "attitude", "velocity", "angular_velocity"), final=True)


def scene(velocity="velocity", current=0.0, sensors=None, noise=0.0, events=()):
    """A body that nothing brakes goes north through the water; it reckons by its compass and a log."""
    if sensors is None:
        sensors = [
            lw.control.Sensor(of="heading", name="compass", noise=noise),
            lw.control.DeadReckoning(velocity=velocity),
        ]
    guidance, laws = [lw.control.SetPoint(speed=PACE)], [lw.control.SpeedPID(kp=0.0)]
    controller = lw.Controller(period=1.0, sensors=sensors, guidance=guidance, laws=laws)
    body = lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(10.0, 10.0, 10.0), buoyancy=20.0 * 9.8)
    terms = [lw.terms.ControlWrench(limit=[60.0] * 6), lw.terms.Current(velocity=[0.0, current, 0.0])]
    start = lw.Start(velocity=(PACE, current, 0.0))
    return lw.Scene(body, lw.Environment(gravity=9.8), terms, controller=controller, start=start, events=list(events))


def fleet(members=512, **words):
    vary = {"compass.bias": lw.distributions.Normal(std=S)}
    return lw.Ensemble(scene(**words), members, seed=1, vary=vary)


def turned(b):
    """The way that a compass with the bias b (n,) [rad] tells (n, 2) [m]."""
    return D * np.stack([np.cos(b), np.sin(b)], axis=-1)


def beyond(r, way=D):
    """Probability that 2 way |sin(b / 2)| is larger than r [m]."""
    return 2.0 * norm.cdf(-2.0 * np.arcsin(r / (2.0 * way)) / S)


def biases(members):
    return members.select(0, members.members).parameters["compass.bias"]


# Sums of 100 numbers of 4 m: their round-off.
EXACT = dict(rtol=0.0, atol=1e-11)


@pytest.mark.ci
@pytest.mark.parametrize("current", [0.0, DRIFT])
def test_with_bottom_lock_the_current_does_not_matter(current):
    members = fleet(current=current)
    result = lw.solve(members, **RUN, save=SAVE)
    b = biases(members)
    # The way over ground is that of the current too, which the compass turns with the rest.
    way = np.hypot(D, current * T1)
    np.testing.assert_allclose(
        np.linalg.norm(result.navigation_error[-1], axis=-1), 2 * way * np.abs(np.sin(b / 2)), **EXACT
    )
    np.testing.assert_array_equal(result.navigation_error, result.measured_position - result.position)


@pytest.mark.ci
def test_without_it_the_current_is_the_error():
    result = lw.solve(scene("water_velocity", DRIFT), **RUN, save=SAVE)
    np.testing.assert_allclose(result.navigation_error[-1, 0], [0.0, -DRIFT * T1, 0.0], **EXACT)
    # Both together: the way through the water is turned, and that of the water is missing.
    members = fleet(velocity="water_velocity", current=DRIFT)
    both = lw.solve(members, **RUN, save=SAVE).navigation_error[-1]
    np.testing.assert_allclose(both[:, :2], turned(biases(members)) - [D, DRIFT * T1], **EXACT)


def test_a_log_that_is_lost_for_a_part_of_the_run():
    first = lw.solve(scene("velocity", DRIFT), **RUN, save=GOES_ON)
    later = lw.solve(scene("water_velocity", DRIFT), **RUN | {"t1": T1 + 40.0}, save=SAVE, start=first.final)
    assert np.abs(first.navigation_error).max() < 1e-11
    # The rule of trapezoids takes half of the last velocity over ground at the first tick without it.
    np.testing.assert_allclose(later.navigation_error[-1, 0], [0.0, -DRIFT * 39.5, 0.0], **EXACT)


@pytest.mark.ci
def test_statistics_during_a_run_keep_no_sample(tmp_path):
    asked = [lw.statistics.Exceedance(ERROR, above=r, name=f"{r:g}") for r in (20.0, 30.0, 40.0)]
    asked += [lw.statistics.Mean("navigation_error"), lw.statistics.Covariance("navigation_error")]
    asked += [lw.statistics.Quantiles("horizontal(measured_position - position)", levels=(0.95,))]
    members = fleet(20_000)
    result = lw.solve(members, **RUN, keep="none", statistics=asked, store=tmp_path / "run.zarr")
    for r in (20.0, 30.0, 40.0):
        p = beyond(r)
        assert abs(result.statistics[f"{r:g}"].value[-1, 0] - p) < 4.0 * np.sqrt(p * (1.0 - p) / 20_000)
    spread = np.sqrt(result.statistics["covariance navigation_error"].value[-1, 1, 1])
    # sd of D sin(b), of b normal; it is s L for small s.
    assert spread == pytest.approx(D * np.sqrt(0.5 * -np.expm1(-2.0 * S**2)), rel=4.0 / np.sqrt(2 * 20_000))
    assert spread == pytest.approx(S * D, rel=0.03)
    name = "quantiles horizontal(measured_position - position)"
    # The quantile's standard error: sqrt(p (1 - p) / n) over the density there.
    assert result.statistics[name].value[-1].ravel()[0] == pytest.approx(2 * D * np.sin(0.98 * S), rel=0.03)
    assert lw.open_run(tmp_path / "run.zarr").statistics.keys() == result.statistics.keys()


@pytest.mark.parametrize("dtype", ["float32", "float32_compensated"])
@pytest.mark.slow
def test_in_single_precision(dtype):
    members = fleet()
    result = lw.solve(members, **RUN, dtype=dtype, save=SAVE)
    exact = 2 * D * np.abs(np.sin(biases(members) / 2))
    # A hundred sums of numbers of up to 412 m.
    assert np.abs(np.linalg.norm(result.navigation_error[-1], axis=-1) - exact).max() < 100 * 412 * 1.2e-7
    assert result.navigation_error.dtype == np.float32


@pytest.mark.ci
def test_its_slope_is_that_of_a_rotation():
    result = lw.solve(scene().with_numbers({"compass.bias": 0.01}), **RUN, tangents=["compass.bias"], save=SAVE)
    slope = D * np.array([-np.sin(0.01), np.cos(0.01), 0.0])
    np.testing.assert_allclose(result.jacobian["navigation_error"][-1, 0, :, 0], slope, rtol=0.0, atol=1e-10)


@pytest.mark.ci
@pytest.mark.parametrize("r", [30.0, 60.0])
def test_rare_event_and_estimate_know_the_name(r):
    answer = lw.rare_event(fleet(), f"{ERROR} - {r}", **RUN, relative_error=0.1)
    assert abs(answer.probability / beyond(r) - 1.0) < 4.0 * answer.relative_error
    if r == 30.0:
        found = lw.estimate(fleet(), f"{ERROR} above {r}", error=0.004, **RUN)
        assert abs(float(found.value) - beyond(r)) < 4.0 * 0.004


@pytest.mark.ci
def test_splitting_follows_it():
    # East: the sum of PACE sin(n), n of each tick by itself, of which the rule takes half of the first and the last.
    sd = PACE * np.sqrt((99 + 0.5) * 0.5 * -np.expm1(-2 * 0.05**2))
    answer = lw.rare_event(
        scene(noise=0.05), f"navigation_error[1] above {3.0 * sd}", **RUN, by="splitting", relative_error=0.2
    )
    assert abs(answer.probability / norm.sf(3.0) - 1.0) < 4.0 * answer.relative_error


@pytest.mark.ci
def test_sensitivity_is_of_the_compass_alone():
    vary = {"compass.bias": lw.distributions.Normal(std=S), "current.velocity[2]": lw.distributions.Normal(std=0.0001)}
    found = lw.uq.sobol(lw.Ensemble(scene(), 1, vary=vary), ERROR, samples=256, **RUN)
    first = dict(zip(found.factors, np.ravel(found.first), strict=True))
    assert first["compass.bias"] == pytest.approx(1.0, abs=0.05)
    assert first["current.velocity[2]"] == pytest.approx(0.0, abs=0.05)


@pytest.mark.ci
def test_a_sweep_asks_for_it_as_a_metric_and_as_a_path():
    metrics = ["navigation end", "navigation largest", "navigation percent", f"max({ERROR})"]
    cases = {"lock": {}, "lost": {"dead_reckoning.start_error": [0.0, 0.0, 60.0]}}
    swept = lw.sweep(fleet(400), cases=cases, metrics=metrics, success={"navigation end": {"below": 30.0}}, threads=1,
                     method="psi_s", h=1.0, t1=T1)  # fmt: skip
    value, *_ = swept.success("lock", swept.cells[0].point)
    assert value == pytest.approx(1.0 - beyond(30.0), abs=4.0 * np.sqrt(beyond(30.0) / 400))
    assert swept.success("lost", swept.cells[1].point)[0] == 0.0


@pytest.mark.ci
def test_the_metric_is_that_of_the_members():
    members = fleet(events=[lw.events.StopTime(at=50.5)])
    kinds = ("end", "largest", "percent")
    asked = [lw.metrics.NavigationError(kind, then=[lw.statistics.MemberValues()]) for kind in kinds]
    asked += [lw.metrics.NavigationError("end", horizontal=True, name="flat", then=[lw.statistics.MemberValues()])]
    result = lw.solve(members, **RUN, keep="none", statistics=asked)
    exact = D * np.abs(np.sin(biases(members) / 2))
    lengths = ("navigation end", "navigation largest", "flat")
    each = {name: result.statistics[f"each {name}"].value[0, 0] for name in (*lengths, "navigation percent")}
    for name in lengths:
        np.testing.assert_allclose(each[name], exact, **EXACT)
    np.testing.assert_allclose(each["navigation percent"], 100.0 * exact / (0.5 * D), rtol=0.0, atol=1e-11)


@pytest.mark.ci
def test_stores_exports_and_pictures_have_it(tmp_path):
    members = fleet(8)
    whole = lw.solve(members, **RUN, save=SAVE)
    stored = lw.solve(members, **RUN, save=SAVE, store=tmp_path / "run.zarr")
    np.testing.assert_array_equal(stored.navigation_error, whole.navigation_error)
    np.testing.assert_array_equal(
        lw.Result.load(whole.save(tmp_path / "run.npz")).navigation_error, whole.navigation_error
    )
    assert whole.dataset.navigation_error.attrs["units"] == "m"
    axes = lw.plots.fan(whole, ERROR, path=tmp_path / "error.svg")
    assert axes.get_ylabel().endswith("[m]")
    # In two parts, the second of which goes on in the memory of the first.
    half = lw.solve(members, **RUN | {"t1": 50.0}, save=GOES_ON)
    again = lw.solve(members, **RUN, save=SAVE, start=half.final)
    np.testing.assert_array_equal(again.navigation_error[-1], whole.navigation_error[-1])
    np.testing.assert_array_equal(again.navigation_error[0], half.navigation_error[-1])


@pytest.mark.ci
def test_samples_that_are_asked_for_bring_what_the_quantity_reads():
    save = lw.SaveAt(every=10.0)
    run = lw.prepare(fleet(4), of="max(norm(measured_position - position))", **RUN, save=save)
    np.testing.assert_allclose(run(), D * 2.0 * np.abs(np.sin(0.5 * biases(fleet(4)))), rtol=1e-9)
    found = lw.worst_case(scene(), {"compass.bias": (-0.1, 0.05)}, f"max({ERROR})", **RUN, save=save, budget=64)
    assert found.answer.startswith(f"The largest max({ERROR}) found is ")
    assert "compass.bias -0.1 rad (its lower bound)" in found.answer


@pytest.mark.ci
def test_a_part_of_the_distance_is_refused_where_a_run_goes_on():
    half = lw.solve(fleet(4), **RUN | {"t1": 50.0}, save=GOES_ON)
    with pytest.raises(lw.SceneError, match=r"navigation.of = 'percent' .* goes on from another"):
        lw.solve(fleet(4), **RUN, start=half.final, statistics=[lw.metrics.NavigationError("percent")])


@pytest.mark.ci
def test_the_page_and_the_command_know_the_names(tmp_path, capsys):
    (text,) = blocks("docs/guide/how_far_off.md", "toml")
    path, way, to = tmp_path / "budget.toml", 900.0, ["--out", str(tmp_path / "out"), "--json", "-q"]
    path.write_text(text)

    def answer(*words):
        assert cli.main([words[0], str(path), *words[1:], *to]) == 0
        document = json.loads(capsys.readouterr().out)
        return document.get("content", {words[0]: document})[words[0]]

    # As on the page.
    assert beyond(50.0, way) == pytest.approx(0.11, abs=0.005)
    assert abs(answer("estimate", "--of", f"{ERROR} above 50", "--error", "0.01")["value"] - beyond(50.0, way)) < 0.04
    rare = answer("rare", "--limit", f"{ERROR} above 120")
    assert abs(rare["probability"] / beyond(120.0, way) - 1.0) < 4.0 * rare["relative_error"]
    # The mean of |b| is S sqrt(2 / pi); 256 members of a design that is spread evenly.
    mean = answer("sensitivity", "--of", ERROR, "--samples", "64")["mean"]
    assert mean == pytest.approx([way * S * np.sqrt(2.0 / np.pi)], rel=0.02)
    # A run with a statistic, and a sweep over noise that adds nothing.
    above = f'run.statistics=[{{type = "exceedance", of = "{ERROR}", above = 50.0}}]'
    told = answer("run", "--set", above, "--set", "ensemble.members=400")["statistics"]
    share, error = beyond(50.0, way), np.sqrt(beyond(50.0, way) / 400)
    assert np.ravel(told[0]["value"])[-1] == pytest.approx(share, abs=4.0 * error)
    path = tmp_path / "sweep.toml"
    path.write_text('scene = "budget.toml"\nmembers = 400\nmetrics = ["navigation end"]\n'
                    '[success]\n"navigation end" = { below = 50.0 }\n[grid]\n"compass.noise" = [0.0, 1e-9]\n')  # fmt: skip
    assert cli.main(["sweep", str(path), "--out", str(tmp_path / "swept")]) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    assert float(re.search(r"(\S+) % \(", line)[1]) == pytest.approx(100.0 * (1.0 - share), abs=400.0 * error)


@pytest.mark.parametrize("sensors", [[], [lw.control.Sensor(of="heading", bias=0.1)]], ids=["none", "compass"])
def test_a_scene_that_estimates_no_position_refuses_it(sensors):
    told = r"navigation_error'.*needs an estimate of the position, which nothing in this scene makes. Give"
    blind = scene(sensors=sensors)
    for settings in (dict(save=lw.SaveAt(fields=SAVED)), dict(statistics=[lw.statistics.Mean(ERROR)])):
        with pytest.raises(lw.SceneError, match=told):
            lw.solve(blind, **RUN, **settings)
    with pytest.raises(lw.SceneError, match=told):
        lw.prepare(blind, of=ERROR, **RUN)
    with pytest.raises(lw.SceneError, match=told):
        lw.solve(lw.Scene.named("sphere"), **RUN, statistics=[lw.metrics.NavigationError()])


@pytest.mark.ci
def test_a_sensor_of_position_has_the_error_of_its_reading():
    fix = [lw.control.Sensor(of="position", bias=(1.0, -2.0, 0.5))]
    result = lw.solve(scene(sensors=fix), **RUN, save=SAVE)
    np.testing.assert_allclose(result.navigation_error[:, 0], np.broadcast_to([1.0, -2.0, 0.5], (11, 3)), **EXACT)
