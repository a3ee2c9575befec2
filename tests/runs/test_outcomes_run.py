# SPDX-License-Identifier: Apache-2.0
"""Outcomes of members in runs: counted alike by status, outcome, exceedance and passage, in memory and in stores."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.distributions import Normal, Uniform
from lgvi_warp.events import Box, Floor, StopTime, Surface
from lgvi_warp.physics.terms import events
from lgvi_warp.results.quantities import quantities
from lgvi_warp.statistics import EndTime, Exceedance, Extremes, FirstPassage, Mean, Outcome, PathMaximum
from tests.conftest import ROOT
from tests.support.refusals import says
from tests.support.stops import FarAway, stops

STATISTICS = [
    Outcome("floor"), EndTime("floor"), Exceedance("depth", above=26.0), FirstPassage("depth", above=26.0),
    Mean("position", at="floor"), Extremes("depth", at="floor"), PathMaximum("depth", Exceedance(above=26.0)),
]  # fmt: skip
SETTINGS = {"method": "psi_s", "h": 0.04, "t1": 40.0, "save": lw.SaveAt(every=4.0), "statistics": STATISTICS}


def fleet(members, ends=None, more=(), **ensemble):
    """The paper's vehicle a little too heavy or too light, from a depth of 20 m."""
    scene = lw.Scene.named("nordkvist_sanyal", start={"position": [0, 0, 20.0], "velocity": [0.1, 0, 0]},
                           vehicle={"buoyancy": 1212.0}, events=ends or stops(floor=26.0))  # fmt: skip
    vary = {"vehicle.buoyancy": Normal(std=3.0), "start.angular_velocity": Normal(std=(0.02, 0.05, 0.02))}
    return lw.Ensemble(scene, members, 1, vary | dict(more), **ensemble)


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


@pytest.mark.ci
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


@pytest.mark.ci
def test_in_a_store_and_after_a_resume(tmp_path, monkeypatch):
    monkeypatch.setitem(events.TYPES, FarAway.type, FarAway)
    members, whole = fleet(1000), lw.solve(fleet(1000), **SETTINGS)
    stored = lw.solve(members, **SETTINGS, store=tmp_path / "run.zarr", blocks=range(0, 2))
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


@pytest.mark.ci
def test_several_events_by_their_names():
    surface, floor, *others = stops(surface=17.0, floor=26.0)
    ends = [surface, dataclasses.replace(floor, name="sea floor"), *others]
    asked = [Outcome("sea floor"), Outcome("surface"), Outcome("stopped"), Mean("depth", at="surface")]
    result = lw.solve(fleet(1000, ends), **SETTINGS | {"statistics": asked})
    counts, s = result.status.counts(), result.statistics
    assert s["outcome sea floor"]["ended"][-1] == counts["floor"]
    assert s["outcome surface"]["ended"][-1] == counts["surface"]
    assert s["outcome stopped"].value[-1] == (counts["floor"] + counts["surface"]) / 1000
    # Those that rise do not sink; had nothing stopped them, they would have sunk as often as the others.
    assert s["outcome sea floor"]["alone"][-1] > s["outcome sea floor"].value[-1] == counts["floor"] / 1000
    assert s["mean depth at surface"].value[0, 0] == pytest.approx(17.0, abs=1e-12)


