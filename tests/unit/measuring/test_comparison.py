# SPDX-License-Identifier: Apache-2.0
"""lw.tradeoff and lw.suggest on runs that are made by hand: errors of known size, references, fronts, suggestions, words."""

import contextlib
import dataclasses
import itertools
import json
import math
import time
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.accuracy import suggest
from lgvi_warp.accuracy import tradeoff as tradeoffs
from lgvi_warp.common.status import Status
from lgvi_warp.measuring import cost
from lgvi_warp.measuring import distance as compared
from lgvi_warp.measuring.budget import Budget
from lgvi_warp.measuring.comparison import Sample
from lgvi_warp.measuring.ladders import Ladders
from lgvi_warp.measuring.reference import PRECISE, extrapolated, make_reference, more_seconds, paired
from lgvi_warp.measuring.speed import void
from lgvi_warp.measuring.trials import Trial, between, is_dominated
from lgvi_warp.runs.default_method import h_rates
from lgvi_warp.runs.step_error import rates
from lgvi_warp.studies import Candidate, Growth, Measurement, Suggestion, Tradeoff
from tests.conftest import ROOT
from tests.support.made import made, turned

ENOUGH = 1e4
CURRENT = lw.terms.GaussMarkovCurrent(standard_deviation=[0.2, 0.2, 0.05], time_constant=30.0)
# No method on the front.
BAD = dict.fromkeys((*suggest.CANDIDATES, *PRECISE), 1e12)
QUANTITIES = ("position", "attitude", "velocity", "angular_velocity", "energy")


@pytest.fixture(scope="module")
def scene():
    """The paper's vehicle; samples are at equal times, twenty unless a test says otherwise."""
    paper = lw.Scene.load(ROOT / "examples" / "paper.toml")
    return dataclasses.replace(paper, run=dataclasses.replace(paper.run, save_every=None))


def exact(t, n):
    """Paths (k, n, 3) [m] that no setting meets exactly."""
    return np.stack(
        [np.sin(t)[:, None] * np.ones(n), np.outer(t, np.arange(1.0, n + 1.0)), np.ones((len(t), n))], axis=2
    )


class Runs:
    """Stands for the kernels: a run's error along x is size[method] h^order times time times (1 + index of the member).

    Its heading is off by half as much [rad]. An infinite size is a failure. late: method -> time from which it is off by a
    metre a second. A step costs `prices[method, dtype]` microseconds; float32 adds `round_off` to the error. grows: how a
    difference of two starts grows with time. stops: members that a floor stops, and when.
    """

    def __init__(self, sizes, prices=None, round_off=1e-5, late=None, grows=None, stops=None):
        self.sizes, self.prices, self.round_off, self.settings = sizes, prices or {}, round_off, []
        self.late, self.grows, self.stops = late or {}, grows, stops or {}
        self.results, self.plans, self.priced = {}, [], []

    def compile(self, plan):
        return 0.25 * (plan.dtype == "float64") + plan.grid.h

    def clock(self):
        return 0.0

    def run(self, plan):
        name, h, n = plan.method.name, plan.grid.h, plan.ensemble.members
        self.settings.append((name, plan.dtype, h))
        self.plans.append(plan)
        t = plan.grid.times
        path, single, size = exact(t, n), plan.dtype != "float64", self.sizes.get(name, 0.0)
        end = np.array([self.stops.get(i, np.nan) for i in range(n)])
        ended = {"status": np.where(np.isnan(end), Status.OK, Status.FLOOR), "end": end}
        off = np.zeros((len(t), n))
        if size == math.inf:
            ended = {"status": np.full(n, Status.NON_FINITE), "end": np.full(n, t[1])}
        else:
            off = (size * h**plan.method.order + single * self.round_off) * np.outer(t, 1.0 + np.arange(n))
            off += (t * (t >= self.late.get(name, np.inf)))[:, None]
        if self.grows:
            # A turn of the start is seen in the path alone.
            turned_by = np.linalg.norm(plan.ensemble.select(0, n).attitude - self.start(plan), axis=(1, 2)) / math.sqrt(
                2.0
            )
            off = off + np.outer(self.grows(t), turned_by)
        path[..., 0] += off
        attitude = turned(np.zeros_like(off) if self.grows else 0.5 * off)
        result = made(path, t, dtype=np.float32 if single else np.float64, attitude=attitude, **ended)
        result = dataclasses.replace(
            result, provenance=result.provenance | {"step": h}, compile_seconds=0.0, run_seconds=0.0
        )
        self.results[name, plan.dtype, h, plan.method.solver] = result
        return result

    def start(self, plan):
        """The attitudes of the first run of as many members."""
        first = next(one for one in self.plans if one.ensemble.members == plan.ensemble.members)
        return first.ensemble.select(0, plan.ensemble.members).attitude

    def costs(self, plans, rounds=5):
        self.priced += plans
        return [cost.Cost(self.prices.get((p.method.name, p.dtype), 1.0) / p.grid.h, 1.0) for p in plans]


@contextlib.contextmanager
def made_by(kernels):
    """Comparisons whose runs are made by others than this machine's kernels."""
    with mock.patch.dict(Sample.__init__.__kwdefaults__, kernels=kernels):
        yield


def tradeoff_by(runs, fleet, of="position", methods=None, members=128, seconds=ENOUGH, t1=4.0):
    with made_by(runs):
        return lw.tradeoff(fleet, t1, of, methods, members, seconds)


def suggestion_by(runs, fleet, error, methods=None, seconds=ENOUGH, t1=4.0, **more):
    with made_by(runs):
        return lw.suggest(fleet, error, t1=t1, methods=methods, seconds=seconds, **more)


def fleet_of(scene, n=4, every=None, **changes):
    """Members of a scene with other parts, saved at other times."""
    run = dataclasses.replace(scene.run, save_every=every)
    return lw.Ensemble(dataclasses.replace(scene, run=run, **changes), n, 1, scene.ensemble_settings.vary)


def noisy(scene, noise_step=None):
    return fleet_of(scene, 2, terms=[dataclasses.replace(CURRENT, noise_step=noise_step)])


def refusal(call, *arguments, **named):
    with pytest.raises(lw.SceneError) as caught:
        call(*arguments, **named)
    return str(caught.value)


# What is run


@pytest.mark.parametrize(("every", "times"), [
    (None, 0.2 * np.arange(21)), (0.3, 0.2 * np.arange(21)), (8.0, 0.2 * np.arange(21)), (0.5, 0.5 * np.arange(9)),
    (4.0, [0.0, 4.0]), (0.1, 0.2 * np.arange(21)), (0.125, 0.125 * np.round(np.linspace(0, 32, 21))),
])  # fmt: skip
def test_runs_are_compared_at_the_scenes_times_where_they_divide(scene, every, times):
    runs = Runs({"psi_s": 1.0})
    found = tradeoff_by(runs, fleet_of(scene, every=every), methods=["psi_s"], members=2, seconds=1e-6)
    spacing = {0.5: 0.5, 4.0: 4.0, 0.1: 0.1, 0.125: 0.125}.get(every, 0.2)
    assert (found.members, found.t1) == (2, 4.0)
    for plan in runs.plans:
        assert plan.grid.times == pytest.approx(times)
        assert plan.grid.steps == round(4.0 / plan.grid.h)
        assert spacing / plan.grid.h == pytest.approx(round(spacing / plan.grid.h))
    # The coarsest step turns no member by more than a radian at the start; here a turn in t1 is the fastest.
    coarsest = max(h for name, _, h in runs.settings if name == "psi_s")
    assert coarsest == pytest.approx(spacing / math.ceil(spacing * 2.0 * math.pi / 4.0))


