# SPDX-License-Identifier: Apache-2.0
"""Statistics of runs: exact solutions, equal bits for any number of threads, members that fail or stop, what is kept."""

import json
import pickle
import tomllib
import tracemalloc

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.designs import Grid, Halton, LatinHypercube, Sobol
from lgvi_warp.distributions import Normal
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.keepers import observation
from lgvi_warp.engine.keepers.statistics import Gathered
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene import scene as scenes
from lgvi_warp.scene.scene import from_dict
from lgvi_warp.statistics import (
    CircularMean,
    Covariance,
    Exceedance,
    Extremes,
    FirstPassage,
    Mean,
    MeanAttitude,
    PathMaximum,
    PathMean,
    PathMinimum,
    PathRange,
    PathRms,
    PathTime,
    Quantiles,
    Quantity,
)
from lgvi_warp.statistics.base import TYPES
from tests.conftest import ROOT
from tests.support.stops import stops
from tests.support.tools import one, random_states, scene_of
from tests.unit.statistics.test_statistics import EVERY


@pytest.fixture(scope="module")
def fleet():
    """1,003 different members in four blocks, the last of them ragged."""
    return one(scene_of((1.0, 2.0, 3.0), net=-0.3, moment=(0.1, 0.2, -0.5)), *random_states(3, 1003))


SETTINGS = {"h": 0.01, "t1": 0.75, "save": lw.SaveAt(every=0.25)}


@pytest.fixture(scope="module")
def complete(fleet):
    return lw.solve(fleet, **SETTINGS, statistics=EVERY)


def same(first, second):
    """Whether two runs' statistics hold the same bytes."""
    assert list(first) == list(second)
    return all(
        first[name].arrays.keys() == second[name].arrays.keys()
        and all(first[name][key].tobytes() == second[name][key].tobytes() for key in first[name].arrays)
        for name in first
    )


