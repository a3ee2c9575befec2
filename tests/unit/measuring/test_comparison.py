# SPDX-License-Identifier: Apache-2.0
"""Comparisons of settings whose runs are made by hand: errors of known size, references, fronts, suggestions, reports."""

import copy
import dataclasses
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
from lgvi_warp.accuracy.tradeoff import Measurement, Tradeoff
from lgvi_warp.common.status import Status
from lgvi_warp.measuring import comparison, cost
from lgvi_warp.measuring import distance as compared
from lgvi_warp.measuring.budget import Budget
from lgvi_warp.measuring.comparison import Candidate, Sample
from lgvi_warp.measuring.ladders import Ladders, lengthened
from lgvi_warp.measuring.reference import (
    PRECISE,
    Growth,
    Reference,
    extrapolated,
    fitted,
    make_reference,
    measured_growth,
    more_seconds,
    paired,
    time_over,
)
from lgvi_warp.measuring.speed import void
from lgvi_warp.measuring.trials import PRECISIONS, Trial, between, is_dominated, trials_of, tried
from lgvi_warp.methods.method import Method
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics import notation
from lgvi_warp.runs.default_method import h_rates
from lgvi_warp.runs.step_error import rates
from tests.conftest import ROOT
from tests.support.made import made

ENOUGH = 1e4
CURRENT = lw.terms.GaussMarkovCurrent(standard_deviation=[0.2, 0.2, 0.05], time_constant=30.0)
# No method on the front.
BAD = dict.fromkeys((*suggest.CANDIDATES, *PRECISE), 1e12)
NAMES = ["position", "attitude", "velocity", "angular_velocity", "energy"]


@pytest.fixture(scope="module")
def scene():
    """The paper's vehicle; samples are at equal times, five unless a test says more."""
    paper = lw.Scene.load(ROOT / "examples" / "paper.toml")
    return dataclasses.replace(paper, run=dataclasses.replace(paper.run, save_every=None))


def exact(t, n):
    """Paths (k, n, 3) [m] that no setting meets exactly."""
    return np.stack(
        [np.sin(t)[:, None] * np.ones(n), np.outer(t, np.arange(1.0, n + 1.0)), np.ones((len(t), n))], axis=2
    )


class Runs:
    """Stands for the kernels: a run's error along x is size[method] h^order times time times (1 + index of the member).

    An infinite size is a failure. A step costs `prices[method, dtype]` microseconds; float32 adds `round_off` to the error.
    """

    def __init__(self, sizes, prices=None, round_off=1e-5):
        self.sizes, self.prices, self.round_off, self.settings = sizes, prices or {}, round_off, []

    def compile(self, plan):
        return 0.0

    def clock(self):
        return 0.0

    def run(self, plan):
        name, h, n = plan.method.name, plan.grid.h, plan.ensemble.members
        self.settings.append((name, plan.dtype, h))
        t = plan.grid.times
        path, single, size = exact(t, n), plan.dtype != "float64", self.sizes.get(name, 0.0)
        fails = {"status": np.full(n, Status.NON_FINITE), "end": np.full(n, t[1])} if size == math.inf else {}
        if not fails:
            path[..., 0] += (size * h**plan.method.order + single * self.round_off) * np.outer(t, 1.0 + np.arange(n))
        result = made(path, t, dtype=np.float32 if single else np.float64, **fails)
        return dataclasses.replace(
            result, provenance=result.provenance | {"step": h}, compile_seconds=0.0, run_seconds=0.0
        )

    def costs(self, plans, rounds=5):
        return [cost.Cost(self.prices.get((p.method.name, p.dtype), 1.0) / p.grid.h, 1.0) for p in plans]


def on(sample, kernels):
    """The same sample, whose runs are made by others: by sizes of errors, or by what stands for the kernels."""
    sample = copy.copy(sample)
    sample.kernels = Runs(kernels) if isinstance(kernels, dict) else kernels
    return sample


def tradeoff_by(runs, fleet, of="position", methods=None, members=128, seconds=ENOUGH, **parts):
    """A trade-off up to 4 s whose runs are made by `runs`."""
    sample, names = Sample(fleet, 4.0, members, kernels=runs), tradeoffs.chosen_methods(methods)
    parts = {"grown": lambda *_: GROWN} | parts
    return tradeoffs.tradeoff_on(sample, compared.compared_in(of), names, seconds, void, methods is not None, **parts)


def suggestion_by(runs, fleet, error, methods=suggest.CANDIDATES, seconds=ENOUGH, named=False, **settings):
    """A suggestion for an error of position up to 4 s whose runs are made by `runs`."""
    sample = Sample(fleet, 4.0, 128, suggest.TIMES, kernels=runs)
    of = compared.compared_in("position")
    return suggest.suggestion_on(sample, of, error, methods, seconds, void, named, **settings)


def fleet_of(scene, n=4):
    return lw.Ensemble(scene, n, 1, scene.ensemble_settings.vary)


# Samples


def test_a_sample_takes_the_scenes_times_where_they_divide(scene):
    def sample(every, t1=4.0, samples=5):
        one = dataclasses.replace(scene, run=dataclasses.replace(scene.run, save_every=every))
        return Sample(lw.Ensemble(one, 4, 1), t1, 2, samples)

    assert sample(0.5).spacing == 1 / 2
    assert sample(0.5).times.tolist() == [0.0, 1.0, 1.5, 2.5, 3.0, 4.0]
    assert (sample(0.5).index.tolist(), sample(4.0).times.tolist()) == ([0, 2, 3, 5, 6, 8], [0.0, 4.0])
    for every in (0.3, 8.0, None):
        assert float(sample(every).spacing) == 0.8
        assert sample(every).times == pytest.approx(0.8 * np.arange(6))
    one = sample(0.5)
    assert (one.members, one.whole.members, one.t1, one.draws, one.fixed_draws) == (2, 4, 4.0, 0, 0)
    more = one.more(3)
    assert (more.members, more.t1, more.samples) == (3, 4.0, 5)
    assert Sample(one.whole, 4.0).members == 4
    assert one.h(4) == 0.125
    assert one.candidate("rk4", 2, "float32") == Candidate("rk4", 0.25, "float32")
    assert one.candidate("psi", 2, solver=("newton", 3)) == Candidate("psi", 0.25, "float64", "newton", 3)
    plan = one.plan(Candidate("rk4", 0.125))
    assert plan.grid.steps == 32
    assert plan.grid.times.tolist() == one.times.tolist()
    assert (plan.method.name, plan.dtype, plan.ensemble.members) == ("rk4", "float64", 2)


