# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy: errors that are checked, a front that is one, suggestions that keep what was asked."""

import contextlib
import csv
import dataclasses
import json
import math
import os
import subprocess
import sys
from typing import Any, ClassVar
from unittest import mock

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import add, div, int_lane, lane, mul, normals3, ones, root, struct  # noqa: F401
from lgvi_warp import cli
from lgvi_warp.accuracy import suggest as suggestion
from lgvi_warp.accuracy import tradeoff as tradeoffs
from lgvi_warp.measuring import comparison, cost
from lgvi_warp.measuring import trials as settings
from lgvi_warp.measuring.budget import Budget
from lgvi_warp.measuring.comparison import Sample
from lgvi_warp.measuring.ladders import Ladders
from lgvi_warp.measuring.reference import make_reference
from lgvi_warp.measuring.trials import TRUST, tried
from tests.conftest import ROOT
from tests.support.random_scenes import judged, random_scene
from tests.support.refusals import says

PAPER = str(ROOT / "examples" / "paper.toml")
SHORT = ["--members", "8", "--duration", "4", "--set", "run.save_every=1.0"]
METHODS = ("su4(psi_x)", "psi_s")
# Of several orders: the front has most of them.
DISTURBED = ("psi", "psi_s", "psi_x", "su4(psi_x)", "kl8(psi_x)", "rk8")
# A budget that no search here spends: all of them end by themselves, however busy the machine is.
ENOUGH = 1e4


@pytest.fixture(scope="module", autouse=True)
def kernels_of_other_tests():
    """No kernel that this file alone would load: psi_s compensated, with one solver."""
    with mock.patch.multiple(settings, COMPENSATED=("psi_s",), SOLVERS=()):
        yield


@pytest.fixture(scope="module")
def answer(scene):
    """The trade-off of two methods over four seconds."""
    fleet = lw.Ensemble(scene, 8, 1, scene.ensemble_settings.vary)
    return lw.tradeoff(fleet, 4.0, methods=METHODS, seconds=ENOUGH)


@pytest.mark.ci
@pytest.mark.parametrize("of", ["position", "attitude"])
@pytest.mark.parametrize("kind", tradeoffs.KINDS)
def test_the_front_is_monotone_and_nothing_beats_it(answer, of, kind):
    front = answer.front(of, kind)
    costs, errors = [one.us_per_vehicle_second for one in front], [one.error(of, kind) for one in front]
    assert len(front) > 3
    assert costs == sorted(costs)
    assert errors == sorted(errors, reverse=True)
    for one in answer.shown(of, kind):
        assert any(
            c <= one.us_per_vehicle_second and e <= one.error(of, kind) for c, e in zip(costs, errors, strict=True)
        )


def test_what_is_shown_is_ten_times_the_reference(answer):
    for of in ("position", "attitude", "velocity"):
        least = min(one.error(of) for one in answer.shown(of))
        assert least >= TRUST * answer.reference_error[of] > 0.0


@pytest.mark.parametrize(("method", "order", "least"), [("psi_s", 2, 1e-9), ("su4(psi_x)", 4, 1e-9)])
def test_errors_scale_with_the_order(answer, method, order, least):
    line = [one for one in answer.shown("attitude") if one.setting.name == method and one.setting.dtype == "float64"]
    fine = [one for one in line if least < one.error("attitude") < 1e-3]
    slope = np.polyfit(np.log([one.setting.h for one in fine]), np.log([one.error("attitude") for one in fine]), 1)[0]
    assert len(fine) >= 3
    assert abs(slope - order) < 0.3


@pytest.mark.ci
def test_the_reference_is_the_truth(answer, scene):
    sample = Sample(scene, 4.0)
    reference = make_reference(sample, seconds=ENOUGH)
    other = sample.run(sample.candidate("kl6(psi_x)", 40))
    apart = comparison.errors(comparison.distances(other, reference.result), -1 + len(sample.times))
    assert apart["position"]["path_max"] < 1e-11
    assert reference.error("position") < 1e-11


def test_one_cost_a_step_for_each_kernel(answer):
    by_kernel = {}
    for one in answer.measurements:
        by_kernel.setdefault((one.setting.name, one.setting.dtype), []).append(
            one.us_per_vehicle_second * one.setting.h
        )
    assert len(by_kernel) == 2 * len(METHODS) + len(set(METHODS) & set(settings.COMPENSATED))
    assert all(np.ptp(steps) <= 1e-12 * max(steps) for steps in by_kernel.values())
    assert any(len(steps) > 3 for steps in by_kernel.values())
    doubtful = [one for one in answer.measurements if one.cost_spread > cost.DISAGREE]
    assert bool(doubtful) == any("readings of cost disagree" in message for message in answer.messages)