@pytest.mark.ci
def test_an_own_monte_carlo_with_three_competing_events():
    """An upright vehicle moves up or down at constant acceleration to the surface or the floor, unless its time is over first.

    The truth draws its own numbers, 400,000 times, and solves the quadratic.
    """
    depth, surface, floor, t1, n, many = 20.0, 17.0, 26.0, 40.0, 2000, 400_000
    scene = lw.Scene.named("nordkvist_sanyal", start={"position": [0, 0, depth]}, vehicle={"buoyancy": 1212.5},
                           events=stops(floor=floor, surface=surface, at=20.0))  # fmt: skip
    vary = {"vehicle.buoyancy": Normal(std=3.0), "start.velocity[2]": Normal(std=0.1),
            "time.at": Uniform(low=2.0, high=80.0)}  # fmt: skip
    asked = [Outcome(name) for name in ("floor", "surface", "time", "ok")] + [FirstPassage("depth", above=floor)]
    result = lw.solve(lw.Ensemble(scene, n, 1, vary), **SETTINGS | {"statistics": asked})

    rng = np.random.default_rng(5)
    a = (123.8 * 9.8 - rng.normal(1212.5, 3.0, many)) / (123.8 + 75.0)
    w, time = rng.normal(0.0, 0.1, many), rng.uniform(2.0, 80.0, many)

    def first(level):
        roots = np.stack([(-w + sign * np.sqrt(w * w + 2.0 * a * (level - depth) + 0j)) / a for sign in (-1.0, 1.0)])
        return np.where((roots.imag == 0.0) & (roots.real > 0.0), roots.real, np.inf).min(axis=0)

    ends = np.stack([first(floor), first(surface), time, np.full(many, t1)])
    kind, end = ends.argmin(axis=0), ends.min(axis=0)
    s, sum_of = result.statistics, 0.0
    for i, name in enumerate(("floor", "surface", "time", "ok")):
        found = s[f"outcome {name}"]
        true = np.array([((kind == i) & (end <= t)).mean() for t in found.time])
        # Five standard deviations of both numbers; of 1 / n, none of which either may see.
        error = 5.0 * np.sqrt((true * (1.0 - true) + 1.0 / n) * (1.0 / n + 1.0 / many))
        assert (np.abs(found.value - true) < error).all(), name
        assert 0.05 < true[-1] < 0.6
        assert found.value[-1] == (found["ended"][-1] / n)
        sum_of += found.value[-1]
    assert sum_of == pytest.approx(1.0, abs=1e-15)
    assert s["first_passage depth above 26"].value[-1] == s["outcome floor"].value[-1] < s["outcome floor"]["alone"][-1]
    # The half of the members never reaches the floor, and no time is said for it.
    assert np.isfinite(s["outcome floor"]["end_time"][0])
    assert s["outcome floor"]["end_time"][2] == np.inf


def named(name, vary, ends, **start):
    """A fleet of a named vehicle, or of a scene among the examples."""
    path = ROOT / "examples" / "scenes" / f"{name}.toml"
    scene = lw.Scene.load(path) if path.exists() else lw.Scene.named(name, start={"position": [0, 0, 10.0], **start})
    return lw.Ensemble(dataclasses.replace(scene, events=tuple(ends)), 128, 1, vary)


BOTH = {"floor": 26.0, "surface": 17.0}
ALL = {"floor": 24.0, "surface": 17.0, "lower": (-1e6, -1e6, 0.0), "upper": (2.0, 1e6, 30.0), "radius": 1.5, "at": 30.0}
FAST = {"start.angular_velocity": Normal(std=(40.0, 5.0, 0.02))}
HEAVE = {"vehicle.buoyancy": Normal(relative=0.02), "start.velocity[2]": Normal(std=0.3)}
NEAR = [Floor(depth=11.0), Surface(depth=9.0)]
WALLS = [Box(lower=(-0.3, -9.0, 0.0), upper=(1e3, 9.0, 99.0), name="astern"),
         Box(lower=(-1e3, -9.0, 0.0), upper=(0.3, 9.0, 99.0), name="ahead"),
         Surface(depth=9.5)]  # fmt: skip
# Members, with settings of the run beside those of SETTINGS.
TEN = {
    "nobody ends": (lambda: fleet(256, stops()), {}),
    "every event": (lambda: fleet(256, stops(**ALL)), {}),
    "some fail": (lambda: fleet(256, stops(**BOTH), more=FAST), {}),
    "some fail, and soon over": (lambda: fleet(256, stops(surface=17.0, at=20.0), more=FAST), {}),
    "replicates": (lambda: fleet(256, stops(**BOTH), sampling=lw.designs.Sobol(replicates=4)), {}),
    "replicates, some fail": (lambda: fleet(256, stops(**BOTH), more=FAST, sampling=lw.designs.Sobol(replicates=4)), {}),
    "until": (lambda: fleet(4000, stops(**BOTH)), {"until": lw.Until("outcome floor", 0.05, members=256)}),
    "remus_100": (lambda: named("remus_100", HEAVE, NEAR, velocity=[1.5, 0, 0]), {"method": "psi_x", "t1": 12.0}),
    "bluerov2_heavy": (lambda: named("bluerov2_heavy", HEAVE | {"start.velocity[0]": Normal(std=0.5)}, WALLS),
                       {"method": "rk4", "dtype": "float32", "t1": 8.0}),
    "bluerov2_dead_thruster": (lambda: named("bluerov2_dead_thruster", HEAVE,
                                             [Floor(depth=4.0), StopTime(at=6.0)]),
                               {"method": None, "h": 0.05, "t1": 8.0}),
}  # fmt: skip