@pytest.mark.ci
def test_statistics_are_those_of_the_samples(complete):
    s, b = complete.statistics, complete.position
    speed = np.linalg.norm(complete.velocity, axis=-1)
    np.testing.assert_allclose(s["mean position"].value, b.mean(axis=1), rtol=0, atol=1e-14)
    joint = np.concatenate([b, speed[..., None]], axis=-1)
    for t in range(4):
        np.testing.assert_allclose(s["covariance position, speed"].value[t], np.cov(joint[t].T), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(s["extremes velocity"]["maximum"], complete.velocity.max(axis=1))
    np.testing.assert_allclose(s["exceedance depth above 0.5"].value[:, 0], (b[..., 2] > 0.5).mean(axis=1), rtol=1e-14)
    np.testing.assert_allclose(s["mean energy"].value[:, 0], complete.energy.mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(s["mean path_maximum speed"].value[0], speed.max(axis=0).mean(), rtol=1e-13)
    passed = (b[..., 2] > 1.0).any(axis=0).mean()
    assert s["first_passage depth above 1.0"].value[-1] == pytest.approx(passed, rel=1e-12)
    ranks = np.sort(b[-1, :, 2]).searchsorted(s["quantiles depth"].value[-1, :, 0]) / 1003
    # Of a sketch of 64; between two ranks the value is interpolated.
    np.testing.assert_allclose(ranks, (0.05, 0.5, 0.95), atol=s["quantiles depth"]["rank_error"][-1] + 1 / 1003)


@pytest.mark.ci
def test_quantities_are_those_of_the_result(fleet, complete):
    inertial = np.einsum("knij,knj->kni", complete.attitude, complete.velocity)
    names = ("velocity_inertial", "attitude", "angular_velocity", "speed")
    truths = (inertial, complete.attitude.reshape(4, -1, 9), complete.angular_velocity,
              np.linalg.norm(complete.velocity, axis=-1)[..., None])  # fmt: skip
    found = lw.solve(fleet, **SETTINGS, statistics=[Mean(name) for name in names]).statistics
    for name, truth in zip(names, truths, strict=True):
        np.testing.assert_allclose(found[f"mean {name}"].value, truth.mean(axis=1), rtol=0, atol=1e-14)
    assert found["mean attitude"].coordinates["component"][5] == "attitude[1, 2]"


@pytest.mark.ci
def test_what_is_too_large_to_square_says_so(fleet):
    states = [
        np.array(getattr(fleet.select(0, 500), name))
        for name in ("position", "attitude", "velocity", "angular_velocity")
    ]
    states[0][300, 2] = 1e200
    huge = lw.solve(one(fleet.scene, *states), **SETTINGS, keep="none", statistics=[Mean("depth"), Covariance("depth")])
    assert np.all(huge.statistics["mean depth"].value > 1e197)
    assert not np.isfinite(huge.statistics["mean depth"].half_width).any()


def test_euler_angles_are_fossens():
    angles = np.array([[10.0, -20.0, 170.0], [-100.0, 60.0, -30.0]])
    R = lw.notation.matrix_from_euler_deg(angles)
    states = (np.zeros((2, 3)), R, np.zeros((2, 3)), np.zeros((2, 3)))
    scene = scene_of((1.0, 2.0, 3.0), net=-0.3, moment=(0.1, 0.2, -0.5))
    found = lw.solve(one(scene, *states), **SETTINGS, statistics=[Extremes("euler")]).statistics["extremes euler"]
    np.testing.assert_allclose(found["maximum"][0], np.deg2rad(angles.max(axis=0)), atol=1e-14)
    np.testing.assert_allclose(found["minimum"][0], np.deg2rad(angles.min(axis=0)), atol=1e-14)


def test_every_statistic_is_among_them():
    assert {one.type for one in EVERY} == {word for word, kind in TYPES.items() if not kind.ticks}


@pytest.mark.ci
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_change_no_bit(fleet, complete, threads):
    alone = lw.solve(fleet, **SETTINGS, statistics=EVERY, keep="none", threads=threads)
    assert same(alone.statistics, complete.statistics)
    assert (alone.samples, alone.members) == ({}, 1003)
    with pytest.raises(AttributeError, match="keep='all'"):
        _ = alone.position


class Ordered:
    """Blocks that finish in another order: what threads do by chance, done on purpose."""

    def __init__(self, order):
        self.order = order

    def run(self, work, blocks, advanced):
        for i in self.order:
            yield blocks[i], work(blocks[i])


@pytest.mark.ci
@pytest.mark.parametrize("order", [(3, 2, 1, 0), (2, 0, 3, 1)])
def test_the_order_in_which_blocks_finish_changes_no_bit(fleet, complete, order):
    found = lw.solve(fleet, **SETTINGS, statistics=EVERY, keep="none", executor=Ordered(order))
    assert same(found.statistics, complete.statistics)


@pytest.mark.ci
def test_segments_change_no_bit(fleet, complete, monkeypatch):
    monkeypatch.setattr("lgvi_warp.engine.launches.SEGMENT_SAMPLE_BYTES", 1)
    assert same(lw.solve(fleet, **SETTINGS, statistics=EVERY, keep="none").statistics, complete.statistics)


@pytest.mark.ci
def test_parts_pass_through_files(fleet, complete, tmp_path):
    """A store may keep a block's part, and merge it later: to the same bits, in any order."""
    plan = make_plan(fleet, **SETTINGS)
    statistics = tuple(EVERY)
    # What gathers blocks elsewhere was pickled.
    gathered, again = (pickle.loads(pickle.dumps(Gathered(plan.grid.times, plan.ensemble.members, statistics))),
                       Gathered(plan.grid.times, plan.ensemble.members, statistics))  # fmt: skip
    from lgvi_warp.engine.work import run_block

    plan.compile()
    for i in (2, 0, 3, 1):
        block: Block = blocks(1003)[i]
        (part,) = run_block(plan, block, [gathered]) or ()
        arrays, content = gathered.to_arrays(part)
        assert json.loads(json.dumps(content)) == content
        np.savez(tmp_path / f"{i}.npz", **{k.replace("/", "|"): a for k, a in arrays.items()})
    for i in (3, 1, 0, 2):
        with np.load(tmp_path / f"{i}.npz") as data:
            again.merge(blocks(1003)[i], again.from_arrays({k.replace("|", "/"): data[k] for k in data.files}, content))
    assert same(again.result(), complete.statistics)


@pytest.mark.parametrize(("sampling", "words"), [
    ("sobol", "wider than need be"), ("halton", "{ halton = { replicates = 16 } }"),
    (Sobol(replicates=2), "balanced at powers of two: 512 or 1024 members"), (Halton(replicates=2), ""),
    (Grid({"start.position[0]": 4, "vehicle.mass": 4}), "do not rely"), ("random", ""),
])  # fmt: skip
def test_intervals_of_dependent_members_are_said_to_be(scene, complete, sampling, words):
    sampled = lw.Ensemble(
        scene, 16, 1, {"start.position[0]": Normal(std=1.0), "vehicle.mass": Normal(std=1.0)}, sampling
    )
    apart = Gathered(np.zeros(1), 1003, EVERY).apart
    (text,) = observation.messages_about(complete.statistics, sampled.to_dict(), np.zeros(1003, np.uint8), apart) or (
        "",
    )
    assert words in text
    assert bool(text) == bool(words)


@pytest.mark.ci
def test_the_result_keeps_its_statistics(fleet, complete, tmp_path):
    r = lw.solve(fleet, **SETTINGS, statistics=EVERY, keep=[3, 1002])
    back = lw.Result.load(r.save(tmp_path / "r.npz"))
    assert same(back.statistics, complete.statistics)
    assert back.statistics["mean position"].unit == "m"
    assert back.kept_members.tolist() == [3, 1002]
    assert back.kept.position.tobytes() == r.kept.position.tobytes()
    np.testing.assert_array_equal(back.kept.energy, r.kept.energy)
    observed = r.provenance["observed"]
    assert observed["keep"] == [3, 1002]
    assert observed["statistics"][0] == {"type": "mean", "of": "position"}
    json.dumps(r.provenance)


@pytest.mark.ci
def test_kept_members_are_those_of_the_whole(fleet, complete):
    kept = lw.solve(fleet, **SETTINGS, keep=[1002, 513, 0]).kept
    assert all(kept.samples[f].tobytes() == complete.samples[f][:, [0, 513, 1002]].tobytes() for f in FIELDS)


@pytest.mark.slow  # for its kernels: rk8 that chooses its steps
def test_kept_members_of_a_method_that_chooses_its_steps(fleet):
    method = lw.Method("rk8", rtol=1e-6, atol=1e-6)
    every = lw.solve(fleet.subset(range(40)), method, **SETTINGS)
    kept = lw.solve(fleet.subset(range(40)), method, **SETTINGS, keep=[5, 38]).kept
    assert all(kept.samples[f].tobytes() == every.samples[f][:, [5, 38]].tobytes() for f in FIELDS)
    assert kept.members == 2


@pytest.fixture(scope="module")
def spinning():
    """Members that a torque of their own spins up until the step is too large for them, one of them not a number."""
    n = 600
    torque = np.zeros((n, 3))
    torque[:, 0] = np.linspace(0.0, 40.0, n)
    states = [np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 3))]
    states[0][:, 2] = np.arange(n)
    states[2] = states[2].copy()
    states[2][7, 0] = np.nan
    scene = lw.Scene(lw.Vehicle(20.0, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=0.0),
                     lw.Environment(gravity=0.0), [lw.terms.Wrench(torque=(1.0, 0.0, 0.0))])  # fmt: skip
    return lw.Ensemble.from_states(scene, *states, {"wrench.torque": torque})