def test_the_coarsest_step_turns_by_an_angle(scene):
    fast = fleet_of(scene, start=dataclasses.replace(scene.start, angular_velocity=[0.0, 30.0, 40.0]))
    runs = Runs({"psi_s": 1.0})
    tradeoff_by(runs, lw.Ensemble(fast.scene, 1), methods=["psi_s"], seconds=1e-6)
    assert max(h for name, _, h in runs.settings if name == "psi_s") == pytest.approx(0.2 / 10)
    assert max(h for name, _, h in runs.settings if name == "kl8(psi_x)") == pytest.approx(0.2 / 20)


def test_the_end_is_the_scenes_or_given(scene):
    assert tradeoff_by(Runs({}), fleet_of(scene), methods=["rk4"], t1=None, seconds=1e-6).t1 == scene.run.duration
    endless = fleet_of(dataclasses.replace(scene, run=dataclasses.replace(scene.run, duration=None)))
    words = "t1 = None is missing. Give the end in seconds: t1=150.0 or [run] duration"
    assert words in refusal(lw.tradeoff, endless)


def test_methods_are_taken_refused_or_the_same_as_others(scene):
    damped = fleet_of(scene, terms=[lw.terms.Drag(linear=[1.0] * 6)])
    found = tradeoff_by(Runs({"rk4": 1e-3}), damped, methods=["gauss4", "rk4", "rk4"])
    assert list(found.refused) == ["gauss4", "rk4"]
    assert "gauss4" in found.refused["gauss4"]
    assert found.refused["rk4"] == "method rk4: in this scene it is rk4"
    assert {one.setting.method for one in found.measurements} == {"rk4"}
    assert refusal(tradeoff_by, Runs({}), damped, methods=["gauss4"]).startswith("method gauss4: ")


# Noise


def test_runs_in_noise_share_its_draws(scene):
    runs = Runs({})
    found = tradeoff_by(runs, noisy(scene), methods=["psi_s"])
    # 3 2^k draws, at first sixteen in the longest step: here 12, and 24 in the finer run.
    assert found.reference == "psi_s at h = 0.008333 s against psi_x at h = 0.01667 s"
    path = "noise acts: all runs see one path of it, drawn every 0.008333 s; errors by paths are of order 1"
    assert found.messages[0] == path
    assert {plan.ensemble.scene.terms[0].noise_step for plan in runs.plans} == {0.2 / 24}
    assert {24 % round(0.2 / h) for _, _, h in runs.settings} == {0}
    # A step is priced as a run of it draws: once.
    assert [plan.ensemble.scene.terms[0].noise_step for plan in runs.priced] == pytest.approx(
        [plan.grid.h for plan in runs.priced]
    )


def test_a_scenes_own_draws_are_kept(scene):
    runs = Runs({"psi_s": 1e-3})
    found = tradeoff_by(runs, noisy(scene, 0.05), methods=["psi_s"])
    assert found.reference == "psi_s at h = 0.05 s against psi_x at h = 0.1 s"
    assert {plan.ensemble.scene.terms[0].noise_step for plan in (*runs.plans, *runs.priced)} == {0.05}
    assert {round(0.2 / h) for _, _, h in runs.settings} <= {1, 2, 4}
    words = "noise_step = 0.3 does not divide the 0.2 s between the times of the comparison. Give run.save_every"
    assert words in refusal(tradeoff_by, Runs({}), noisy(scene, 0.3))
    two = [dataclasses.replace(CURRENT, noise_step=step, name=f"c{step:g}") for step in (0.05, 0.1)]
    runs = Runs({"psi_s": 1e-3})
    tradeoff_by(runs, fleet_of(scene, 2, terms=two), methods=["psi_s"])
    assert {round(0.2 / h) for _, _, h in runs.settings} <= {1, 2}


def test_where_a_path_of_noise_is_too_rough_statistics_are_compared(scene):
    runs = Runs({}, late={"psi_x": 0.1})
    found = tradeoff_by(runs, noisy(scene), methods=["psi_s"])
    assert found.reference == "the finest run's statistics, since noise acts"
    assert found.messages[1].endswith(": only statistics are compared")
    assert found.reference_error == {}
    assert found.growth is None
    assert found.until == 4.0
    assert all(one.errors == {} and one.trusted == {} and one.biases for one in found.measurements)
    # Steps are halved at each of ten refinements.
    reference = [h for name, _, h in runs.settings if name == "psi_x"]
    assert np.allclose(np.divide(reference[:-1], reference[1:]), 2.0)
    assert len(reference) == 10


# Errors


def apart(of, run, truth, i, j):
    """The distance of two results at a time, of a member."""
    if of == "attitude":
        one, other = (math.atan2(each.attitude[i, j, 1, 0], each.attitude[i, j, 0, 0]) for each in (run, truth))
        return abs(one - other)
    if of == "position[0]":
        return abs(run.position[i, j, 0] - truth.position[i, j, 0])
    one, other = (np.atleast_1d(np.asarray(getattr(each, of)[i, j], float)) for each in (run, truth))
    return math.dist(one, other)


def errors_by_hand(of, run, truth, until):
    """The four errors, member by member and time by time, of those that were not stopped."""
    rows = [
        [apart(of, run, truth, i, j) for j in range(run.members) if not run.time[i] >= run.failure_time[j]]
        for i in range(until + 1)
    ]
    path, end = list(itertools.chain(*rows)), rows[-1]
    rms = lambda values: math.sqrt(sum(value**2 for value in values) / len(values))  # noqa: E731
    return {"end_max": max(end), "end_rms": rms(end), "path_max": max(path), "path_rms": rms(path)}


def bias_by_hand(run, truth):
    """Differences of mean and spread of positions in standard errors: root mean squares over components and times."""
    means, spreads, n = [], [], run.members
    for i in range(1, len(run.time)):
        for c in range(3):
            a, b = run.position[i, :, c].astype(float), truth.position[i, :, c]
            if np.ptp(b) > 1e-6:
                size = b.std(ddof=1)
                means.append((a.mean() - b.mean()) / (size / math.sqrt(n)))
                spreads.append((a.std(ddof=1) - size) / (size / math.sqrt(2 * (n - 1))))
    return {f"position_{name}": math.sqrt(np.mean(np.square(v))) for name, v in (("mean", means), ("std", spreads))}


