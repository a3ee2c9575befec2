# SPDX-License-Identifier: Apache-2.0
"""A run sampled from a CSV file goes on wherever its folder or the file went: what counts is the file's checksum."""

import shutil

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.measuring import speed
from lgvi_warp.sampling.designs.table import Table, moved
from tests.support.stores import differing

SETTINGS = {"method": "psi_s", "h": 0.01, "t1": 0.1}
MEMBERS = 600


def written(path, seed=0):
    """A CSV file of members."""
    path.parent.mkdir(parents=True, exist_ok=True)
    mass, depth = np.random.default_rng(seed).random((2, MEMBERS))
    lines = "\n".join(f"{123.8 + 0.01 * m},{10 + d}" for m, d in zip(mass, depth, strict=True))
    path.write_text(f"vehicle.mass,start.position[2]\n{lines}\n")
    return path


def fleet(path):
    """Fleet of a scene file."""
    content = speed.example().to_dict() | {"ensemble": {"sampling": {"table": {"file": str(path)}}}}
    return lw.Ensemble.from_scene(lw.Scene.from_dict(content))


@pytest.fixture
def project(tmp_path):
    """A folder with a table and a run of which one block of three is there; and the whole run."""
    path = tmp_path / "a" / "project"
    table = written(path / "data" / "members.csv")
    lw.solve(fleet(table), **SETTINGS, store=tmp_path / "whole.zarr")
    lw.solve(fleet(table), **SETTINGS, store=path / "runs" / "run.zarr", blocks=range(0, 1))
    return path


@pytest.fixture
def older(monkeypatch, project):
    """The same of a version whose stores did not keep a table's numbers."""
    with monkeypatch.context() as then:
        then.setattr(Table, "arrays", lambda table: {} if table.file is not None else table.own_values())
        shutil.rmtree(project / "runs")
        lw.solve(
            fleet(project / "data" / "members.csv"), **SETTINGS, store=project / "runs" / "run.zarr", blocks=range(1)
        )
    return project


def elsewhere(project):
    """The project, moved."""
    target = project.parent.parent / "b" / "c" / "renamed"
    target.parent.mkdir(parents=True)
    shutil.move(project, target)
    return target


def check(store, tmp_path):
    assert lw.resume(store).members == MEMBERS
    assert differing(store, tmp_path / "whole.zarr") == []


@pytest.mark.ci
def test_the_folder_was_moved(project, tmp_path):
    check(elsewhere(project) / "runs" / "run.zarr", tmp_path)


@pytest.mark.ci
@pytest.mark.parametrize("change", [lambda path: path.unlink(), lambda path: written(path, 1)], ids=["gone", "changed"])
def test_the_store_has_the_numbers(project, tmp_path, change):
    change(project / "data" / "members.csv")
    check(project / "runs" / "run.zarr", tmp_path)


@pytest.mark.ci
def test_an_older_run_finds_its_table_by_its_checksum(older):
    there = elsewhere(older)
    written(there / "runs" / "members.csv", 1)
    assert lw.resume(there / "runs" / "run.zarr").members == MEMBERS


@pytest.mark.ci
def test_an_older_run_without_its_table_names_it(older):
    there = elsewhere(older)
    written(there / "data" / "members.csv", 1)
    with pytest.raises(lw.SceneError, match=r"table\.file = .* cannot be read"):
        lw.resume(there / "runs" / "run.zarr")


@pytest.mark.ci
def test_the_same_run_is_told_by_the_tables_checksum(project, tmp_path):
    there = elsewhere(project)
    store = lw.Store(there / "runs" / "run.zarr", existing="resume")
    lw.solve(fleet(there / "data" / "members.csv"), **SETTINGS, store=store)
    assert differing(store.path, tmp_path / "whole.zarr") == []
    with pytest.raises(lw.SceneError, match=r"sampling\.table\.sha256 is .*another run"):
        lw.solve(fleet(written(tmp_path / "members.csv", 1)), **SETTINGS, store=store)


@pytest.mark.ci
def test_parts_with_a_table_each_are_of_one_run(tmp_path):
    for name, only in (("a", range(0, 2)), ("b", range(2, 3))):
        table = written(tmp_path / name / "members.csv")
        lw.solve(fleet(table), **SETTINGS, store=tmp_path / name / "run.zarr", blocks=only)
    assert lw.merge([tmp_path / "a", tmp_path / "b"], tmp_path / "all").complete


def test_where_a_table_is_looked_for(tmp_path):
    table = written(tmp_path / "x" / "data" / "members.csv")
    store, sha256 = tmp_path / "x" / "runs" / "deep" / "run.zarr", Table(table).sha256
    assert moved("/old/x/data/members.csv", sha256, store) == str(table)
    assert moved("/members.csv", sha256, store) == "/members.csv"
    assert moved("/old/x/data/members.csv", None, store) == "/old/x/data/members.csv"
    assert moved(str(table), "another", store) == str(table)