@pytest.mark.ci
def test_members_that_fail_are_left_out_from_then_on(spinning):
    settings = {"h": 0.1, "t1": 4.0, "save": lw.SaveAt(every=0.5)}
    r = lw.solve(spinning, **settings, statistics=[Mean("depth"), PathMaximum("depth")], threads=2)
    failed = r.status != 0
    assert 100 < failed.sum() < 500
    good = ~failed | (r.time[:, None] <= r.failure_time + 1e-9)
    good[:, 7] = r.time == 0.0  # its depth is known at the start
    found = r.statistics["mean depth"]
    np.testing.assert_array_equal(found.count, good.sum(axis=1))
    assert found.count[0] == 600
    assert len(set(found.count.tolist())) > 5
    expected = [r.position[t, good[t], 2].mean() for t in range(len(r.time))]
    np.testing.assert_allclose(found.value[:, 0], expected, rtol=1e-14)
    assert r.statistics["mean path_maximum depth"].count.tolist() == [(~failed).sum()]
    assert any(f"{found.count.min()} of 600" in message or "of 600 count" in message for message in r.messages)
    lean = lw.solve(spinning, **settings, keep="failed", statistics=[Mean(name) for name in FIELDS])
    np.testing.assert_array_equal(lean.kept_members, np.flatnonzero(failed))
    assert all(lean.kept.samples[f].tobytes() == r.samples[f][:, failed].tobytes() for f in FIELDS)
    np.testing.assert_array_equal(lean.kept.failure_time, r.failure_time[failed])


@pytest.mark.ci
def test_paths_of_members_that_fail_are_left_out(spinning):
    settings = {"h": 0.1, "t1": 4.0, "save": lw.SaveAt(every=0.5)}
    asked = [*(kind("depth") for kind in (PathMean, PathRms, PathRange)), PathTime("depth", above=0.0)]
    r = lw.solve(spinning, **settings, statistics=asked)
    whole, depth = r.status == 0, r.position[..., 2]
    assert 0 < whole.sum() < 600
    truths = [depth.mean(axis=0), depth.mean(axis=0), 0.0 * depth[0], 4.0 * (depth[0] > 0.0)]  # none moves
    for statistic, truth in zip(asked, truths, strict=True):
        found = r.statistics[f"mean {statistic.key}"]
        assert found.count.tolist() == [whole.sum()]
        assert found.value[0, 0] == pytest.approx(truth[whole].mean(), rel=1e-12)


@pytest.mark.ci
def test_what_is_left_out_is_said_with_its_reason(spinning):
    settings = {"h": 0.1, "t1": 1.0}
    none = Quantity("none", lambda s, m: np.where(s["position"][..., 2] < 50.0, np.nan, 1.0), "1", ("position",))
    r = lw.solve(spinning, **settings, statistics=[Mean("depth")])
    failed = int(((r.status != 0) & (r.status < lw.Status.SURFACE)).sum())
    (said,) = (text for text in r.messages if "leave out" in text)
    assert f"leave out {failed} members from their failure on: {600 - failed} of 600 count" in said
    both = lw.solve(spinning, **settings, statistics=[Mean("depth"), Mean(none)])
    (said,) = (text for text in both.messages if "leave out" in text)
    assert f"{failed} members from their failure on, and members where a number of theirs is not finite: " in said
    left_out = 'members from the event on that stopped them (stopped = "left_out")'
    for kind, words in (
        (Mean("depth"), None),
        (Mean(none), "leave out members where a number of theirs is not finite: 0 of 300"),
        (Mean("depth", stopped="left_out"), left_out),
        (PathMean("depth", stopped="left_out"), left_out),
    ):  # fmt: skip
        r = lw.solve(grounding(), h=0.1, t1=2.0, save=lw.SaveAt(every=0.5), statistics=[kind])
        said = [text for text in r.messages if "leave out" in text]
        assert (words is None and not said) or words in said[0], (kind, said)
        if words is left_out:
            assert f"leave out {(r.status == lw.Status.FLOOR).sum()} members" in said[0]
            assert "finite" not in said[0]