def test_the_end_of_a_sample_is_the_scenes_or_given(scene):
    fleet = lw.Ensemble(scene, 2)
    assert (Sample(fleet).t1, Sample(fleet, 3.0).t1) == (scene.run.duration, 3.0)
    endless = lw.Ensemble(dataclasses.replace(scene, run=dataclasses.replace(scene.run, duration=None)), 2)
    with pytest.raises(
        lw.SceneError, match=r"t1 = None: is missing; give the end in seconds: t1=150.0 or \[run\] duration"
    ):
        Sample(endless)


def test_the_coarsest_step_turns_by_an_angle(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    rates = np.linalg.norm(sample.ensemble.select(0, 4).angular_velocity, axis=1)
    slowest = 2.0 * math.pi / 4.0
    assert sample.rate == max(rates.max(), slowest) == slowest
    fast = dataclasses.replace(scene, start=dataclasses.replace(scene.start, angular_velocity=[0.0, 3.0, 4.0]))
    assert Sample(lw.Ensemble(fast, 1), 4.0, samples=5).rate == 5.0
    assert sample.coarsest(0.5) == math.ceil(0.8 * slowest / 0.5) == 3
    assert (sample.coarsest(100.0), sample.allowed(7)) == (1, 7)
    noisy = Sample(lw.Ensemble(dataclasses.replace(scene, terms=[CURRENT]), 2), 4.0, samples=5).on_grid(12)
    assert [noisy.allowed(m) for m in (1, 4, 5, 7, 12, 13)] == [1, 4, 6, 12, 12, 12]
    assert noisy.draws == 12
    assert noisy.ensemble.scene.terms[0].noise_step == pytest.approx(0.8 / 12)


def test_draws_that_the_scene_fixes(scene):
    def sample(*steps):
        terms = [dataclasses.replace(CURRENT, noise_step=step, name=f"c{i}") for i, step in enumerate(steps)]
        return Sample(lw.Ensemble(dataclasses.replace(scene, terms=terms), 2), 4.0, samples=5)

    assert [sample(*steps).fixed_draws for steps in ((None,), (0.1,), (0.1, 0.2), (0.8,))] == [0, 8, 4, 1]
    with pytest.raises(lw.SceneError) as caught:
        sample(0.3)
    words = "c0.noise_step = 0.3: does not divide the 0.8 s between the times of the comparison; give run.save_every"
    assert words in str(caught.value)
    own = lw.Ensemble(dataclasses.replace(scene, terms=[dataclasses.replace(CURRENT, noise_step=0.1)]), 2)
    assert comparison.drawn_every(own, 0.05).scene.terms[0].noise_step == 0.1
    assert comparison.drawn_every(own, 0.05, own_grid=False).scene.terms[0].noise_step == 0.05
    assert own.scene.terms[0].noise_step == 0.1


def test_noise_is_none_or_on_a_grid(scene):
    assert Sample(fleet_of(scene), 4.0).noise("psi_s") == "none"
    assert Sample(lw.Ensemble(dataclasses.replace(scene, terms=[CURRENT]), 2), 4.0).noise("psi_s") == "grid"


def test_methods_are_taken_refused_or_the_same_as_others(scene):
    sample = Sample(fleet_of(scene), 4.0)
    names = ["psi_x", "rk4", "psi_s"]
    assert sample.accepted(names) == (names, {})
    assert sample.accepted(names, most=2)[0] == names[:2]
    damped = Sample(lw.Ensemble(dataclasses.replace(scene, terms=[lw.terms.Drag(linear=[1.0] * 6)]), 2), 4.0)
    taken, refused = damped.accepted(["gauss4", "rk4"])
    assert taken == ["rk4"]
    assert list(refused) == ["gauss4"]
    assert "gauss4" in refused["gauss4"]
    same, refused = sample.accepted(["rk4", "rk4", "cg3"])
    assert same == ["rk4", "cg3"]
    assert refused == {"rk4": "method rk4: in this scene it is rk4"}


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


# Distances and errors


def test_distances_of_two_results():
    path = exact(np.arange(3.0), 2)
    turn = notation.matrix_from_rotation_vector(np.array([0.0, 0.3, 0.0]))
    attitude = np.broadcast_to(np.eye(3), (3, 2, 3, 3)).copy()
    attitude[1, 0], attitude[2, 1] = turn, np.diag([-1.0, -1.0, 1.0])
    moved = path + np.array([3.0, 4.0, 0.0])
    one, other = made(path), made(moved, attitude=attitude)
    apart = comparison.distances(one, other)
    assert list(apart) == NAMES
    assert np.allclose(apart["position"], 5.0)
    assert apart["attitude"] == pytest.approx(np.array([[0.0, 0.0], [0.3, 0.0], [0.0, np.pi]]))
    assert apart["energy"] == pytest.approx(np.abs(one.energy - other.energy))
    asked = comparison.distances(one, other, compared.compared_in("position[1]"))
    assert np.allclose(asked["position[1]"], 4.0)
    assert list(asked) == [*NAMES, "position[1]"]
    assert list(comparison.distances(one, other, compared.compared_in("position"))) == NAMES
    stopped = made(moved, status=[0, Status.FLOOR], end=[np.nan, 1.0])
    for pair in ((one, stopped), (stopped, one)):
        apart = comparison.distances(*pair)["position"]
        assert np.isnan(apart[1:, 1]).all()
        assert np.isfinite(apart[:, 0]).all()
        assert np.isfinite(apart[0, 1])


def test_errors_are_four_norms_up_to_a_time():
    values = np.array([[0.0, 0.0], [3.0, 1.0], [2.0, np.nan], [np.nan, np.nan], [9.0, 8.0]])
    norms = comparison.errors({"x": values}, 3)["x"]
    assert norms == pytest.approx({"end_max": 2.0, "end_rms": 2.0, "path_max": 3.0, "path_rms": np.sqrt(14.0 / 5.0)})
    early = comparison.errors({"x": values}, 1)["x"]
    assert early == pytest.approx(
        {"end_max": 3.0, "end_rms": np.sqrt(5.0), "path_max": 3.0, "path_rms": np.sqrt(10.0 / 4.0)})  # fmt: skip
    assert comparison.errors({"x": values}, 4)["x"]["end_rms"] == pytest.approx(np.sqrt(72.5))


def test_agreement_rises_and_is_infinite_where_a_run_failed():
    path = exact(np.arange(4.0), 2)
    apart = np.zeros_like(path)
    apart[1, 0, 0], apart[2, 1, 0], apart[3, 0, 0] = 3.0, 1.0, 5.0
    one, other = made(path), made(path + apart)
    assert comparison.agreement(one, other)["position"].tolist() == [0.0, 3.0, 3.0, 5.0]
    stopped = made(path + apart, status=[Status.FLOOR, 0], end=[3.0, np.nan])
    assert comparison.agreement(one, stopped)["position"].tolist() == [0.0, 3.0, 3.0, 3.0]
    failed = made(path, status=[0, Status.NON_FINITE], end=[np.nan, 2.0])
    asked = compared.compared_in("depth")
    for pair in ((one, failed), (failed, one)):
        found = comparison.agreement(*pair, asked)
        assert list(found) == [*NAMES, "depth"]
        assert all(v.tolist() == [0.0, *[np.inf] * 3] for v in found.values())
    assert list(comparison.agreement(one, failed)) == NAMES
    lost = made(np.where(np.arange(4.0)[:, None, None] == 2.0, np.inf, path))
    with np.errstate(all="ignore"):
        found = comparison.agreement(one, lost)
    assert found["position"].tolist() == [0.0, 0.0, np.inf, np.inf]
    assert not comparison.failed(stopped)
    assert comparison.failed(failed)


def test_a_reference_reaches_as_far_as_it_agrees():
    reference = Reference(None, "", {"x": np.array([0.0, 1e-3, 1e-2, 1e-2, 1.0])}, None)
    assert [reference.reaches("x", error) for error in (1e-4, 1e-3, 5e-3, 1e-2, 2.0)] == [0, 1, 1, 3, 4]
    assert (reference.error("x"), reference.error("x", 2)) == (1.0, 1e-2)


def test_two_methods_of_a_reference_are_of_like_order():
    assert paired(["rk8", "kl8(psi_x)"]) == ("rk8", "kl8(psi_x)")
    assert paired(["kl6(psi_x)", "rk4"]) == ("kl6(psi_x)", "rk4")
    assert paired(["rk8", "rk5"]) == ("rk8", "rk8")
    assert paired(["rk8"]) == ("rk8", "rk8")


def test_extrapolation_takes_out_two_orders(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)

    def cubic(plan):
        h, t = plan.grid.h, plan.grid.times
        path = exact(t, 4)
        path[..., 0] += (2.0 * h**2 + 5.0 * h**3) * t[:, None]
        return dataclasses.replace(made(path, t), compile_seconds=h)

    sample = on(sample, SimpleNamespace(run=cubic))
    found = extrapolated(sample, "psi_s", 2)
    np.testing.assert_allclose(found.position, exact(sample.times, 4), atol=1e-13)
    assert found.compile_seconds == pytest.approx(0.4 + 0.2 + 0.1)
    plain = extrapolated(sample, "rk4", 2)
    assert plain.compile_seconds == 0.4
    assert np.abs(plain.position - exact(sample.times, 4)).max() > 1.0
    noisy = extrapolated(sample.on_grid(8), "psi_s", 2)
    assert noisy.compile_seconds == 0.4


def test_a_reference_is_refined_until_it_agrees(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    sizes = {"rk8": 1.0, "kl8(psi_x)": 3.0}
    shares = []
    runs = Runs(sizes)
    sample = on(sample, runs)
    coarse = make_reference(sample, goal=1e-3, seconds=ENOUGH, report=shares.append)
    m = sample.coarsest(0.5)
    while True:
        finer = max(m + 1, round(1.5 * m))
        h, H = sample.h(finer), sample.h(m)
        error = 4.0 * 4.0 * abs(1.0 * h**8 - 3.0 * H**8)
        if error <= 1e-3:
            break
        m *= 2
    assert coarse.error("position") == pytest.approx(error, rel=1e-6)
    assert coarse.methods == ("kl8(psi_x)", "rk8")
    assert coarse.text == f"rk8 at h = {h:.4g} s against kl8(psi_x) at h = {H:.4g} s"
    assert coarse.asked.name == "position"
    assert runs.settings[-2:] == [("kl8(psi_x)", "float64", H), ("rk8", "float64", h)]
    assert len(shares) >= 1
    assert coarse.result.provenance["step"] == h
    assert coarse.sample is sample
    best = make_reference(sample, "position[0]", seconds=ENOUGH, methods=["rk8", "rk4", "psi_s"])
    assert best.methods == ("rk8", "psi_s")
    assert best.asked.name == "position[0]"
    assert best.error("position") < 1e-12
    # No better twice, and it ends.
    runs = Runs({})
    make_reference(on(sample, runs), seconds=ENOUGH, methods=["rk8", "rk5"], goal=-1.0)
    assert len(runs.settings) == 2 * 3
    runs = Runs(sizes)
    make_reference(on(sample, runs), seconds=0.0)
    assert len(runs.settings) == 2


def test_a_reference_in_noise_shares_its_draws(scene):
    noisy = lw.Ensemble(dataclasses.replace(scene, terms=[CURRENT]), 2)
    sample = Sample(noisy, 4.0, samples=5)
    runs = Runs({})
    reference = make_reference(on(sample, runs), seconds=0.0)
    m = 3 * 2 ** math.ceil(math.log2(8.0 * sample.coarsest(0.5) / 3.0))
    assert reference.methods == ("psi_x", "psi_s")
    assert reference.sample.draws == 2 * m
    assert [h for _, _, h in runs.settings] == [sample.h(m), sample.h(2 * m)]
    fixed = Sample(lw.Ensemble(dataclasses.replace(scene, terms=[dataclasses.replace(CURRENT, noise_step=0.1)]), 2), 4.0,
                   samples=5)  # fmt: skip
    runs = Runs({})
    reference = make_reference(on(fixed, runs), seconds=ENOUGH)
    assert [h for _, _, h in runs.settings] == [fixed.h(4), fixed.h(8)]
    assert reference.sample.draws == 8


def test_a_scene_without_a_precise_method_has_no_reference(scene):
    class Refusing(Sample):
        def accepted(self, *_, **__):
            return [], {}

    with pytest.raises(lw.SceneError) as caught:
        make_reference(Refusing(fleet_of(scene), 4.0))
    assert "method: the scene takes none of kl8(psi_x), rk8, " in str(caught.value)
    assert "name one that it takes: methods=[...]" in str(caught.value)


# Growth and statistics


def test_growth_needs_two_times_and_counts_only_those_later():
    t = np.array([0.0, 1.0])
    few = fitted(t, np.array([1.0, 2.0]), 1.0)
    assert all(np.isnan(value) for value in (few.rate, few.doubling, few.factor))
    assert few.power is None
    assert few.predictable == {"float64": 0.0, "float32": 0.0}
    assert few.times is t
    two = fitted(np.array([0.0, 1.0, 2.0]), np.array([7.0, 2.0, 4.0]), 2.0)
    assert two.rate == pytest.approx(math.log(2.0))
    assert two.factor == 4.0
    # Between an exponential and a power that fit alike the power is taken, but no steep one.
    assert two.power == pytest.approx(1.0)
    assert two.doubling == math.inf
    steep = fitted(np.array([0.0, 1.0, 2.0]), np.array([1.0, 2.0, 20.0]), 2.0)
    assert steep.power is None
    assert steep.doubling == pytest.approx(math.log(2.0) / math.log(10.0))
    falling = fitted(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.0, 0.5, 0.3, 0.2]), 3.0)
    assert falling.power < 0.0
    assert falling.predictable["float64"] == math.inf
    t = np.linspace(0.0, 10.0, 11)
    fast = fitted(t, np.exp(3.0 * t), 10.0)
    assert (fast.power, fast.doubling) == (None, pytest.approx(math.log(2.0) / 3.0))
    assert fast.predictable["float32"] == t[np.flatnonzero(np.exp(3.0 * t) * 2.0**-24 > 1e-2)[0]] == 5.0
    assert fast.predictable["float64"] == pytest.approx(max(10.0, math.log(1e-2 / 2.0**-53) / 3.0))


