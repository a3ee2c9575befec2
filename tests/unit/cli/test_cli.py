# SPDX-License-Identifier: Apache-2.0
"""The command: what it writes, what it says, and how it refuses."""

import json
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli.runs import all_failed
from tests.conftest import ROOT
from tests.support.verbs import Study

PAPER = str(ROOT / "examples" / "paper.toml")
SMALL = ["--members", "20", "--duration", "2", "--set", "run.save_every=0.5"]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A small run in a process of its own: its folder and what it printed."""
    out = tmp_path_factory.mktemp("runs") / "paper"
    code = "from lgvi_warp.cli import entry; import sys; sys.argv = ['lgvi-warp', *sys.argv[1:]]; entry()"
    arguments = [sys.executable, "-c", code, "run", PAPER, "--out", str(out), *SMALL]
    return out, subprocess.run(arguments, capture_output=True, text=True, cwd=out.parent)


@pytest.mark.ci
@pytest.mark.kernel
def test_run_writes_three_files_and_a_summary(finished):
    out, done = finished
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(path.name for path in out.iterdir()) == ["fleet.png", "fleet.rrd", "result.npz"]
    for word in (
        "members     20",
        "psi_s",
        "vehicle-steps per second",
        "All 20 members end ok at 2 s.",
        "energy",
        "momentum",
        "result.npz",
    ):
        assert word in done.stdout


@pytest.mark.kernel
def test_the_result_is_that_of_solve(finished):
    scene = lw.Scene.load(PAPER)
    result = lw.Result.load(finished[0] / "result.npz")
    fleet = lw.Ensemble(scene, 20, 1, scene.ensemble_settings.vary)
    same = lw.solve(fleet, h=0.01, t1=2.0, save=lw.SaveAt(every=0.5))
    assert result.position.tobytes() == same.position.tobytes()
    assert result.provenance["ensemble"]["members"] == 20


@pytest.mark.kernel
def test_the_picture_is_not_empty(finished):
    from matplotlib.image import imread

    picture = imread(finished[0] / "fleet.png")
    assert picture.shape[0] > 1000
    assert picture.shape[1] >= 1200
    assert all(third.std() > 0.05 for third in np.array_split(picture[..., :3], 3, axis=1))


@pytest.mark.kernel
def test_the_recording_holds_every_pose(finished):
    import rerun as rr  # noqa: F401  (the chunk module needs it)
    from rerun.chunk import RrdReader

    rows = 0
    for chunk in RrdReader(finished[0] / "fleet.rrd").stream().filter(content="/world/bodies/**"):
        batch = chunk.to_record_batch()
        column = next((name for name in batch.schema.names if name.endswith("translations")), None)
        if column and "sim_time" in batch.schema.names:
            rows += batch.num_rows
            poses = batch.column(column).to_pylist()
            assert all(len(frame) == 20 and np.isfinite(frame).all() for frame in poses)
    assert rows == 5


@pytest.mark.ci
@pytest.mark.kernel
def test_quiet_says_nothing(tmp_path, capfd):
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, "--quiet"]) == 0
    assert capfd.readouterr() == ("", "")


@pytest.mark.ci
@pytest.mark.kernel
def test_options_reach_the_run(tmp_path, capsys):
    # A kernel that other tests load as well.
    options = ["--method", "psi_s", "--step", "0.02", "--dtype", "float32_compensated", "--width", "16"]
    options += ["--threads", "1", "--seed", "9"]
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, *options, "--set", "vehicle.mass=124"]) == 0
    p = lw.Result.load(tmp_path / "result.npz").provenance
    assert (p["method"]["name"], p["step"], p["dtype"], p["width"]) == ("psi_s", 0.02, "float32_compensated", 16)
    assert p["ensemble"]["seed"] == 9
    assert p["scene"]["vehicle"]["mass"] == 124


@pytest.mark.parametrize(("arguments", "words"), [
    (["--set", "vehicle.mas=1"], ["vehicle.mas", "Did you mean 'mass'"]),
    (["--step", "-1", "--members", "0", "--set", "vehicle.mass=-2"], ["3 faults", "step", "members", "mass"]),
    (["--method", "psy"], ["psy", "Did you mean"]), (["--set", "nonsense"], ["nonsense", "vehicle.buoyancy=300"]),
    (["--dtype", "float16"], ["float16"]), (["--width", "5"], ["width = 5"]), (["--threads", "0"], ["threads = 0"]),
    (["--device", "cuda"], ["run.device = 'cuda'", "runs are on CPU cores", 'give "cpu"']),
    (["--resume"], ["--resume", "--store zarr"]),
    (["--blocks", "0:2", "--overwrite"], ["--blocks and --overwrite", "--store zarr"]),
    (["--store", "zarr", "--blocks", "3"], ["--blocks 3", "--blocks 0:100"]),
    (["--store", "zarr", "--blocks", "5:9"], ["blocks 5:9", "within the 1"]),
    (["--store", "zarr", "--store-dtype", "float16"], ["float16"]),
    (["--executor", "thread"], ["Did you mean 'threads'"]), (["--scheduler", "tcp://x"], ["dask alone"]),
])  # fmt: skip
def test_a_bad_argument_is_refused_with_the_remedy(arguments, words, tmp_path, capsys):
    assert cli.main(["run", PAPER, "--out", str(tmp_path / "out"), *SMALL, *arguments]) == 2
    text = capsys.readouterr().err
    assert all(word in text for word in words)
    assert "Traceback" not in text


def test_a_missing_scene_is_named(tmp_path, capsys):
    assert cli.main(["run", str(tmp_path / "none.toml"), "--out", str(tmp_path)]) == 2
    assert "none.toml" in capsys.readouterr().err


def test_an_output_that_cannot_be_written_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert cli.main(["run", PAPER, "--out", str(tmp_path / "file" / "out"), *SMALL]) == 1
    assert "file" in capsys.readouterr().err


@pytest.mark.kernel
def test_every_member_failing_is_an_exit_code_and_a_reason(tmp_path, capsys):
    fast = ["--set", "start.angular_velocity=[900.0, 0.0, 0.0]", "--step", "0.1"]
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, *fast]) == 1
    out = capsys.readouterr()
    assert "step_too_large 20" in out.out
    assert "Shorten the step" in out.out
    assert "fleet.png was not written" in out.err
    assert (tmp_path / "result.npz").exists()


@pytest.mark.slow
@pytest.mark.kernel
def test_a_run_in_a_store(tmp_path, capsys):
    """run --store zarr, refused a second time, gone on with, described, exported."""
    out = tmp_path / "whole"
    run = ["run", PAPER, *SMALL, "--store", "zarr", "--out", str(out)]
    assert cli.main(run) == 0
    assert "run.zarr" in capsys.readouterr().out
    assert sorted(path.name for path in out.iterdir()) == ["fleet.png", "fleet.rrd", "run.zarr"]
    assert cli.main([*run, "--quiet"]) == 2
    assert "holds a run already" in capsys.readouterr().err
    assert cli.main([*run, "--quiet", "--resume"]) == 0
    assert cli.main([*run, "--quiet", "--overwrite"]) == 0
    assert cli.main(["resume", str(out)]) == 0
    assert "All 20 members end ok at 2 s." in capsys.readouterr().out
    assert cli.main(["info", str(out)]) == 0
    text = capsys.readouterr().out
    assert "1 of 1 finished; complete" in text
    assert "5 times of position" in text
    assert cli.main(["export", str(out), "--to", "parquet"]) == 0
    assert (out / "run.parquet").exists()


def test_members_that_an_event_stopped_have_not_failed():
    for status, failed in (([16, 17], False), ([1, 0], False), ([1, 16], False), ([1, 3], True)):
        assert all_failed(SimpleNamespace(status=np.array(status))) == failed


def test_a_file_where_a_folder_should_be_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    for verb in (["run"], ["stability"], ["sensitivity", "--of", "depth"], ["tradeoff"]):
        assert cli.main([*verb, PAPER, "--out", str(tmp_path / "file")]) == 2
        assert f"--out {tmp_path / 'file'} is a file. Give a folder" in capsys.readouterr().err
    for verb in (["info"], ["resume"], ["export", "--to", "netcdf"]):
        assert cli.main([*verb, str(tmp_path / "file")]) == 2
        assert "file is a file. Give the folder of a run made with --store zarr" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_refused_before_the_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(os, "access", lambda path, mode: (path, mode) != (tmp_path, os.W_OK | os.X_OK))
    for verb in ("run", "tradeoff"):
        assert cli.main([verb, PAPER, "--out", str(tmp_path)]) == 1
        text = f"lgvi-warp: {tmp_path}: Permission denied: choose a folder that can be written\n"
        assert capsys.readouterr().err == text


@pytest.mark.kernel
def test_a_recording_that_cannot_be_begun_is_told(finished, tmp_path):
    result = lw.Result.load(finished[0] / "result.npz")
    with pytest.raises(OSError, match=r"there is no such folder: '.*none'"):
        lw.record(result, tmp_path / "none" / "fleet.rrd")


def test_what_an_interrupt_leaves_is_said(tmp_path, capsys):
    verbs = dict.fromkeys(("run", "resume", "info"), Study(KeyboardInterrupt()))
    run = ["run", PAPER, "--store", "zarr", "--out", str(tmp_path)]
    cases = [(run, "nothing was written"), (["info"], "nothing was to be written")]
    (tmp_path / "there" / "run.zarr").mkdir(parents=True)
    kept = f"finished blocks are kept: go on with lgvi-warp resume {tmp_path / 'there'}"
    cases += [([*run[:-1], str(tmp_path / "there")], kept), (["resume", str(tmp_path / "there")], kept)]
    for arguments, text in cases:
        assert cli.main(arguments, verbs=verbs) == 130
        assert capsys.readouterr().err == f"lgvi-warp: interrupted; {text}\n"


def test_exit_codes_are_told(capsys):
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    assert "exit codes:\n  0    done\n  1    members, files or the disk failed" in capsys.readouterr().out


@pytest.mark.ci
@pytest.mark.kernel
def test_info(capsys):
    assert cli.main(["info"]) == 0
    out = capsys.readouterr().out
    assert all(word in out for word in ("cpu", "threads", "warp-lang 1.19", "chained float32 ", "GFMA/s"))


@pytest.mark.ci
@pytest.mark.kernel
def test_bench(capsys):
    assert cli.main(["bench", "--members", "64", "--steps", "10"]) == 0
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [r["dtype"] for r in records] == ["float64", "float32"]
    assert all(r["ns_per_vehicle_step"] > 0 and r["part_of_peak"] > 0 for r in records)


@pytest.mark.ci
@pytest.mark.kernel
def test_warnings_are_counted_and_explained(tmp_path, capsys):
    # At h = 0.5 and 3 m/s both oscillations of the paper's vehicle are coarse; nothing fails.
    options = ["--checks", "all", "--step", "0.5", "--set", "start.velocity_inertial=[0.1,0.2,3.0]"]
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, *options]) == 0
    said = capsys.readouterr().out
    result = lw.Result.load(tmp_path / "result.npz")
    assert result.provenance["checks"] == "all"
    assert result.warnings.counts()["munk_coarse"] == 20
    assert "warnings    munk_coarse 20, restoring_coarse 20" in said
    assert "Shorten the step" in said
    assert f"(first: member 0 at 0 s, h sqrt(B|r|/J) = {result.warning_value[0]:.4g})" in said


@pytest.mark.kernel
def test_raise_exits_with_1_and_writes_the_files(tmp_path, capsys):
    options = ["--on-failure", "raise", "--set", "start.angular_velocity=[0,0,500]"]
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, *options]) == 1
    said = capsys.readouterr()
    assert "step_too_large, 20 of 20 members (first: member 0 at 0 s" in said.err
    assert "result.npz" in said.out
    assert lw.Result.load(tmp_path / "result.npz").status.counts() == {"step_too_large": 20}


@pytest.mark.ci
@pytest.mark.kernel
def test_substep_is_told_of(tmp_path, capsys):
    options = ["--on-failure", "substep", "--set", "start.angular_velocity=[0,0,250]"]
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, *options]) == 0
    assert "substeps    4,000 steps of 20 members" in capsys.readouterr().out


@pytest.mark.ci
@pytest.mark.kernel
def test_a_step_is_chosen_by_options(tmp_path, capsys):
    options = ["--method", "rk8", "--rtol", "1e-9", "--atol", "1e-9", "--step", "0.5"]
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, *options]) == 0
    method = lw.Result.load(tmp_path / "result.npz").provenance["method"]
    assert (method["name"], method["rtol"], method["atol"]) == ("rk8", 1e-9, 1e-9)
    assert cli.main(["run", PAPER, "--out", str(tmp_path), *SMALL, "--rtol", "1e-9"]) == 2
    assert "run.rtol" in capsys.readouterr().err


AUTOPILOT = str(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
LOOP = (
    "controller  acts every 0.1 s, 0.02 s until they act; sensors depth_cell, compass; guidance set_point, reference_model; "
    "laws depth_pid, heading_pid; allocation matrix; faults stuck_rudder\n"
)


def test_check_names_the_parts_of_a_controller(capsys):
    assert cli.main(["check", AUTOPILOT]) == 0
    assert LOOP in capsys.readouterr().out
    assert cli.main(["check", PAPER]) == 0
    assert "controller" not in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.kernel
def test_a_run_saves_what_the_scene_names(tmp_path, capsys):
    # Gains at which the rudder goes from limit to limit: all ask for more than it delivers.
    more = ["--set", 'run.save_fields=["position", "unmet"]', "--set", "run.save_every=1.0"]
    arguments = [AUTOPILOT, "--members", "20", "--duration", "3", *more]
    arguments += ["--set", 'ensemble.vary={ "heading_pid.kp" = { uniform = { low = 1e4, high = 2e4 } } }']
    for store in ("npz", "zarr"):
        out = tmp_path / store
        assert cli.main(["run", *arguments, "--out", str(out), "--store", store]) == 0
        said = capsys.readouterr().out
        assert LOOP in said
        assert "unmet       20 members asked" in said
        assert "pictures    none, and no energy: attitude, velocity, angular_velocity not saved" in said
        assert [path.name for path in out.iterdir()] == ["result.npz" if store == "npz" else "run.zarr"]
    assert cli.main(["info", str(out)]) == 0
    said = capsys.readouterr().out
    assert LOOP in said
    assert "of position, unmet\n" in said
