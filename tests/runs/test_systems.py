# SPDX-License-Identifier: Apache-2.0
"""Ten things that a user does, on whatever system: run, save, store, go on, sweep, draw, and be refused.

They use nothing that a system may lack, so that they run on Windows and macOS too (the job `systems` of the workflow). On
Linux they run once more in a process that has lost what Windows has not: `tests/support/windows.py`.
"""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from tests.conftest import ROOT

SCENE = str(ROOT / "examples" / "paper.toml")
SWEEP = """
scene = 'SCENE'
members = 5
metrics = ["max(norm(velocity))"]
run = { duration = 0.5 }
[[cases]]
name = "light"
set = { "vehicle.mass" = 120.0 }
""".replace("SCENE", SCENE)


def run(out, *options):
    """Run a small ensemble by the command."""
    return cli.main(["run", SCENE, "--members", "300", "--duration", "0.5", "--out", str(out), *options])


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run in memory and one in a store; no test changes them."""
    folder = tmp_path_factory.mktemp("runs")
    assert run(folder / "memory") == run(folder / "store", "--store", "zarr") == 0
    return folder


@pytest.fixture
def copied(runs, tmp_path):
    return shutil.copytree(runs, tmp_path / "copied")


def test_solve_in_memory():
    result = lw.solve(lw.Scene.load(SCENE, {"ensemble.members": 8, "run.duration": 0.5}))
    assert result.status.counts()["ok"] == 8


@pytest.mark.ci
def test_a_result_is_saved_and_read(runs, tmp_path):
    result = lw.Result.load(runs / "memory" / "result.npz")
    for _ in range(2):  # the second replaces the first
        again = lw.Result.load(result.save(tmp_path / "a.npz"))
    np.testing.assert_array_equal(again.position, result.position)
    assert os.listdir(tmp_path) == ["a.npz"]


def test_a_store_has_the_numbers_of_a_run_in_memory(runs):
    stored, kept = lw.open_run(runs / "store"), lw.Result.load(runs / "memory" / "result.npz")
    np.testing.assert_array_equal(np.asarray(stored.position), kept.position)
    assert sorted(path.name for path in (runs / "store").iterdir() if not path.name.startswith("fleet")) == ["run.zarr"]


@pytest.mark.ci
def test_a_stopped_run_goes_on(copied, capsys):
    path = copied / "store" / "run.zarr"
    (path / "blocks" / "000000000.json").unlink()
    assert cli.main(["info", str(path)]) == 1
    assert cli.main(["resume", str(path)]) == cli.main(["info", str(path)]) == 0


@pytest.mark.ci
def test_a_run_is_overwritten(copied):
    assert run(copied / "store", "--store", "zarr", "--overwrite") == 0
    assert [path.name for path in (copied / "store").iterdir() if "zarr" in path.name] == ["run.zarr"]


def test_the_files_of_a_folder_are_told(runs, capsys):
    assert cli.main(["info", str(runs / "memory"), "--json"]) == 0
    assert [item["kind"] for item in json.loads(capsys.readouterr().out)["holds"]] == ["result"]


@pytest.mark.ci
def test_pictures_and_a_report(copied):
    folder = copied / "memory"
    assert cli.main(["plot", str(folder)]) == cli.main(["report", str(folder)]) == 0
    assert (folder / "fleet.png").stat().st_size > 1000
    assert "</html>" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.ci
def test_a_sweep_finds_its_cells(tmp_path, capsys):
    (tmp_path / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    for _ in range(2):
        assert cli.main(["sweep", str(tmp_path / "sweep.toml"), "--out", str(tmp_path / "out"), "--json"]) == 0
    cells = list((tmp_path / "out" / "cells").iterdir())
    assert len(cells) == 1
    assert (tmp_path / "out" / "summary.md").read_text(encoding="utf-8").startswith("# Sweep")


def test_a_folder_in_the_place_of_a_file_is_refused(tmp_path, capsys):
    (tmp_path / "out" / "result.npz").mkdir(parents=True)
    assert run(tmp_path / "out") == 2
    assert "is a folder, which is not replaced" in capsys.readouterr().err
    (tmp_path / "scene.toml").mkdir()
    assert cli.main(["check", str(tmp_path / "scene.toml")]) == 2
    assert "is a folder" in capsys.readouterr().err


@pytest.mark.ci
def test_a_scene_is_begun_and_checked(tmp_path, capsys):
    for code in (0, 2):  # the second finds the first
        assert cli.main(["new", str(tmp_path / "new" / "scene.toml")]) == code
    assert cli.main(["check", str(tmp_path / "new" / "scene.toml")]) == 0


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the imitation is one of Linux")
def test_all_of_them_without_what_windows_has_not():
    words = ["-q", "-p", "no:cacheprovider", "-p", "tests.support.windows",
             str(ROOT / "tests" / "runs" / "test_systems.py")]  # fmt: skip
    paths = os.pathsep.join(map(str, (ROOT, ROOT / "kernels")))
    environment = os.environ | {"PYTHONPATH": paths, "LGVI_WARP_IMITATED": "1"}
    if os.environ.get("LGVI_WARP_IMITATED"):
        pytest.skip("this is that process")
    found = subprocess.run([sys.executable, "-m", "pytest", *words], capture_output=True, text=True, timeout=240,
                           cwd=ROOT, env=environment, check=False)  # fmt: skip
    assert found.returncode == 0, found.stdout[-4000:] + found.stderr[-2000:]
    assert "10 passed" in found.stdout, found.stdout[-4000:] + found.stderr[-2000:]