def test_growth_is_of_two_runs_whose_attitudes_differ(scene):
    fleet = fleet_of(scene, 3)
    sample = Sample(fleet, 4.0, samples=5)
    starts = []

    def run(plan):
        state = plan.ensemble.select(0, 3)
        starts.append((plan.ensemble, state))
        t = plan.grid.times
        path = exact(t, 3)
        if len(starts) == 2:
            path[..., 0] += 1e-8 * np.exp(0.5 * t)[:, None]
        return made(path, t, attitude=np.broadcast_to(state.attitude, (len(t), 3, 3, 3)))

    grown = measured_growth(on(sample, SimpleNamespace(run=run)), sample.candidate("rk4", 2))
    assert np.hypot(np.exp(0.5 * grown.times), 1.0) == pytest.approx(grown.curve, rel=1e-6)
    turn = np.swapaxes(starts[0][1].attitude, 1, 2) @ starts[1][1].attitude
    angle = np.linalg.norm(turn - np.eye(3), axis=(1, 2)) / math.sqrt(2.0)
    assert angle == pytest.approx(np.full(3, 1e-8), rel=1e-6)
    for name in ("position", "velocity", "angular_velocity"):
        assert getattr(starts[0][1], name) == pytest.approx(getattr(fleet.select(0, 3), name), abs=1e-15)
        assert np.array_equal(getattr(starts[0][1], name), getattr(starts[1][1], name))
    assert all(one.seed == 1 and list(one.indices) == [0, 1, 2] for one, _ in starts)


