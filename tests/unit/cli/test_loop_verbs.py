# SPDX-License-Identifier: Apache-2.0
"""The verbs margins, worst-case and trim: what their arguments reach, what they write and how they end. No study runs."""

import json
import math
import shlex

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from tests.conftest import ROOT
from tests.support.verbs import Study, main
from tests.unit.cli.test_terminal import document

SCENE = str(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")


def loops(*why):
    """Margins of a fleet, of members with these reasons for none."""
    lost = np.array([bool(text) for text in why])
    upper = np.where(lost, np.nan, np.geomspace(2.0, 8.0, len(why)))
    upper[-1] = math.inf
    return lw.linear.Margins("heading_pid", {"gain_lower": 1.0 / upper, "gain_upper": upper}, {"delay": 0.1 * upper},
                             np.array(why, dtype=object), 0.02, ("a message",))  # fmt: skip


def worst(value=3.5, **others):
    """A worst case."""
    parameters = {"vehicle.buoyancy": 297.0, "drag_matrix.quadratic[1,1]": 1000.0}
    settings = {"of": "max(depth)", "worst": "largest", "restarts": np.array([value, 3.0]), "runs": 64} | others
    return lw.studies.WorstCase(parameters, value, at_bounds={"vehicle.buoyancy": "low", "drag_matrix.quadratic[1,1]": ""},
                                fleet=None, **settings)  # fmt: skip


def steady():
    """A steady motion."""
    start = lw.Start(velocity=[0.5, 0.0, 0.0], euler_deg=[0.0, 0.0, 90.0])
    return lw.linear.Trim(start, {"thrusters": np.array([0.25, -0.5])}, {"thrusters[0]": 0.25, "thrusters[1]": -0.5},
                          {"pitch": 0.0, "speed": 0.5}, np.full(6, 1e-15), lw.Method("psi_s"), 0.02)  # fmt: skip


def test_arguments_of_margins(tmp_path, capsys):
    study = Study(loops("", "", "does not settle", ""))
    plain = ["margins", SCENE, "--out", str(tmp_path)]
    assert main([*plain, "-q"], study=study) == 0
    more = ["--loop", "depth_pid", "--of", "disk", "--of", "gain", "--of", "disk", "--of", "peak", "--to", "position[2]",
            "--by", "eigenvalues", "--by", "runs", "--skew", "-0.5",
            "--about", "5", "--settle", "50", "--seconds", "30", "--tilt", "1e-4", "--most", "20",
            "--longest", "2", "--members", "7", "--seed", "3", "--method", "rk4", "--step", "0.05"]  # fmt: skip
    assert main([*plain, *more], study=study) == 0
    ((scene, *asked), settings), ((other, *others), numbers) = study.calls
    assert (scene.ensemble_settings.members, asked) == (10000, [None, ("gain", "delay")])
    assert settings == {"by": ("eigenvalues",), "to": (), "skew": 0.0, "about": 60.0, "settle": 1200.0, "seconds": 240.0,
                        "tilt": 1e-3, "most": 100.0, "longest": 10.0}  # fmt: skip
    assert others == ["depth_pid", ("disk", "gain", "peak")]
    assert numbers == {"by": ("eigenvalues", "runs"), "to": ("position[2]",), "skew": -0.5,
                       "about": 5.0, "settle": 50.0, "seconds": 30.0,
                       "tilt": 1e-4, "most": 20.0, "longest": 2.0}  # fmt: skip
    assert (other.ensemble_settings.members, other.ensemble_settings.seed) == (7, 3)
    assert (str(other.run.method), other.run.step) == ("rk4", 0.05)
    told = capsys.readouterr().out
    assert told.startswith(str(loops("", "", "does not settle", "")))
    assert all(f"{tmp_path}/margins.{ending}" in told for ending in ("json", "csv", "png"))


def test_margins_are_read_back_from_their_files(tmp_path, capsys):
    found = loops("", "at its limit: control_fins[1]", "")
    assert main(["margins", SCENE, "--out", str(tmp_path), "-q"], study=Study(found)) == 0
    again = lw.linear.Margins.load(tmp_path / "margins.json")
    assert again.to_dict() == found.to_dict() == json.loads((tmp_path / "margins.json").read_text())
    assert again.values["gain_upper"][-1] == math.inf
    assert str(again) == str(found)
    head, *rows = (tmp_path / "margins.csv").read_text().splitlines()
    assert head == "member,why,gain_lower,gain_upper,delay_by_runs"
    assert rows[1].startswith("1,at its limit: control_fins[1],")
    assert (rows[0], rows[2]) == ("0,,0.5,2.0,0.2", "2,,0.0,inf,inf")
    (held,) = document(["info", str(tmp_path)], capsys, name="info of a folder")["holds"]
    assert held == {"kind": "margins", "path": f"{tmp_path}/margins.json", "content": found.to_dict()}
    (tmp_path / "margins.png").unlink()
    assert document(["plot", str(tmp_path)], capsys)["files"] == [f"{tmp_path}/margins.png"]
    assert cli.main(["report", str(tmp_path), "-q"]) == 0
    assert "at its limit: control_fins[1]" in (tmp_path / "report.html").read_text()


def test_members_that_fail_end_margins_with_1(tmp_path, capsys):
    given = ["margins", SCENE, "--out", str(tmp_path)]
    study = Study(loops("failed", "", "failed", ""))
    document(given, capsys, code=1, study=study)
    assert main([*given, "-q"], study=study) == 1
    assert capsys.readouterr().err.endswith("2 of 4 members failed\n")
    nobody = Study(loops("does not settle", "does not settle"))
    content = document(given, capsys, study=nobody)
    assert content["content"]["margins"]["why"] == ["does not settle"] * 2


def test_arguments_of_a_worst_case(tmp_path, capsys):
    study = Study(worst())
    plain = ["worst-case", SCENE, "--of", "max(depth)", "--within", "vehicle.buoyancy=297:302", "--out", str(tmp_path)]
    assert main([*plain, "-q"], study=study) == 0
    more = ["--within", "heading_pid.kp=0.5:5:log", "--worst", "smallest", "--budget", "400", "--restarts", "2", "--seed",
            "9", "--threads", "1", "--method", "rk4", "--step", "0.05", "--duration", "20", "--set",
            "run.save_every=0.5"]  # fmt: skip
    assert main([*plain, *more], study=study) == 0
    ((scene, *asked), settings), ((other, *others), numbers) = study.calls
    assert asked == [{"vehicle.buoyancy": (297.0, 302.0)}, "max(depth)"]
    expected = {"worst": "largest", "budget": 20_000, "restarts": 3, "seed": 0, "threads": None, "progress": None}
    assert settings == expected
    assert others[0] == {"vehicle.buoyancy": (297.0, 302.0), "heading_pid.kp": (0.5, 5.0, "log")}
    asked_for = {"worst": "smallest", "budget": 400, "restarts": 2, "seed": 9, "threads": 1}
    assert {name: numbers[name] for name in asked_for} == asked_for
    # The seed is that of the search, and leaves the scene's members alone.
    assert other.ensemble_settings.seed == scene.ensemble_settings.seed == 1
    assert (other.run.step, other.run.duration) == (0.05, 20.0)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == str(worst())
    command = shlex.split(lines[1].removeprefix("again "))
    assert command[:3] == ["lgvi-warp", "run", SCENE]
    chosen = cli.parser().parse_args(command[1:])
    member = lw.Ensemble.from_scene(lw.Scene.load(SCENE, cli.overrides(chosen)))
    assert (member.members, member.seed, member.scene.run.step) == (1, 0, 0.05)
    assert member.parameters(0, 1)["vehicle.buoyancy"].tolist() == [297.0]
    assert member.parameters(0, 1)["drag_matrix.quadratic"][0, 1, 1] == 1000.0


@pytest.mark.parametrize(("value", "which"), [(3.5, "largest"), (-2.0, "smallest"), (math.inf, "largest"),
                                              (math.inf, "smallest")])  # fmt: skip
def test_worst_cases_are_read_back_from_their_files(value, which, tmp_path, capsys):
    restarts = np.array([value if math.isfinite(value) or which == "largest" else -math.inf, 3.0])
    found = worst(value, worst=which, restarts=restarts)
    given = ["worst-case", SCENE, "--of", "depth", "--within", "vehicle.mass=1:2", "--out", str(tmp_path)]
    content = document(given, capsys, study=Study(found))["content"]["worst_case"]
    assert content["value"] == (value if math.isfinite(value) else None)
    again = lw.studies.WorstCase.load(tmp_path / "worst_case.json")
    assert str(again) == str(found)
    assert again.restarts.tolist() == found.restarts.tolist()
    assert (tmp_path / "worst_case.csv").read_text() == 'vehicle.buoyancy,"drag_matrix.quadratic[1,1]"\n297.0,1000.0\n'
    (held,) = document(["info", str(tmp_path)], capsys, name="info of a folder")["holds"]
    assert (held["kind"], held["content"]) == ("worst_case", content)
    assert cli.main(["plot", str(tmp_path)]) == 0
    assert "has no picture" in capsys.readouterr().err
    assert cli.main(["report", str(tmp_path), "-q"]) == 0


def test_arguments_of_a_trim(capsys):
    study = Study(steady())
    assert main(["trim", SCENE], study=study) == 0
    more = [
        "--speed",
        "0.5",
        "--fixed",
        "pitch=0",
        "--fixed",
        "control_fins[0]=-0.1",
        "--free",
        "roll",
        "--free",
        "drift",
    ]
    assert main(["trim", SCENE, *more, "--method", "psi_s", "--step", "0.02", "-q"], study=study) == 0
    ((scene, speed), settings), ((other, value), others) = study.calls
    assert (speed, settings) == (None, {"free": None, "fixed": {}})
    assert (value, others) == (0.5, {"free": ["roll", "drift"], "fixed": {"pitch": 0.0, "control_fins[0]": -0.1}})
    assert (scene.run.step, other.run.step) == (0.01, 0.02)
    told = capsys.readouterr().out
    start = {"euler_deg": [0.0, 0.0, 90.0], "velocity": [0.5, 0.0, 0.0]}
    assert told == f"{steady()}\n\n[start]\n" + "".join(f"{name} = {value}\n" for name, value in start.items())
    content = document(["trim", SCENE], capsys, study=study)
    assert (content["start"], content["commands"]) == (start, {"thrusters": [0.25, -0.5]})
    assert (content["method"], content["step"], len(content["residual"])) == ("psi_s", 0.02, 6)


@pytest.mark.parametrize(("given", "words"), [
    (["worst-case", SCENE, "--of", "depth", "--within", "vehicle.mass=4", "--within", "=1:2", "--within", "a=1:2:lg"],
     ["--within = 'vehicle.mass=4': names no bounds", "'=1:2'", "'a=1:2:lg'"]),
    (["worst-case", SCENE, "--of", "depth", "--within", "vehicle.buoyance=4:5"],
     ["within.\"vehicle.buoyance\" = '...': does not name what the scene has; did you mean 'vehicle.buoyancy'?"]),
    (["worst-case", SCENE, "--of", "depth", "--within", "start.velocity=4:5"],
     ["within.\"start.velocity\" = '...': is not a single number"]),
    (["trim", SCENE, "--fixed", "pitch", "--fixed", "roll=low", "--fixed", "=2"],
     ["--fixed = 'pitch': is no value; give pitch=0.1", "'roll=low'", "'=2'"]),
    (["margins", SCENE, "--loop", "heading", "--skew", "2"],
     ["loop = 'heading': is no law of the controller; did you mean 'heading_pid'?",
      "skew = 2.0: is above 1; give a number from -1 to 1"]),
    (["margins", str(ROOT / "examples" / "paper.toml")],
     ["controller = None: is not in the scene, and margins are those of a loop; give [controller]"]),
])  # fmt: skip
def test_odd_arguments_are_refused_all_at_once(given, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main([*given, "-q"]) == 2
    out = capsys.readouterr()
    assert all(text in out.err for text in words)
    assert out.out == ""
