# SPDX-License-Identifier: Apache-2.0
"""Statistics of samples at hand: the bits of those gathered on the way, from memory, stores and files, and what is refused."""

import pickle

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.fixed_scenes import STATISTICS, VARY, paper

pytestmark = pytest.mark.kernel

MEMBERS = 1003
SETTINGS = {"method": "psi_s", "h": 0.02, "t1": 1.0, "save": lw.SaveAt(every=0.1), "threads": 1}


def moved_north(samples, members):
    return samples["position"][..., 0] - members.position[:, 0]


ASKED = [
    *STATISTICS, lw.statistics.Mean(moved_north), lw.statistics.Mean("depth", name="left", stopped="left_out"),
    lw.statistics.Outcome("deep"), lw.statistics.Mean("speed", at="floor"), lw.statistics.EndTime("floor"),
    lw.statistics.Mean("max(depth)"), lw.statistics.PathMaximum("depth", then=lw.statistics.MemberValues()),
]  # fmt: skip


def fleet_of(members=MEMBERS, **others):
    """Members of the paper's vehicle, of which two floors stop some: both have one status."""
    scene = paper().scene
    events = [lw.events.Floor(depth=10.1), lw.events.Floor(name="deep", depth=10.35)]
    scene = lw.Scene(scene.vehicle, scene.environment, scene.terms, scene.start, events=events)
    return lw.Ensemble(scene, members, 1, **{"vary": VARY} | others)


@pytest.fixture(scope="module")
def result():
    return lw.solve(fleet_of(), **SETTINGS, statistics=ASKED)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    path = tmp_path_factory.mktemp("gather") / "run.zarr"
    lw.solve(fleet_of(), **SETTINGS, statistics=ASKED, store=path)
    return path


def assert_same(first, second):
    """All arrays of two sets of estimates have equal bits."""
    assert list(first) == list(second)
    for name, estimate in first.items():
        assert estimate.arrays.keys() == second[name].arrays.keys()
        for key, values in estimate.arrays.items():
            other = np.asarray(second[name][key])
            assert np.asarray(values).dtype == other.dtype
            assert np.asarray(values).tobytes() == other.tobytes(), f"{name}: {key}"


@pytest.mark.ci
def test_a_result_in_memory_gives_the_bits_of_the_run(result):
    gathered = lw.gather(result, ASKED)
    assert_same(gathered, result.statistics)
    assert 0 < result.status.counts()["floor"] < MEMBERS
    assert set(gathered.messages) <= set(result.messages)
    assert_same(lw.gather(pickle.loads(pickle.dumps(result)), ASKED), result.statistics)


@pytest.mark.ci
def test_a_store_gives_the_bits_of_the_run(result, store):
    assert_same(lw.gather(store, ASKED), result.statistics)
    assert_same(lw.gather(lw.open_run(store), ASKED[:5]), lw.gather(result, ASKED[:5]))


def test_a_saved_file_gives_the_bits_of_the_run(result, tmp_path):
    assert_same(lw.gather(lw.Result.load(result.save(tmp_path / "run.npz")), ASKED), result.statistics)


def test_some_members_are_a_run_of_their_own(result, store):
    """Members 100 to 355 fill one block; their mean is that of their samples."""
    few = lw.open_run(store, members=slice(100, 356))
    gathered = lw.gather(few, [lw.statistics.Mean("position")])["mean position"]
    np.testing.assert_allclose(gathered.value, few.position.mean(axis=1), rtol=1e-13)
    assert_same(lw.gather(result.part(np.arange(100, 356)), [lw.statistics.Mean("position")]),
                lw.gather(few, [lw.statistics.Mean("position")]))  # fmt: skip
    alone = lw.gather(result.part(np.array([7])), [lw.statistics.Mean("depth"), lw.statistics.Outcome("deep")])
    assert alone["mean depth"].value[-1, 0] == result.depth[-1, 7]


@pytest.mark.ci
def test_replicates_and_a_run_that_ended_early_keep_their_intervals():
    asked = [*STATISTICS, lw.statistics.Mean("speed", name="watched")]
    until = lw.Until("watched", half_width=1.0)
    for sampling, settings in ((lw.designs.Sobol(replicates=16), {}), ("random", {"until": until})):
        result = lw.solve(fleet_of(4096, sampling=sampling), **SETTINGS, statistics=asked, **settings)
        assert_same(lw.gather(result, asked), result.statistics)
    assert result.members < 4096


@pytest.mark.ci
def test_what_was_not_kept_is_named():
    few = lw.solve(fleet_of(40), **SETTINGS | {"save": lw.SaveAt(fields=("position",))})
    with pytest.raises(lw.SceneError, match=r"'velocity'.*not kept. Keep it: .*fields=\('position', 'velocity'\)"):
        lw.gather(few, [lw.statistics.Mean("speed"), lw.statistics.Mean("depth")])
    with pytest.raises(lw.SceneError, match=r"'velocity'"):
        lw.gather(few, [lw.statistics.Mean(lambda samples, members: samples["velocity"][..., 0])])
    assert lw.gather(few, [lw.statistics.Mean("depth")])["mean depth"].count[0] == 40
    none = lw.solve(fleet_of(40), **SETTINGS, keep="none")
    with pytest.raises(lw.SceneError, match=r'no samples of all were kept. Run with keep="all"'):
        lw.gather(none, [lw.statistics.Mean("depth")])
    assert lw.gather(none, [lw.statistics.Outcome("floor")])["outcome floor"].value[-1] >= 0.0
    with pytest.raises(lw.SceneError, match="not an outcome of this scene"):
        lw.gather(none, [lw.statistics.Outcome("flor")])
    with pytest.raises(lw.SceneError, match="is not a result"):
        lw.gather(fleet_of(2), [lw.statistics.Mean("depth")])


def test_stores_and_tables_hold_what_varied_and_how_it_ended(result, store, tmp_path):
    pandas = pytest.importorskip("pandas")
    import xarray

    fleet = fleet_of()
    wanted = fleet.starts(0, MEMBERS)
    assert set(wanted) == {"start.position", "start.angular_velocity"}
    stored, loaded = lw.open_run(store), lw.Result.load(result.save(tmp_path / "run.npz"))
    for each in (result, stored, loaded):
        assert set(each.starts) == set(wanted)
        for name, values in wanted.items():
            np.testing.assert_array_equal(each.starts[name], values)
        assert np.bincount(each.event, minlength=3)[1:].sum() == result.status.counts()["floor"]
    table = pandas.read_parquet(lw.export(store, "parquet", tmp_path / "run.parquet"))
    last = table[table.time == 1.0]
    np.testing.assert_array_equal(last["start.position_2"], wanted["start.position"][:, 2])
    np.testing.assert_array_equal(last["end_time"], result.end_time)
    np.testing.assert_array_equal(last["event"], result.event)
    with xarray.open_dataset(lw.export(store, "netcdf", tmp_path / "run.nc"), decode_times=False) as content:
        np.testing.assert_array_equal(content["end_time"], result.end_time)
        np.testing.assert_array_equal(content["start.position"], wanted["start.position"])
