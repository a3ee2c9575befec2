# SPDX-License-Identifier: Apache-2.0
"""The verbs of studies: what their arguments reach, what they write and how they end. No study runs."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli, uq
from lgvi_warp.accuracy.stability.map import GRIDS
from lgvi_warp.cli import studies
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.errors import MissingExtra, NothingToDraw
from tests.conftest import ROOT
from tests.support.verbs import Study, main
from tests.unit.cli.test_terminal import document, region, sobol
from tests.unit.measuring.test_cost import found as tradeoff_of
from tests.unit.uncertainty.test_estimating import answer

PAPER = str(ROOT / "examples" / "paper.toml")


def draw(found, *, path):
    """Stands for what draws a picture."""
    path.write_text("a picture")


def test_a_method_that_was_asked_for_and_has_no_measurement_ends_with_1(tmp_path, capsys):
    found = dataclasses.replace(tradeoff_of(4.0), missing={"rk8": "members failed at every step that was tried"})
    verb = ["tradeoff", PAPER, "--methods", "rk4,rk8", "--out", str(tmp_path / "b")]
    assert main(verb, study=Study(found), draw=draw) == 1
    out, err = capsys.readouterr()
    assert "lgvi-warp: --methods rk8: has no measurement: members failed at every step" in err
    assert out.startswith("missing     rk8: members failed")
    assert (tmp_path / "b" / "tradeoff.png").exists()
    assert json.loads((tmp_path / "b" / "tradeoff.json").read_text())["missing"] == found.missing


def test_arguments_of_a_tradeoff(tmp_path, monkeypatch, capsys):
    measure = Study(tradeoff_of(4.0))
    monkeypatch.chdir(tmp_path)
    assert main(["tradeoff", PAPER, "--members", "7", "-q"], study=measure, draw=draw) == 0
    assert capsys.readouterr() == ("", "")
    more = ["--of", "depth", "--methods", "rk4, psi_s", "--seconds", "3", "--out", "b"]
    assert main(["tradeoff", PAPER, *more], study=measure, draw=draw) == 0
    ((scene,), settings), (_, others) = measure.calls
    assert scene.ensemble_settings.members == 7
    assert settings == {"of": "position", "methods": None, "seconds": 45.0, "progress": None}
    assert others.pop("progress") is not None
    assert others == {"of": "depth", "methods": ["rk4", "psi_s"], "seconds": 3.0}
    for folder in ("runs/paper_tradeoff", "b"):
        assert sorted(path.name for path in (tmp_path / folder).iterdir()) == [
            "tradeoff.csv", "tradeoff.json", "tradeoff.png"]  # fmt: skip
    said = capsys.readouterr().out.split("\n")
    files = [line.partition(" (")[0] for line in said[-4:-1]]
    assert said[-5] == ""
    assert files == [f"file        b/tradeoff.{end}" for end in ("json", "csv", "png")]


def test_a_picture_that_fails_is_an_exit_code(tmp_path, capsys):
    for error, code, text in ((OSError("no room"), 1, "no room"), (NothingToDraw("no rows"), 0, "no rows")):
        parts = {"study": Study(tradeoff_of(4.0)), "draw": Study(error)}
        assert main(["tradeoff", PAPER, "--out", str(tmp_path), "-q"], **parts) == code
        picture = tmp_path / "tradeoff.png"
        assert capsys.readouterr().err == f"lgvi-warp: {picture} was not written: {text}\n"


def test_arguments_of_a_sensitivity_study(tmp_path, capsys):
    study = Study(sobol())
    verb = ["sensitivity", PAPER, "--out", str(tmp_path)]

    def reached(*options, code=0):
        assert main([*verb, *options], study=study, draw=draw) == code
        return study.calls[-1]

    common = {"failed": "refuse", "threads": None, "progress": None}
    plainly = common | {"samples": 256, "second_order": True, "replicates": 8, "groups": {}}
    (_, of), settings = reached("-q")
    assert (of, settings) == (["position[2]"], plainly)
    assert reached("--first-order", "--samples", "0", "-q")[1] == plainly | {"samples": 0, "second_order": False}
    grouped = ["--replicates", "4", "--group", "start=start.position,start.velocity"]
    groups = {"start": ["start.position", "start.velocity"]}
    assert reached(*grouped, "-q")[1] == plainly | {"replicates": 4, "groups": groups}
    reached("--group", "start", "-q", code=2)
    assert "--group = 'start': names no factors" in capsys.readouterr().err
    assert reached("--analysis", "morris", "-q")[1] == common | {"samples": 64}
    more = ["--of", "depth", "--of", "speed", "--samples", "5", "--failed", "drop", "--threads", "3", "--seed", "4"]
    (scene, of), settings = reached("--analysis", "morris", *more)
    assert scene.ensemble_settings.seed == 4
    assert of == ["depth", "speed"]
    assert settings.pop("progress") is not None
    assert settings == {"failed": "drop", "threads": 3, "samples": 5}
    said = capsys.readouterr().out
    assert said.startswith(f"{sobol()}\n\nfile        {tmp_path}/sensitivity.")
    assert said.count("file  ") == 4
    assert said.endswith("MB)\n")


@pytest.mark.parametrize(
    ("error", "code"), [(uq.FailedMembers("3 members failed"), 1), (MissingExtra("studies", "SALib", "uq"), 2)]
)
def test_a_sensitivity_study_that_fails_is_one_line(tmp_path, capsys, error, code):
    assert main(["sensitivity", PAPER, "--out", str(tmp_path), "-q"], study=Study(error)) == code
    assert capsys.readouterr() == ("", f"lgvi-warp: {error}\n")
    assert not list(tmp_path.iterdir())


def test_arguments_of_a_stability_map(tmp_path):
    study = Study(region())
    verb = ["stability", PAPER, "-q", "--out", str(tmp_path)]
    more = "--x h=0.1:1 --y vehicle.mass --methods psi --points 5 --error 0.5 --of depth --duration 9 --seed 11"
    assert main(verb, study=study, draw=draw) == 0
    assert main([*verb, *more.split()], study=study, draw=draw) == 0
    (plain, named) = study.calls
    assert plain[0][1:] == ("h", "angular_velocity", None)
    seed = lw.Scene.load(PAPER).ensemble_settings.seed
    assert plain[1] == {"points": 24, "t1": None, "error": 0.01, "of": "attitude", "seed": seed, "progress": None}
    assert named[0][1:] == ("h=0.1:1", "vehicle.mass", ["psi"])
    assert named[1] == {"points": 5, "t1": 9.0, "error": 0.5, "of": "depth", "seed": 11, "progress": None}
    assert (tmp_path / "stability.png").exists()


def test_a_scene_without_an_ensemble_has_the_seed_0(tmp_path):
    study = Study(region())
    scene = tmp_path / "bare.toml"
    scene.write_text('[vehicle]\nname = "sphere"\n')
    verb = ["stability", str(scene), "-q", "--x", "speed", "--out", str(tmp_path / "out")]
    assert main(verb, study=study, draw=draw) == 0
    ((values, settings),) = study.calls
    assert settings["seed"] == 0
    assert values[1:3] == ("speed", "angular_velocity")


def test_grids_of_a_stability_study(tmp_path, capsys):
    study = Study(region())
    verb = ["stability", PAPER, "--out", str(tmp_path)]
    assert main([*verb, "--grid", "mass"], study=study, draw=draw) == 0
    assert (tmp_path / "stability_mass.png").exists()
    assert main([*verb, "--grid", "all"], study=study, draw=draw) == 0
    assert [values[1:3] for values, _ in study.calls] == [GRIDS["mass"], *GRIDS.values()]
    assert all(settings["progress"] is not None for _, settings in study.calls)
    assert {path.name for path in tmp_path.glob("*.json")} == {f"stability_{name}.json" for name in GRIDS}
    # One report for each, and a blank line between them.
    said = capsys.readouterr().out
    report = said.partition("\n\nfile")[0]
    assert said.partition(report)[2].count(f"{report}\n\n") == 3
    for axis in ("--x", "--y"):
        assert cli.main([*verb, "--grid", "mass", axis, "h"]) == 2
        words = "--grid mass: names the same axes as --x and --y; leave out --grid, or both of them"
        assert capsys.readouterr().err == f"lgvi-warp: {words}\n"


def test_an_interrupted_stability_study_says_which_maps_are_finished(tmp_path, capsys):
    interrupted = KeyboardInterrupt()
    for results, text in (([interrupted], "nothing was written"),
                          ([region(), region(), interrupted], f"2 of 3 maps are finished, in {tmp_path}")):  # fmt: skip
        verb = ["stability", PAPER, "--grid", "all", "--out", str(tmp_path), "-q"]
        assert main(verb, study=Study(results), draw=draw) == 130
        assert capsys.readouterr().err == f"lgvi-warp: interrupted; {text}\n"


class Swept:
    """Answer of a sweep of three cells, some of them refused."""

    rares = None

    def __init__(self, refused):
        cases = [SimpleNamespace(name=name) for name in "ab"]
        self.setup = SimpleNamespace(axes={"delay": [1, 2]})
        self.cells = [SimpleNamespace(case=cases[i // 2], index=i, point={"delay": 1 + i % 2}) for i in range(3)]
        self.refused, self.runs = refused, []

    def record(self, cell):
        return SimpleNamespace(refused=self.refused[cell.index])

    def save(self, out):
        (out / "sweep.json").write_text('{"seed": 3}')
        return [out / "sweep.json"]

    def worst(self, count):
        every = [("a", 2, 9), ("b", 1, 4), ("a", 2, 5), ("a", 1, 1)]
        return [{"case": case, "delay": delay, "member": member} for case, delay, member in every[:count]]

    def cell(self, case, at):
        return next(cell for cell in self.cells if cell.case.name == case and cell.point == at)

    def again(self, case, members, point):
        self.runs.append((case, members, point))
        return f"members {members} of {case}"

    def __str__(self):
        return "the sweep in words"


@pytest.fixture
def sweep(tmp_path):
    """A function of what was refused and of options: exit code, what the sweep was called with, what it found."""
    (tmp_path / "laws.toml").write_text(
        f'scene = "{PAPER}"\nmembers = 40\nseed = 1\nmetrics = ["max(depth)"]\n[compare]\nbaseline = "a"\n[run]\nstep = 0.1\n'
    )

    def run(*options, refused=("", "", ""), **parts):
        found = Swept(refused)
        study = Study(found)
        parts = {"study": study, "drawings": lambda _: {"a.png": draw}} | parts
        code = main(["sweep", str(tmp_path / "laws.toml"), "--out", str(tmp_path / "out"), *options], **parts)
        return code, study.calls, found

    return run


def test_arguments_of_a_sweep(sweep, tmp_path, capsys):
    code, (((), settings),), _ = sweep("-q", "--members", "1e3", "--seed", "-2", "--threads", "3", "--executor", "dask",
                                       "--scheduler", "tcp://x")  # fmt: skip
    assert code == 0
    assert settings.pop("scene").to_dict() == lw.Scene.load(PAPER).to_dict()
    assert settings == {
        "members": 1000, "seed": -2, "baseline": "a", "metrics": ["max(depth)"], "h": 0.1, "threads": 3, "executor": "dask",
        "scheduler": "tcp://x", "out": tmp_path / "out", "progress": None,
    }  # fmt: skip
    assert capsys.readouterr() == ("", "")
    assert (tmp_path / "out" / "a.png").read_text() == "a picture"
    _, (((), settings),), found = sweep("--members", "many")
    assert (settings["members"], settings["seed"]) == ("many", 1)
    assert settings["progress"] is not None
    assert found.runs == []  # nothing is recorded that was not asked for
    lines = capsys.readouterr().out.split("\n")
    assert lines[:2] == ["the sweep in words", ""]
    assert [line.partition(" (")[0] for line in lines[2:]] == [
        f"file        {tmp_path}/out/sweep.json", f"file        {tmp_path}/out/a.png", ""]  # fmt: skip
    assert sweep("--json")[0] == 0
    assert json.loads(capsys.readouterr().out)["content"] == {"sweep": {"seed": 3}}


def test_a_sweep_of_refused_cells_alone_failed(sweep):
    assert sweep("-q", refused=("", "no", "no"))[0] == 0
    assert sweep("-q", refused=("no",) * 3)[0] == 1


def test_the_worst_members_are_recorded_by_cell(tmp_path):
    recorded, written, found = [], Written(), Swept(("", "", ""))

    def log(result, path):
        recorded.append((result, path.name))
        path.write_text("a recording")

    studies.record_worst(found, 3, tmp_path, written, log=log)
    assert found.runs == [("a", [5, 9], {"delay": 2}), ("b", [4], {"delay": 1})]
    assert recorded == [("members [5, 9] of a", "worst_0001.rrd"), ("members [4] of b", "worst_0002.rrd")]
    assert [path.name for path in written.files] == ["worst_0001.rrd", "worst_0002.rrd"]


def test_the_plan_of_a_sweep_runs_nothing(sweep, tmp_path, capsys):
    plan = Study("cells 4\ntime 2")
    code, runs, _ = sweep("--plan", "--threads", "2", "--members", "5", plan=plan)
    assert code == 0
    assert runs == []
    assert capsys.readouterr().out == "cells 4\ntime 2\n"
    assert not (tmp_path / "out").exists()
    (((setup, threads), _),) = plan.calls
    assert (setup.members.members, threads) == (5, 2)
    assert sweep("--plan", "--json", plan=plan)[0] == 0
    assert json.loads(capsys.readouterr().out)["plan"] == ["cells 4", "time 2"]


class Rare:
    """Answer of a search for a rare event."""

    def save(self, out):
        (out / "rare.json").write_text("{}")
        return [out / "rare.json"]

    def to_dict(self):
        return {"probability": 1e-5}

    def __str__(self):
        return "the probability in words"


def test_arguments_of_a_rare_event(tmp_path, capsys):
    study = Study(Rare())
    verb = ["rare", PAPER, "--when", "position[0] above 60", "--out", str(tmp_path)]
    assert main([*verb, "-q"], study=study, draw=draw) == 0
    more = ["--error", "0.2", "--cheaper", "h=0.1,dtype=float32", "--cheaper", "vehicle.mass = 5", "--failed", "refuse",
            "--most", "50000", "--seed", "7", "--threads", "2", "--by", "splitting", "--looks", "20",
            "--store", "kept"]  # fmt: skip
    assert main([*verb, *more], study=study, draw=draw) == 0
    ((_, when), plain), (_, others) = study.calls
    seed = lw.Scene.load(PAPER).ensemble_settings.seed
    assert when == "position[0] above 60"
    assert plain == {"relative_error": 0.1, "by": "chains", "looks": 50, "cheaper": [], "failed": "event",
                     "most": 1_000_000, "seed": seed, "threads": None, "progress": None, "store": None}  # fmt: skip
    assert others.pop("progress") is not None
    assert others == {"relative_error": 0.2, "by": "splitting", "looks": 20,
                      "cheaper": [{"h": 0.1, "dtype": "float32"}, {"vehicle.mass": 5.0}],
                      "failed": "refuse", "most": 50_000, "seed": 7, "threads": 2, "store": "kept"}  # fmt: skip
    assert capsys.readouterr().out.startswith("the probability in words")
    assert main([*verb, "--cheaper", "h", "-q"], study=study, draw=draw) == 2
    assert "--cheaper = 'h': names no values" in capsys.readouterr().err


def test_arguments_of_an_estimate(capsys):
    study = Study(answer())
    assert main(["estimate", PAPER, "--of", "mean depth", "--error", "0.1", "-q"], study=study) == 0
    more = ["--of", "max(depth)", "--relative-error", "0.01", "--risk", "cvar:0.1", "--cheaper", "controller.delay=0",
            "--step", "0.1", "--method", "rk4", "--seed", "7", "--threads", "1", "--dtype", "float32",
            "--store", "kept"]  # fmt: skip
    assert main(["estimate", PAPER, *more], study=study) == 0
    assert capsys.readouterr().out == f"{answer()}\n"
    ((scene, of, error), settings), ((other, *_), others) = study.calls
    assert (of, error, scene.ensemble_settings.members) == ("mean depth", 0.1, 4096)
    assert (settings["method"], settings["h"], settings["risk"], settings["cheaper"]) == (None, None, "mean", [])
    assert other.ensemble_settings.seed == 7
    assert (others["method"], others["h"], others["dtype"], others["threads"]) == ("rk4", 0.1, "float32", 1)
    assert (others["relative_error"], others["risk"]) == (0.01, lw.metrics.CVaR(0.1))
    assert others["cheaper"] == [{"controller.delay": 0.0}]
    assert (settings["store"], others["store"]) == (None, "kept")
    assert (
        document(["estimate", PAPER, "--of", "depth", "--error", "1"], capsys, study=study)["members"]["psi_x 0.2"]
        == 8192
    )


def test_an_estimate_is_written_and_run_again_by_its_file(tmp_path, capsys):
    """The folder has the answer with its recipe, which --recipe gives to the next."""
    recipe = {"setting": {"method": "psi_x", "h": 0.025}, "levels": [], "seed": 3}
    study = Study(dataclasses.replace(answer(), recipe=recipe))
    verb = ["estimate", PAPER, "--of", "mean depth"]
    assert main([*verb, "--error", "0.1", "--out", str(tmp_path), "-q"], study=study) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["estimate.csv", "estimate.json", "estimate.txt"]
    assert main([*verb, "--recipe", str(tmp_path / "estimate.json"), "--heavy-tail", "-q"], study=study) == 0
    (_, first), (_, second) = study.calls
    assert (first["recipe"], first["heavy_tail"]) == (None, False)
    assert (second["recipe"], second["heavy_tail"]) == (recipe, True)
    (tmp_path / "odd.json").write_text("[1]")
    assert main([*verb, "--recipe", str(tmp_path / "odd.json")]) == 2
    assert "is no recipe of an answer" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "words"),
    [(["--risk", "large"], "--risk"), (["--risk", "cvar:2"], "is no part"), (["--cheaper", "a"], "--cheaper")],
)
def test_odd_arguments_of_an_estimate(option, words, capsys):
    assert main(["estimate", PAPER, "--of", "depth", "--error", "1", *option], study=Study(answer())) == 2
    assert words in capsys.readouterr().err


def test_arguments_of_derivatives(tmp_path, capsys):
    slopes = lw.studies.Derivatives(
        ("depth",), ("m",), ("vehicle.mass",), np.ones(1), np.full((1, 1), np.nan), np.full((1, 1), np.nan),
        np.full((1, 1), np.nan), {"depth by vehicle.mass": "there is none"},
    )  # fmt: skip
    study = Study(slopes)
    verb = ["derivatives", PAPER, "--of", "depth", "--by", "vehicle.mass", "--out", str(tmp_path)]
    assert main([*verb, "-q"], study=study) == 0
    more = ["--of", "max(depth)", "--by", "start.position[2]", "--smooth", "--fleet", "--threads", "2", "--seed", "7"]
    assert main([*verb, *more], study=study) == 0
    ((scene, *asked), plain), ((fleet, *others), settings) = study.calls
    assert (type(scene), asked) == (lw.Scene, [["depth"], ["vehicle.mass"]])
    assert plain == {"smooth": False, "threads": None, "progress": None}
    assert (type(fleet), others) == (lw.Ensemble, [["depth", "max(depth)"], ["vehicle.mass", "start.position[2]"]])
    assert (fleet.seed, settings["smooth"], settings["threads"]) == (7, True, 2)
    assert "undefined   depth by vehicle.mass: there is none" in capsys.readouterr().out
    assert lw.studies.Derivatives.load(tmp_path / "derivatives.json").undefined == slopes.undefined
    content = document([*verb], capsys, study=study)["content"]["derivatives"]
    assert content["jacobian"] == [[None]]


@pytest.mark.parametrize("words, remedy", [
    ("peak depth over 12", 'write "peak depth above 12"'),
    ("max(depth) > 4 m", 'write "max(depth) above 4"'),
    ("depth under", 'write "depth below 12.0"'),
    ("depth", 'write "depth above 12.0"'),
    ("max(dpeth) above 3", "did you mean 'depth'?"),
    ("dpeth", "is neither a quantity nor an event"),
])  # fmt: skip
def test_words_of_a_rare_event_are_read_before_anything_runs(words, remedy, capsys):
    assert main(["rare", str(PAPER), "--when", words]) == 2
    assert remedy in capsys.readouterr().err
