# SPDX-License-Identifier: Apache-2.0
"""Statistics in a store: the bits of a run in memory, of any executor, killed and gone on with."""

import pickle
import shutil
import time

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.engine.keepers.observation import observation_of, observe
from lgvi_warp.results.provenance import messages, provenance
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.store.create import create
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.solve import request_of
from lgvi_warp.store.state import state
from tests.conftest import ROOT
from tests.support import hostile
from tests.support.refusals import says
from tests.support.stores import SETTINGS, STATISTICS, UNTIL, bits, differing, fleet, forked, markers, tree


@pytest.fixture(scope="module")
def memory():
    return lw.solve(fleet(), **SETTINGS, statistics=STATISTICS, keep="none")


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """A complete store without samples."""
    path = tmp_path_factory.mktemp("statistics") / "run.zarr"
    lw.solve(fleet(), **SETTINGS, statistics=STATISTICS, keep="none", store=path)
    return path


@pytest.mark.ci
def test_a_store_without_samples_has_statistics_and_arrays_of_members(complete, memory):
    stored = lw.open_run(complete)
    assert bits(stored) == bits(memory)
    assert len(stored.samples) == 0
    assert not (complete / "position").exists()
    assert len(list((complete / "parts").glob("*.npy"))) == 4
    np.testing.assert_array_equal(stored.parameters["vehicle.mass"], memory.parameters["vehicle.mass"])
    for name in ("status", "failure_time", "warnings", "warning_time", "warning_value", "substeps"):
        np.testing.assert_array_equal(getattr(stored, name), getattr(memory, name))
    assert stored.provenance["observed"] == memory.provenance["observed"]
    assert stored.messages == memory.messages
    assert "mean_position" in stored.statistics.dataset
    assert "position" not in stored.dataset


@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_it_is_exported_with_its_statistics(complete, memory, tmp_path):
    import pyarrow.parquet as pq
    import xarray

    with xarray.open_dataset(lw.export(complete, "netcdf", tmp_path / "run.nc"), group="statistics") as found:
        np.testing.assert_array_equal(found.mean_position.values, memory.statistics["mean position"].value)
    table = pq.read_table(lw.export(complete, "parquet", tmp_path / "run.parquet"))
    starts = [f"start.angular_velocity_{i}" for i in range(3)]
    assert table.column_names == ["realization", *starts, "vehicle.mass", "status", "failure_time", "end_time"]
    assert table.num_rows == 1003


def test_statistics_of_damaged_parts_are_refused(complete, tmp_path):
    path = shutil.copytree(complete, tmp_path / "run.zarr")
    part = path / "parts" / "000000256.npy"
    hostile.flipped(part, None)
    with pytest.raises(lw.SceneError, match=r"parts/000000256.* has changed. `lgvi-warp resume .*` mends it"):
        lw.open_run(path)
    (path / "blocks" / "000000256.json").unlink()
    with pytest.raises(lw.SceneError, match=r"blocks/000000256.json is missing; repair it with `lgvi-warp resume"):
        lw.open_run(path)


@pytest.mark.ci
@pytest.mark.parametrize("harm", [hostile.flipped, hostile.torn(0.99), hostile.removed])
def test_a_damaged_part_is_seen_and_its_block_alone_runs_again(harm, complete, memory, tmp_path):
    path = shutil.copytree(complete, tmp_path / "run.zarr")
    harm(path / "parts/000000512.npy", None)
    assert any("parts/000000512.npy" in text for text in state(path)["damage"])
    before = markers(path)
    assert bits(lw.resume(path)) == bits(memory)
    assert differing(complete, path) == []
    after = markers(path)
    assert [name for name in after if after[name] != before[name]] == ["000000512.json"]


@pytest.mark.ci
def test_samples_and_statistics_together(memory, tmp_path):
    save = lw.SaveAt(every=0.1, fields=("attitude",))
    result = lw.solve(fleet(), **SETTINGS | {"save": save}, statistics=STATISTICS, store=tmp_path / "run.zarr")
    assert list(result.samples) == ["attitude"]
    assert bits(result) == bits(memory)


