# SPDX-License-Identifier: Apache-2.0
"""Members that are kept after all lie in the store: the bits of a run in memory, killed, damaged, merged and exported."""

import json
import pickle
import shutil
import time

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.common.status import Status
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.store import open as stored
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.state import state
from tests.runs.test_store import FIELDS
from tests.support.hostile import flipped, removed, torn
from tests.support.stores import MEMBERS, SETTINGS, differing, fleet, forked, tree

# Some members turn too fast for the step: |J^-1 a| reaches 1.
VARY = {
    "start.angular_velocity": lw.distributions.Normal(std=115.0),
    "vehicle.mass": lw.distributions.Normal(relative=0.001),
}


def failing(members=MEMBERS):
    """Members of which about one in three fails in its first steps."""
    return lw.Ensemble(fleet(1).scene, members, 1, VARY)


@pytest.fixture(scope="module")
def memory():
    return lw.solve(failing(), **SETTINGS)


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """A complete store of the members that failed: more than one block of them, and no test changes it."""
    path = tmp_path_factory.mktemp("kept") / "run.zarr"
    lw.solve(failing(), **SETTINGS, keep="failed", store=path)
    return path


@pytest.fixture
def copy(complete, tmp_path):
    return shutil.copytree(complete, tmp_path / "run.zarr")


@pytest.mark.ci
def test_it_has_the_bits_of_a_run_in_memory(complete, memory):
    failed = np.flatnonzero(memory.status)
    assert 256 < len(failed) < 512
    assert set(memory.status[failed]) == {Status.STEP_TOO_LARGE}
    result, asked = lw.open_run(complete), lw.solve(failing(), **SETTINGS, keep="failed")
    np.testing.assert_array_equal(result.kept_members, failed)
    assert not result.samples
    assert result.kept.members == len(failed)
    for name in FIELDS:
        assert getattr(result.kept, name).tobytes() == getattr(memory, name)[:, failed].tobytes()
    for name in ("status", "failure_time", "failure_value"):
        assert getattr(result.kept, name).tobytes() == getattr(memory, name)[failed].tobytes()
    np.testing.assert_array_equal(result.kept.parameters["vehicle.mass"], memory.parameters["vehicle.mass"][failed])
    assert result.kept.provenance == json.loads(json.dumps(asked.kept.provenance))
    assert result.kept.energy.tobytes() == asked.kept.energy.tobytes()


def test_xarray_opens_the_group_alone_and_with_the_run(complete, memory, recwarn):
    import xarray

    failed = np.flatnonzero(memory.status)
    group = xarray.open_zarr(complete, group="kept")
    assert group.position.dims == ("time", "member", "component")
    assert group.position.attrs["units"] == "m"
    np.testing.assert_array_equal(group.member.values, failed)
    one = group.position.sel(member=failed[7]).isel(time=-1)
    np.testing.assert_array_equal(one.values, memory.position[-1, failed[7]])
    tree = xarray.open_datatree(complete, engine="zarr")
    assert tree["kept"].sizes["member"] == len(failed)
    assert tree.sizes["realization"] == MEMBERS
    assert lw.open_run(complete).kept.dataset.sizes["realization"] == len(failed)
    assert len(recwarn) == 0


@pytest.mark.ci
@pytest.mark.parametrize("executor", [pytest.param("processes", marks=pytest.mark.slow), "threads"])
def test_the_same_run_leaves_the_same_bytes(executor, complete, tmp_path):
    path = tmp_path / "run.zarr"
    result = lw.solve(failing(), **SETTINGS, keep="failed", store=path, executor=executor, threads=1)
    assert differing(complete, path) == []
    assert result.kept.members == len(result.kept_members) > 256
    before = tree(path)
    assert lw.resume(path).kept is not None
    assert tree(path) == before


def test_a_part_is_sent_as_what_it_is():
    """Alone, these members would need less of a kernel than all do; elsewhere they must have the same."""
    states = fleet(2).select(0, 2)
    given = {"vehicle.added_mass": np.array([[65.0, 70.0, 75.0], [70.0, 70.0, 70.0]])}
    own = lw.Ensemble.from_states(fleet(2).scene, states.position, states.attitude, states.velocity,
                                  states.angular_velocity, parameters=given)  # fmt: skip
    plan = make_plan(own, **SETTINGS)
    part = plan.subplan([1], ("position",))
    assert part.spec.mass == plan.spec.mass != make_plan(own.subset([1]), **SETTINGS).spec.mass
    again = pickle.loads(pickle.dumps(part))
    assert (again.spec, again.fields, again.ensemble.members) == (part.spec, ("position",), 1)


@pytest.mark.ci
def test_no_failures_leave_no_group(tmp_path):
    result = lw.solve(fleet(), **SETTINGS, keep="failed", store=tmp_path / "run.zarr")
    assert result.kept is None
    assert not (tmp_path / "run.zarr" / "kept").exists()
    assert lw.open_run(tmp_path).kept is None
    assert state(tmp_path)["complete"]