def grounding(n=300):
    """Members that sink, some of them to the sea floor."""
    scene = lw.Scene(
        lw.Vehicle(
            10.0,
            inertia=(1.0, 2.0, 2.5),
            added_mass=(20.0, 20.0, 21.0),
            buoyancy=50.0,
            center_of_buoyancy=(0.0, 0.0, -1e-9),
        ),
        lw.Environment(gravity=9.8),
        events=stops(floor=1.0),
    )
    b = np.zeros((n, 3))
    b[:, 2] = np.linspace(-3.0, 0.9, n)
    still = (np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 3)))
    return lw.Ensemble.from_states(scene, b, *still)


@pytest.mark.ci
def test_members_that_stop_are_held_or_left_out():
    n = 300
    fleet = grounding(n)
    ask = [Mean("depth", name="held"), Mean("depth", stopped="left_out", name="left out")]
    r = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=0.5), statistics=ask)
    stopped = (r.status == lw.Status.FLOOR)[None] & (r.time[:, None] > r.failure_time)
    assert 50 < stopped[-1].sum() < 250
    assert r.statistics["held"].count.tolist() == [n] * 5
    np.testing.assert_array_equal(r.statistics["left out"].count, n - stopped.sum(axis=1))
    np.testing.assert_allclose(r.statistics["held"].value[:, 0], r.position[..., 2].mean(axis=1), rtol=0, atol=1e-14)
    expected = [r.position[t, ~stopped[t], 2].mean() for t in range(5)]
    np.testing.assert_allclose(r.statistics["left out"].value[:, 0], expected, rtol=0, atol=1e-14)
    # A stop is no failure.
    assert lw.solve(fleet, h=0.1, t1=2.0, keep="failed", statistics=[Mean(name) for name in FIELDS]).kept is None


@pytest.mark.ci
def test_a_linear_gaussian_case_has_its_exact_moments():
    """M v' = S w with normal starts: b_n = b0 + v0 t + (S/M) h^(3/2) sum of (j + 1/2) xi, v_n = v0 + (S/M) h^(1/2) sum of xi.

    Every mean, covariance, quantile and probability lies in its interval of a confidence that makes all of them hold
    99.9 % of the time.
    """
    M, S, h, steps, n = 2.0, np.array([0.5, 1.0, 2.0]), 0.05, 40, 20_000
    sb, sv, t = np.array([0.3, 0.1, 0.5]), np.array([0.2, 0.4, 0.1]), h * steps
    base = scene_of((M, M, M))
    start = lw.Start(position=[1.0, -2.0, 10.0], velocity=[0.5, 0.0, -1.0])
    scene = lw.Scene(base.vehicle, base.environment, [lw.terms.WrenchNoise(force=tuple(S))], start)
    vary = {"start.position": Normal(std=tuple(sb)), "start.velocity": Normal(std=tuple(sv))}
    fleet = lw.Ensemble(scene, n, 4, vary)
    j = np.arange(steps) + 0.5
    q = S**2 / M**2 * h
    bb, bv, vv = sb**2 + sv**2 * t**2 + q * h**2 * np.sum(j**2), sv**2 * t + q * h * np.sum(j), sv**2 + q * steps
    exact = np.block([[np.diag(bb), np.diag(bv)], [np.diag(bv), np.diag(vv)]])
    mean = np.array([1.0, -2.0, 10.0, 0.5, 0.0, -1.0]) + np.array([0.5, 0.0, -1.0, 0.0, 0.0, 0.0]) * t
    share = 1.0 - 0.001 / (6 + 21 + 9 + 3)
    levels = (0.05, 0.5, 0.95)
    names = ["position", "velocity"]
    ask = [Mean(names, confidence=share), Covariance(names, confidence=share)]
    ask += [Quantiles("position", levels, confidence=share),
            Exceedance("position", above=(2.0, -2.5, 9.0), confidence=share)]  # fmt: skip
    found = lw.solve(fleet, h=h, t1=t, statistics=ask, keep="none").statistics
    truths = {"mean position, velocity": mean, "covariance position, velocity": exact,
              "quantiles position": mean[:3] + np.sqrt(bb) * ndtri(np.array(levels))[:, None],
              "exceedance position above (2, -2.5, 9)": ndtr((mean[:3] - [2.0, -2.5, 9.0]) / np.sqrt(bb))}  # fmt: skip
    for name, truth in truths.items():
        assert np.all((found[name].lower[-1] <= truth) & (truth <= found[name].upper[-1])), name
    # And the intervals are no wider than they have to be: 4.2 standard errors of the estimate, of 20,000 members.
    z = ndtri(0.5 + 0.5 * share)
    half = {name: found[name].half_width[-1] for name in truths}
    variance = np.diag(exact)
    np.testing.assert_allclose(half["mean position, velocity"], z * np.sqrt(variance / n), rtol=0.05)
    # Of fourth moments, which of normal numbers are known to sqrt(14 / n) / 2 = 1.3 %.
    errors = np.sqrt((np.outer(variance, variance) + exact**2) / n)
    np.testing.assert_allclose(half["covariance position, velocity"], z * errors, rtol=5.0 * 0.5 * np.sqrt(14.0 / n))
    p = truths["exceedance position above (2, -2.5, 9)"]
    np.testing.assert_allclose(half["exceedance position above (2, -2.5, 9)"], z * np.sqrt(p * (1 - p) / n), rtol=0.05)
    # Of order statistics: so many members lie between the two, which varies by the root of it; the sketch's error adds.
    q = np.array(levels)[:, None]
    ranks = z * np.sqrt(q * (1 - q) / n)
    ideal = ranks * np.sqrt(bb) * np.sqrt(2.0 * np.pi) * np.exp(0.5 * ndtri(q) ** 2)
    spread, wider = 5.0 / np.sqrt(2.0 * ranks * n), 1.0 + found["quantiles position"]["rank_error"][-1] / ranks
    assert np.all(
        (half["quantiles position"] / ideal > 1.0 - spread)
        & (half["quantiles position"] / ideal < wider * (1.0 + spread))
    )