@pytest.mark.ci
@pytest.mark.slow_for("remus_100-*", "bluerov2_dead_thruster-*")
@pytest.mark.parametrize("stored", [False, True], ids=["memory", "store"])
@pytest.mark.parametrize("name", TEN)
def test_the_sum_over_outcomes_and_ok_is_1_over_ten_scenes(name, stored, monkeypatch, tmp_path):
    monkeypatch.setitem(events.TYPES, FarAway.type, FarAway)
    make, more = TEN[name]
    one = make()
    ends = one.scene.events
    asked = [Outcome(kind) for kind in (*(end.key for end in ends), "ok", "stopped", "failed")]
    how = SETTINGS | {"save": lw.SaveAt(every=2.0)} | more | {"statistics": asked}
    if stored:
        lw.solve(one, **how, store=tmp_path / "run.zarr")
    result = lw.open_run(tmp_path / "run.zarr") if stored else lw.solve(one, **how)
    s, counts, n = result.statistics, result.status.counts(), result.members
    for status in {end.status for end in ends}:
        of_status = [end.key for end in ends if end.status == status]
        assert sum(s[f"outcome {key}"]["ended"][-1] for key in of_status) == counts.get(status.name.lower(), 0)
    each = np.stack([s[f"outcome {end.key}"].value for end in ends])
    assert each[:, -1].sum() + s["outcome ok"].value[-1] == pytest.approx(1.0, abs=1e-13)
    np.testing.assert_allclose(each.sum(axis=0), s["outcome stopped"].value, atol=1e-13)
    failed = np.asarray(result.status.failed).sum()
    assert s["outcome failed"].value[-1] == failed / n
    assert (failed > 20) == ("fail" in name)
    if not failed:
        np.testing.assert_array_equal(each, [s[f"outcome {end.key}"]["fraction"] for end in ends])
    assert name == "nobody ends" or (each[:, -1] > 0.0).sum() >= 2 - (name == "bluerov2_dead_thruster")
    assert (n < 4000) == (one.members < 4000 or name == "until")


@pytest.mark.ci
def test_replicates_of_a_design():
    result = lw.solve(fleet(512, sampling=lw.designs.Sobol(replicates=4)), **SETTINGS)
    hits = (np.asarray(result.status) == lw.Status.FLOOR).sum()
    for name in ("outcome floor", "exceedance depth above 26", "first_passage depth above 26"):
        assert round(float(np.ravel(result.statistics[name].value)[-1]) * 512) == hits


@pytest.mark.ci
def test_quantities_of_outcomes_and_times():
    members = fleet(300, stops(floor=26.0, surface=17.0))
    result = lw.solve(members, **SETTINGS)
    status, when = np.asarray(result.status), result.end_time
    floor = status == lw.Status.FLOOR
    exact = {
        "outcome floor": floor, "outcome ok": status == 0, "outcome stopped": status > 0,
        "end_time floor": np.where(floor, when, np.nan), "depth at floor": np.where(floor, result.depth[-1], np.nan),
        "position at surface": np.where((status == lw.Status.SURFACE)[:, None], result.position[-1], np.nan),
        "depth at 8": result.depth[2], "norm(velocity) at 40": np.linalg.norm(result.velocity[-1], axis=1),
    }  # fmt: skip
    for text, numbers in exact.items():
        (quantity,) = quantities(text)
        found = quantity.values(result)
        np.testing.assert_array_equal(found, np.reshape(numbers, found.shape), err_msg=text)
        again = [quantities(label)[0].values(result) for label in quantity.labels(found.shape[1])]
        np.testing.assert_array_equal(np.concatenate(again, axis=1), found)
    # The same through `uq`, whose runs keep what these need.
    how = {name: SETTINGS[name] for name in ("method", "h", "t1")}
    f = lw.uq.model(
        members.scene, ["vehicle.buoyancy"], ["outcome floor", "depth at 8", "end_time floor"], failed="nan", **how
    )
    Y = f([[1205.0], [1220.0]])
    np.testing.assert_array_equal(Y[:, 0], [1.0, 0.0])
    assert np.isnan(Y[1, 2])  # the second has no end_time, but a depth
    assert np.isfinite(Y[1, 1])
    assert 20.0 < Y[0, 1] < 26.0
    assert 8.0 < Y[0, 2] < 40.0
    found = lw.uq.sobol(members, ["outcome floor", "outcome surface"], samples=64, second_order=False, **how)
    assert found.quantities == ("outcome floor", "outcome surface")
    assert found.mean.sum() <= 1.0
    refused = {"outcome flor": "is not an outcome of this scene. Did you mean 'floor'", "depth at flor": "Did you mean",
               "max(depth) at floor": "is taken over the whole path", "depth at -1": "is at no time of a run"}  # fmt: skip
    for text, words in refused.items():
        with pytest.raises(lw.SceneError, match=words):
            lw.uq.sobol(members, text, samples=8, **how)