DAMAGED = (("kept/position/c.0.1.0", flipped, "has changed"), ("kept/attitude/c.0.0.0.0", torn(0.99), "is torn"),
           ("kept/vehicle.mass/c.1", removed, "is missing"), ("kept/position/zarr.json", flipped, "has changed"),
           ("kept/member/c.0", flipped, "has changed"), ("kept/blocks/000000256.json", removed, "is missing or damaged"),
           ("kept/blocks/000000000.json", flipped, "is missing or damaged"), ("kept/created.json", flipped, "is damaged"),
           ("kept/zarr.json", torn(0.99), "is damaged"), ("kept", shutil.rmtree, "is missing"))  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize(("name", "harm", "word"), DAMAGED, ids=[f"{h.__name__} {n}" for n, h, _ in DAMAGED])
def test_damage_is_seen_and_mended(copy, complete, name, harm, word, capsys):
    harm(copy / name, None)
    assert cli.main(["info", str(copy)]) == 1
    said = capsys.readouterr().out
    assert f"damage      {name} {word}" in said
    assert "not complete: lgvi-warp resume" in said
    lw.resume(copy)
    assert differing(complete, copy) == []
    assert cli.main(["info", str(copy)]) == 0


@pytest.mark.ci
@pytest.mark.parametrize(
    ("harm", "output"),
    [
        ((), "nothing was missing: 4 of 4 blocks were there and whole"),
        (("kept/blocks/000000000.json",), "went on: 4 of 4 blocks were there and whole, 0 ran, and 1 of kept members"),
        (("blocks/000000512.json",), "went on: 3 of 4 blocks were there and whole, 1 ran"),
        (("kept",), "went on: 4 of 4 blocks were there and whole, 0 ran, and 2 of kept members"),
    ],
    ids=["nothing", "a kept block", "a block", "all kept"],
)
def test_a_resume_counts_what_ran(copy, complete, harm, output):
    for name in harm:
        shutil.rmtree(copy / name) if (copy / name).is_dir() else (copy / name).unlink()
    assert lw.resume(copy).messages[-1] == output
    assert differing(complete, copy) == []


def test_a_lost_group_is_not_silently_none(copy):
    shutil.rmtree(copy / "kept")
    with pytest.raises(lw.SceneError, match=r"kept is missing. `lgvi-warp resume"):
        lw.open_run(copy)


def interrupted(path, complete):
    """Leave the run as if killed before its kept members were run again."""
    shutil.copytree(complete, path)
    Folder(path).reopen()
    shutil.rmtree(path / "kept")
    return path


@pytest.mark.ci
def test_a_run_is_complete_only_with_them(complete, tmp_path, capsys):
    path = interrupted(tmp_path / "run.zarr", complete)
    with pytest.raises(lw.SceneError, match=r"members that it keeps have not been run again yet.*resume"):
        lw.open_run(path)
    assert lw.open_run(path, incomplete=True).kept is None
    assert cli.main(["info", str(path)]) == 1
    # What is left of others that were killed there.
    shutil.copytree(complete / "kept", path / "kept.new")
    result = lw.resume(path)
    assert differing(complete, path) == []
    assert result.kept.members == len(result.kept_members)


@pytest.mark.ci
def test_other_members_than_those_that_failed_are_run_anew(complete, tmp_path):
    path = interrupted(tmp_path / "run.zarr", complete)
    other = lw.solve(failing(), **SETTINGS, keep=[3, 5], store=tmp_path / "other.zarr")
    assert (list(other.kept_members), other.kept.members) == ([3, 5], 2)
    shutil.copytree(tmp_path / "other.zarr" / "kept", path / "kept")
    lw.resume(path)
    assert differing(complete, path) == []


def kept_run(path):
    lw.solve(failing(), **SETTINGS, keep="failed", threads=1, store=lw.Store(path, chunk_bytes=20_000))


@pytest.mark.ci
@pytest.mark.parametrize("wanted", ["zarr.json", pytest.param("blocks/000000000.json", marks=pytest.mark.slow)])
def test_killed_among_its_kept_members(wanted, tmp_path):
    path, other = tmp_path / "run.zarr", tmp_path / "other.zarr"
    lw.solve(failing(), **SETTINGS, keep="failed", store=lw.Store(other, chunk_bytes=20_000))
    process = forked(kept_run, path)
    while not (path / "kept" / wanted).exists() and process.is_alive():
        time.sleep(0.0005)
    process.kill()
    process.join()
    assert process.exitcode != 0
    lw.resume(path)
    assert differing(other, path) == []


@pytest.mark.ci
def test_with_statistics_until_and_fewer_fields(tmp_path):
    own = {
        "statistics": [lw.statistics.Mean("depth")],
        "until": lw.Until("mean depth", 1e9, members=512),
        "keep": "failed",
    }
    chosen = lw.Store(tmp_path / "run.zarr", dtype="float32", fields=("position", "velocity"))
    save = lw.SaveAt(every=0.1, fields=("position", "attitude"))
    result = lw.solve(failing(), **SETTINGS | {"save": save}, **own, store=chosen)
    every = lw.solve(failing(), **SETTINGS)
    assert (result.members, list(result.kept.samples)) == (512, ["position"])
    np.testing.assert_array_equal(result.kept_members, np.flatnonzero(every.status[:512]))
    assert result.kept.position.dtype == np.float32
    np.testing.assert_array_equal(result.kept.position, every.position[:, result.kept_members].astype(np.float32))
    before = tree(tmp_path)
    shutil.rmtree(tmp_path / "run.zarr" / "kept")
    (tmp_path / "run.zarr" / "blocks" / "000000256.json").unlink()
    assert lw.resume(tmp_path).kept.position.tobytes() == result.kept.position.tobytes()
    assert tree(tmp_path) == before