@pytest.mark.ci
def test_every_measurement_is_as_by_hand(scene):
    """Errors to the last time at which the reference agrees with itself; one member is stopped before."""
    runs = Runs({"psi_s": 2e-2, "psi_x": 1e-2, "rk4": math.inf}, {("psi_s", "float32"): 0.5, ("psi_s", "float64"): 3.0},
                late={"kl8(psi_x)": 3.0}, stops={1: 1.1})  # fmt: skip
    found = tradeoff_by(runs, fleet_of(scene), "position[0]", ["psi_s", "psi_x", "rk4"])
    truth = next(run for (name, _, _, _), run in runs.results.items() if name == "rk8")
    assert found.until == pytest.approx(2.8)
    assert found.messages[0] == ("errors of single members are up to 2.8 s, where the reference still agrees with itself; "
                                 "beyond it only statistics are meaningful")  # fmt: skip
    assert found.units == dict(zip(QUANTITIES, ("m", "rad", "m/s", "rad/s", "J"), strict=True)) | {"position[0]": "m"}
    assert list(found.reference_error) == [*QUANTITIES, "position[0]"]
    assert set(found.missing) == {"rk4"}
    assert len(found.measurements) > 30
    for one in found.measurements:
        s = one.setting
        run = runs.results[s.method, s.dtype, s.h, s.solver]
        for of in (*QUANTITIES, "position[0]"):
            for kind, value in errors_by_hand(of, run, truth, 14).items():
                assert one.error(of, kind) == pytest.approx(value, rel=1e-6, abs=3e-8), (of, kind)
            assert one.trusted[of] == (one.error(of) >= 10.0 * found.reference_error[of])
        assert one.us_per_vehicle_second == pytest.approx(runs.prices.get((s.method, s.dtype), 1.0) / s.h)
        assert (one.order, one.cost_spread) == (2, 1.0)
        assert one.energy_drift == pytest.approx(np.abs(run.energy - run.energy[0]).max(), rel=1e-6)
        expected = bias_by_hand(run, truth)
        assert {name: one.biases[name] for name in expected} == pytest.approx(expected, rel=1e-4, abs=1e-6)
    wanted = {"position", "velocity", "attitude", "energy", "linear_momentum", "angular_momentum", "position[0]"}
    coarse = max(found.measurements, key=lambda one: one.setting.h)
    assert {name.rpartition("_")[0] for name in coarse.biases} <= wanted
    assert {f"{name}_mean" for name in ("position", "velocity", "energy", "linear_momentum")} <= set(coarse.biases)
    # The longest that a kernel took to load stands at all of its settings.
    assert len({(one.setting.name, one.setting.dtype, one.compile_seconds) for one in found.measurements}) == len(
        {(one.setting.name, one.setting.dtype) for one in found.measurements})  # fmt: skip
    assert max(one.compile_seconds for one in found.measurements) == pytest.approx(0.25 + 0.2)


def test_one_member_has_no_statistics_and_an_angle_is_the_short_way_round(scene):
    runs = Runs({"psi_s": 2.0 * 3.1 / 0.04 / 4.0})
    found = tradeoff_by(runs, fleet_of(scene, 1), methods=["psi_s"], seconds=1e-6)
    assert all(one.biases == {} for one in found.measurements)
    (coarse,) = found.measurements
    assert coarse.error("attitude", "end_max") == pytest.approx(3.1)
    over = tradeoff_by(Runs({"psi_s": 2.0 * 3.2 / 0.04 / 4.0}), fleet_of(scene, 1), methods=["psi_s"], seconds=1e-6)
    (coarse,) = over.measurements
    assert coarse.error("attitude", "end_max") == pytest.approx(2.0 * math.pi - 3.2)


def test_a_mean_is_compared_by_the_end_of_its_interval(scene):
    found = tradeoff_by(Runs({"psi_s": 1.0}), fleet_of(scene), "mean position[0]", ["psi_s"], seconds=1e-6)
    (one,) = found.measurements
    members = 4.0 * one.setting.h**2 * np.arange(1.0, 5.0)
    expected = members.mean() + 2.0 * members.std(ddof=1) / 2.0
    assert one.error("mean position[0]", "end_max") == pytest.approx(expected, rel=1e-6)
    alone = tradeoff_by(Runs({"psi_s": 1.0}), fleet_of(scene, 1), "mean position[0]", ["psi_s"], seconds=1e-6)
    (coarse,) = alone.measurements
    assert coarse.error("mean position[0]") == pytest.approx(4.0 * coarse.setting.h**2)
    assert (found.of, found.units[found.of]) == ("mean position[0]", "m")


@pytest.mark.parametrize(("of", "words"), [
    ("mean attitude", "of = 'mean attitude' is not a mean of numbers. Give the mean of an entry, such as 'mean attitude"),
    ("mean mean depth", "is not a mean of numbers"),
    (("depth", "speed"), "of = ('depth', 'speed') is several quantities, and an error is of one of them. Give its name"),
    ("max(depth)", "is taken over the whole path, and errors are of a quantity at each time. Give 'depth', whose"),
])  # fmt: skip
def test_quantities_that_cannot_be_compared_are_refused(of, words):
    assert words in refusal(lw.tradeoff, lw.Scene.named("sphere"), 1.0, of)


# References


def test_a_reference_is_refined_until_it_agrees(scene):
    sizes = {"rk8": 1.0, "kl8(psi_x)": 3.0, "psi_s": 1e-3}
    runs = Runs(BAD | sizes)
    found = suggestion_by(runs, fleet_of(scene), 0.1, ["psi_s"])
    m = math.ceil(0.8 * 0.5 * math.pi / 0.5)
    while (error := 4.0 * 4.0 * abs((0.8 / max(m + 1, round(1.5 * m))) ** 8 - 3.0 * (0.8 / m) ** 8)) > 0.1 / 30.0:
        m *= 2
    h, H = 0.8 / max(m + 1, round(1.5 * m)), 0.8 / m
    assert found.reference == f"rk8 at h = {h:.4g} s against kl8(psi_x) at h = {H:.4g} s"
    assert found.reference_error == pytest.approx(error, rel=1e-6)
    assert [one for one in runs.settings if one[0] in ("rk8", "kl8(psi_x)")][:2] == [
        ("kl8(psi_x)", "float64", pytest.approx(0.8 / 3)), ("rk8", "float64", pytest.approx(0.8 / 4))]  # fmt: skip
    # A trade-off refines until that gains nothing twice, or the time is over.
    runs = Runs(sizes)
    best = tradeoff_by(runs, fleet_of(scene), methods=["psi_s"])
    assert best.reference_error["position"] < 1e-12
    steps = [h for name, _, h in runs.settings if name == "kl8(psi_x)"]
    assert np.allclose(np.divide(steps[:-1], steps[1:]), 2.0)
    assert len(steps) > 5


def test_two_methods_of_a_reference_are_of_like_order():
    assert paired(["rk8", "kl8(psi_x)"]) == ("rk8", "kl8(psi_x)")
    assert paired(["kl6(psi_x)", "rk4"]) == ("kl6(psi_x)", "rk4")
    assert paired(["rk8", "rk5"]) == ("rk8", "rk8")
    assert paired(["rk8"]) == ("rk8", "rk8")