def test_biases_are_in_standard_errors():
    rng = np.random.default_rng(3)
    n = 50
    path = np.cumsum(rng.normal(size=(3, n, 3)), axis=0)
    one = made(path)
    scaled = path.copy()
    center = path.mean(axis=1, keepdims=True)
    scaled = center + 1.3 * (path - center) + 0.5 * path.std(axis=1, ddof=1, keepdims=True)
    found = comparison.biases(made(scaled), one)
    assert found["position_mean"] == pytest.approx(0.5 * math.sqrt(n))
    assert found["position_std"] == pytest.approx(0.3 * math.sqrt(2.0 * (n - 1)))
    # What does not vary has no standard error; neither has one member, nor one that failed.
    assert "attitude_mean" not in found
    assert "angular_velocity_std" not in found
    assert comparison.biases(made(path[:, :1]), made(path[:, :1])) == {}
    assert (
        comparison.biases(made(path, status=[Status.NON_FINITE] + [0] * (n - 1), end=[1.0] + [np.nan] * (n - 1)), one)
        == {}
    )
    assert set(comparison.biases(made(path[:, :2]), made(path[:, :2]))) >= {"position_mean", "position_std"}
    asked = comparison.biases(made(scaled), one, compared.compared_in("depth"))
    assert asked["depth_mean"] == pytest.approx(0.5 * math.sqrt(n))
    assert "depth_mean" not in found


def test_statistics_are_of_vectors_energies_and_momenta():
    path = exact(np.arange(3.0), 2)
    turn = np.broadcast_to(notation.matrix_from_rotation_vector(np.array([0.1, 0.2, 0.3])), (3, 2, 3, 3))
    result = made(path, attitude=turn)
    values = comparison.quantities_of(result)
    names = ["position", "velocity", "angular_velocity", "attitude", "energy", "linear_momentum", "angular_momentum"]
    assert (list(values), values["energy"].shape) == (names, (3, 2, 1))
    np.testing.assert_array_equal(values["attitude"], turn[..., 2, :])
    np.testing.assert_array_equal(values["linear_momentum"], invariants.linear_momentum(result))
    np.testing.assert_array_equal(values["angular_momentum"], invariants.angular_momentum(result))
    assert "depth" in comparison.quantities_of(result, compared.compared_in("depth"))
    angle = comparison.quantities_of(result, compared.Distance("heading", "rad", None))
    assert "heading" not in angle
    assert len(comparison.quantities_of(result, compared.Distance("position", "m"))) == len(names)


def test_part_of_a_result_in_memory():
    result = made(exact(np.arange(3.0), 4))
    some = comparison.part(result, [2, 0])
    np.testing.assert_array_equal(some.position, result.position[:, [2, 0]])


# Quantities


def test_a_quantitys_distance_and_size():
    path = exact(np.arange(3.0), 2)
    one, other = made(path), made(path + np.array([0.0, 3.0, 4.0]))
    assert np.allclose(compared.compared_in(" position ").distance(one, other), 5.0)
    assert compared.compared_in("position").largest(other) == np.abs(path + np.array([0.0, 3.0, 4.0])).max()
    attitude = compared.compared_in("attitude")
    assert attitude.unit == "rad"
    assert attitude.functional is None
    assert attitude.values(one).shape == (3, 2, 9)
    asked = compared.compared_in("depth")
    assert compared.compared_in(asked) is asked
    assert asked.unit == "m"
    assert not asked.mean
    assert compared.compared_in("norm(velocity)").unit == "m/s"