@pytest.mark.ci
def test_cpu_time_is_that_of_the_run(scene):
    """Also where the run is asked for by the main thread: a hundred thousand times the steps take longer."""
    sample = Sample(scene, 4.0, 8)
    few, many = (sample.candidate("psi_s", m) for m in (4, 400_000))
    seconds = [tried(sample, one, None).cpu_seconds for one in (few, many)]
    predicted = [suggestion.seconds_of(sample.ensemble, one, 4.0) for one in (few, many)]
    assert seconds[1] > 5.0 * seconds[0]
    assert predicted[1] > 5.0 * predicted[0]


@pytest.mark.ci
def test_errors_of_whatever_statistics_know(scene, tmp_path):
    of = "depth"
    fleet = lw.Ensemble(scene, 8, 1, scene.ensemble_settings.vary)
    found = lw.tradeoff(fleet, 4.0, of, methods=["su4(psi_x)"], seconds=ENOUGH)
    assert (found.of, found.units[of]) == (of, "m")
    assert len(found.front()) > 2
    for one in found.measurements:
        assert one.error(of) <= one.error("position") * (1.0 + 1e-9)
    assert f"{of}_path_max" in found.rows()[0]
    assert json.loads(found.to_json())["units"][of]
    assert of in str(found)
    lw.plots.tradeoff(found, path=tmp_path / "of.png")
    assert (tmp_path / "of.png").stat().st_size > 10_000
    suggested = lw.suggest(fleet, 1e-4, of, t1=4.0, methods=["su4(psi_x)"], seconds=ENOUGH)
    assert suggested.of == of
    assert suggested.margin >= 1.0
    times = lw.SaveAt(at=list(Sample(fleet, 4.0).times[1:]))
    result = lw.solve(fleet, t1=4.0, save=times, threads=1, **suggested.settings)
    assert suggestion.verified(fleet, result, suggested)[0] <= 1.05e-4


@pytest.mark.parametrize(("vehicle", "terms", "names"), [
    ("torpedo", [], ["rk8", "kl8(psi_x)", "psi_x", "psi_1"]), ("remus_100", [], ["rk4", "rk8"]),
    ("torpedo", [lw.terms.Drag(linear=[5.0] * 6)], ["rk4", "rk8", "psi_x"]),
    ("torpedo", [lw.terms.GaussMarkovCurrent(standard_deviation=[0.1] * 3, time_constant=9.0)], ["psi_x", "psi_s"]),
])  # fmt: skip
def test_few_methods_are_tried_first_by_what_acts(vehicle, terms, names):
    sample = Sample(lw.Ensemble(lw.Scene.named(vehicle, terms=terms)), 4.0)
    taken = sample.accepted(suggestion.CANDIDATES)[0]
    assert suggestion.short_list(sample, taken) == names
    refused = [name for name in taken if name not in names]
    assert not refused or suggestion.short_list(sample, refused) == refused


def test_a_search_compiles_only_what_may_be_cheaper(scene, monkeypatch):
    """Costs are made up; of all kernels that of psi_s in float64 alone is there, from the reference."""
    sample = Sample(scene, 4.0, 8)
    reference = make_reference(sample, methods=("psi_s", "psi_s"), seconds=ENOUGH, goal=1.0)
    asked = suggestion.compared_in("position")

    def climbed(prices, methods, **settings):
        climbs = []

        class Priced(Ladders):
            def longest(self, method, dtype):
                climbs.append((method, dtype[5:]))
                price = prices[climbs[-1]]
                if price is not None and price < math.inf:
                    self.priced.append((price, None))
                yield from ()
                return price

        ladders = Priced(sample, reference, asked, 0.1, Budget(ENOUGH))
        ladders.climb(methods, **settings)
        return climbs

    both = ["rk4", "psi_s"]
    assert climbed({("psi_s", "64"): 9.0, ("rk4", "32"): 1.0}, both) == [("psi_s", "64"), ("rk4", "32")]
    near = {("psi_s", "64"): 2.0, ("rk4", "32"): 1.0, ("psi_s", "32"): 0.9}
    assert climbed(near, both) == list(near)
    stalled = {("psi_s", "64"): None, ("rk4", "32"): None, ("rk4", "64"): 1.0}
    assert climbed(stalled, both) == list(stalled)
    dear = {("psi_s", "64"): math.inf, ("rk4", "32"): math.inf}
    assert climbed(dear, both) == list(dear)
    assert climbed({("psi_s", "64"): 1.0}, both, new_kernels=False) == [("psi_s", "64")]