def falling(n=20_000):
    base = scene_of((2.0, 2.0, 3.0), net=1.0, moment=(0.0, 0.0, -1e-9))
    vary = {"start.position": Normal(std=1.0)}
    return lw.Ensemble(lw.Scene(base.vehicle, base.environment, start=lw.Start(position=[0, 0, 10])), n, 1, vary)


@pytest.mark.ci
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_a_run_stops_when_it_knows_enough(threads):
    until = lw.Until("mean position[2]", 0.05)
    r = lw.solve(falling(), h=0.1, t1=1.0, statistics=[Mean("position")], keep="none", until=until, threads=threads)
    # 1.96 / sqrt(n) <= 0.05 from 1,537 members on: a block is 512; looks come at 1,024 and at each block from there.
    assert len(blocks(20_000)) == 40
    assert r.members in (1536, 2048)
    found = r.statistics["mean position"]
    assert found.count.tolist() == [r.members] * 2
    assert found.half_width[-1, 2] <= 0.05
    assert found.half_width[-1, 2] == pytest.approx(1.96 / np.sqrt(r.members), rel=0.1)
    assert any("reached with" in message for message in r.messages)
    assert r.provenance["members"] == r.members
    first = lw.solve(falling(), h=0.1, t1=1.0, statistics=[Mean("position")], keep="none", until=until, threads=1)
    assert same(first.statistics, r.statistics)
    assert first.members == r.members
    assert r.parameters["vehicle.mass"].shape == (1,)
    assert len(r.failure_time) == r.members


@pytest.mark.ci
def test_a_run_stops_when_it_knows_enough_of_paths():
    ask = {"h": 0.1, "t1": 1.0, "keep": "none", "statistics": [PathTime("depth", above=10)]}
    r = lw.solve(falling(), **ask, until=lw.Until("mean path_time depth above 10.0", 0.02))
    assert r.members < 20_000
    assert r.statistics["mean path_time depth above 10"].half_width[0, 0] <= 0.02


@pytest.mark.ci
def test_an_expression_over_the_path_is_what_the_statistic_of_paths_is():
    ask = {"h": 0.1, "t1": 1.0, "save": lw.SaveAt(every=0.2), "keep": "none"}
    pairs = {
        "max(depth)": PathMaximum, "min(velocity)": PathMinimum,
        "range(norm(velocity))": PathRange,
        "mean(position[2])": PathMean,
    }  # fmt: skip
    asked = [Mean(text) for text in pairs] + [Quantiles("max(depth)", (0.05, 0.95))]
    of_paths = [kind(text[text.index("(") + 1 : -1]) for text, kind in pairs.items()]
    of_paths += [PathMaximum("depth", Quantiles(levels=(0.05, 0.95)))]
    until = lw.Until("quantiles max(depth) 0.95", 0.15)
    r = lw.solve(falling(5000), **ask, statistics=[*asked, *of_paths], until=until)
    found = list(r.statistics.values())
    assert [estimate.name for estimate in found[:5]] == [*(f"mean {text}" for text in pairs), "quantiles max(depth)"]
    for estimate, of_path in zip(found[:5], found[5:], strict=True):
        assert estimate.arrays.keys() == of_path.arrays.keys()
        assert estimate.unit == of_path.unit
        assert all(estimate[name].tobytes() == of_path[name].tobytes() for name in estimate.arrays)
        assert estimate.time.tolist() == [1.0]
    assert 1024 <= r.members < 5000
    assert found[4].half_width[0, 1, 0] <= 0.15
    assert "reached with" in r.messages[-1]


@pytest.mark.ci
def test_a_run_says_when_it_does_not_know_enough():
    r = lw.solve(falling(2000), h=0.1, t1=1.0, keep="none", until=lw.Until("mean depth", 1e-9))
    assert r.members == 2000
    assert any("not reached with 2000" in message for message in r.messages)
    kept = lw.solve(falling(3000), h=0.1, t1=1.0, until=lw.Until("mean position[2]", 0.1))
    assert kept.position.shape == (2, kept.members, 3)
    assert kept.members == 1024
    watched = lw.Until("deep", 0.03, at=0.5)
    found = lw.solve(falling(), h=0.1, t1=1.0, save=lw.SaveAt(every=0.5), keep="none", until=watched,
                     statistics=[Exceedance("depth", above=10.0, name="deep")])  # fmt: skip
    assert found.statistics["deep"].half_width[1, 0] <= 0.03
    assert found.members < 2000


