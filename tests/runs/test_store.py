# SPDX-License-Identifier: Apache-2.0
"""A run in a store: the bits of one in memory, whatever reads it; and how it is refused, damaged, mended and exported."""

import asyncio
import errno
import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import zarr

import lgvi_warp as lw
from benchmarks.problems import DepthSum
from lgvi_warp import cli
from lgvi_warp.common import files as durable
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.results import member_fields
from lgvi_warp.results.provenance import messages, provenance
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.store import folder as store
from lgvi_warp.store import layout as store_layout
from lgvi_warp.store.block_files import packed, unpacked
from lgvi_warp.store.export import fault_of_library
from lgvi_warp.store.run import StoredRun
from lgvi_warp.store.state import state
from tests.conftest import ROOT
from tests.support import hostile
from tests.support.disks import Disk, files_of_at_most, full
from tests.support.refusals import says
from tests.support.stores import MEMBERS, SETTINGS, differing, fleet, markers, tree

FIELDS = ("position", "attitude", "velocity", "angular_velocity")


@pytest.fixture(scope="module")
def memory():
    return lw.solve(fleet(), **SETTINGS)


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """A complete store, which no test changes."""
    path = tmp_path_factory.mktemp("store") / "run.zarr"
    lw.solve(fleet(), **SETTINGS, store=path)
    return path


@pytest.fixture
def copy(complete, tmp_path):
    return shutil.copytree(complete, tmp_path / "run.zarr")


def test_it_has_the_bits_of_a_run_in_memory(complete, memory):
    stored = lw.open_run(complete.parent)
    for name in FIELDS:
        assert stored.samples[name].tobytes() == memory.samples[name].tobytes()
    for name in ("time", *(one.name for one in member_fields.present(make_plan(fleet(), **SETTINGS)))):
        assert getattr(stored, name).tobytes() == getattr(memory, name).tobytes()
    assert stored.parameters.keys() == memory.parameters.keys()
    for name, values in memory.parameters.items():
        np.testing.assert_array_equal(stored.parameters[name], values)
    assert stored.provenance == json.loads(json.dumps(memory.provenance))
    assert stored.messages == memory.messages
    np.testing.assert_array_equal(stored.energy, memory.energy)


@pytest.mark.parametrize("into", ["memory", "store"])
def test_blocks_are_handed_over_in_order_with_the_bits_of_the_run(into, memory, tmp_path):
    handed = []
    store = {} if into == "memory" else {"store": tmp_path / "run.zarr"}
    result = lw.solve(fleet(), **SETTINGS, **store, threads=2, on_block=handed.append)
    assert len(handed) > 1
    assert sum(block.members for block in handed) == result.members
    whole = {name: np.concatenate([block.samples[name] for block in handed], axis=1) for name in FIELDS}
    for name in FIELDS:
        assert whole[name].tobytes() == memory.samples[name].tobytes()
    np.testing.assert_array_equal(np.concatenate([block.status for block in handed]), memory.status)
    for name, values in memory.parameters.items():
        if len(values) > 1:
            np.testing.assert_array_equal(np.concatenate([block.parameters[name] for block in handed]), values)


@pytest.mark.parametrize("into", ["memory", "store"])
def test_what_takes_blocks_cannot_change_the_run(into, memory, tmp_path):
    """A taker that writes into all its arguments, at once and at the end."""
    handed = []

    def spoil(block):
        every = [*block.samples.values(), *block.parameters.values(), *vars(block).values()]
        for values in every:
            if isinstance(values, np.ndarray) and values.flags.writeable:
                values.view(np.ndarray)[...] = 77

    store = {} if into == "memory" else {"store": tmp_path / "run.zarr"}
    statistic = lw.statistics.Mean("position")
    more = dict(threads=2, statistics=[statistic])
    result = lw.solve(fleet(), **SETTINGS, **store, **more, on_block=lambda block: (spoil(block), handed.append(block)))
    for block in handed:
        spoil(block)
    clean = lw.solve(fleet(), **SETTINGS, **more)
    for name, values in vars(memory).items():
        if isinstance(values, np.ndarray):
            assert np.asarray(getattr(result, name)).tobytes() == values.tobytes(), name
    for name in FIELDS:
        assert result.samples[name].tobytes() == memory.samples[name].tobytes()
    for name, values in memory.parameters.items():
        np.testing.assert_array_equal(result.parameters[name], values)
    np.testing.assert_array_equal(
        result.statistics[statistic.key].value, clean.statistics[statistic.key].value)  # fmt: skip


def test_some_members_alone_are_read(complete, memory):
    some = lw.open_run(complete, [5, 1002, 300])
    assert some.position.tobytes() == memory.position[:, [5, 1002, 300]].tobytes()
    assert some.members == 3
    assert lw.open_run(complete, slice(250, 260)).parameters["vehicle.mass"].shape == (10,)