def test_angles_differ_the_short_way_round():
    one, other = (made(np.full((2, 1, 3), angle)) for angle in (3.1, -3.1))
    heading = compared.Distance("heading", "rad", lambda samples, members: samples["position"][..., :1])
    assert heading.distance(one, other) == pytest.approx(np.full((2, 1), 2.0 * np.pi - 6.2))
    plain = dataclasses.replace(heading, unit="m")
    assert plain.distance(one, other) == pytest.approx(np.full((2, 1), 6.2))


def test_a_mean_is_compared_by_the_end_of_its_interval():
    n = 9
    path = exact(np.arange(3.0), n)
    apart = np.zeros_like(path)
    apart[1, :, 0] = np.arange(n) - 2.0
    entry = compared.compared_in("mean position[0]")
    assert entry.name == "mean position[0]"
    assert entry.mean
    assert entry.unit == "m"
    found = entry.distance(made(path + apart), made(path))
    error = 2.0 * np.std(np.arange(n), ddof=1) / 3.0
    assert found.shape == (3, n)
    assert np.allclose(found[1], 2.0 + error)
    assert np.allclose(found[[0, 2]], 0.0)
    alone = entry.distance(made((path + apart)[:, :1]), made(path[:, :1]))
    assert alone[1] == pytest.approx([2.0])
    whole = compared.compared_in("mean position").distance(made(path + apart), made(path))
    assert np.allclose(whole[1], 2.0 + error)


@pytest.mark.parametrize(("of", "words"), [
    ("mean attitude", "of = 'mean attitude': is no mean of numbers; give the mean of an entry, such as 'mean attitude[2,2]'"),
    ("mean mean depth", "is no mean of numbers"),
    (("depth", "speed"), "of = ('depth', 'speed'): is several quantities; errors are of one of them: give its name"),
    ("max(depth)", "looks over the path, and errors are of a quantity at each time; give 'depth', whose largest error"),
])  # fmt: skip
def test_quantities_that_cannot_be_compared_are_refused(of, words):
    with pytest.raises(lw.SceneError) as caught:
        compared.compared_in(of)
    assert words in str(caught.value)


# Trade-offs


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
    assert tradeoffs.report_text(found) == REPORT
    lost = traded(measured("psi_x", 1.0, 1e-2, energy_drift=math.nan))
    assert "energy drift" not in tradeoffs.report_text(lost)
    assert "note" not in tradeoffs.report_text(lost)
    bare = tradeoffs.report_text(traded(growth=None, reference_error={}))
    assert bare == "sample      8 members, 0 to 4 s, 0 settings in 12 s"


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


def reference_of(sample, sizes, goal=0.0):
    return make_reference(on(sample, sizes), goal=goal, seconds=ENOUGH)


