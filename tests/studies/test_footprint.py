# SPDX-License-Identifier: Apache-2.0
"""Footprints of runs: in memory, in a store, of the end alone, and by the command."""

import json

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.store.open import Arrays
from tests.support.refusals import refused, says

pytestmark = pytest.mark.kernel
NORMAL = lw.distributions.Normal
SCENE = lw.Scene.named("sphere", start={"velocity": [0.5, 0.0, 0.5]}, events=[lw.events.Floor(depth=1.0)],
                       environment={"origin": [63.44, 10.40]})  # fmt: skip
# Half of the members sink slower than the metre in two seconds.
VARY = {"start.position": NORMAL(std=[3.0, 2.0, 0.0]), "start.velocity": NORMAL(std=[0.0, 0.0, 0.2])}
FLEET = lw.Ensemble(SCENE, members=300, seed=4, vary=VARY)
RUN = {"method": "psi_s", "h": 0.05, "t1": 2.0}


@pytest.fixture(scope="module")
def result():
    return lw.solve(FLEET, save=lw.SaveAt(every=0.5), **RUN)


@pytest.mark.ci
def test_a_run_in_a_store_has_the_same_footprint(result, tmp_path, monkeypatch):
    lw.solve(FLEET, save=lw.SaveAt(every=0.5), store=tmp_path / "run.zarr", **RUN)
    stored = lw.open_run(tmp_path / "run.zarr")
    # Whole arrays are never read: a run may be larger than the memory.
    read = Arrays.__getitem__
    monkeypatch.setattr(Arrays, "__getitem__", lambda arrays, name: 1 / (name != "position") and read(arrays, name))
    for at in ("end", "floor", 1.0):
        once, again = (lw.studies.footprint(run, at) for run in (result, stored))
        assert once.answer == again.answer
        np.testing.assert_array_equal(once.main.polygons[0][0], again.main.polygons[0][0])
    part = lw.open_run(tmp_path / "run.zarr", members=[5, 3, 200])
    np.testing.assert_allclose(lw.studies.footprint(part).centre, result.position[-1, [5, 3, 200], :2].mean(axis=0))


@pytest.mark.ci
def test_members_that_were_kept_are_a_result_of_their_own():
    few = lw.solve(FLEET, keep=[1, 2, 3], **RUN)
    says(refused(lw.studies.footprint, few), "were not kept", "keep='all'", "result.kept")
    assert lw.studies.footprint(few.kept).members == 3


def test_the_floor_is_where_the_members_reach_it(result):
    found = lw.studies.footprint(result, "floor")
    there = np.asarray(result.status) == lw.Status.FLOOR
    assert 0 < found.members == there.sum() < 300
    assert found.lacking == {"ok": 300 - found.members}
    np.testing.assert_allclose(found.centre, result.position[-1, there, :2].mean(axis=0), rtol=1e-12)


@pytest.mark.ci
def test_the_command_says_and_writes_it(result, tmp_path, capsys):
    result.save(tmp_path / "result.npz")
    assert cli.main(["footprint", str(tmp_path), "--at", "floor"]) == 0
    found = lw.studies.footprint(result, "floor")
    assert capsys.readouterr().out.splitlines()[-1] == found.answer
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {
        "result.npz",
        *(f"footprint.{ending}" for ending in ["json", "csv", "txt", "png", "geojson", "kml"]),
    }
    assert cli.main(["--json", "-q", "footprint", str(tmp_path), "--at", "1.0", "--out", str(tmp_path / "other")]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["content"]["footprint"]["answer"] == lw.studies.footprint(result, 1.0).answer
    assert cli.main(["info", str(tmp_path)]) == 0
    says(capsys.readouterr().out, found.answer)
    assert cli.main(["plot", str(tmp_path)]) == 0
    page = lw.report(tmp_path, tmp_path / "report.html").read_text()
    says(page, "Footprint", "ellipse_area", "data:image/png")
    assert cli.main(["footprint", str(tmp_path / "other")]) == 2
    says(capsys.readouterr().err, "holds no runs", "Give the folder of one run")
    assert cli.main(["footprint", str(tmp_path), "--at", "flor"]) == 2