def test_zarr_cannot_write_into_it(complete):
    read_only = store.Folder(complete).checked()
    before = tree(complete)
    for write in (lambda: read_only.set("position/c/0/0/0", None), lambda: read_only.delete("position/c/0/0/0")):
        with pytest.raises(ValueError, match="read-only"):
            asyncio.run(write())
    with pytest.raises(ValueError, match="only read"):
        read_only.with_read_only(False)
    assert tree(complete) == before


def test_xarray_opens_it_without_a_remark(complete, memory, recwarn):
    import xarray

    dataset = xarray.open_zarr(complete)
    assert dataset.attrs["Conventions"] == "CF-1.11"
    assert dataset.attrs["complete"]
    assert dataset.position.dims == ("time", "realization", "component")
    assert dataset.position.attrs["units"] == "m"
    assert dataset.status.attrs["flag_meanings"].split()[0] == "ok"
    assert dataset["vehicle.mass"].attrs["units"] == "kg"
    np.testing.assert_array_equal(dataset.position.values, memory.position)
    np.testing.assert_array_equal(dataset.realization.values, np.arange(MEMBERS))
    assert dataset.provenance == json.dumps(json.loads(dataset.provenance))
    assert len(recwarn) == 0
    view = lw.open_run(complete).dataset
    assert float(view.position.isel(time=-1, realization=7, component=2)) == memory.position[-1, 7, 2]


def test_chunks_are_raw_numbers_with_a_checksum_one_block_each(complete, memory):
    array = zarr.open_array(complete / "position", mode="r")
    assert array.chunks == (31, 256, 3)
    data = (complete / "position" / "c.0.1.0").read_bytes()
    assert data[:-4] == memory.position[:, 256:512].tobytes()
    assert int.from_bytes(data[-4:], "little") == durable.checksum(data[:-4])


def test_long_runs_are_cut_in_equal_chunks_of_about_10_mb():
    plan = make_plan(fleet(8192), "psi_s", h=0.01, t1=100.0, save=lw.SaveAt(every=0.01))
    found = {one.name: one for one in store_layout.columns(plan, lw.Store("run.zarr"))}
    assert [found[name].times for name in FIELDS] == [1429, 527, 1429, 1429]
    assert all(0.6e7 < found[name].bytes <= 1.01e7 for name in FIELDS)
    assert found["position"].key(blocks(8192)[3], 2) == "position/c.2.3.0"


def test_a_column_for_each_number_of_a_member():
    plan = make_plan(fleet(20), lw.Method("rk5", rtol=1e-6, atol=1e-9), h=0.1, t1=1.0)
    names = [one.name for one in store_layout.columns(plan, lw.Store("run.zarr")) if not one.times]
    assert names == ["realization", "status", "failure_time", "failure_value", "warnings", "warning_time",
                     "warning_value", "substeps", "steps_made", "steps_tried", "vehicle.mass",
                     "start.angular_velocity"]  # fmt: skip


def test_time_chunks_come_together(tmp_path, memory):
    result = lw.solve(fleet(), **SETTINGS, store=lw.Store(tmp_path / "run.zarr", chunk_bytes=50_000))
    assert len(list((tmp_path / "run.zarr" / "position").glob("c.*"))) == 4 * 4
    assert all(result.samples[name].tobytes() == memory.samples[name].tobytes() for name in FIELDS)


def test_float32_and_fewer_fields(tmp_path, memory):
    chosen = lw.Store(tmp_path / "run.zarr", dtype="float32", fields=("position",))
    result = lw.solve(fleet(), **SETTINGS, store=chosen)
    assert (list(result.samples), result.position.dtype) == (["position"], np.float32)
    np.testing.assert_array_equal(result.position, memory.position.astype(np.float32))
    with pytest.raises(AttributeError, match="velocity was not kept"):
        _ = result.velocity
    lw.resume(tmp_path)


LARGER = """
import sys
import lgvi_warp as lw
from tests.support.stores import fleet
lw.solve(fleet(20000), "psi_s", h=0.01, t1=5.0, save=lw.SaveAt(every=0.01), threads=2, store=sys.argv[1])
assert lw.open_run(sys.argv[1], [7]).position.shape == (501, 1, 3)
# ru_maxrss would begin with what the process that started it had.
with open("/proc/self/status") as file:
    print(next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM")))
"""