def test_a_trial_has_the_errors_of_its_run(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = reference_of(sample, {})
    sample = on(sample, {"psi_s": 2.0})
    trial = tried(sample, sample.candidate("psi_s", 4), reference)
    early = tried(sample, sample.candidate("psi_s", 4), reference, 2)
    blind = tried(sample, sample.candidate("psi_s", 4), None)
    size = 2.0 * sample.h(4) ** 2
    assert trial.error("position") == pytest.approx(4 * 4.0 * size)
    assert early.error("position") == pytest.approx(4 * 1.6 * size)
    assert (blind.error("position"), blind.errors) == (math.inf, {})
    assert trial.candidate == sample.candidate("psi_s", 4)
    assert trial.plan.grid.h == sample.h(4)
    assert trial.plan.method.name == "psi_s"
    assert tried(on(sample, {"psi_s": math.inf}), sample.candidate("psi_s", 4), reference).errors == {}
    noisy = Sample(lw.Ensemble(dataclasses.replace(scene, terms=[CURRENT]), 2), 4.0, samples=5).on_grid(12)
    plan = tried(on(noisy, {}), noisy.candidate("psi_s", 4), None).plan
    assert plan.ensemble.scene.terms[0].noise_step == pytest.approx(noisy.h(4))


def test_a_sweep_halves_steps_until_round_off(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = dataclasses.replace(reference_of(sample, {}), own={name: np.full(6, 1e-9) for name in NAMES})
    shares = []
    runs, budgets = Runs({"psi_s": 1e-2, "psi_x": 1e-2}), (Budget(ENOUGH), Budget(ENOUGH))
    trials, skipped = trials_of(
        on(sample, runs), ["psi_s"], reference, 5, *budgets, shares.append, solvers=[("newton", None)]
    )
    assert skipped == []
    assert shares[:4] == pytest.approx([0.0, 0.125, 0.25, 0.375])
    assert min(shares[4:]) >= 0.5
    ladders = {}
    for trial in trials:
        ladders.setdefault((trial.candidate.name, trial.candidate.dtype), []).append(trial)
    assert list(ladders) == [("psi_s", "float64"), ("psi_s", "float32"), ("psi_s newton", "float64"),
                             ("psi_s", "float32_compensated")]  # fmt: skip
    first = ladders["psi_s", "float64"]
    halved = [trial.candidate.h for trial in first]
    # Steps between, near the front, follow.
    rise = np.flatnonzero(np.diff(halved) > 0.0)
    halved = halved[: rise[0] + 1] if len(rise) else halved
    assert halved[0] == sample.h(sample.coarsest(1.0))
    assert np.allclose(np.divide(halved[:-1], halved[1:]), 2.0)
    # The finest step is the first whose error is below ten times the reference's.
    finest = min(first, key=lambda trial: trial.candidate.h)
    assert finest.error("position") < 1e-8 < 4.001 * finest.error("position")
    coarse = [t.candidate.h for t in ladders["psi_s", "float32"]]
    # Round-off ends a series after two steps that gain nothing.
    assert len(coarse) < len(halved)
    assert len(runs.settings) == len(trials)


def test_every_method_has_a_coarse_setting_before_any_step_is_halved(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = dataclasses.replace(reference_of(sample, {}), own={name: np.full(6, 1e-9) for name in NAMES})
    methods = ["psi_x", "psi_s", "rk4", "rk8"]
    runs = Runs(dict.fromkeys(methods, 1e-2))
    trials_of(on(sample, runs), methods, reference, 5, Budget(ENOUGH), Budget(ENOUGH), lambda part: None)
    coarsest = sample.h(sample.coarsest(1.0))
    firsts = [name for name, dtype, h in runs.settings[:4] if (dtype, h) == ("float64", coarsest)]
    assert firsts == methods
    # Then in turn: no series is more than one halving ahead of another that still goes on.
    halved = [h for _, _, h in runs.settings if h < coarsest]
    assert {name for name, _, h in runs.settings if h == 0.5 * coarsest} == set(methods)
    assert halved[: len(methods)] == [0.5 * coarsest] * len(methods)


def spent(seconds, of):
    """A budget of which so much is spent."""
    now = iter([0.0])
    return Budget(of, clock=lambda: next(now, seconds))


def test_a_sweep_without_time_tries_what_was_asked_for_by_name(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = reference_of(sample, {})

    def swept(runs, whole, **more):
        trials, skipped = trials_of(
            sample, ["psi_x", "rk4"], reference, 5, runs, whole, lambda part: None, compensated=(), **more
        )
        return [trial.candidate.text for trial in trials], skipped

    sample = on(sample, {"psi_x": 1.0, "rk4": 1.0})
    rest = ["psi_x float32", "rk4 float32"]
    # Nobody named them: the first begins always.
    assert swept(spent(2.0, 1.0), Budget(ENOUGH)) == (["psi_x float64"],
                                                      ["rk4 float64", *rest, "psi_x float64 at fine steps"])  # fmt: skip
    assert swept(Budget(ENOUGH), spent(2.0, 1.0))[0][:2] == ["psi_x float64"] * 2
    assert swept(spent(2.0, 1.0), spent(2.0, 1.0), named=True) == (
        ["psi_x float64", "rk4 float64"],
        [*rest, "psi_x float64 at fine steps", "rk4 float64 at fine steps"],
    )
    statistics, _ = trials_of(
        sample, ["psi_x"], None, 5, Budget(ENOUGH), Budget(ENOUGH), lambda part: None, compensated=()
    )
    assert len(statistics) == 2 * 5
    assert all(trial.errors == {} for trial in statistics)


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
            one = suggestion_by(runs, fleet_of(scene), 1e-4, methods, seconds=1.0, named=True)
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
    text = tradeoffs.report_text(found)
    assert text.startswith("missing     rk4: members failed")
    assert "path; nothing of rk4" in text
    again = Tradeoff.from_dict(json.loads(found.to_json()))
    assert again.missing == found.missing
    assert json.loads(found.to_json())["missing"] == found.missing
    import matplotlib.pyplot as plt

    figure = plt.figure()
    lw.plots.tradeoff(found, figure=figure)
    assert "no reading of rk4" in figure.get_suptitle().replace("\n", " ")
    plt.close(figure)


def test_a_reference_says_how_much_time_would_do(scene):
    sample = Sample(fleet_of(scene), 4.0, 128, 5)
    of = compared.compared_in("position")
    # Errors fall by 4 a halving, the last two runs took 1 s: from 1e-2 to 1e-4 four halvings, of 2, 4, 8 and 16 s.
    assert more_seconds(1e-2, 1e-4, 4.0, 1.0) == 2.0 + 4.0 + 8.0 + 16.0
    for unknown in ((math.inf, 1e-4, 4.0, 1.0), (1e-2, 1e-4, 1.0, 1.0), (1e-2, 0.0, 4.0, 1.0)):
        assert more_seconds(*unknown) == math.inf
    assert time_over(20.0, 20.0, 0.4) == ("20 s were over", "seconds=50 would do")
    assert time_over(20.0, math.inf, 0.4) == ("20 s were over", "give more seconds")
    rough = dataclasses.replace(reference_of(sample, {}), own={"position": np.full(6, 1.0)}, text="a and b", more=20.0)
    with pytest.raises(lw.SceneError) as caught:
        suggest.checked_reference(sample, of, 1e-2, 20.0, ["rk4"], make_reference=lambda *_, **__: rough)
    assert str(caught.value).startswith("20 s were over; seconds=50 would do. error = 0.01 m of position")
    with pytest.raises(lw.SceneError, match=r"^20 s were over; seconds=\d+ would do\. There is no reference: a and b"):
        tradeoffs.trusted_until(rough, of, 20.0)


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


def test_measurements_are_of_trials_that_did_not_fail(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = dataclasses.replace(reference_of(sample, {}), own={name: np.full(6, 1e-3) for name in NAMES})
    sample = on(sample, Runs({"psi_s": 1.0}, {("psi_s", "float64"): 3.0}))
    trials = [tried(sample, sample.candidate("psi_s", m), reference) for m in (4, 40)]
    lost = dataclasses.replace(trials[0], errors={})
    slow = dataclasses.replace(trials[1], result=dataclasses.replace(trials[1].result, compile_seconds=7.0))
    both = tradeoffs.measurements(sample, [trials[0], slow, lost], reference, reference.result, 5)
    blind = tradeoffs.measurements(sample, [lost], None, reference.result, 5)
    assert [one.setting for one in both] == [trials[0].candidate, trials[1].candidate]
    assert [one.us_per_vehicle_second for one in both] == pytest.approx([3.0 / sample.h(4), 3.0 / sample.h(40)])
    assert all(one.compile_seconds == 7.0 and one.order == 2 and one.cost_spread == 1.0 for one in both)
    limit = [one.errors["position"]["path_max"] >= 1e-2 for one in both]
    assert [one.trusted["position"] for one in both] == limit == [True, False]
    drift = invariants.drift(trials[0].result)["energy"]
    assert both[0].energy_drift == drift
    assert both[0].biases == comparison.biases(trials[0].result, reference.result)
    assert len(blind) == 1
    assert blind[0].trusted == {}


def test_a_tradeoff_says_how_far_its_reference_reaches(scene):
    runs = Runs({"psi_s": 1e-2, "rk8": 1.0, "kl8(psi_x)": 1.0})
    found = tradeoff_by(runs, fleet_of(scene), methods=["psi_s", "gauss4"], members=3)
    late = {name: np.array([0.0, *[1e-9] * 10, *[1.0] * 10]) for name in (*NAMES, "depth")}
    part = dataclasses.replace(reference_of(Sample(fleet_of(scene), 4.0), runs), own=late)
    short = tradeoff_by(runs, fleet_of(scene), "depth", ["psi_s"], make_reference=lambda *_, **__: part)
    assert (found.members, found.t1, found.until, found.of) == (3, 4.0, 4.0, "position")
    assert (found.messages, found.units) == ((), compared.QUANTITIES)
    assert found.growth is GROWN
    assert list(found.reference_error) == NAMES
    assert found.front()
    assert (short.until, short.units["depth"]) == (2.0, "m")
    assert short.messages[0] == ("errors of single members are up to 2 s, where the reference still agrees with itself; "
                                 "beyond it only statistics are meaningful")  # fmt: skip


@pytest.mark.parametrize(("methods", "words"), [
    (["psi_z"], "methods = 'psi_z': is not known; known: "), ([], "methods = []: is empty; name one method or more"),
])  # fmt: skip
def test_methods_that_are_none_are_refused(methods, words):
    assert tradeoffs.chosen_methods(None, ("a",)) == ("a",)
    assert tradeoffs.chosen_methods(["rk4"]) == ("rk4",)
    with pytest.raises(lw.SceneError) as caught:
        tradeoffs.chosen_methods(methods)
    assert words in str(caught.value)


def test_a_reference_too_rough_for_members(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    of = compared.compared_in("position")

    def reference(*own):
        result = SimpleNamespace(time=sample.times)
        return Reference(result, "a and b", {"position": np.array(own)}, sample)

    good = reference(0.0, 1e-4, 1e-4, 1e-3, 1.0, 1.0)
    assert tradeoffs.trusted_until(good, of, 1.0) == 2
    assert not tradeoffs.reaches_nothing(good, of)
    bad = reference(0.0, 0.0123, 1.0, 1.0, 1.0, 1.0)
    assert tradeoffs.reaches_nothing(bad, of)
    with pytest.raises(lw.SceneError) as caught:
        tradeoffs.trusted_until(bad, of, 1.0)
    assert str(caught.value) == ("no reference: a and b differ by 0.012 m after 0.8 s, and agree no better with shorter "
                                 "steps; give a shorter t1 (--duration)")  # fmt: skip
    noisy = Sample(lw.Ensemble(dataclasses.replace(scene, terms=[CURRENT]), 2), 4.0, samples=5).on_grid(16)
    text = "noise acts: all runs see one path of it, drawn every 0.05 s; errors by paths are of order 1"
    assert tradeoffs.noise_text(noisy) == text


def test_growth_is_measured_at_the_references_step(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    result = SimpleNamespace(provenance={"step": 0.1})
    for one, often in ((sample, 20), (sample.on_grid(16), 5)):
        seen, candidate = tradeoffs.growth_of(
            one, ["psi_s", "rk8", "rk4"], Reference(result, "", {}, one), measure=lambda *given: given
        )
        assert candidate.method == "rk8"
        assert len(seen.times) == often + 1
        assert seen.members == 4
        assert candidate.h == pytest.approx(0.1)


# Suggestions

SIZES = {"rk8": 20.0, "kl8(psi_x)": 0.2, "psi_x": 0.05, "psi_1": 0.2}
PRICES = {("rk8", "float64"): 8.0, ("kl8(psi_x)", "float64"): 17.0, ("psi_x", "float64"): 1.0, ("psi_1", "float64"): 1.2,
          ("psi_x", "float32"): 0.6, ("psi_1", "float32"): 0.7, ("rk8", "float32"): 5.0}  # fmt: skip


def longest(name, error, n=4, t1=4.0):
    """The step at which the largest error is this one."""
    return (error / (SIZES[name] * t1 * n)) ** (1.0 / Method(name).order)


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
        suggestion_by(Runs({"psi_x": 1e12, "rk8": 0.0}), fleet_of(scene), 1e-3, ["psi_x"], named=True)
    assert str(caught.value) == ("error = 0.001 m of position: no step of psi_x kept it; ask for a larger error or a shorter "
                                 "t1")  # fmt: skip


def test_others_are_tried_where_the_short_list_fails(scene):
    """None of the short list keeps the error; psi_s does."""
    sizes = dict.fromkeys(("rk8", "kl8(psi_x)", "psi_x", "psi_1"), 0.0) | {"psi_s": 1e-3}
    bad = {"psi_x": 1e12, "psi_1": 1e12}
    reference = reference_of(Sample(fleet_of(scene), 4.0, 128, suggest.TIMES), {})
    names = [name for name in suggest.CANDIDATES if name in ("psi_x", "psi_1", "psi_s")]
    runs = Runs(sizes | bad)
    known = dataclasses.replace(reference, sample=on(reference.sample, runs))
    found = suggestion_by(runs, fleet_of(scene), 1e-3, names, make_reference=lambda *_, **__: known)
    assert found.setting.method == "psi_s"


def test_a_reference_that_is_too_rough_names_what_to_ask(scene):
    sample = Sample(fleet_of(scene), 4.0, 128, 5)
    of = compared.compared_in("position")

    def refusal(own):
        rough = dataclasses.replace(reference_of(sample, {}), own={"position": np.array(own)}, text="a and b")
        make, grown = mock.Mock(return_value=rough), dataclasses.replace(GROWN, power=2.0)
        with pytest.raises(lw.SceneError) as caught:
            suggest.checked_reference(sample, of, 1e-2, 3.0, ["rk4"], make_reference=make, grown=lambda *_: grown)
        assert make.call_args.kwargs == {"goal": 1e-2 / 30.0, "seconds": 0.4 * 3.0}
        return str(caught.value)

    head = "error = 0.01 m of position up to 4 s cannot be checked: a and b differ by 1.0e+00 m, and agree no better"
    assert refusal([0.0, 1e-3, 1e-2, 1.0, 1.0, 1.0]).startswith(head)
    assert refusal([0.0, 1e-3, 1e-2, 1.0, 1.0, 1.0]).endswith(
        "; ask for t1 (--duration) up to 0.8 s, or for a larger error")  # fmt: skip
    assert "; ask for a shorter t1 (--duration), or for a larger error" in refusal([0.0, 1e-2, 1.0, 1.0, 1.0, 1.0])
    good = dataclasses.replace(reference_of(sample, {}), own={"position": np.full(6, 1e-3)})
    make = lambda *_, **__: good  # noqa: E731
    assert suggest.checked_reference(sample, of, 1e-2, 3.0, ["rk4"], make_reference=make) is good


def test_a_step_is_lengthened_as_far_as_the_target_allows(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = reference_of(sample, {})
    sample = on(sample, {"psi_s": 0.1})

    def at(m):
        return tried(sample, sample.candidate("psi_s", m), reference)

    target = 4.0 * 4.0 * 0.1 * sample.h(45) ** 2 * 1.0001
    low = at(32).error("position")
    best = lengthened(sample, at(64), 64, low, reference, "position", target)
    assert best.candidate.h == sample.h(45)
    good = at(64)
    for before in (math.inf, 0.5 * target, math.nan):
        assert lengthened(sample, good, 64, before, reference, "position", target) is good
    one = at(1)
    assert lengthened(sample, one, 1, 1e9, reference, "position", 1e8) is one
    # A step that misses the target is shortened by its order, at most twice each time.
    short, size = suggest.refined(sample, sample.candidate("psi_s", 32), reference, "position", target, 4)
    assert size == short.error("position") <= target
    assert short.candidate.h == sample.h(46)
    same, _ = suggest.refined(sample, sample.candidate("psi_s", 45), reference, "position", target, 4)
    assert same.candidate.h == sample.h(45)
    far, _ = suggest.refined(sample, sample.candidate("psi_s", 1), reference, "position", target, 4)
    assert far.candidate.h == sample.h(46) or far.error("position") <= target
    runs = Runs({"psi_s": math.inf})
    suggest.refined(on(sample, runs), sample.candidate("psi_s", 10), reference, "position", target, 4)
    assert [round(float(sample.spacing) / h) for _, _, h in runs.settings] == [10, 15, 23, 35, 53, 80, 120]


def test_the_worst_members_are_named_first(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = reference_of(sample, {})
    one = tried(on(sample, {"psi_s": 1.0}), sample.candidate("psi_s", 4), reference)
    assert suggest.worst_of(one, reference, "position") == (3, 2, 1, 0)
    assert suggest.worst_of(one, reference, "position", 2) == (3, 2)


def suggested(**more):
    fields = {"settings": {}, "setting": Candidate("psi_s", 0.0123456789), "error": 1e-3, "of": "position", "unit": "m",
              "expected": 4e-4, "us_per_vehicle_second": 2.0, "run_seconds": 1.234, "threads": 2, "memory_bytes": 3_400_000,
              "members": 64, "t1": 150.0, "reference": "a against b", "reference_error": 1e-9}  # fmt: skip
    return suggest.Suggestion(**fields | more)


def test_a_suggestion_in_words():
    one = suggested(rivals=((Candidate("rk4", 0.1, "float32"), 3.0, 2e-4),), messages=("busy",))
    assert str(one).splitlines() == [
        "note        busy",
        "chosen      psi_s, float64, step 0.0123457 s: position to 4.0e-04 m up to 150 s, 2.5 times better than asked "
        "(64 members checked)",
        "predicted   1.2 s on 2 threads, 3.4 MB",
        "reference   a against b: they agree to 1.0e-09 m",
        "  next best rk4, float32, step 0.1 s: 1.50 times the time, position to 2.0e-04 m",
    ]
    assert "on 1 thread, " in str(suggested(threads=1))
    assert "note" not in str(suggested())
    assert suggested().margin == pytest.approx(2.5)
    assert suggested(expected=0.0).margin == math.inf


def test_memory_and_time_are_those_of_all_members(scene):
    run = dataclasses.replace(scene.run, save_every=0.5)
    fleet = lw.Ensemble(dataclasses.replace(scene, run=run), 1000, 1)
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

    def run(one, threads):
        checks.append(one)
        path = exact(one.grid.times, 100)[:, one.ensemble.indices]
        return made(path, one.grid.times)

    error, members = suggest.verified(fleet, Runs({"psi_s": 1.0}).run(plan), found, run=run)
    (one,) = checks
    assert members == 64
    assert list(one.ensemble.indices) == [99, 7, *range(7), *range(8, 63)]
    assert (one.grid.h, one.grid.steps, one.dtype, one.method.name) == (0.05, 80, "float64", "psi_s")
    # The finer run is exact here: all of the error is seen, and more is concluded of order 2.
    assert error == pytest.approx(100 * 4.0 * 0.1**2 / (1.0 - 2.0**-2))


def test_ladders_give_up_what_is_dear_or_stalls(scene):
    sample = Sample(fleet_of(scene), 4.0, samples=5)
    reference = reference_of(sample, {})
    of = compared.compared_in("position")

    def ladders(target, seconds=ENOUGH):
        return Ladders(sample, reference, of, target, Budget(seconds))

    def longest(one, method, dtype):
        steps = one.longest(method, dtype)
        while True:
            try:
                next(steps)
            except StopIteration as end:
                return end.value

    assert ladders(1e-3).dtypes == list(PRECISIONS)
    assert ladders(1e-12).dtypes == ["float64"]
    size = of.largest(reference.result)
    assert ladders(4.0 * 2.0**-24 * size).dtypes == ["float64"]
    assert ladders(4.1 * 2.0**-24 * size).dtypes != ["float64"]
    assert ladders(1e-30).dtypes == ["float64"]
    prices = {("psi_s", "float64"): 3.0, ("psi_x", "float64"): 100.0}
    sample = on(sample, Runs({"psi_s": 1e-2, "psi_x": 1e-2, "rk4": 1e12}, prices, round_off=1e-3))
    one = ladders(1e-3)
    h = (1e-3 / (1e-2 * 16.0)) ** 0.5
    price = longest(one, "psi_s", "float64")
    assert price == one.priced[0][0] == 3.0 / sample.h(math.ceil(0.8 / h))
    assert longest(one, "psi_x", "float64") == math.inf
    assert longest(one, "psi_s", "float32") is None
    assert one.cheapest() == [one.priced[0][1]]
    assert len(one.priced) == 1
    assert longest(ladders(1e-3, -1.0), "rk4", "float64") is None
    one.priced += [(1.49 * price, "near"), (1.5 * price, "far"), (1.2 * price, "nearer")]
    assert one.cheapest()[1:] == ["nearer", "near"]
    assert ladders(1e-3).limited_by_damping
    assert ladders(1e-3).cheapest() == []
    damped = Sample(lw.Ensemble(dataclasses.replace(scene, terms=[lw.terms.Drag(linear=[1.0] * 6)]), 2), 4.0, samples=5)
    rate = h_rates(rates(damped.ensemble), 1.0)["drag"]
    for ratio, limited in ((1.99, False), (2.01, True)):
        one = Ladders(damped, reference, of, 1e-3, Budget(ENOUGH))
        one.priced = [(1.0, SimpleNamespace(candidate=Candidate("psi_s", ratio / rate)))]
        assert one.limited_by_damping is limited
