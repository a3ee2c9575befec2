# SPDX-License-Identifier: Apache-2.0
"""Weighted members in whole runs: what importance sampling gives against closed forms, on the way and from what was kept.

A sphere without forces keeps its velocity: after t seconds it is at its start plus v t, whose distribution is known.
"""

import pickle

import numpy as np
import pytest
from scipy.stats import norm

import lgvi_warp as lw
from tests.runs.test_gather import assert_same

pytestmark = pytest.mark.kernel

S = lw.statistics
T1, DOWN, FLOOR = 2.0, 2.0, 15.0
SETTINGS = {"method": "psi_s", "h": 0.25, "t1": T1, "save": lw.SaveAt(every=0.5), "threads": 1}
# Drawn from this normal distribution, and wanted of N(10, 1).
MEAN, STD = 10.5, 1.3
ASKED = [
    S.Mean("position"), S.Covariance(["position[0]", "depth"]), S.Exceedance("depth", above=12.0),
    S.Quantiles("depth", levels=(0.1, 0.5, 0.9)), S.Histogram("depth", edges=(9.0, 10.0, 11.0)), S.CircularMean("euler[2]"),
    S.MeanAttitude(), S.Extremes("depth"), S.FirstPassage("depth", above=14.5), S.Outcome("floor"), S.EndTime("floor"),
    S.PathMaximum("depth", then=[S.Mean(), S.Exceedance(above=14.5), S.MemberValues()]), S.Mean("speed", at="floor"),
]  # fmt: skip


def drawn(members, seed):
    """Starts by the proposal, with their weights."""
    z = MEAN + STD * np.random.default_rng(seed).standard_normal(members)
    north = np.random.default_rng([seed, 1]).standard_normal(members)
    weights = norm.pdf(z, 10.0, 1.0) / norm.pdf(z, MEAN, STD)
    return {"start.position[2]": z, "start.position[0]": north, "w": weights}


def fleet_of(members, seed=0, **columns):
    vehicle = lw.Vehicle(20.0, inertia=(1.0, 1.0, 1.0), buoyancy=20.0 * 9.80665)
    start = lw.Start([0.0, 0.0, 10.0], velocity=[1.0, 0.0, DOWN])
    scene = lw.Scene(vehicle, lw.Environment(), [], start, events=[lw.events.Floor(depth=FLOOR)])
    return lw.Ensemble(scene, sampling=lw.designs.Table(drawn(members, seed) | columns, weights="w"))


@pytest.fixture(scope="module")
def result():
    return lw.solve(fleet_of(3000), **SETTINGS, statistics=ASKED)


@pytest.mark.ci
def test_estimates_are_those_of_the_wanted_distribution(result):
    """Within four told errors of the closed forms; the spread of told errors is some percent."""
    found = result.statistics
    mean = found["mean position"]
    assert abs(mean.value[1, 2] - (10.0 + 0.5 * DOWN)) < 4.0 * mean["standard_error"][1, 2] + 1e-3
    assert abs(mean.value[-1, 0] - T1) < 4.0 * mean["standard_error"][-1, 0] + 0.2
    outcome = found["outcome floor"]
    wanted = norm.sf(FLOOR - T1 * DOWN, 10.0, 1.0)
    width = outcome.upper[-1] - outcome.lower[-1]
    # Half of the interval is 1.96 told errors.
    assert abs(outcome.value[-1] - wanted) < width / 0.98
    assert width < 0.06
    weights = result.weights
    assert mean.count[0] == pytest.approx(weights.sum() ** 2 / np.sum(weights**2))
    assert mean["members"][0] == 3000
    assert "effective members" in "\n".join(str(row) for row in found.summary_rows()[1])
    assert not any("table" in text for text in result.messages)