REPLICATED = [
    Mean("position"), Quantiles("depth", (0.05, 0.5, 0.95), size=64), Extremes("depth"), MeanAttitude(),
    Exceedance("depth", above=12.0), FirstPassage("depth", above=12.0), CircularMean("euler"),
    PathMaximum("speed", then=[Mean(), Quantiles(levels=(0.5,), size=64)]), PathMean("depth"),
    Mean("angular_velocity"),
]  # fmt: skip
STARTS = {"start.position": Normal(std=0.1), "start.velocity_inertial": Normal(std=0.02),
          "start.angular_velocity": Normal(std=0.03)}  # fmt: skip


@pytest.fixture(scope="module")
def designed(scene):
    """1,024 members of the paper's scene by each sampling, to t = 5: sampling -> result."""
    save = lw.SaveAt(every=1.0)
    return {
        sampling: lw.solve(
            lw.Ensemble(scene, 1024, 1, STARTS, sampling), h=0.01, t1=5.0, save=save, statistics=REPLICATED
        )
        for sampling in ("random", "sobol", Sobol(replicates=16), LatinHypercube(64, replicates=16))
    }


@pytest.mark.ci
def test_a_smooth_mean_is_known_much_better_by_replicates(designed):
    halves = {name: r.statistics["mean position"].half_width[-1] for name, r in designed.items()}
    replicated, latin = (halves[name] for name in halves if not isinstance(name, str))
    # What 16 sequences of 64 points err by is 1/8 to 1/30 of what 1,024 independent members do (sampling_cost.md).
    assert np.all(8.0 * replicated < halves["random"])
    assert np.all(8.0 * latin < halves["random"])
    np.testing.assert_allclose(halves["sobol"], halves["random"], rtol=0.1)
    assert [len(r.messages) for r in designed.values()] == [0, 1, 0, 0]
    for r in designed.values():
        if not isinstance(r.provenance["ensemble"].get("sampling", "random"), str):
            assert "16 replicates" in r.statistics["mean position"].interval


def test_values_of_replicates_are_those_of_the_samples(designed):
    r = next(one for name, one in designed.items() if isinstance(name, Sobol))
    found, b = r.statistics, r.position
    np.testing.assert_allclose(found["mean position"].value, b.mean(axis=1), rtol=0, atol=1e-13)
    means = b.reshape(6, 64, 16, 3).mean(axis=1)
    np.testing.assert_allclose(
        found["mean position"]["standard_error"], means.std(axis=1, ddof=1) / 4.0, rtol=1e-10, atol=1e-15
    )
    deepest = found["extremes depth"]
    np.testing.assert_array_equal(deepest["maximum_member"][:, 0], b[..., 2].argmax(axis=1))
    np.testing.assert_array_equal(deepest["maximum"][:, 0], b[..., 2].max(axis=1))
    average = np.trapezoid(b[..., 2], r.time, axis=0) / r.time[-1]
    path = found["mean path_mean depth"]
    assert path.value[0, 0] == pytest.approx(average.mean(), rel=1e-13)
    assert "16 replicates" in path.interval
    passed = (b[..., 2] > 12.0).any(axis=0).mean()
    assert found["first_passage depth above 12.0"].value[-1] == pytest.approx(passed, rel=1e-12)


@pytest.mark.ci
@pytest.mark.parametrize("threads", [1, 3])
def test_threads_change_no_bit_of_replicates(designed, scene, threads):
    fleet = lw.Ensemble(scene, 1024, 1, STARTS, Sobol(replicates=16))
    settings = {"h": 0.01, "t1": 5.0, "save": lw.SaveAt(every=1.0), "statistics": REPLICATED, "keep": "none"}
    alone = lw.solve(fleet, **settings, threads=threads)
    first = next(one for name, one in designed.items() if isinstance(name, Sobol))
    assert same(alone.statistics, first.statistics)


def test_chosen_members_of_a_design_are_no_design(scene):
    fleet = lw.Ensemble(scene, 1024, 1, STARTS, Sobol(replicates=16))
    part = lw.solve(fleet.subset(range(100)), h=0.01, t1=0.1, statistics=[Mean("depth")])
    assert part.statistics["mean depth"].interval == "Student's t"
    assert any("those of independent members" in text for text in part.messages)


@pytest.mark.ci
def test_a_run_of_replicates_stops_at_a_power_of_two():
    base = falling()
    fleet = lw.Ensemble(base.scene, 20_480, 1, {"start.position": Normal(std=1.0)}, Sobol(replicates=8))
    fleet_of = {"h": 0.1, "t1": 1.0, "keep": "none", "statistics": [Quantiles("position", (0.5, 0.95))]}
    r = lw.solve(fleet, **fleet_of, until=lw.Until("quantiles position[2] 0.5", 0.02))
    found = r.statistics["quantiles position"]
    assert r.members in (1024, 2048, 4096)
    assert found.half_width[-1, 0, 2] <= 0.02
    # Of 0.95 it takes more: the density there is a quarter of that in the middle.
    both = lw.solve(fleet, **fleet_of, until=lw.Until("quantiles position[2] 0.95", 0.02))
    assert both.members > r.members
    assert both.statistics["quantiles position"].half_width[-1, 1, 2] <= 0.02
    assert any("reached with" in text for text in both.messages)
    assert not any("balanced" in text for text in both.messages)