@pytest.mark.slow
def test_samples_may_be_larger_than_the_memory_of_the_run(tmp_path):
    """1.44 GB of samples by a process that never has half of that."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    arguments = [sys.executable, "-c", LARGER, str(tmp_path / "run.zarr")]
    peak = int(subprocess.run(arguments, capture_output=True, text=True, env=env, check=True).stdout)
    stored = sum(path.stat().st_size for path in tmp_path.rglob("c.*"))
    assert stored > 1.4e9
    assert peak < stored / 2


def test_an_existing_run_is_refused_replaced_or_gone_on_with(copy):
    with pytest.raises(lw.SceneError, match=r"holds a run already.*resume.*--overwrite"):
        lw.solve(fleet(), **SETTINGS, store=copy)
    before = tree(copy)
    lw.solve(fleet(), **SETTINGS, store=lw.Store(copy, existing="resume"))
    assert tree(copy) == before
    with pytest.raises(lw.SceneError, match=r"ensemble.members is 1003 in the store and 1004 here is another run"):
        lw.solve(fleet(1004), **SETTINGS, store=lw.Store(copy, existing="resume"))
    with pytest.raises(lw.SceneError, match=r"stores .*float32"):
        lw.solve(fleet(), **SETTINGS, store=lw.Store(copy, dtype="float32", existing="resume"))
    lw.solve(fleet(300), **SETTINGS, store=lw.Store(copy, existing="overwrite"))
    assert lw.open_run(copy).members == 300
    assert sorted(path.name for path in copy.parent.iterdir()) == ["run.zarr"]


def test_bad_settings_are_refused_at_once(tmp_path):
    with pytest.raises(lw.SceneError) as refused:
        lw.Store(tmp_path / "run", dtype="float16", fields=("speed",), existing="keep")
    text = str(refused.value)
    says(text, "4 faults", ".zarr", "float16", "speed", "keep")


def test_a_run_in_use_is_left_alone(copy):
    with store.held(copy), pytest.raises(lw.SceneError, match="another run is writing"):
        lw.resume(copy)


HARMS = {"has changed": hostile.flipped, "is torn": hostile.torn(0.99), "is missing": hostile.removed}
# Samples, numbers of members (each in all three ways) and what describes them.
DAMAGED = (*((name, word) for name in ("position/c.0.2.0", "status/c.1", "vehicle.mass/c.3") for word in HARMS),
           ("attitude/c.0.0.0.0", "is torn"), ("position/zarr.json", "has changed"),
           ("created.json", "has changed"))  # fmt: skip
BLOCK_OF = {"position/c.0.2.0": 512, "status/c.1": 256, "vehicle.mass/c.3": 768, "attitude/c.0.0.0.0": 0}


@pytest.mark.ci
@pytest.mark.parametrize(("name", "word"), DAMAGED)
def test_damage_is_seen_and_its_block_alone_runs_again(copy, complete, name, word, capsys):
    HARMS[word](copy / name, None)
    word = "is damaged" if name == "created.json" else word
    assert cli.main(["info", str(copy)]) == 1
    assert f"damage      {name} {word}" in capsys.readouterr().out
    before = markers(copy)
    lw.resume(copy)
    assert differing(complete, copy) == []
    assert cli.main(["info", str(copy)]) == 0
    after = markers(copy)
    again = [int(one.removesuffix(".json")) for one in after if after[one] != before[one]]
    assert again == ([BLOCK_OF[name]] if name in BLOCK_OF else [])


def test_damaged_times_are_mended_by_the_same_run(copy, complete):
    hostile.flipped(copy / "time" / "c.0", None)
    with pytest.raises(lw.SceneError, match=r"time/c.0 has changed. Run the same scene again"):
        lw.resume(copy)
    lw.solve(fleet(), **SETTINGS, store=lw.Store(copy, existing="resume"))
    assert differing(complete, copy) == []


def test_metadata_of_the_root_are_mended(copy, complete):
    # The root repeats what each array says of itself: xarray would believe the root.
    content = json.loads((copy / "zarr.json").read_text())
    content["consolidated_metadata"]["metadata"]["position"]["attributes"]["units"] = "km"
    (copy / "zarr.json").write_text(json.dumps(content))
    lw.solve(fleet(), **SETTINGS, store=lw.Store(copy, existing="resume"))
    assert differing(complete, copy) == []
    assert lw.open_run(copy).dataset.position.attrs["units"] == "m"


def test_lost_times_are_not_taken_for_nan(copy, complete):
    """A missing chunk reads as NaN: a run that went on with that would write it down as right."""
    for name in ("time/c.0", "step/c.0"):
        (copy / name).unlink()
        before = tree(copy)
        with pytest.raises(lw.SceneError, match=f"{name} is missing. Run the same scene again"):
            lw.resume(copy)
        assert tree(copy) == before
        if name.startswith("time"):
            with pytest.raises(lw.SceneError, match=r"time/c.0 is missing"):
                lw.open_run(copy)
        lw.solve(fleet(), **SETTINGS, store=lw.Store(copy, existing="resume"))
        assert differing(complete, copy) == []


def test_lost_folders_are_made_again(copy, complete):
    for name in ("blocks", "parts", "position"):
        shutil.rmtree(copy / name)
    lw.resume(copy)
    assert differing(complete, copy) == []


def test_what_was_there_is_told(copy):
    (copy / "blocks" / "000000256.json").unlink()
    assert "went on: 3 of 4 blocks were there and whole, 1 ran" in lw.resume(copy).messages
    result = lw.solve(fleet(), **SETTINGS, store=lw.Store(copy, existing="resume"))
    assert result.messages == ("nothing was missing: 4 of 4 blocks were there and whole",)
    assert not result.run_seconds


@pytest.mark.ci
@pytest.mark.parametrize("name", ["blocks/000000256.json", "velocity/c.0.2.0"])
def test_a_missing_block_is_one_line_with_the_remedy(copy, name, tmp_path, capsys):
    """Its members would be drawn as if they had failed."""
    (copy / name).unlink()
    with pytest.raises(lw.SceneError, match=rf"{name} is missing.*; repair it with `lgvi-warp resume"):
        lw.open_run(copy)
    assert f"{name} is missing" in lw.open_run(copy, incomplete=True).messages[-1]
    for verb in (["view", "--out", str(tmp_path / "a.rrd")], ["plot"], ["report"]):
        assert cli.main([verb[0], str(copy.parent), *verb[1:]]) == 2
        said = capsys.readouterr().err
        assert f"{name} is missing" in said
        assert said.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.zarr"]
    lw.resume(copy)
    assert lw.open_run(copy).members == MEMBERS


@pytest.mark.parametrize("to", ["netcdf", "parquet"])
def test_what_is_damaged_is_not_exported(copy, tmp_path, to):
    """Missing blocks would be exported as NaN."""
    out = tmp_path / "run.out"
    (copy / "blocks" / "000000256.json").unlink()
    with pytest.raises(lw.SceneError, match=r"1 blocks are not marked as finished. `lgvi-warp resume .*` mends it"):
        lw.export(copy, to, out)
    lw.resume(copy)
    (copy / "velocity" / "c.0.2.0").unlink()
    with pytest.raises(lw.SceneError, match=r"velocity/c.0.2.0 is missing. `lgvi-warp resume"):
        lw.export(copy, to, out)
    with pytest.raises(lw.SceneError, match=r"is a folder, which is not replaced. Give the name of a file"):
        lw.export(copy, to, tmp_path)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["run.zarr"]


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
@pytest.mark.parametrize("to", ["netcdf", "parquet"])
def test_a_full_disk_is_told_by_an_export(complete, tmp_path, to, capsys):
    with files_of_at_most(100_000):
        assert cli.main(["export", str(complete), "--to", to, "--out", str(tmp_path / "run.out")]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"lgvi-warp: {tmp_path / 'run.out'}: ")
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("error", "number", "text"),
    [
        (OSError(errno.EDQUOT, "Disk quota exceeded"), errno.EDQUOT, "Disk quota exceeded"),
        (RuntimeError("NetCDF: HDF error"), errno.EIO, "was not written (NetCDF: HDF error); is the disk full?"),
    ],
    ids=["the system's", "the library's"],
)
def test_an_export_that_fails_says_what_the_library_says(error, number, text, tmp_path):
    with pytest.raises(OSError) as caught, fault_of_library("netcdf", tmp_path / "run.nc"):
        raise error
    assert (caught.value.errno, caught.value.strerror, caught.value.filename) == (
        number,
        text,
        str(tmp_path / "run.nc"),
    )


def test_values_are_read_when_they_are_used(complete):
    assert lw.open_run(complete).dataset.position.chunks is not None


def test_a_damaged_marker_runs_its_block_again(copy, complete):
    hostile.flipped(copy / "blocks" / "000000256.json", None)
    assert state(copy)["finished"] == 3
    lw.resume(copy)
    assert differing(complete, copy) == []


def test_damaged_settings_are_refused(copy):
    text = (copy / "zarr.json").read_text()
    (copy / "zarr.json").write_text(text.replace('\\"step\\": 0.01', '\\"step\\": 0.02', 1))
    with pytest.raises(lw.SceneError, match="is damaged"):
        lw.resume(copy)


def test_a_run_that_is_not_complete_is_not_opened_by_mistake(tmp_path):
    part = lw.solve(fleet(), **SETTINGS, store=tmp_path / "run.zarr", blocks=range(1, 3))
    assert part.members == 512
    assert np.isfinite(part.position).all()
    with pytest.raises(lw.SceneError, match=r"2 blocks are missing.*lgvi-warp resume"):
        lw.open_run(tmp_path)
    with pytest.raises(lw.SceneError, match="not complete"):
        lw.export(tmp_path, "netcdf")
    some = lw.open_run(tmp_path, incomplete=True)
    assert np.isnan(some.position[:, 0]).all()
    assert "2 blocks are missing" in some.messages[-1]


@pytest.mark.ci
def test_parts_of_a_run_are_merged(tmp_path, complete):
    for name, only in (("a", range(0, 1)), ("b", range(2, 4)), ("c", range(0, 2))):
        lw.solve(fleet(), **SETTINGS, store=tmp_path / name / "run.zarr", blocks=only)
    assert not lw.merge([tmp_path / "a", tmp_path / "b"], tmp_path / "some").complete
    folder = lw.merge([tmp_path / name for name in "abc"], tmp_path / "all")
    assert folder.complete
    assert differing(complete, folder.path) == []
    lw.resume(tmp_path / "some")
    assert differing(complete, tmp_path / "some" / "run.zarr") == []
    with pytest.raises(lw.SceneError, match="holds a run already"):
        lw.merge([tmp_path / "a"], tmp_path / "all")
    # Nor is what comes of a complete run that has lost a block.
    (folder.path / "blocks" / "000000256.json").unlink()
    lost = lw.merge([folder.path], tmp_path / "lost")
    assert not lost.complete
    assert lw.resume(lost.path).members == MEMBERS
    assert differing(complete, lost.path) == []


def test_a_store_in_use_is_not_replaced_by_a_merge(copy, tmp_path):
    with store.held(copy), pytest.raises(lw.SceneError, match="another run is writing"):
        lw.merge([copy], tmp_path, overwrite=True)
    assert lw.merge([copy], tmp_path, overwrite=True).complete
    assert sorted(one.name for one in tmp_path.iterdir()) == ["run.zarr"]


def test_parts_that_may_only_be_read_are_merged(copy, complete, tmp_path):
    """Their merge may be written: modes are not copied."""
    for one in copy.rglob("*"):
        one.chmod(0o555 if one.is_dir() else 0o444)
    made = lw.merge([copy], tmp_path / "all").path
    assert differing(complete, made) == []
    assert all(one.stat().st_mode & 0o200 for one in made.rglob("*"))
    for one in copy.rglob("*"):
        one.chmod(0o755)


def test_a_part_that_is_damaged_lends_no_times(tmp_path, complete):
    for name, only in (("a", range(0, 2)), ("b", range(2, 4))):
        lw.solve(fleet(), **SETTINGS, store=tmp_path / name / "run.zarr", blocks=only)
    (tmp_path / "a" / "run.zarr" / "time" / "c.0").unlink()
    assert differing(complete, lw.merge([tmp_path / "a", tmp_path / "b"], tmp_path / "all").path) == []
    with pytest.raises(lw.SceneError, match=r"time/c.0 is missing"):
        lw.merge([tmp_path / "a"], tmp_path / "none")


def test_only_parts_of_one_run_are_merged(tmp_path, complete):
    lw.solve(fleet(), **{**SETTINGS, "t1": 2.0}, store=tmp_path / "run.zarr", blocks=range(0, 1))
    with pytest.raises(lw.SceneError, match=r"steps is 200 in .*run.zarr and 300 in .*: these are parts of different"):
        lw.merge([complete, tmp_path], tmp_path / "all")
    flipped = shutil.copytree(complete, tmp_path / "flipped.zarr")
    hostile.flipped(flipped / "position" / "c.0.1.0", None)
    with pytest.raises(lw.SceneError, match=r"flipped.zarr.*torn, missing or changed"):
        lw.merge([flipped], tmp_path / "all")


def test_blocks_beyond_the_run_are_refused(tmp_path):
    for only in (range(4, 9), range(2, 2), range(-1, 2), range(0, 4, 2)):
        with pytest.raises(lw.SceneError, match=f"blocks {only.start}:{only.stop} are not within the 4"):
            lw.solve(fleet(), **SETTINGS, store=tmp_path / "run.zarr", blocks=only)
    assert list(tmp_path.iterdir()) == []
    # The last of equal parts may be shorter.
    assert lw.solve(fleet(), **SETTINGS, store=tmp_path / "run.zarr", blocks=range(3, 6)).members == 1003 - 768
    with pytest.raises(lw.SceneError, match="is for a run into a store"):
        lw.solve(fleet(), **SETTINGS, blocks=range(0, 1))


@pytest.mark.ci
def test_explicit_states_and_subsets_go_on_from_the_store_alone(tmp_path):
    chosen = fleet(600).subset(np.arange(599, 99, -1))
    lw.solve(chosen, **SETTINGS, store=tmp_path / "a.zarr")
    lw.solve(chosen, **SETTINGS, store=tmp_path / "b.zarr", blocks=range(0, 1))
    lw.resume(tmp_path / "b.zarr")
    assert differing(tmp_path / "a.zarr", tmp_path / "b.zarr") == []
    assert list(lw.open_run(tmp_path / "a.zarr").dataset.realization.values[:2]) == [599, 598]


RANDOM = np.random.default_rng(5).uniform(0.1, 0.9, (700, 4))
# 600 members of each: given as arrays, of 700 rows.
ARRAYS = {"table": lambda u: lw.designs.Table({"vehicle.mass": 123.0 + u[:, 0], "start.angular_velocity": u[:, 1:]}),
          "levels": lambda u: lw.designs.UnitCubePoints(u)}  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize("kind", ARRAYS)
def test_values_given_as_arrays_lie_in_the_store_as_arrays(kind, tmp_path):
    def members(u):
        vary = fleet().vary if kind == "levels" else {"start.position": lw.distributions.Normal(std=1.0)}
        return lw.Ensemble(fleet().scene, 600, 1, vary, ARRAYS[kind](u))

    whole = lw.solve(members(RANDOM), **SETTINGS)
    for ensemble, name in ((members(RANDOM), "a"), (members(RANDOM).subset(np.arange(599, 99, -1)), "c")):
        stored = lw.solve(ensemble, **SETTINGS, store=tmp_path / f"{name}.zarr")
        lw.solve(ensemble, **SETTINGS, store=tmp_path / f"{name}b.zarr", blocks=range(0, 1))
        lw.resume(tmp_path / f"{name}b.zarr")
        assert differing(tmp_path / f"{name}.zarr", tmp_path / f"{name}b.zarr") == []
        assert state(tmp_path / f"{name}b.zarr")["complete"]
        np.testing.assert_array_equal(stored.position, whole.position[:, ensemble.indices])
    given = store.Folder(tmp_path / "a.zarr").group()["explicit"]
    assert {name: array.shape[0] for name, array in given.arrays()} == dict.fromkeys(members(RANDOM).explicit(), 600)
    # In memory provenance is the section of a scene file.
    assert whole.provenance["ensemble"] == members(RANDOM).to_dict()
    assert len((tmp_path / "a.zarr" / "zarr.json").read_bytes()) < 40_000
    other = RANDOM.copy()
    other[599, 0] += 0.01
    again = lw.Store(tmp_path / "a.zarr", existing="resume")
    with pytest.raises(lw.SceneError, match=r"ensemble\.arrays_sha256 .* is another run"):
        lw.solve(members(other), **SETTINGS, store=again)
    other[599:] = RANDOM[599:]
    other[600:] = 0.5  # rows that no member has
    np.testing.assert_array_equal(lw.solve(members(other), **SETTINGS, store=again).position, whole.position)


def test_other_states_are_another_run(tmp_path):
    scene, n = fleet().scene, 300
    states = np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.full((n, 3), 0.1)
    lw.solve(lw.Ensemble.from_states(scene, *states), **SETTINGS, store=tmp_path / "a.zarr", blocks=range(0, 1))
    other = lw.Ensemble.from_states(scene, states[0] + 1.0, *states[1:])
    with pytest.raises(lw.SceneError, match=r"ensemble\.arrays_sha256 .* is another run"):
        lw.solve(other, **SETTINGS, store=lw.Store(tmp_path / "a.zarr", existing="resume"))
    whole = lw.solve(lw.Ensemble.from_states(scene, *states), **SETTINGS)
    np.testing.assert_array_equal(lw.resume(tmp_path / "a.zarr").position, whole.position)


class Mine(lw.terms.Wrench):
    """A law of a user."""

    type = "mine"


@pytest.mark.ci
def test_a_law_of_your_own_goes_on_with_its_ensemble(tmp_path, monkeypatch):
    # As in another process, which has not made the class: no scene file knows it.
    monkeypatch.delitem(lw.laws.Term.kinds, "mine")
    scene = lw.Scene(fleet().scene.vehicle, terms=[Mine(force=[0.1, 0.0, 0.0], torque=[0.0, 0.0, 0.0])])
    own = lw.Ensemble(scene, 300, 1, {"mine.force": lw.distributions.Normal(std=0.1)})
    whole = lw.solve(own, **SETTINGS, store=tmp_path / "a.zarr")
    lw.solve(own, **SETTINGS, store=tmp_path / "b.zarr", blocks=range(0, 1))
    with pytest.raises(lw.SceneError, match=r"'mine' is not known"):
        lw.resume(tmp_path / "b.zarr")
    assert lw.resume(tmp_path / "b.zarr", own).energy.tobytes() == whole.energy.tobytes()
    assert differing(tmp_path / "a.zarr", tmp_path / "b.zarr") == []
    assert state(tmp_path / "b.zarr")["complete"]


def of_run(path, **changes):
    """Write into a store that another machine, or another version, made the run."""
    content = json.loads((path / "zarr.json").read_text())
    attributes = content["attributes"]
    made_by = json.loads(attributes["provenance"])
    for name, values in changes.items():
        made_by[name] |= values
    attributes["provenance"] = json.dumps(made_by)
    texts = [attributes[name] for name in ("provenance", "recipe", "messages", "shared")]
    attributes["crc32c"] = store.checksum_of(texts)
    (path / "zarr.json").write_text(json.dumps(content))


def test_another_version_or_machine_is_refused_unless_forced(copy):
    of_run(copy, versions={"numpy": "0.1"})
    with pytest.raises(lw.SceneError, match=r"versions.numpy is '0.1' in the store and '.*' here: the same bits"):
        lw.resume(copy)
    assert any("continued although versions.numpy" in text for text in lw.resume(copy, force=True).messages)
    of_run(copy, versions={"numpy": "0.1"}, machine={"cpu": "abacus"})
    with pytest.raises(lw.SceneError, match="2 faults"):
        lw.resume(copy)


def test_more_threads_or_another_python_are_no_difference(copy):
    of_run(copy, machine={"threads": 17}, versions={"python": "9"})
    assert lw.resume(copy, threads=2).members == MEMBERS


def test_a_disk_that_is_full_when_a_block_was_written_already(tmp_path, complete):
    """Some systems find out when they sync: the run ends, and all other blocks that were written are there."""
    path = tmp_path / "run.zarr"
    kept = r"No space left on device: the blocks that were finished are kept"
    with pytest.raises(OSError, match=kept), Disk(full(("synced", "000000256.json"))):
        lw.solve(fleet(), **SETTINGS, store=path, threads=1)
    assert state(path)["damage"] == []
    assert 1 <= state(path)["finished"] <= 3
    assert not list(path.rglob(f"*{durable.UNFINISHED}"))
    assert not state(path)["complete"]
    lw.resume(path)
    assert differing(complete, path) == []


def test_an_interrupted_run_keeps_the_blocks_that_were_written(tmp_path, complete):
    def interrupted(fraction):
        if fraction > 0.8:
            raise KeyboardInterrupt

    path = tmp_path / "run.zarr"
    with pytest.raises(KeyboardInterrupt):
        lw.solve(fleet(), **SETTINGS, store=path, threads=1, progress=interrupted)
    assert state(path)["finished"] == 3
    assert not list(path.rglob(f"*{durable.UNFINISHED}"))
    lw.resume(path)
    assert differing(complete, path) == []


def test_a_file_that_may_not_grow_is_told_as_a_full_disk(tmp_path, capsys):
    arguments = ["run", str(ROOT / "examples" / "paper.toml"), "--members", "500", "--set", "run.save_every=0.1",
                 "--duration", "3", "--out", str(tmp_path), "--store", "zarr", "--quiet"]  # fmt: skip
    with files_of_at_most(100_000):
        assert cli.main(arguments) == 1
    text = capsys.readouterr().err
    says(text, "File too large: the blocks that were finished are kept", "run.zarr")


def test_too_small_a_disk_is_refused_before_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(10**9, 10**9, 10**6))
    with pytest.raises(lw.SceneError, match=r"needs 0.00 GB, and the disk has 0.00 GB left. Save less often"):
        lw.solve(fleet(), **SETTINGS, store=tmp_path / "run.zarr")
    assert list(tmp_path.iterdir()) == []


def test_chunks_are_synced_before_their_block_is_marked(tmp_path):
    with Disk() as disk:
        lw.solve(fleet(200), **SETTINGS, store=tmp_path / "run.zarr", threads=1)
    order = [(what, str(path)) for what, path in disk.done if what != "created"]
    root = str(tmp_path / "run.zarr")
    marked = order.index(("named", f"{root}/blocks/000000000.json"))
    written = [
        i for i, (what, name) in enumerate(order) if what == "named" and name.startswith(f"{root}/") and "/c." in name
    ]
    assert len(written) == 14
    assert max(written) < marked
    for i in written:
        name = order[i][1]
        assert ("synced", name) in order[:i]
    assert ("synced", f"{root}/position") in order[max(written) : marked]
    assert order.index(("named", f"{root}/zarr.json")) > marked


@pytest.mark.ci
def test_parts_of_keepers_lie_in_the_store(tmp_path, memory):
    plan = make_plan(fleet(), **SETTINGS)
    plan.compile()

    def run(name, only=None, existing="refuse"):
        keeper = DepthSum(plan)
        chosen = lw.Store(tmp_path / name, existing=existing)
        StoredRun(plan, chosen, provenance(plan), messages(plan), (keeper,), only).run(Threads(2))
        return keeper

    one = run("a.zarr")
    run("b.zarr", range(1, 3))
    two = run("b.zarr", existing="resume")
    assert one.merged == two.merged == [0, 256, 512, 768]
    assert one.sums.tobytes() == two.sums.tobytes()
    np.testing.assert_allclose(one.sums, memory.position[..., 2].sum(axis=1), rtol=1e-12)
    assert differing(tmp_path / "a.zarr", tmp_path / "b.zarr") == []
    with pytest.raises(lw.SceneError, match=r"stores \['depth sum'\], not \[\]"):
        lw.resume(tmp_path / "b.zarr")
    path = tmp_path / "b.zarr" / "parts" / "000000512.npy"
    hostile.flipped(path, None)
    assert any("000000512.npy has changed" in text for text in state(tmp_path / "b.zarr")["damage"])
    assert run("b.zarr", existing="resume").sums.tobytes() == one.sums.tobytes()
    assert differing(tmp_path / "a.zarr", tmp_path / "b.zarr") == []


def test_parts_of_several_keepers_lie_in_one_file(tmp_path):
    plan = make_plan(fleet(10), **SETTINGS)
    several = DepthSum(plan), DepthSum(plan), DepthSum(plan)
    given = np.arange(4.0), np.zeros(0), np.array([-0.0, np.nan])
    for keeper, name in zip(several, ("second", "a third", "first"), strict=True):
        keeper.name = name
    path = tmp_path / "000000000.npy"
    path.write_bytes(packed(several, given))
    found = unpacked(several[::-1], tmp_path, path.name)
    assert [one.tobytes() for one in found] == [one.tobytes() for one in given[::-1]]
    assert [one.tobytes() for one in unpacked(several[1:2], tmp_path, path.name)] == [b""]


def test_keepers_that_cannot_be_stored_are_refused(tmp_path):
    plan = make_plan(fleet(10), **SETTINGS)
    named = [DepthSum(plan), DepthSum(plan), object()]
    with pytest.raises(lw.SceneError) as refused:
        StoredRun(plan, lw.Store(tmp_path / "a.zarr"), {}, (), tuple(named)).run(Threads(1))
    says(str(refused.value), "to_arrays", "'depth sum'")


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_netcdf(complete, memory, tmp_path):
    import xarray

    path = lw.export(complete, "netcdf", tmp_path / "run.nc")
    with xarray.open_dataset(path, engine="netcdf4") as dataset:
        np.testing.assert_array_equal(dataset.attitude.values, memory.attitude)
        assert (dataset.position.attrs["units"], dataset.attrs["Conventions"]) == ("m", "CF-1.11")
        assert dataset.status.values.dtype == np.uint8
        assert json.loads(dataset.attrs["provenance"])["steps"] == 300
    assert [one.name for one in tmp_path.iterdir()] == ["run.nc"]


def test_parquet(complete, memory, tmp_path):
    import pyarrow.parquet as pq

    table = pq.read_table(lw.export(complete, "parquet", tmp_path / "run.parquet"))
    assert table.num_rows == MEMBERS * 31
    at = 700 * 31 + 11
    assert table["realization"][at].as_py() == 700
    assert table["time"][at].as_py() == memory.time[11]
    assert table["position_2"][at].as_py() == memory.position[11, 700, 2]
    assert table["attitude_12"][at].as_py() == memory.attitude[11, 700, 1, 2]
    assert table["vehicle.mass"][at].as_py() == memory.parameters["vehicle.mass"][700]
    assert [table.schema.field(name).metadata for name in ("velocity_0", "vehicle.mass")] == [
        {b"units": b"m s-1"},
        {b"units": b"kg"},
    ]
    with pytest.raises(lw.SceneError, match=r"to = 'csv'"):
        lw.export(complete, "csv")


def test_what_is_no_run_is_named(tmp_path):
    for call in (lw.open_run, lw.resume, state):
        with pytest.raises(lw.SceneError, match=r"holds no store. Give the folder of a run made with --store zarr"):
            call(tmp_path)
    with pytest.raises(lw.SceneError, match="is not there"):
        lw.open_run(tmp_path / "none")
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(lw.SceneError, match="holds no run"):
        lw.open_run(tmp_path)


class Tilted:
    """A law of a user's, which says of itself where it lies in memory."""

    def ppf(self, u):
        return 0.1 * np.sqrt(u)


@pytest.mark.ci
def test_a_distribution_of_your_own_goes_on_with_its_ensemble(tmp_path):
    def own():
        return lw.Ensemble(fleet().scene, 600, 1, {"start.position": Tilted()})

    whole, path = tmp_path / "whole.zarr", tmp_path / "run.zarr"
    lw.solve(own(), **SETTINGS, store=whole)
    lw.solve(own(), **SETTINGS, store=path)
    (path / "blocks" / "000000256.json").unlink()
    with pytest.raises(
        lw.SceneError, match=r"a distribution of your own, which a file does not hold. Give the ensemble again"
    ):
        lw.resume(path)
    lw.resume(path, own())
    assert differing(whole, path) == []