def test_compositions_of_one_method_share_a_kernel(scene):
    sample = Sample(scene, 4.0)
    specs = [sample.plan(sample.candidate(name, 1)).spec for name in ("kl8(psi_x)", "su4(psi_x)", "ss6_13(psi_x)")]
    assert specs[0] == specs[1] == specs[2] != sample.plan(sample.candidate("psi_x", 1)).spec


def test_steps_near_the_front_are_between_those_tried_first(answer):
    """Steps are halved, and beside the best ones a few are tried that are 1.4 times longer or shorter."""
    steps = {}
    for each in answer.measurements:
        steps.setdefault((each.setting.name, each.setting.dtype), []).append(each.setting.h)
    ratios = [max(h) / np.array(h) for h in steps.values()]
    assert any(np.any(np.abs(np.log2(ratio) - np.log2(ratio).round()) > 0.2) for ratio in ratios)


@pytest.mark.ci
def test_biases_shrink_with_the_step_and_are_one_for_other_members(scene):
    fleet = lw.Ensemble(scene, 64, 1, scene.ensemble_settings.vary)
    sample = Sample(fleet, 4.0)
    fine = sample.run(sample.candidate("kl8(psi_x)", 8))
    near = [comparison.biases(sample.run(sample.candidate("psi_s", m)), fine)["position_mean"] for m in (2, 8)]
    assert near[0] / near[1] == pytest.approx(16.0, rel=0.2)
    others = Sample(lw.Ensemble(scene, 64, 2, scene.ensemble_settings.vary), 4.0)
    chance = comparison.biases(others.run(others.candidate("kl8(psi_x)", 8)), fine)
    assert 0.3 < chance["position_mean"] < 4.0
    assert 0.3 < chance["position_std"] < 4.0


@wp.func
def shaken_law(w: Any, view: Any, p: Any):
    unity = ones(view.b.x)
    seed = wp.int32(7)
    w.force = w.force + (p.strength / root(view.h * unity)) * normals3(unity, p.member, view.step, seed, seed, seed)
    return w


class Shaker:
    NOISE = True
    law = shaken_law

    @staticmethod
    def params(width, real):
        return struct("Shaken", strength=lane(width, real), member=int_lane(width))


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Shaken(lw.laws.Term):
    """Noise by its own key, which knows no grid."""

    type: ClassVar[str] = "shaken_of_test"
    device: ClassVar[Any] = Shaker
    timed: ClassVar[bool] = True
    strength: Any = lw.laws.number((), "N s^1/2")

    def packed(self, numbers, context):
        return lw.laws.Packed({"strength": numbers["strength"], "member": context.members.astype(np.int32)})


CURRENT = lw.terms.GaussMarkovCurrent(standard_deviation=[0.2, 0.2, 0.05], time_constant=30.0)


def noisy_fleet(term):
    """A vehicle that this noise alone drives."""
    vehicle = lw.Vehicle(100.0, inertia=[50.0, 60.0, 70.0], added_mass=[5.0, 6.0, 7.0], buoyancy=981.0,
                         center_of_buoyancy=[0.0, 0.0, -0.01])  # fmt: skip
    return lw.Ensemble(lw.Scene(vehicle, lw.Environment(gravity=9.81), [term]), 32, 1)


@pytest.mark.slow
def test_noise_without_a_grid_compares_statistics_only(tmp_path):
    fleet = noisy_fleet(Shaken(strength=5.0))
    found = lw.tradeoff(fleet, 4.0, methods=["psi_x"], seconds=60.0)
    assert found.front() == []
    assert "noise acts" in found.messages[0]
    assert all(0.0 < one.biases["position_mean"] < 5.0 for one in found.measurements)
    lw.plots.tradeoff(found, path=tmp_path / "noise.png")
    assert (tmp_path / "noise.png").stat().st_size > 10_000
    with pytest.raises(lw.SceneError, match=r"error = 0.001: noise acts.*tradeoff"):
        lw.suggest(fleet, 1e-3, t1=4.0)