@pytest.mark.slow
def test_quantities_of_two_events_of_one_status():
    """Two shelves end a drift to the north and one to the south: by hand, since it goes straight on at its first velocity."""
    shelves = [Box(lower=(-1e6,) * 3, upper=(4.0, 1e6, 1e6), name="north"),
               Box(lower=(-2.0, -1e6, -1e6), upper=(1e6,) * 3, name="south"),
               Floor(depth=1e6)]  # fmt: skip
    scene = lw.Scene.named("sphere", start={"position": [0, 0, 20.0]}, events=shelves)
    u, t1 = np.array([0.5, -0.5, 0.3, -0.1, 0.2]), 10.0
    of = ["outcome north", "outcome south", "outcome box", "outcome floor", "end_time south", "position[0] at north"]
    how = dict(method="psi_s", h=0.1, t1=t1)
    north, south = u * t1 > 4.0, u * t1 < -2.0
    f = lw.uq.model(scene, ["start.velocity[0]"], of[:4], **how)
    np.testing.assert_array_equal(f(u[:, None]), np.stack([north, south, north | south, 0.0 * u], axis=1))
    run = lw.prepare(scene, ["start.velocity[0]"], of[4:], **how, failed="nan")
    both = run(u[:, None])
    np.testing.assert_allclose(both[:, 0], np.where(u < -0.2, -2.0 / u, np.nan), atol=1e-9)
    np.testing.assert_allclose(both[:, 1], np.where(u > 0.4, 4.0, np.nan), atol=1e-9)
    ends = lw.uq.model(scene, ["start.velocity[0]"], "end_time south", **how, failed="nan")(u[:, None])
    np.testing.assert_allclose(ends, np.where(u < -0.2, -2.0 / u, np.nan), atol=1e-9)
    there = lw.uq.model(scene, ["start.velocity[0]"], "position[0] at north", **how, failed="nan")(u[:, None])
    np.testing.assert_allclose(there, np.where(u > 0.4, 4.0, np.nan), atol=1e-9)
    vary = {"start.velocity[0]": Uniform(low=-0.6, high=0.6)}
    share = lw.uq.sobol(scene, of[:2], vary=vary, samples=256, second_order=False, **how).mean
    assert share == pytest.approx([1.0 / 6.0, 1.0 / 3.0], abs=0.02)
    result = lw.solve(lw.Ensemble(scene, 4, 1, vary), **how)
    ended = quantities("outcome north")[0].values(result)
    np.testing.assert_array_equal(ended[:, 0], result.position[-1, :, 0] > 3.9)
    # A file of an earlier version does not tell which of them it was.
    with pytest.raises(
        lw.SceneError, match=r"is one of several events of the status box. Gather lw\.statistics\.Outcome"
    ):
        quantities("outcome north")[0].values(dataclasses.replace(result, event=None))


def test_an_outcome_that_no_member_can_have_is_refused():
    with pytest.raises(lw.SceneError) as error:
        lw.solve(fleet(10, [Floor(depth=26.0)]), "psi_s", h=0.04, t1=1.0,
                 statistics=[Outcome("surface"), Mean("depth", at="flor")])  # fmt: skip
    text = str(error.value)
    says(text, "outcome.of = 'surface' is not an outcome of this scene", "Did you mean 'floor'")


@pytest.mark.ci
def test_until_an_outcome_is_sure_enough():
    asked = SETTINGS | {"statistics": [Outcome("floor"), EndTime("floor", Mean())]}
    for watched, half in (("outcome floor", 0.03), ("mean end_time floor", 1.0)):
        result = lw.solve(fleet(4000), **asked, until=lw.Until(watched, half, members=512))
        assert len(result.status) < 4000
        assert "reached" in result.messages[-1]
        assert result.statistics[watched].half_width[-1] <= half