@pytest.mark.parametrize(("inputs", "text"), [
    ({"statistics": "mean"}, "not a list"), ({"statistics": [3]}, "not a statistic"), ({"keep": "some"}, "keep"),
    ({"keep": [5]}, "is none of the"), ({"keep": [-1]}, "is negative"), ({"keep": 3}, "is not a list of members"),
    ({"statistics": [Mean("depth"), Mean("depth")]}, "name of 2 statistics"),
    ({"until": 3}, "not a table"),
    ({"statistics": [Mean()]}, "mean.of"),
    ({"until": lw.Until("median depth", 1.0)}, "not a statistic of the run"),
    ({"until": {"statistic": "mean depth"}}, "half_width"), ({"until": lw.Until("mean depth", 1.0, at=0.3)}, "sample time"),
    ({"statistics": [Extremes("depth")], "until": lw.Until("extremes depth", 1.0)}, "no interval"),
])  # fmt: skip
def test_what_a_run_refuses(scene, inputs, text):
    with pytest.raises(lw.SceneError, match=text):
        lw.solve(lw.Ensemble(scene, 3), **SETTINGS, **inputs)


@pytest.mark.ci
def test_a_function_of_ones_own(fleet, complete):
    def drop(samples, members):
        return samples["position"][..., 2] - members.position[None, :, 2]

    pair = Quantity("pair", lambda s, m: s["velocity"][..., :2], "m/s", ("velocity",), ("u", "v"))
    found = lw.solve(fleet, **SETTINGS, statistics=[Mean(drop), Mean(pair)], keep="none").statistics
    expected = (complete.position[..., 2] - complete.position[0, :, 2]).mean(axis=1)
    np.testing.assert_allclose(found["mean drop"].value[:, 0], expected, atol=1e-14)
    np.testing.assert_allclose(found["mean pair"].value, complete.velocity[..., :2].mean(axis=1), atol=1e-14)
    wrong = Quantity("wrong", lambda s, m: s["velocity"][0], "m/s")
    with pytest.raises(ValueError, match=r"quantity wrong gave shape .*. It must be \(\d+, \d+\):"):
        lw.solve(fleet, **SETTINGS, statistics=[Mean(wrong)])
    two = Quantity("two", lambda s, m: s["velocity"], "m/s", ("velocity",), ("u", "v"))
    with pytest.raises(ValueError, match=r"quantity two gave shape .*. It must be \(\d+, \d+, 2\):"):
        lw.solve(fleet, **SETTINGS, statistics=[Mean(two)])


@pytest.mark.ci
def test_float32_is_summed_up_in_float64(fleet):
    ask = [Mean("position"), Covariance("position"), Quantiles("position", (0.1, 0.9)), Quantiles("speed", (0.5,))]
    found = lw.solve(
        fleet, **SETTINGS, dtype="float32", statistics=[*ask, PathMaximum("depth", Quantiles(levels=(0.5,)))]
    )
    b = found.position.astype(np.float64)
    np.testing.assert_allclose(found.statistics["mean position"].value, b.mean(axis=1), rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.statistics["covariance position"].value[-1], np.cov(b[-1].T), rtol=0, atol=1e-12)
    exact = np.moveaxis(np.quantile(b, (0.1, 0.9), axis=1), 1, 0)
    np.testing.assert_allclose(found.statistics["quantiles position"].value, exact, rtol=0, atol=1e-15)
    speed = np.linalg.norm(found.velocity.astype(np.float64), axis=-1)
    np.testing.assert_allclose(found.statistics["quantiles speed"].value[:, 0, 0], np.median(speed, axis=1), rtol=1e-14)
    deepest = found.statistics["quantiles path_maximum depth"].value[0, 0, 0]
    assert deepest == pytest.approx(np.median(b[..., 2].max(axis=0)), rel=1e-15)


@pytest.mark.ci
def test_only_the_fields_that_statistics_need_are_written(fleet):
    settings = observation.observe(fleet, [Mean("depth")], "none")
    assert settings.fields(FIELDS) == ("position",)
    assert observation.Observation(keep="none").fields(FIELDS) == ()
    assert observation.Observation((Mean("speed"),)).fields(("position",)) == ("position", "velocity")
    shown = lw.solve(fleet, **(SETTINGS | {"save": lw.SaveAt(fields=("position",))}), statistics=[Mean("speed")])
    assert list(shown.samples) == ["position"]


def test_what_a_moved_origin_needs_is_written_too():
    # psi_x puts the origin where mass and inertia fall apart: positions come back with the help of attitudes.
    fleet = lw.Ensemble(lw.Scene.named("remus_100"))
    plan = make_plan(fleet, "psi_x", 0.01, 0.1, lw.SaveAt(fields=("position",)))
    assert plan.fields == ("position",)
    assert plan.layout.sizes == {"position": 3, "attitude": 9}
    plan = make_plan(fleet, "psi_x", 0.01, 0.1, lw.SaveAt(fields=("velocity", "position")))
    assert (plan.fields, tuple(plan.layout.sizes)) == (("position", "velocity"), FIELDS)
    plan = make_plan(one(scene_of(net=1.0)), "psi_s", 0.01, 0.1, lw.SaveAt(fields=("position",)))
    assert plan.fields == tuple(plan.layout.sizes) == ("position",)