def test_extrapolation_takes_out_two_orders(scene):
    def cubic(plan):
        h, t = plan.grid.h, plan.grid.times
        path = exact(t, 4)
        path[..., 0] += (2.0 * h**2 + 5.0 * h**3) * t[:, None]
        return dataclasses.replace(made(path, t), compile_seconds=h)

    sample = Sample(fleet_of(scene), 4.0, samples=5, kernels=SimpleNamespace(run=cubic))
    found = extrapolated(sample, "psi_s", 2)
    np.testing.assert_allclose(found.position, exact(sample.times, 4), atol=1e-13)
    assert found.compile_seconds == pytest.approx(0.4 + 0.2 + 0.1)
    for plain in (extrapolated(sample, "rk4", 2), extrapolated(sample.on_grid(8), "psi_s", 2)):
        assert plain.compile_seconds == 0.4
        assert np.abs(plain.position - exact(sample.times, 4)).max() > 1.0


def test_a_scene_without_a_precise_method_has_no_reference(scene):
    class Refusing(Sample):
        def accepted(self, *_, **__):
            return [], {}

    said = refusal(make_reference, Refusing(fleet_of(scene), 4.0))
    assert "method: the scene takes none of kl8(psi_x), rk8, " in said
    assert "Name one that it takes: methods=[...]" in said


@pytest.mark.ci
def test_a_reference_too_rough_is_refused_with_what_would_do(scene):
    """From the first time on; later than the time asked for; and where time was short."""
    early, late, busy = Runs({}, late={"rk8": 0.1}), Runs({}, late={"rk8": 1.5}), Runs({"rk8": 1e6})
    said = refusal(tradeoff_by, early, fleet_of(scene), methods=["rk4"])
    assert said.startswith("no reference: rk8 at h = ")
    assert said.endswith(
        "differ by 0.2 m after 0.2 s, and agree no better with shorter steps. Give a shorter t1 (--duration)."
    )
    said = refusal(suggestion_by, late, fleet_of(scene), 1e-2, ["rk4"])
    assert said.startswith("error = 0.01 m of position up to 4 s cannot be checked: rk8 at h = ")
    assert "differ by 4.0e+00 m, and agree no better with shorter steps; " in said
    assert said.endswith(". Ask for t1 (--duration) up to 0.8 s, or for a larger error.")
    said = refusal(suggestion_by, early, fleet_of(scene), 1e-2, ["rk4"])
    assert ". Ask for a shorter t1 (--duration), or for a larger error" in said
    said = refusal(suggestion_by, busy, fleet_of(scene), 1e-9, ["rk4"], seconds=1e-6)
    assert said.startswith("1e-06 s were over. ")
    assert " of position up to 4 s cannot be checked yet: rk8 at h" in said
    said = refusal(tradeoff_by, busy, fleet_of(scene), methods=["rk4"], seconds=1e-6)
    assert said.startswith("1e-06 s were over. Give more seconds. There is no reference: rk8 at h")
    failing = Runs({"rk8": math.inf})
    assert "differ by inf m after 0.2 s" in refusal(tradeoff_by, failing, fleet_of(scene), methods=["rk4"])


def test_a_reference_says_how_much_time_would_do():
    # Errors fall by 4 a halving, the last two runs took 1 s: from 1e-2 to 1e-4 four halvings, of 2, 4, 8 and 16 s.
    assert more_seconds(1e-2, 1e-4, 4.0, 1.0) == 2.0 + 4.0 + 8.0 + 16.0
    for unknown in ((math.inf, 1e-4, 4.0, 1.0), (1e-2, 1e-4, 1.0, 1.0), (1e-2, 0.0, 4.0, 1.0)):
        assert more_seconds(*unknown) == math.inf


# Growth


T = 0.5 * np.arange(21)
# How a difference grows, and what is told of it: power, rate, and the times at which a round-off is 0.01.
GROWTHS = {
    "an exponential": (lambda t: np.exp(0.5 * t), None, 0.5, math.log(1e-2 * 2.0**53) / 0.5, math.log(1e-2 * 2.0**24) / 0.5),
    "a fast one": (lambda t: np.exp(3.0 * t), None, 3.0, math.log(1e-2 * 2.0**53) / 3.0, 4.5),
    "a power": (lambda t: t**1.5, 1.5, None, math.inf, math.inf),
    "a steep power": (lambda t: t**4.0, None, None, None, None),
    "one that falls": (lambda t: 1.0 / (1.0 + t), -1.0, None, math.inf, math.inf),
}  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize("name", GROWTHS)
def test_growth_is_that_of_two_runs_whose_attitudes_differ(scene, name):
    grows, power, rate, double, single = GROWTHS[name]
    runs = Runs({}, grows=grows)
    fleet = fleet_of(scene, 3)
    found = tradeoff_by(runs, fleet, methods=["psi_s", "rk4"], t1=10.0).growth
    kept = (grows(T) > 0.0) & (grows(T) < 1e7)
    np.testing.assert_allclose(found.times, T[kept], atol=1e-12)
    np.testing.assert_allclose(found.curve, grows(T)[kept], rtol=1e-4)
    assert found.factor == pytest.approx(grows(found.times[-1]), rel=1e-4)
    if power is None:
        assert found.power is None
        assert found.doubling == pytest.approx(math.log(2.0) / found.rate)
    else:
        assert found.doubling == math.inf
        assert found.power == pytest.approx(power, rel=0.4 if power < 0.0 else 1e-3)
    if rate:
        assert found.rate == pytest.approx(rate, rel=1e-4)
    if double:
        assert found.predictable == pytest.approx({"float64": double, "float32": single}, rel=1e-3)
    # Of all methods that of highest order runs, with the same members but for the turn.
    one, other = (plan.ensemble for plan in [p for p in runs.plans if p.method.name == "rk4"][:2])
    states = [ensemble.select(0, 3) for ensemble in (one, other, fleet)]
    turn = np.swapaxes(states[0].attitude, 1, 2) @ states[1].attitude
    assert np.linalg.norm(turn - np.eye(3), axis=(1, 2)) / math.sqrt(2.0) == pytest.approx(np.full(3, 1e-8), rel=1e-6)
    for field in ("position", "velocity", "angular_velocity"):
        np.testing.assert_array_equal(getattr(states[0], field), getattr(states[1], field))
        assert getattr(states[0], field) == pytest.approx(getattr(states[2], field), abs=1e-15)
    assert all(each.seed == 1 and list(each.indices) == [0, 1, 2] for each in (one, other))


def test_growth_beyond_measure_and_growth_in_noise(scene):
    lost = tradeoff_by(Runs({}, grows=lambda t: 1e9 * t), fleet_of(scene), methods=["rk4"]).growth
    assert all(math.isnan(value) for value in (lost.rate, lost.doubling, lost.factor))
    assert (lost.power, lost.predictable) == (None, {"float64": 0.0, "float32": 0.0})
    rough = tradeoff_by(Runs({}, grows=lambda t: 1.0 + t), noisy(scene), methods=["psi_s"]).growth
    assert len(rough.times) == 21


# Trade-offs


def test_settings_in_words_and_as_options():
    plain = Candidate("psi_s", 0.1)
    assert plain.plain
    assert (plain.name, plain.text) == ("psi_s", "psi_s float64")
    assert plain.options() == {"method": "psi_s", "h": 0.1, "dtype": "float64"}
    newton = Candidate("psi_s", 0.1, "float32", "newton")
    few = Candidate("psi_s", 0.1, "float32", "quartic", 2)
    assert newton.text == "psi_s newton float32"
    assert few.name == "psi_s quartic 2"
    assert not newton.plain
    assert not few.plain
    assert few.options()["method"].iterations == 2
    assert newton.options()["method"].solver == "newton"