@pytest.mark.ci
def test_members_kept_are_run_again_and_after_a_resume(complete, tmp_path):
    every = lw.solve(fleet(), **SETTINGS)
    result = lw.solve(fleet(), **SETTINGS, keep=[3, 1002], store=tmp_path / "run.zarr")
    (tmp_path / "run.zarr/blocks/000000256.json").unlink()
    for one in (result, lw.resume(tmp_path)):
        assert one.kept.position.tobytes() == every.position[:, [3, 1002]].tobytes()
        assert len(one.samples) == 0
        assert list(one.kept_members) == [3, 1002]


@pytest.mark.ci
@pytest.mark.parametrize("executor", [pytest.param("processes", marks=pytest.mark.slow), "threads"])
def test_executors_give_the_same_bits(executor, memory, complete, tmp_path):
    settings = {**SETTINGS, "statistics": STATISTICS, "keep": "none", "executor": executor, "threads": 2}
    assert bits(lw.solve(fleet(), **settings)) == bits(memory)
    assert bits(lw.solve(fleet(), **settings, store=tmp_path / "run.zarr")) == bits(memory)
    assert differing(complete, tmp_path / "run.zarr") == []


@pytest.mark.slow
def test_until_and_samples_in_processes(tmp_path):
    settings = {**SETTINGS, "statistics": STATISTICS, "until": UNTIL}
    one, two = (lw.solve(fleet(), **settings, executor=name, threads=2) for name in ("threads", "processes"))
    assert bits(one) == bits(two)
    assert one.position.tobytes() == two.position.tobytes()


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A run that had members enough before the last block, on one thread."""
    path = tmp_path_factory.mktemp("until") / "run.zarr"
    lw.solve(fleet(), **SETTINGS, statistics=STATISTICS, until=UNTIL, store=path, threads=1)
    return path


@pytest.mark.ci
def test_until_stops_a_store_at_the_same_block(stopped, tmp_path):
    memory = lw.solve(fleet(), **SETTINGS, statistics=STATISTICS, until=UNTIL)
    assert memory.members == 512
    stored = lw.solve(fleet(), **SETTINGS, statistics=STATISTICS, until=UNTIL, store=tmp_path / "run.zarr", threads=2)
    assert differing(stopped, tmp_path / "run.zarr") == []
    for one in (stored, lw.open_run(stopped)):
        assert one.members == memory.members
        assert bits(one) == bits(memory)
        assert (one.messages, one.provenance["members"]) == (memory.messages, memory.members)
        assert one.position.tobytes() == memory.position.tobytes()
    assert lw.open_run(stopped).dataset.sizes["realization"] == memory.members
    with pytest.raises(IndexError, match=f"of the {memory.members}"):
        lw.open_run(stopped, [memory.members])


@pytest.mark.ci
def test_until_stops_a_resumed_store_at_the_same_block(stopped, tmp_path):
    path = shutil.copytree(stopped, tmp_path / "run.zarr")
    before = tree(path)
    assert lw.resume(path).members == 512
    assert tree(path) == before
    (path / "blocks/000000000.json").unlink()
    (path / "position/c.0.0.0.0").unlink(missing_ok=True)
    assert lw.resume(path, threads=2).members == 512
    assert tree(path) == before


def lasting_run(path, keep, threads=None):
    settings = {"h": 0.01, "t1": 60.0, "save": lw.SaveAt(every=0.5), "threads": threads}
    return lw.solve(fleet(2048), "psi_s", **settings, statistics=STATISTICS, keep=keep, store=path)


@pytest.mark.ci
@pytest.mark.parametrize("keep", ["none", pytest.param("all", marks=pytest.mark.slow)])
def test_killed_and_gone_on_with(keep, tmp_path):
    path, other = tmp_path / "run.zarr", tmp_path / "other.zarr"
    undisturbed = lasting_run(other, keep)
    process = forked(lasting_run, path, keep, 1)
    while len(list(path.glob("blocks/*.json"))) < 2 and process.is_alive():
        time.sleep(0.002)
    process.kill()
    process.join()
    assert process.exitcode != 0
    assert 0 < len(list(path.glob("blocks/*.json"))) < 8
    assert bits(lw.resume(path)) == bits(undisturbed)
    assert differing(other, path) == []


@pytest.mark.ci
def test_the_command_restores_the_statistics_of_the_scene(tmp_path, capsys):
    scene = (ROOT / "examples/paper.toml").read_text()
    scene += '\n[[run.statistics]]\ntype = "mean"\nof = "position"\n'
    scene += '[run.until]\nstatistic = "mean position[2]"\nhalf_width = 10.0\nmembers = 256\n'
    (tmp_path / "scene.toml").write_text(scene.replace("[run]", '[run]\nkeep = "none"'))
    options = ["--members", "1003", "--duration", "1", "--store", "zarr", "--out", str(tmp_path)]
    assert cli.main(["run", str(tmp_path / "scene.toml"), *options]) == 0
    before, said = tree(tmp_path / "run.zarr"), capsys.readouterr().out
    says(said, "mean position", "reached with 256 members")
    (tmp_path / "run.zarr/blocks/000000000.json").unlink()
    (tmp_path / "statistics.png").unlink()
    assert cli.main(["resume", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    says(said, "mean position", "reached with 256 members")
    assert (tmp_path / "statistics.png").exists()
    assert tree(tmp_path / "run.zarr") == before
    assert cli.main(["info", str(tmp_path)]) == 0
    says(capsys.readouterr().out, "statistics of each block", "1 of 1 finished; complete")


def shallow(samples, members):
    """Whether each member is above 10 m."""
    return (samples["position"][..., 2] < 10.0).astype(np.float64)


@pytest.mark.ci
def test_statistics_of_functions_are_asked_for_again(tmp_path):
    statistics = [lw.statistics.Mean(shallow)]
    first = lw.solve(fleet(), **SETTINGS, statistics=statistics, keep="none", store=tmp_path / "run.zarr")
    (tmp_path / "run.zarr/blocks/000000256.json").unlink()
    with pytest.raises(lw.SceneError, match=r"mean shallow are of functions .* Give statistics="):
        lw.resume(tmp_path)
    with pytest.raises(lw.SceneError, match="are not the run's"):
        lw.resume(tmp_path, statistics=[lw.statistics.Mean("depth")])
    assert bits(lw.resume(tmp_path, statistics=statistics)) == bits(first)
    assert not lw.open_run(tmp_path).statistics
    assert bits(lw.open_run(tmp_path, statistics=statistics)) == bits(first)


def test_another_observation_is_another_run(complete):
    store = lw.Store(complete, existing="resume")
    with pytest.raises(lw.SceneError, match=r"observed\.statistics"):
        lw.solve(fleet(), **SETTINGS, statistics=[lw.statistics.Mean("position")], keep="none", store=store)


@pytest.mark.ci
def test_replicates_of_a_store_are_those_of_memory(tmp_path):
    base = fleet(2)
    members = lw.Ensemble(base.scene, 1024, 1, base.vary, lw.designs.Sobol(replicates=16))
    asked = {"statistics": [*STATISTICS, lw.statistics.FirstPassage("depth", above=11.0)], "keep": "none"}
    memory = lw.solve(members, **SETTINGS, **asked)
    stored = lw.solve(members, **SETTINGS, **asked, store=tmp_path / "run.zarr", threads=2)
    assert bits(memory) == bits(stored) == bits(lw.open_run(tmp_path))
    assert memory.provenance["ensemble"]["sampling"] == {"sobol": {"replicates": 16}}
    (tmp_path / "run.zarr/blocks/000000256.json").unlink()
    assert bits(lw.resume(tmp_path)) == bits(memory)
    again = lw.Store(tmp_path / "run.zarr", existing="resume")
    for other in ("sobol", lw.designs.Sobol(replicates=8)):
        with pytest.raises(lw.SceneError, match=r"ensemble\.sampling"):
            lw.solve(lw.Ensemble(base.scene, 1024, 1, base.vary, other), **SETTINGS, **asked, store=again)


def test_a_run_in_parts_has_no_until(tmp_path):
    with pytest.raises(lw.SceneError, match="runs in parts"):
        lw.solve(fleet(), **SETTINGS, until=UNTIL, store=tmp_path / "run.zarr", blocks=range(1))


@pytest.mark.ci
def test_parts_of_a_run_are_merged_with_their_statistics(complete, memory, tmp_path):
    for i, only in enumerate((range(0, 2), range(2, 4))):
        lw.solve(fleet(), **SETTINGS, statistics=STATISTICS, keep="none", store=tmp_path / f"{i}.zarr", blocks=only)
    lw.merge([tmp_path / "0.zarr", tmp_path / "1.zarr"], tmp_path / "run.zarr")
    assert differing(complete, tmp_path / "run.zarr") == []
    assert bits(lw.open_run(tmp_path / "run.zarr")) == bits(memory)


@pytest.mark.parametrize("inputs", [[], STATISTICS])
def test_an_observation_is_told_and_read(inputs):
    observed = observe(lw.Ensemble.from_scene(lw.Scene.load(ROOT / "examples/paper.toml")), inputs, "failed", UNTIL)
    assert observation_of(observed.to_dict() | {"fields": ["position"]}).to_dict() == observed.to_dict()


MASS = {"vehicle.mass": lw.distributions.Normal(relative=0.001)}
RATES = {"start.angular_velocity": lw.distributions.Normal(std=0.01)}


def known(plan):
    """The provenance but for why the plan has its width, which a plan that is read has by the run."""
    content = provenance(plan)
    machine = {name: value for name, value in content["machine"].items() if name != "width_source"}
    return content | {"machine": machine}


@pytest.mark.parametrize(("vary", "sampling"), [
    (MASS | RATES, "sobol"), (MASS | RATES, lw.designs.Sobol(replicates=4)), (MASS, lw.designs.Halton(replicates=8)),
    (MASS, lw.designs.LatinHypercube(8)),
    ({}, lw.designs.Grid({"start.position[0]": [0.0, 1.0], "vehicle.mass": [123.0, 124.0, 125.0, 126.0]})),
    ({}, lw.designs.Table(values={"vehicle.mass": np.linspace(123.0, 124.0, 8)})), (RATES, "random"),
])  # fmt: skip
@pytest.mark.parametrize("chosen", [None, [5, 2, 3]])
def test_the_plan_of_a_store_is_the_plan_of_the_run(vary, sampling, chosen, tmp_path):
    members = lw.Ensemble(fleet(2).scene, 8, 3, vary, sampling)
    members = members if chosen is None else members.subset(chosen)
    method = lw.Method("psi_s", solver="newton", iterations=3, tolerance=1e-9)
    plan = make_plan(members, method, h=0.1, t1=1.0, checks="all", on_failure="substep")
    create(lw.Store(tmp_path / "run.zarr"), plan, provenance(plan), messages(plan))
    for again in (request_of(Folder(tmp_path / "run.zarr")).plan(), pickle.loads(pickle.dumps(plan))):
        assert known(again) == known(plan)
        assert (again.method, again.spec) == (plan.method, plan.spec)
        one, other = again.ensemble.select(0, members.members), members.select(0, members.members)
        for name in ("position", "attitude", "velocity", "angular_velocity", "indices"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        for name, values in other.parameters.items():
            np.testing.assert_array_equal(one.parameters[name], values)