@pytest.mark.slow
def test_noise_is_compared_on_one_path():
    found = lw.tradeoff(noisy_fleet(CURRENT), 4.0, methods=["psi_x", "psi_s"], seconds=60.0)
    assert "all runs see one path" in found.messages[0]
    assert len(found.front(kind="path_rms")) > 3
    steps, errors = np.array([(one.setting.h, one.error(kind="path_rms")) for one in found.shown()
                              if one.setting.text == "psi_x float64"]).T  # fmt: skip
    # Of order 1, each by 32 members, three axes and as many times as there are.
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("noise_step", [None, 0.005])
def test_a_suggestion_in_noise_keeps_the_error(noise_step):
    fleet = noisy_fleet(dataclasses.replace(CURRENT, noise_step=noise_step))
    found = lw.suggest(fleet, 0.02, t1=4.0, methods=["psi_x"], seconds=ENOUGH)
    assert "all runs see one path" in str(found)
    assert found.expected <= 0.02
    # Half the cost of float64, whatever number of draws the longest steps take.
    assert found.setting.dtype == "float32"
    result = lw.solve(fleet, t1=4.0, threads=1, **found.settings)
    error, members = suggestion.verified(fleet, result, found)
    # Another path, and the largest of 32 members: not the same error, but one of its size.
    assert 0.2 * found.expected < error < 0.04
    assert members == 32


@pytest.mark.slow
def test_events_end_what_is_compared(scene, tmp_path):
    falling = dataclasses.replace(scene, events=[{"type": "floor", "depth": 11.0}])
    found = lw.tradeoff(lw.Ensemble(falling, 1, 1), 4.0, methods=["psi_x"], seconds=ENOUGH)
    assert found.front()[-1].error() < 1e-6
    assert found.measurements[0].biases == {}
    lw.plots.tradeoff(found, path=tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 10_000


@pytest.mark.ci
def test_time_that_is_up_leaves_the_first_method(scene):
    # As on a busy machine, where the reference's kernels alone take longer to compile than the whole is to take.
    found = lw.tradeoff(lw.Ensemble(scene, 8, 1), 4.0, methods=METHODS, seconds=1e-6)
    assert found.front()
    assert found.measurements[0].setting.name == METHODS[0]
    assert "no time for " in " ".join(found.messages)


@contextlib.contextmanager
def busy(core):
    """A second process at work on a core."""
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        os.sched_setaffinity(process.pid, {core})
        yield
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system pins no process to a core")
def test_a_busy_core_changes_no_method_of_the_front(scene):
    fleet = lw.Ensemble(scene, 8, 1, scene.ensemble_settings.vary)

    def names():
        found = lw.tradeoff(fleet, 4.0, methods=DISTURBED, seconds=ENOUGH)
        assert all(one.cost_spread >= 1.0 for one in found.measurements)
        # Errors of 10 m over up to 10,000 steps are of round-off below that: which of them is the least is chance.
        return {one.setting.name for one in found.front() if one.error() > 1e-11}

    cores = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {max(cores)})
        quiet = names()
        assert len(quiet) > 1
        for _ in range(5):
            with busy(max(cores)):
                assert names() == quiet
    finally:
        os.sched_setaffinity(0, cores)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [104, 105, 107])
def test_a_suggestion_keeps_the_error(seed):
    fleet, asked = random_scene(seed)
    found = lw.suggest(fleet, **asked, methods=METHODS, seconds=60.0)
    sample = Sample(fleet, asked["t1"], fleet.members)
    reference = make_reference(sample, asked["of"], asked["error"] / 100.0)
    times = lw.SaveAt(at=list(sample.times[1:]))
    result = lw.solve(fleet, t1=asked["t1"], save=times, threads=1, **found.settings)
    apart = comparison.distances(result, reference.result)[asked["of"]]
    assert apart.max() <= asked["error"]
    assert found.margin >= 1.0
    error, members = suggestion.verified(fleet, result, found)
    assert error <= 1.05 * asked["error"]
    assert members == 64
    assert found.memory_bytes > 0
    assert found.run_seconds > 0.0
    assert found.setting.method in str(found)


@pytest.mark.parametrize(("steps", "times"), [((4,), 4), ((5,), 1), ((41,), 4), ((8, 6), 2), ((8, 5), 1), ((3, 9), 3)])
def test_a_choice_is_checked_at_more_times_where_its_steps_allow(scene, steps, times):
    sample = Sample(lw.Ensemble(scene, 1), 10.0, 1, 5)
    assert suggestion.times_to_check(sample, [sample.candidate("rk8", m) for m in steps]) == times


# In this scene round-off grows so fast that no two runs agree to better than 2e-5 rad, however short their steps.
CHAOTIC = 36


@pytest.mark.slow
def test_what_round_off_spoils_is_refused():
    fleet, asked = random_scene(CHAOTIC)
    with pytest.raises(lw.SceneError, match="agree no better with shorter steps"):
        lw.suggest(fleet, **asked)