@pytest.mark.slow  # for its kernels: rk5 that chooses its steps
def test_members_that_share_their_steps_lie_beside_those_that_are_kept(tmp_path):
    method = lw.Method("rk5", rtol=1e-6, atol=1e-9)
    settings = {"method": method, "h": 0.1, "t1": 1.0, "save": lw.SaveAt(every=0.5), "width": 4}
    every = lw.solve(fleet(30), **settings)
    result = lw.solve(fleet(30), **settings, keep=[5, 6, 29], store=tmp_path / "run.zarr")
    group = stored.Folder(tmp_path / "run.zarr" / "kept").group()
    assert (list(group["member"][:]), list(group["chosen"][:])) == ([4, 5, 6, 7, 28, 29], [0, 1, 1, 0, 0, 1])
    for one in (result, lw.open_run(tmp_path)):
        assert (list(one.kept_members), one.kept.members) == ([5, 6, 29], 3)
        assert one.kept.position.tobytes() == every.position[:, [5, 6, 29]].tobytes()
        assert one.kept.dataset.realization.values.tolist() == [5, 6, 29]
        assert one.kept.provenance["ensemble"]["indices"] == [5, 6, 29]


@pytest.mark.ci
def test_parts_are_merged_with_their_kept_members(complete, tmp_path):
    for name, only in (("a", range(0, 2)), ("b", range(2, 4))):
        lw.solve(failing(), **SETTINGS, keep="failed", store=tmp_path / name / "run.zarr", blocks=only)
        assert not (tmp_path / name / "run.zarr" / "kept").exists()
    folder = lw.merge([tmp_path / "a", tmp_path / "b"], tmp_path / "all")
    assert folder.complete
    assert differing(complete, folder.path) == []
    again = lw.merge([folder.path], tmp_path / "again")
    assert again.complete
    assert differing(complete, again.path) == []


@pytest.mark.ci
def test_the_last_part_into_one_folder_runs_them(complete, tmp_path):
    path = tmp_path / "run.zarr"
    for only in (range(2, 4), range(0, 2)):
        lw.solve(failing(), **SETTINGS, keep="failed", store=lw.Store(path, existing="resume"), blocks=only)
    assert differing(complete, path) == []


@pytest.mark.ci
def test_all_are_told_with_exit_code_and_files(tmp_path, capsys):
    """on_failure="raise" ends with 1, and what failed lies in the store."""
    fast = ["--set", "start.angular_velocity=[0,0,500]", "--keep", "failed", "--on-failure", "raise"]
    scene = str(cli_scene())
    run = ["run", scene, "--members", "20", "--duration", "2", "--set", "run.save_every=0.5", "--store", "zarr"]
    assert cli.main([*run, "--out", str(tmp_path), *fast]) == 1
    said = capsys.readouterr()
    assert "step_too_large, 20 of 20 members" in said.err
    assert "kept        20 members' samples" in said.out
    assert cli.main(["resume", str(tmp_path), "--quiet"]) == 1
    assert lw.open_run(tmp_path).kept.members == 20
    assert cli.main(["info", str(tmp_path)]) == 0
    assert "kept        20 members" in capsys.readouterr().out


def cli_scene():
    from tests.conftest import ROOT

    return ROOT / "examples" / "paper.toml"


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_netcdf_has_them_in_a_group(complete, memory, tmp_path):
    import xarray

    failed = np.flatnonzero(memory.status)
    path = lw.export(complete, "netcdf", tmp_path / "run.nc")
    with xarray.open_dataset(path, group="kept", engine="netcdf4") as group:
        np.testing.assert_array_equal(group.member.values, failed)
        np.testing.assert_array_equal(group.attitude.values, memory.attitude[:, failed])
        assert (group.position.attrs["units"], group.attrs["Conventions"]) == ("m", "CF-1.11")
    with xarray.open_datatree(path, engine="netcdf4") as tree:
        assert tree.sizes["realization"] == MEMBERS
        assert tree["kept"].sizes["member"] == len(failed)


def test_parquet_has_the_rows_of_those_that_are_kept(complete, memory, tmp_path):
    import pandas

    failed = np.flatnonzero(memory.status)
    table = pandas.read_parquet(lw.export(complete, "parquet", tmp_path / "run.parquet"))
    assert len(table) == len(failed) * 31
    assert table.attrs["units"]["velocity_2"] == "m s-1"
    one = table[table.realization == failed[300]]
    np.testing.assert_array_equal(one.position_2, memory.position[:, failed[300], 2])
    assert set(one["vehicle.mass"]) == {memory.parameters["vehicle.mass"][failed[300]]}