def measured(name, price, error, dtype="float64", h=0.1, **more):
    """A measurement with this error of position and a tenth of it as root mean square."""
    errors = {"position": {"end_max": 0.5 * error, "end_rms": 0.05 * error, "path_max": error, "path_rms": 0.1 * error}}
    fields = {"compile_seconds": 2.0, "errors": errors, "energy_drift": 1e-3, "biases": {}, "order": 2,
              "trusted": {"position": True}}  # fmt: skip
    return Measurement(Candidate(name, h, dtype), price, **fields | more)


GROWN = Growth(0.2, math.log(2.0) / 0.2, None, 54.6, {"float64": 150.0, "float32": 66.0}, np.arange(3.0), np.ones(3))


def traded(*measurements, **more):
    fields = {"of": "position", "members": 8, "t1": 4.0, "until": 3.0, "reference": "rk8 against itself",
              "reference_error": {"position": 1e-9}, "growth": GROWN, "seconds": 12.4}  # fmt: skip
    return Tradeoff(tuple(measurements), **fields | more)


def test_the_front_leaves_out_what_is_dearer_and_no_better():
    ones = [measured("a", 3.0, 1e-4), measured("b", 1.0, 1e-2), measured("c", 2.0, 1e-2), measured("d", 4.0, 1e-3),
            measured("e", 0.5, 1e-9, trusted={"position": False}), measured("f", 0.1, math.inf),
            measured("g", 0.2, 1.0, trusted={})]  # fmt: skip
    found = traded(*ones)
    assert [one.setting.method for one in found.shown()] == ["b", "c", "a", "d"]
    assert [one.setting.method for one in found.front()] == ["b", "a"]
    assert found.front("attitude") == []
    assert (ones[0].error("attitude"), ones[0].cost_spread, ones[0].error()) == (math.inf, 1.0, 1e-4)
    assert ones[0].error(kind="end_rms") == pytest.approx(5e-6)
    assert [row["front"] for row in found.rows()] == [True, True] + [False] * 5


def test_rows_of_a_tradeoff_have_every_number():
    one = measured("psi_s", 3.0, 1e-4, dtype="float32", biases={"position_mean": 0.5}, cost_spread=1.2)
    (row,) = traded(one).rows()
    assert {name: row[name] for name in ("method", "h", "dtype", "order", "front", "us_per_vehicle_second", "cost_spread",
                                         "compile_seconds", "energy_drift", "bias_position_mean")} == {
        "method": "psi_s", "h": 0.1, "dtype": "float32", "order": 2, "front": True, "us_per_vehicle_second": 3.0,
        "cost_spread": 1.2, "compile_seconds": 2.0, "energy_drift": 1e-3, "bias_position_mean": 0.5}  # fmt: skip
    assert row["position_path_max"] == 1e-4
    assert row["position_end_rms"] == pytest.approx(5e-6)
    assert row["position_trusted"]
    assert not row["attitude_trusted"]
    assert row["attitude_end_max"] == math.inf
    assert (row["solver"], row["iterations"]) == ("quartic", None)


def test_a_tradeoff_comes_back_from_its_file(tmp_path):
    odd = dataclasses.replace(GROWN, rate=math.nan, doubling=math.inf, power=1.5, curve=np.array([1.0, math.nan, 2.0]),
                              predictable={"float64": math.inf, "float32": 66.0})  # fmt: skip
    bare = {"errors": {"position": dict.fromkeys(tradeoffs.KINDS, math.inf)}, "energy_drift": math.nan,
            "biases": {"energy_mean": math.nan}}  # fmt: skip
    found = traded(measured("a", 3.0, 1e-4), measured("b", 1.0, 1.0, **bare), growth=odd, messages=("one", "two"),
                   reference_error={"position": math.inf}, refused={"gauss4": "why"})  # fmt: skip
    files = found.save(tmp_path)
    assert [path.name for path in files] == ["tradeoff.json", "tradeoff.csv"]
    again = Tradeoff.load(files[0])
    assert again.to_dict() == found.to_dict() == json.loads(files[0].read_text())
    assert (again.messages, again.refused) == (("one", "two"), {"gauss4": "why"})
    assert again.reference_error["position"] == math.inf
    first, second = again.measurements
    assert first == found.measurements[0]
    assert second.error() == math.inf
    assert math.isnan(second.energy_drift)
    assert math.isnan(second.biases["energy_mean"])
    assert isinstance(first.setting, Candidate)
    grown = again.growth
    assert math.isnan(grown.rate)
    assert (grown.doubling, grown.power) == (math.inf, 1.5)
    assert grown.predictable == {"float64": math.inf, "float32": 66.0}
    assert math.isnan(grown.curve[1])
    assert isinstance(grown.times, np.ndarray)
    assert (grown.times.tolist(), grown.factor) == ([0.0, 1.0, 2.0], 54.6)
    assert traded(measured("a", 3.0, 1e-4), growth=None).to_dict()["growth"] is None
    assert Tradeoff.from_dict(traded(measured("a", 3.0, 1e-4), growth=None).to_dict()).growth is None
    assert found.to_dict()["front"] == [
        {"method": "a", "h": 0.1, "dtype": "float64", "solver": "quartic", "iterations": None}
    ]


REPORT = """\
note        one
sample      8 members, 0 to 4 s, 2 settings in 12 s
reference   rk8 against itself: they agree to 1.0e-09 m up to 3 s
predictable errors double every 3.47 s (rate 0.2 /s, 55 times in this run). One round-off reaches 0.01: float64 to about \
150 s, float32 to about 66 s; beyond, compare statistics only
refused     gauss4, gauss6 (why: tradeoff.json)
costs       CPU time of one thread, the least of several readings; their median is at most 1.20 times that

Cheapest settings for each error (position, largest over members and path):
us/vehicle/s  method            precision             step [s]   position [m]       rms  energy drift [J]
           1  psi_x             float32                    0.2        1.0e-02   1.0e-03           1.0e-03
           3  psi_s newton      float64                    0.1        1.0e-04   1.0e-05           1.0e-03"""


def test_a_tradeoff_in_words():
    second = dataclasses.replace(measured("psi_s", 3.0, 1e-4, cost_spread=1.2),
                                 setting=Candidate("psi_s", 0.1, solver="newton"))  # fmt: skip
    found = traded(measured("psi_x", 1.0, 1e-2, "float32", 0.2), second, messages=("one",),
                   refused={"gauss4": "a", "gauss6": "b"})  # fmt: skip
    assert str(found) == f"{REPORT}\n{found.answer}"
    lost = traded(measured("psi_x", 1.0, 1e-2, energy_drift=math.nan))
    assert "energy drift" not in str(lost)
    assert "note" not in str(lost)
    bare = str(traded(growth=None, reference_error={}))
    assert bare.splitlines()[0] == "sample      8 members, 0 to 4 s, 0 settings in 12 s"