@pytest.mark.slow
def test_suggestions_for_twenty_scenes():
    kept = cheap = 0
    for seed in {*range(20, 41)} - {CHAOTIC}:
        fleet, asked = random_scene(seed)
        error, cost, _ = judged(fleet, lw.suggest(fleet, **asked), asked, rounds=15)
        kept, cheap = kept + (error <= 1.0), cheap + (cost <= 1.5)
    assert kept >= 19
    assert cheap >= 19


@pytest.mark.parametrize(("arguments", "words"), [
    ({"error": -1.0}, ["error = -1.0", "above 0 [m]"]), ({"of": "spead"}, ["of = 'spead'", "Did you mean 'speed'"]),
    ({"of": "max(depth)"}, ["of = 'max(depth)'", "Give 'depth'"]),
    ({"of": ["depth", "speed"]}, ["of = ['depth', 'speed']", "one of them"]),
    ({"methods": ["psi_z"]}, ["methods = 'psi_z'", "psi_x"]), ({"methods": []}, ["methods = []", "Name one"]),
    ({"t1": 0.0}, ["t1 = 0.0"]),
])  # fmt: skip
def test_bad_arguments_are_refused_with_the_remedy(scene, arguments, words):
    with pytest.raises(lw.SceneError) as caught:
        lw.suggest(scene, **({"t1": 1.0} | arguments))
    assert all(word in str(caught.value) for word in words)


@pytest.mark.ci
def test_the_command_writes_files_that_load_again(tmp_path, capsys):
    options = ["--methods", "su4(psi_x)", "--seconds", str(ENOUGH)]
    assert cli.main(["tradeoff", PAPER, "--out", str(tmp_path), *SHORT, *options]) == 0
    out = capsys.readouterr().out
    says(
        out,
        "sample      8 members",
        "reference   ",
        "they agree to",
        "predictable ",
        "psi_x",
        "Bias of",
        "tradeoff.png",
    )
    content = json.loads((tmp_path / "tradeoff.json").read_text())
    with (tmp_path / "tradeoff.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(content["measurements"]) > 8
    assert content["units"]["position"] == "m"
    assert [float(row["h"]) for row in rows] == [one["setting"]["h"] for one in content["measurements"]]
    assert sum(row["front"] == "True" for row in rows) == len(content["front"])
    from matplotlib.image import imread

    picture = imread(tmp_path / "tradeoff.png")
    assert picture.shape[1] > 1200
    assert all(third.std() > 0.05 for third in np.array_split(picture[..., :3], 3, axis=1))


@pytest.mark.ci
def test_run_with_an_error_chooses_and_checks(tmp_path, capsys):
    options = ["--error", "1e-4", "--of", "attitude", "--method", "psi_s"]
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SHORT, *options]) == 0
    out = capsys.readouterr().out
    says(out, "psi_s float32 with step", "keeps attitude to 0.0001 rad", "predicted", "members     8, psi_s")
    says(out, "checked     error of attitude")
    assert lw.Result.load(tmp_path / "result.npz").provenance["method"]["name"] == "psi_s"


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--error", "1e-3", "--step", "0.1"], ["--step 0.1", "Leave out"]), (["--of", "position"], ["--error 1e-3"])],
)
def test_options_that_contradict_are_refused(options, words, tmp_path, capsys):
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SHORT, *options]) == 2
    text = capsys.readouterr().err
    assert all(word in text for word in words)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_suggestion_keeps_its_error_on_fresh_members(seed):
    """Brute force: a fleet drawn by another seed, run by what was suggested, beside rk8 at a step of 1/400 s."""
    drag = lw.terms.Drag(linear=[4.0, 12.0, 12.0, 0.5, 2.0, 2.0], quadratic=[5.0, 30.0, 30.0, 1.0, 5.0, 5.0])
    scene = dataclasses.replace(lw.Scene.named("torpedo"), terms=[drag], start=lw.Start(velocity=[1.0, 0.0, 0.0]))
    vary = {
        "start.angular_velocity": lw.distributions.Normal(std=0.3),
        "start.velocity": lw.distributions.Normal(std=0.2),
    }
    found = lw.suggest(lw.Ensemble(scene, 2000, seed, vary), 1e-3, t1=8.0, methods=("rk4", "rk8"), seconds=ENOUGH)
    fresh, save = lw.Ensemble(scene, 2000, seed + 100, vary), lw.SaveAt(every=1.6)
    result = lw.solve(fresh, t1=8.0, save=save, **found.settings)
    truth = lw.solve(fresh, "rk8", h=1.0 / 400.0, t1=8.0, save=save)
    errors = np.linalg.norm(result.position - truth.position, axis=2).max(axis=0)
    assert errors.max() <= found.error
    assert errors.max() > 0.02 * found.expected