@pytest.mark.ci
def test_samples_at_hand_stores_and_other_processes_give_the_same(result, tmp_path):
    assert_same(lw.gather(result, ASKED), result.statistics)
    path = tmp_path / "run.zarr"
    lw.solve(fleet_of(3000), **SETTINGS, statistics=ASKED, store=path)
    assert_same(lw.open_run(path).statistics, result.statistics)
    assert_same(lw.gather(path, ASKED), result.statistics)
    np.testing.assert_array_equal(lw.open_run(path).weights, result.weights)
    # A block that is lost runs again with the weights that the store holds.
    (path / "blocks" / "000000256.json").unlink()
    assert_same(lw.resume(path).statistics, result.statistics)
    loaded = lw.Result.load(result.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(loaded.weights, result.weights)
    assert_same(lw.gather(pickle.loads(pickle.dumps(loaded)), ASKED), result.statistics)


@pytest.mark.ci
def test_weights_afterwards_are_those_of_a_table(result):
    """The same draws without weights, weighed when they are asked."""
    columns = drawn(3000, 0)
    weights = columns.pop("w")
    scene = fleet_of(2).scene
    plain = lw.solve(lw.Ensemble(scene, sampling=lw.designs.Table(columns)), **SETTINGS)
    assert plain.weights is None
    assert_same(lw.gather(plain, ASKED, weights=weights), result.statistics)
    with pytest.raises(lw.SceneError, match="are 5 numbers for 3,000 members"):
        lw.gather(plain, ASKED, weights=np.ones(5))
    few = lw.gather(plain, [S.Mean("depth"), S.Outcome("floor")], weights=np.where(np.arange(3000) < 40, 1.0, 0.0))
    assert "effective number of 40 of 40 members" in few.messages[-1]
    assert few["mean depth"].count[0] == pytest.approx(40.0)


def test_studies_that_count_members_alike_refuse_weights():
    fleet = fleet_of(8)
    with pytest.raises(lw.SceneError, match="members with weights, and a sweep counts them alike"):
        lw.sweep(fleet.scene, sampling=fleet.sampling, metrics=["max(depth)"], h=0.25, t1=1.0)
    with pytest.raises(lw.SceneError, match="members with weights, and a risk counts them alike"):
        lw.tune_gains(fleet, {"environment.gravity": (9.0, 10.0)}, "max(depth)", budget=16, h=0.25, t1=1.0)


TRUTHS = {
    "mean depth": 10.0 + 0.5 * DOWN, "exceedance depth above 12": norm.sf(12.0 - 0.5 * DOWN, 10.0, 1.0),
    "quantiles depth": norm.ppf([0.1, 0.5, 0.9], 10.0 + 0.5 * DOWN), "covariance depth": 1.0,
    "outcome floor": norm.sf(FLOOR - T1 * DOWN, 10.0, 1.0),
    "first_passage depth above 14": norm.sf(14.0 - T1 * DOWN, 10.0, 1.0),
    "exceedance path_maximum depth above 14": norm.sf(14.0 - T1 * DOWN, 10.0, 1.0),
}  # fmt: skip
COVERED = [
    S.Mean("depth"), S.Exceedance("depth", above=12.0), S.Quantiles("depth", levels=(0.1, 0.5, 0.9)), S.Covariance("depth"),
    S.Outcome("floor"), S.FirstPassage("depth", above=14.0), S.PathMaximum("depth", then=S.Exceedance(above=14.0)),
]  # fmt: skip
ROWS = {"outcome floor": -1, "first_passage depth above 14": -1, "exceedance path_maximum depth above 14": -1}


@pytest.mark.slow
def test_intervals_hold_as_often_as_they_say():
    """300 seeds of 400 members: 95 % less 3.6 standard deviations (1.26 %) of the share that hold, and as much above."""
    seeds, size = 300, 400
    whole = lw.solve(fleet_of(seeds * size, seed=7), **SETTINGS)
    hits = {name: 0 for name in TRUTHS}
    for seed in range(seeds):
        part = whole.part(np.arange(seed * size, (seed + 1) * size))
        for name, estimate in lw.gather(part, COVERED).items():
            # At 0.5 s none has come to the floor within four deviations.
            row = ROWS.get(name, 1)
            lower, upper = (np.ravel(end[row]) for end in (estimate.lower, estimate.upper))
            hits[name] += (lower <= TRUTHS[name]) & (TRUTHS[name] <= upper)
    shares = {name: np.ravel(hit) / seeds for name, hit in hits.items()}
    assert all((share > 0.905).all() and (share < 0.995).all() for share in shares.values()), shares
