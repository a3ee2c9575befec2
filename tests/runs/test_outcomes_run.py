# SPDX-License-Identifier: Apache-2.0
"""What members ended by, in runs: counted alike by status, outcome, exceedance and passage, in memory and in stores."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics.terms import events
from tests.support.stops import FarAway, stops

STATISTICS = [
    lw.Outcome("floor"), lw.EndTime("floor"), lw.Exceedance("depth", above=26.0), lw.FirstPassage("depth", above=26.0),
    lw.Mean("position", at="floor"), lw.Extremes("depth", at="floor"), lw.PathMaximum("depth", lw.Exceedance(above=26.0)),
]  # fmt: skip
SETTINGS = {"method": "psi_s", "h": 0.04, "t1": 40.0, "save": lw.SaveAt(every=4.0), "statistics": STATISTICS}


def fleet(members, ends=None, **ensemble):
    """The paper's vehicle a little too heavy or too light, from a depth of 20 m."""
    scene = lw.Scene.named("nordkvist_sanyal", start={"position": [0, 0, 20.0], "velocity": [0.1, 0, 0]},
                           vehicle={"buoyancy": 1212.0}, events=ends or stops(floor=26.0))  # fmt: skip
    vary = {"vehicle.buoyancy": lw.Normal(std=3.0), "start.angular_velocity": lw.Normal(std=(0.02, 0.05, 0.02))}
    return lw.Ensemble(scene, members, 1, vary, **ensemble)


def agree(result, members):
    """All ways of counting those on the floor, and where and when they came to it."""
    s, floor = result.statistics, np.asarray(result.status) == lw.Status.FLOOR
    hits = int(floor.sum())
    assert 0.1 * members < hits < 0.9 * members
    for name in ("outcome floor", "exceedance depth above 26", "first_passage depth above 26",
                 "exceedance path_maximum depth above 26"):  # fmt: skip
        assert round(float(np.ravel(s[name].value)[-1]) * members) == hits, name
    assert s["outcome floor"]["ended"][-1] == hits == s["mean position at floor"].count[0]
    assert s["mean end_time floor"].value[0, 0] == pytest.approx(result.end_time[floor].mean(), rel=1e-12)
    # A margin of a few spacings of the numbers of some 60 m.
    low, high = (s["extremes depth at floor"][name][0, 0] - 26.0 for name in ("minimum", "maximum"))
    assert 0.0 < low <= high < 1e-12
    return floor


def test_counts_agree():
    result = lw.solve(fleet(2000), **SETTINGS)
    floor = agree(result, 2000)
    s = result.statistics
    np.testing.assert_allclose(
        s["mean position at floor"].value[0], result.position[-1, floor].mean(axis=0), rtol=1e-12
    )
    # A stopped member stands still, at its event, from the first sample after it on.
    after = result.time[:, None] >= result.end_time[floor]
    assert (np.where(after, result.position[:, floor, 2], 26.0) >= 26.0).all()
    assert (np.where(after, 0.0, result.position[:, floor, 2]) < 26.0).all()
    # First passages are seen where the event was, to a part of the time between two samples.
    passage, outcome = s["first_passage depth above 26"], s["outcome floor"]
    np.testing.assert_allclose(passage["passage_time"][0], outcome["end_time"][0], atol=4.0 / 8)


@pytest.mark.slow
def test_counts_agree_of_100_000():
    agree(lw.solve(fleet(100_000), **SETTINGS, keep="none"), 100_000)


def test_in_a_store_and_after_a_resume(tmp_path, monkeypatch):
    monkeypatch.setitem(events.TYPES, FarAway.type, FarAway)
    members, whole = fleet(1000), lw.solve(fleet(1000), **SETTINGS)
    stored = lw.solve(members, **SETTINGS, store=tmp_path / "run.zarr", only=range(0, 2))
    assert len(stored.status) == 512
    lw.resume(tmp_path / "run.zarr")
    back = lw.open_run(tmp_path / "run.zarr")
    agree(back, 1000)
    for name, one in whole.statistics.items():
        assert all(one[key].tobytes() == back.statistics[name][key].tobytes() for key in one.arrays)
    np.testing.assert_array_equal(back.position[-1], whole.position[-1])
    np.testing.assert_array_equal(back.end_time, whole.end_time)
    for result in (back, whole):
        np.testing.assert_array_equal(result.dataset.end_time, whole.end_time)
    loaded = lw.Result.load(whole.save(tmp_path / "r.npz"))
    assert (
        loaded.statistics["outcome floor"]["end_time"].tobytes()
        == whole.statistics["outcome floor"]["end_time"].tobytes()
    )


@pytest.mark.slow
def test_processes_give_the_same(tmp_path):
    asked = SETTINGS | {"keep": "none"}
    whole, apart = lw.solve(fleet(600), **asked), lw.solve(fleet(600), **asked, executor="processes", threads=2)
    for name, one in whole.statistics.items():
        assert all(one[key].tobytes() == apart.statistics[name][key].tobytes() for key in one.arrays)


def test_several_events_by_their_names():
    surface, floor, *others = stops(surface=17.0, floor=26.0)
    ends = [surface, dataclasses.replace(floor, name="sea floor"), *others]
    asked = [lw.Outcome("sea floor"), lw.Outcome("surface"), lw.Outcome("stopped"), lw.Mean("depth", at="surface")]
    result = lw.solve(fleet(1000, ends), **SETTINGS | {"statistics": asked})
    counts, s = result.status.counts(), result.statistics
    assert (
        s["outcome sea floor"]["ended"][-1] == counts["floor"]
        and s["outcome surface"]["ended"][-1] == counts["surface"]
    )
    assert s["outcome stopped"].value[-1] == (counts["floor"] + counts["surface"]) / 1000
    # Those that rise are no more at risk of sinking: of the others more would have sunk than of all did.
    assert s["outcome sea floor"].value[-1] > s["outcome sea floor"]["fraction"][-1] == counts["floor"] / 1000
    assert s["mean depth at surface"].value[0, 0] == pytest.approx(17.0, abs=1e-12)


def test_replicates_of_a_design():
    result = lw.solve(fleet(512, sampling=lw.Sobol(replicates=4)), **SETTINGS)
    hits = (np.asarray(result.status) == lw.Status.FLOOR).sum()
    for name in ("outcome floor", "exceedance depth above 26", "first_passage depth above 26"):
        assert round(float(np.ravel(result.statistics[name].value)[-1]) * 512) == hits


def test_an_outcome_that_no_member_can_have_is_refused():
    with pytest.raises(lw.SceneError) as error:
        lw.solve(
            fleet(10, [lw.Floor(depth=26.0)]),
            "psi_s",
            h=0.04,
            t1=1.0,
            statistics=[lw.Outcome("surface"), lw.Mean("depth", at="flor")],
        )
    text = str(error.value)
    assert "outcome.of = 'surface': is no outcome of this scene" in text and "did you mean 'floor'" in text


def test_until_an_outcome_is_sure_enough():
    asked = SETTINGS | {"statistics": [lw.Outcome("floor"), lw.EndTime("floor", lw.Mean())]}
    for watched, half in (("outcome floor", 0.03), ("mean end_time floor", 1.0)):
        result = lw.solve(fleet(4000), **asked, until=lw.Until(watched, half, members=512))
        assert len(result.status) < 4000 and "reached" in result.messages[-1]
        assert result.statistics[watched].half_width[-1] <= half