@pytest.mark.slow  # for its kernel
def test_positions_alone_where_the_origin_is_moved():
    scene = lw.Scene.named("remus_100")
    settings = {"method": "psi_x", "h": 0.01, "t1": 0.1}
    whole = lw.solve(scene, **settings)
    few = lw.solve(scene, **settings, save=lw.SaveAt(fields=("position", "velocity")))
    assert list(few.samples) == ["position", "velocity"]
    assert few.position.tobytes() == whole.position.tobytes()
    assert few.velocity.tobytes() == whole.velocity.tobytes()


TABLES = """
keep = "none"
[[run.statistics]]
type = "mean"
of = "position"
[[run.statistics]]
type = "quantiles"
of = "depth"
levels = [0.05, 0.5, 0.95]
[[run.statistics]]
type = "path_maximum"
of = "speed"
then = [{ type = "mean" }, { type = "exceedance", above = 1.0 }]
[[run.statistics]]
type = "quantiles"
of = "max(norm(velocity))"
[[run.statistics]]
type = "path_time"
of = "depth"
above = 10
below = 12.0
[run.until]
statistic = "mean position[2]"
half_width = 1.0
"""


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text((ROOT / "examples" / "paper.toml").read_text() + TABLES)
    return file


def test_scene_files(path):
    scene = lw.Scene.load(path)
    assert [one.type for one in scene.run.statistics] == ["mean", "quantiles", "path_maximum", "quantiles", "path_time"]
    assert scene.run.keep == "none"
    assert scene.run.until == lw.Until("mean position[2]", 1.0)
    content = scene.to_dict()
    assert from_dict(content).to_dict() == content
    assert content["run"]["until"] == tomllib.loads(TABLES.replace("run.", ""))["until"]
    assert "statistics" not in lw.Scene.load(ROOT / "examples" / "paper.toml").to_dict()["run"]


def test_scene_files_tell_all_faults():
    text = """
[run]
keep = "sum"
[[run.statistics]]
type = "maen"
[[run.statistics]]
type = "quantiles"
of = "dept"
level = [0.5]
[[run.statistics]]
type = "quantiles"
of = "dept"
size = 7
[run.until]
statistic = "mean depth"
"""
    with pytest.raises(lw.SceneError) as caught:
        scenes.loads("[vehicle]\nmass = 10.0\ninertia = [1.0, 2.0, 2.5]\n" + text)
    faults = caught.value.faults
    assert len(faults) == 6
    assert all(f.startswith(("run.", "until.")) for f in faults)
    for i, word in enumerate(
        ("keep", "Did you mean 'mean'", "Did you mean 'levels'", "run.statistics[2]", "size", "half_width")
    ):
        assert word in faults[i]


@pytest.mark.ci
def test_the_command_prints_and_draws_them(path, tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["run", str(path), "--members", "1500", "--duration", "2", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    for word in (
        "mean position[2]",
        "quantiles depth 0.95",
        "mean path_maximum speed",
        "mean path_time depth above 10 below 12",
        "reached with 1024 members",
        "1,024 members",
    ):
        assert word in text, word
    assert sorted(file.name for file in out.iterdir()) == ["result.npz", "statistics.png"]
    from matplotlib.image import imread

    assert imread(out / "statistics.png")[..., :3].std() > 0.05
    assert (
        cli.main(["run", str(path), "--members", "20", "--duration", "1", "--out", str(out), "--set", "run.keep=[3]"])
        == 0
    )
    assert {"fleet.png", "fleet.rrd"} <= {file.name for file in out.iterdir()}
    assert "1 members' samples" in capsys.readouterr().out
    assert cli.main(["run", str(path), "--error", "1e-3", "--out", str(out)]) == 2


@pytest.mark.ci
def test_no_statistics_cost_nothing(fleet):
    settings = observation.observe(fleet)
    assert settings == observation.Observation()
    assert settings.watch(np.zeros(1)) == ((), None)
    plain = make_plan(fleet, **SETTINGS)
    asked = make_plan(fleet, **SETTINGS, observed=settings)
    assert plain.kernel.advance is asked.kernel.advance
    assert "observed" not in lw.solve(fleet, **SETTINGS).provenance


@pytest.mark.slow
def test_memory_grows_with_neither_members_nor_steps():
    def peak(n, steps):
        fleet, save = falling(n), lw.SaveAt(every=0.01 * steps / 10)
        tracemalloc.start()
        lw.solve(fleet, h=0.01, t1=0.01 * steps, save=save, statistics=[Mean("depth")], keep="none", threads=1)
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    # Both in blocks of 512; eleven samples of position are 264 bytes a member, and status, warnings and their like below 120.
    few, many = 16_384, 32_767
    peak(few, 10)
    assert peak(many, 10) - peak(few, 10) < 120 * (many - few)
    assert peak(few, 100) - peak(few, 10) < 100_000


@pytest.mark.ci
def test_a_run_stops_at_the_same_block_in_whatever_order_they_finish():
    settings = {"h": 0.1, "t1": 1.0, "statistics": [Mean("position")], "keep": "none",
                "until": lw.Until("mean position[2]", 0.05)}  # fmt: skip
    one, other = (
        lw.solve(falling(), **settings, **how) for how in ({"threads": 1}, {"executor": Ordered(range(39, -1, -1))})
    )
    assert one.members == other.members < 20_000
    assert same(one.statistics, other.statistics)