def test_growth_in_words():
    power = dataclasses.replace(GROWN, power=1.26, factor=12.34)
    assert tradeoffs.growth_text(power) == ("errors grow like time to the power 1.3, 12 times in this run: single "
                                            "trajectories are meaningful throughout")  # fmt: skip
    unknown = dataclasses.replace(GROWN, rate=math.nan)
    assert tradeoffs.growth_text(unknown) == "unknown: a difference of 1e-8 rad grows beyond measure at once"


def test_biases_in_words():
    def one(name, h, order, dtype="float64", **biases):
        return measured(name, 1.0, 1e-3, dtype, h, order=order, biases=biases)

    ones = [one("rk4", 0.1, 4, position_mean=9.0), one("psi_s", 0.1, 2, position_mean=0.5, energy_mean=2.0),
            one("psi_s", 0.2, 2, position_mean=1.0, position_std=3.0, depth_mean=7.0), one("psi_s", 0.3, 2),
            one("psi_s", 0.4, 2, "float32", position_mean=8.0)]  # fmt: skip
    lines = tradeoffs.bias_lines(traded(*ones))
    assert lines[1] == "Bias of statistics up to 4 s by psi_s, in standard errors of 8 members (1.4: chance):"
    assert lines[2].split("  ")[-1].strip() == "ang.mom. mean"
    assert lines[2].startswith("    step [s]  position mean   position std")
    assert [line.split() for line in lines[3:]] == [
        ["0.2", "1.0e+00", "3.0e+00", "-", "-", "-", "-"], ["0.1", "5.0e-01", "-", "-", "-", "2.0e+00", "-"]]  # fmt: skip
    deep = tradeoffs.bias_lines(traded(*ones, of="depth"))
    assert deep[2].startswith("    step [s]     depth mean  position mean")
    assert deep[3].split()[1] == "7.0e+00"
    assert "speed" not in tradeoffs.bias_lines(traded(*ones, of="speed"))[2]
    assert tradeoffs.bias_lines(traded(ones[4], measured("psi_s", 1.0, 1.0))) == []


@pytest.mark.parametrize(("methods", "words"), [
    (["psi_z"], "methods = 'psi_z' is not known. Known: "), ([], "methods = [] is empty. Name one method or more"),
])  # fmt: skip
def test_methods_that_are_none_are_refused(scene, methods, words):
    assert words in refusal(lw.tradeoff, fleet_of(scene), 4.0, methods=methods)


def test_steps_are_halved_until_round_off_and_between_near_the_front(scene):
    runs, shares = Runs({"psi_s": 1e-2}), []
    with made_by(runs):
        found = lw.tradeoff(fleet_of(scene), 4.0, methods=["psi_s"], seconds=ENOUGH, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    ladders = {}
    for name, dtype, h in runs.settings:
        if name == "psi_s":
            ladders.setdefault(dtype, []).append(h)
    assert list(ladders) == ["float64", "float32", "float32_compensated"]
    names = [one.setting.name for one in found.measurements]
    assert list(dict.fromkeys(names)) == ["psi_s", "psi_s quartic 1", "psi_s cayley", "psi_s newton"]
    steps = sorted({one.setting.h for one in found.measurements if one.setting.text == "psi_s float64"}, reverse=True)
    halved = [0.2 / 2**i for i in range(len(steps))]
    assert set(halved[:8]) <= set(steps)
    # Round-off ends a series after two steps that gain nothing.
    coarse = {one.setting.h for one in found.measurements if one.setting.text == "psi_s float32"}
    assert len(coarse & set(halved)) < len(set(steps) & set(halved))
    assert len(runs.results) == len(set(runs.results))


def test_every_method_has_a_coarse_setting_before_any_step_is_halved(scene):
    methods = ["psi_x", "psi_s", "rk4", "su4(psi_x)"]
    runs = Runs(dict.fromkeys(methods, 1e-2))
    tradeoff_by(runs, fleet_of(scene), methods=methods)
    # After the reference, and the two runs of the growth.
    settings, coarsest = [one for one in runs.settings if one[0] in methods][2:], 0.2
    assert [name for name, dtype, h in settings[:4] if (dtype, h) == ("float64", coarsest)] == methods
    # Then in turn: no series is more than one halving ahead of another that still goes on.
    halved = [h for _, _, h in settings if h < coarsest]
    assert {name for name, _, h in settings if h == 0.5 * coarsest} == set(methods)
    assert halved[: len(methods)] == [0.5 * coarsest] * len(methods)


def test_without_time_what_was_asked_for_by_name_is_tried(scene):
    fleet = fleet_of(scene)
    runs = Runs({"psi_x": 1.0, "rk4": 1.0})
    asked = tradeoff_by(runs, fleet, methods=["psi_x", "rk4"], seconds=1e-6)
    assert {one.setting.text for one in asked.measurements} == {"psi_x float64", "rk4 float64"}
    (note,) = asked.messages
    assert note.startswith(
        "no time for psi_x float32, rk4 float32, psi_x float32_compensated, psi_x float64 at fine steps"
    )
    assert note.endswith(": run again, the kernels are compiled now, or give more seconds")
    unasked = tradeoff_by(Runs({}), fleet, seconds=1e-6)
    assert {one.setting.text for one in unasked.measurements} == {"kl8(psi_x) float64"}


@pytest.mark.ci
@pytest.mark.slow_but("suggest")
@pytest.mark.parametrize("study", ["tradeoff", "suggest"])
def test_time_that_other_programs_take_does_not_end_a_search(scene, study):
    """Every run waits as on a busy machine, longer than the search may last."""

    class Waiting(Runs):
        def run(self, plan):
            time.sleep(0.03)
            return super().run(plan)

    sizes = dict.fromkeys(("rk8", "rk4", "psi_x", "psi_s"), 1e-2)
    methods = ["psi_x", "psi_s", "rk4", "rk8"]
    found = []
    for kind in (Runs, Waiting):
        runs = kind(BAD | sizes)
        if study == "suggest":
            # Enough processor time for the arithmetic of a search, and less than its runs wait.
            one = suggestion_by(runs, fleet_of(scene), 1e-4, methods, seconds=1.0)
            found.append((one.settings, one.expected))
        else:
            one = tradeoff_by(runs, fleet_of(scene), methods=methods, seconds=1.0)
            found.append({m.setting.method for m in one.measurements})
    assert found[0] == found[1]


@pytest.mark.slow
def test_what_was_asked_for_and_has_no_reading_is_named(scene):
    runs = Runs({"psi_s": 1e-2, "rk4": math.inf})
    found = tradeoff_by(runs, fleet_of(scene), methods=["psi_s", "rk4", "gauss4"])
    unasked = tradeoff_by(runs, fleet_of(scene))
    brief = tradeoff_by(runs, fleet_of(scene), methods=["psi_s", "rk4"], seconds=1e-6)
    # With no time for more than the coarse step, that is what is told.
    assert brief.missing == {
        "rk4": "members failed at every step down to 0.2 s; for shorter ones give more seconds than 1e-06"
    }
    assert found.missing["rk4"].startswith("members failed at every step down to ")
    assert "rk4" not in unasked.missing
    assert set(found.missing) <= {"rk4", "gauss4"}
    assert unasked.missing == {}
    text = str(found)
    assert text.startswith("missing     rk4: members failed")
    assert "path; nothing of rk4" in text
    again = Tradeoff.from_dict(json.loads(found.to_json()))
    assert again.missing == found.missing
    assert json.loads(found.to_json())["missing"] == found.missing
    import matplotlib.pyplot as plt

    figure = plt.figure()
    lw.plots.tradeoff(found, figure=figure)
    assert "no measurement of rk4" in figure.get_suptitle().replace("\n", " ")
    plt.close(figure)


def trial(seconds, position, attitude=0.0, h=0.1, method="psi_s"):
    errors = {"position": {"path_max": position}, "attitude": {"path_max": attitude}}
    return Trial(Candidate(method, h), None, None, errors, seconds)


def test_a_setting_is_hopeless_where_a_tenth_of_its_time_does_better():
    slow = trial(10.0, 1e-3)
    assert is_dominated(slow, [slow, trial(0.9, 1e-4)])
    assert not is_dominated(slow, [slow, trial(1.0, 1e-4)])
    assert not is_dominated(slow, [trial(0.9, 1e-3)])
    assert not is_dominated(slow, [trial(0.9, 1e-4, 1e-2)])
    assert is_dominated(trial(10.0, 1e-6, 1e-3), [trial(0.9, 1e-4)])
    assert not is_dominated(trial(10.0, math.inf), [trial(0.9, 1e-4)])


def test_steps_between_are_tried_near_the_front(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    trials = [trial(1.0, 1e-2, h=sample.h(1)), trial(2.0, 1e-3, h=sample.h(10)), trial(3.0, 1e-1, h=sample.h(20))]

    def run(candidate):
        return trial(1.0, 1.0, h=candidate.h)

    more = between(sample, trials, Budget(ENOUGH), run)
    assert sorted(one.candidate.h for one in more) == sorted(sample.h(m) for m in (7, 14))
    assert between(sample, trials[:2], Budget(-1.0), run) == []


# Suggestions


@pytest.mark.parametrize("law", [
    lambda rng, n: np.abs(rng.normal(size=n)) ** 4, lambda rng, n: np.exp(rng.normal(size=n)),
    lambda rng, n: np.abs(1.0 + 0.1 * rng.normal(size=n)) ** 9, lambda rng, n: rng.uniform(size=n) ** 5,
])  # fmt: skip
@pytest.mark.parametrize("members", [1024, 20_000])
def test_the_largest_error_of_a_fresh_fleet_is_foreseen(law, members):
    """Brute force: nine in ten of 200 fresh fleets keep what the tail of 1,024 others says; by the maximum, half."""
    rng, n = np.random.default_rng(1), 200
    checked = [law(rng, 1024) for _ in range(n)]
    fresh = np.array([law(rng, members).max() for _ in range(n)])
    foreseen = np.array([suggest.largest_in_fleet(one, members) for one in checked])
    # Three standard deviations of a fraction of 200.
    assert np.mean(fresh <= foreseen) > 0.9 - 3.0 * math.sqrt(0.09 / n)
    assert np.mean(fresh <= [one.max() for one in checked]) < 0.65


def test_a_tail_of_few_or_of_equal_errors():
    assert suggest.largest_in_fleet(np.array([1.0, 3.0, 2.0]), 10**6) == 3.0
    # The quantiles of a power law of their rank: of a fleet one in ten exceeds (members / CHANCE)^a.
    for a in (0.2, 0.5):
        errors = (np.arange(1, 4001) / 4000.0) ** -a
        assert suggest.largest_in_fleet(errors, 10**6) == pytest.approx((10**6 / suggest.CHANCE) ** a, rel=0.5)
    assert suggest.largest_in_fleet(np.full(1000, 2.0), 10**6) == 2.0
    assert suggest.largest_in_fleet(np.zeros(1000), 10**6) == 0.0


SIZES = {"rk8": 20.0, "kl8(psi_x)": 0.2, "psi_x": 0.05, "psi_1": 0.2}
PRICES = {("rk8", "float64"): 8.0, ("kl8(psi_x)", "float64"): 17.0, ("psi_x", "float64"): 1.0, ("psi_1", "float64"): 1.2,
          ("psi_x", "float32"): 0.6, ("psi_1", "float32"): 0.7, ("rk8", "float32"): 5.0}  # fmt: skip


def longest(name, error, n=4, t1=4.0):
    """The step at which the largest error is this one."""
    return (error / (SIZES[name] * t1 * n)) ** (1.0 / lw.Method(name).order)


@pytest.mark.parametrize("error", [1e-1, 1e-3, 1e-7])
def test_a_suggestion_is_the_cheapest_by_arithmetic(scene, error):
    fleet = fleet_of(scene)
    runs = Runs(BAD | SIZES, PRICES, round_off=1e-5)
    found = suggestion_by(runs, fleet, error, threads=2)
    exact_price = {name: PRICES[name, "float64"] / longest(name, error / suggest.SAFETY) for name in SIZES}
    # float32 has an error of 1.6e-4 of its own.
    least = min(exact_price, key=exact_price.get)
    assert (found.setting.method, found.setting.dtype) == (least, "float64" if error < 1e-3 else "float32")
    assert found.expected <= error
    assert found.margin == error / found.expected
    assert found.setting.h <= longest(found.setting.method, error)
    assert found.setting.h > 0.75 * longest(found.setting.method, error)
    assert found.us_per_vehicle_second == PRICES[found.setting.method, found.setting.dtype] / found.setting.h
    assert found.settings == found.setting.options()
    assert (found.members, found.t1, found.of, found.unit) == (4, 4.0, "position", "m")
    assert (found.threads, found.worst, found.error, found.messages) == (1, (3, 2, 1, 0), error, ())
    prices = [price for _, price, _ in found.rivals]
    assert prices == sorted(prices)
    assert all(price >= found.us_per_vehicle_second for price in prices)
    assert runs.settings


def test_a_suggestion_that_no_step_keeps_is_refused(scene):
    with pytest.raises(lw.SceneError) as caught:
        suggestion_by(Runs({"psi_x": 1e12, "rk8": 0.0}), fleet_of(scene), 1e-3, ["psi_x"])
    assert str(caught.value) == ("error = 0.001 m of position: no step of psi_x kept it. Ask for a larger error or a shorter "
                                 "t1.")  # fmt: skip


def test_others_are_tried_where_the_short_list_fails(scene):
    """None of the short list keeps the error; psi_s does."""
    sizes = dict.fromkeys(("rk8", "kl8(psi_x)", "psi_x", "psi_1"), 0.0) | {"psi_s": 1e-3}
    bad = {"psi_x": 1e12, "psi_1": 1e12}
    of, names = compared.compared_in("position"), ("psi_x", "psi_1", "psi_s")
    known = make_reference(
        Sample(fleet_of(scene), 4.0, 128, suggest.TIMES, kernels=Runs({})), goal=1e-4, seconds=ENOUGH
    )
    known.sample.kernels = Runs(sizes | bad)
    sample = Sample(fleet_of(scene), 4.0, 128, suggest.TIMES, kernels=known.sample.kernels)
    found = suggest.suggestion_on(sample, of, 1e-3, names, ENOUGH, void, False, make_reference=lambda *_, **__: known)
    assert found.setting.method == "psi_s"


def test_what_is_too_dear_or_too_fine_is_not_tried(scene):
    """A method whose steps cost twice what the cheapest setting does; a precision whose round-off is near the error."""
    prices = {
        ("psi_s", "float64"): 3.0,
        ("psi_s", "float32"): 9.0,
        ("psi_x", "float64"): 1e4,
        ("psi_x", "float32"): 1e4,
    }
    runs = Runs({"psi_s": 1e-2, "psi_x": 1e-2}, prices)
    found = suggestion_by(runs, fleet_of(scene), 1e-3, ["psi_s", "psi_x"])
    assert found.setting.method == "psi_s"
    assert [rival.method for rival, _, _ in found.rivals] == []
    assert min(h for name, _, h in runs.settings if name == "psi_x") > found.setting.h
    # Paths are 16 m long: 4 units in the last place of float32 are 3.8e-6 m.
    for error, tried in (
        (4.0 * 2.0**-24 * 16.0 * suggest.SAFETY, False),
        (4.1 * 2.0**-24 * 16.0 * suggest.SAFETY, True),
    ):
        runs = Runs({"psi_s": 1e-9}, round_off=0.0)
        suggestion_by(runs, fleet_of(scene), error, ["psi_s"])
        assert ("float32" in {dtype for _, dtype, _ in runs.settings}) == tried
    near = {("psi_s", "float64"): 1.0, ("psi_x", "float64"): 1.49, ("psi_w", "float64"): 1.51}
    found = suggestion_by(Runs(dict.fromkeys(("psi_s", "psi_x", "psi_w"), 1.0), near), fleet_of(scene), 1e-6,
                          ["psi_s", "psi_x", "psi_w"])  # fmt: skip
    assert [rival.method for rival, _, _ in found.rivals] == ["psi_x"]


def test_a_precision_whose_error_ceases_to_fall_is_given_up(scene):
    runs = Runs({"psi_s": 1e-2}, {("psi_s", "float32"): 0.01}, round_off=2e-3)
    found = suggestion_by(runs, fleet_of(scene), 1e-3, ["psi_s"])
    assert found.setting.dtype == "float64"
    coarse = [h for _, dtype, h in runs.settings if dtype == "float32"]
    assert 2 <= len(coarse) <= 6


def test_damping_limits_a_step_above_twice_its_rate(scene):
    damped = Sample(fleet_of(scene, terms=[lw.terms.Drag(linear=[1.0] * 6)]), 4.0, kernels=Runs({}))
    reference, of = make_reference(damped, seconds=ENOUGH), compared.compared_in("position")
    rate = h_rates(rates(damped.ensemble), 1.0)["drag"]
    one = Ladders(damped, reference, of, 1e-3, Budget(ENOUGH))
    assert one.limited_by_damping
    for ratio, limited in ((1.99, False), (2.01, True)):
        one.priced = [(1.0, SimpleNamespace(candidate=Candidate("psi_s", ratio / rate)))]
        assert one.limited_by_damping is limited


def test_a_step_that_more_members_need_shorter_is_shortened_by_its_order(scene):
    """Among 256 members 128 are searched; the error grows with the member."""
    runs = Runs(BAD | {"rk8": 0.0, "kl8(psi_x)": 0.0, "psi_s": 0.1})
    found = suggestion_by(runs, fleet_of(scene, 256), 1e-2, ["psi_s"])
    assert found.members == 256
    assert found.expected <= 1e-2
    assert found.worst[:3] == (255, 254, 253)
    assert len(found.worst) == 32
    longest_step = math.sqrt(1e-2 / (0.1 * 4.0 * 256))
    assert 0.6 * longest_step < found.setting.h < longest_step


def suggested(**more):
    fields = {"settings": {}, "setting": Candidate("psi_s", 0.0123456789), "error": 1e-3, "of": "position", "unit": "m",
              "expected": 4e-4, "us_per_vehicle_second": 2.0, "run_seconds": 1.234, "threads": 2, "memory_bytes": 3_400_000,
              "members": 64, "t1": 150.0, "reference": "a against b", "reference_error": 1e-9}  # fmt: skip
    return Suggestion(**fields | more)


def test_a_suggestion_in_words():
    one = suggested(rivals=((Candidate("rk4", 0.1, "float32"), 3.0, 2e-4),), messages=("busy",))
    assert str(one).splitlines() == [
        "note        busy",
        "checked     64 members, 2.5 times better than requested",
        "predicted   1.2 s on 2 threads, 3.4 MB",
        "reference   a against b: they agree to 1.0e-09 m",
        "  next best rk4, float32, step 0.1 s: 1.50 times the time, position to 2.0e-04 m",
        one.answer,
    ]
    assert "on 1 thread, " in str(suggested(threads=1))
    assert "note" not in str(suggested())
    assert suggested().margin == pytest.approx(2.5)
    assert suggested(expected=0.0).margin == math.inf


def test_memory_and_time_are_those_of_all_members(scene):
    fleet = fleet_of(scene, 1000, every=0.5)
    for dtype, size in (("float64", 8), ("float32", 4)):
        candidate = Candidate("psi_s", 0.1, dtype)
        assert suggest.memory_of(fleet, candidate, 4.0) == 1000 * (9 * 18 * size + suggest.BYTES_OF_A_MEMBER)
    runs = Runs({})
    timed = mock.Mock(side_effect=lambda calls, rounds: (calls[0](), np.array([[3.0, 2.0]]))[1])
    seconds = suggest.seconds_of(fleet, Candidate("psi_s", 0.1), 4.0, kernels=runs, timed=timed)
    few = suggest.seconds_of(fleet.subset(range(10)), Candidate("psi_s", 0.1), 4.0, kernels=runs, timed=timed)
    assert seconds == pytest.approx(2.0 * 1000 / 256)
    assert few == 2.0
    assert timed.call_args.args[1] == 2
    assert set(runs.settings) == {("psi_s", "float64", 0.1)}


def test_a_finished_run_is_checked_with_half_the_step(scene):
    fleet = fleet_of(scene, 100)
    found = suggested(
        setting=Candidate("psi_s", 0.1), worst=(99, 7), asked=compared.compared_in("position"), of="position"
    )
    plan = Sample(fleet, 4.0, 100, 5).plan(Candidate("psi_s", 0.1))
    checks = []

    def run(item, threads):
        checks.append(item)
        path = exact(item.grid.times, 100)[:, item.ensemble.indices]
        return made(path, item.grid.times)

    error, members = suggest.verified(fleet, Runs({"psi_s": 1.0}).run(plan), found, run=run)
    (one,) = checks
    assert members == 64
    assert list(one.ensemble.indices) == [99, 7, *range(7), *range(8, 63)]
    assert (one.grid.h, one.grid.steps, one.dtype, one.method.name) == (0.05, 80, "float64", "psi_s")
    # The finer run is exact here: all of the error is seen, and more is concluded of order 2.
    assert error == pytest.approx(100 * 4.0 * 0.1**2 / (1.0 - 2.0**-2))
