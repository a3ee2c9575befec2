# SPDX-License-Identifier: Apache-2.0
"""The verbs of studies: what their options reach, what they write and how they end. No study runs."""

import dataclasses
import inspect
import json
import math
import shlex
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
from tests.house.test_defaults import ENTRY
from tests.studies.test_saved_answers import tuned
from tests.support.verbs import Study, main
from tests.unit.cli.test_terminal import document, region, sobol
from tests.unit.measuring.test_cost import found as tradeoff_of
from tests.unit.uncertainty.test_estimating import answer

PAPER = str(ROOT / "examples" / "paper.toml")
SCENE = str(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
RUN = {"t1": "duration", "method": "method", "h": "step", "dtype": "dtype"}
# Verb -> its functions, and those of their arguments that no option can be.
VERBS = {
    "tradeoff": ([lw.tradeoff], set()), "estimate": ([lw.estimate], set()),
    "sensitivity": ([uq.sobol, uq.morris], {"vary"}), "stability": ([lw.stability_map], set()),
    "rare": ([lw.rare_event], set()), "derivatives": ([lw.derivatives], {"save"}),
    "margins": ([lw.linear.margins], set()), "worst-case": ([lw.worst_case], set()), "tune-gains": ([lw.tune_gains], set()),
    "trim": ([lw.linear.trim], set()),
}  # fmt: skip
# Options of verbs that are arguments of no function.
OWN = {"-h", "-q", "-v", "--json", "--color", "--out", "--set", "--duration", "--method", "--step", "--dtype", "--threads",
       "--members", "--seed", "--analysis", "--grid", "--fleet"}  # fmt: skip


@pytest.mark.parametrize("verb", VERBS)
def test_options_are_the_arguments_of_the_function(verb):
    """An option is called as its argument, has no default of its own, and its help is the docstring's."""
    functions, without = VERBS[verb]
    actions = {
        action.option_strings[0]: action for action in cli.parser().verbs[verb]._actions if action.option_strings
    }
    options = {
        f"--{RUN.get(name, name).replace('_', '-')}": (function, parameter)
        for function in reversed(functions)
        for name, parameter in list(inspect.signature(function).parameters.items())[1:]
        if parameter.kind is not parameter.VAR_KEYWORD and name not in without | {"progress"}
    }
    assert options.keys() - actions.keys() == set()
    assert actions.keys() - options.keys() <= OWN
    for name, (function, parameter) in options.items():
        action = actions[name]
        assert action.required == (parameter.default is parameter.empty), name
        assert action.default in (None, []), name
        text = " ".join(dict(ENTRY.findall(inspect.getdoc(function)))[parameter.name].split()).rstrip(".")
        if parameter.name not in RUN and not text.lower().startswith("as of"):
            assert text in action.help.replace("%%", "%"), name


# Verbs beside studies -> what they call in Python, and their options that are no arguments of it.
CALLS = {
    "run": ([lw.solve, lw.suggest, lw.Method, lw.Store], {"--live", "--viewer"}),
    **dict.fromkeys(("predict", "plan"), ([lw.predict, lw.solve, lw.Store], set())), "resume": ([lw.resume], set()),
    "merge": ([lw.merge], set()), "export": ([lw.export], set()), "report": ([lw.report], {"--open"}),
    "check": ([lw.solve], set()), "sweep": ([lw.sweep], {"--plan", "--record"}), "view": ([lw.record], {"--movie"}),
    "warm": ([lw.solve], {"--methods", "--dtypes"}), "new": ([], {"--vehicle"}), "bench": ([], {"--members", "--steps"}),
    "footprint": ([lw.studies.footprint], set()),
    **dict.fromkeys(("example", "info", "list", "schema", "plot", "completion", "help"), ([], set())),
}  # fmt: skip
# Options that are keys of a scene file; a word of `existing` of a Store, and its dtype beside that of the run.
OF_FILES = {"--step", "--duration", "--members", "--seed"}
OF_STORES = {"--overwrite": "existing", "--resume": "existing", "--store-dtype": "dtype"}


def test_options_of_other_verbs_are_called_as_arguments():
    verbs, common = cli.parser().verbs, {"-h", "-q", "-v", "--json", "--color", "--out", "--set"}
    assert CALLS.keys() | VERBS.keys() == verbs.keys()
    for verb, (functions, own) in CALLS.items():
        options = {action.option_strings[0] for action in verbs[verb]._actions if action.option_strings}
        arguments = {name for function in functions for name in inspect.signature(function).parameters}
        called = OF_STORES if lw.Store in functions else {}
        others = {each for each in options - common - (set() if verb == "bench" else OF_FILES)
                  if called.get(each, each.strip("-").replace("-", "_")) not in arguments}  # fmt: skip
        assert others == own, verb


def draw(finding, *, path):
    """Stands for what draws a picture."""
    path.write_text("a picture")


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


class Rare:
    """Answer of a search for a rare event."""

    def save(self, out):
        (out / "rare.json").write_text('{"answer": "the probability in words"}')
        return [out / "rare.json"]

    def to_dict(self):
        return {"probability": 1e-5}

    def __str__(self):
        return "the probability in words"


def slopes():
    """Derivatives, of which there are none."""
    return lw.studies.Derivatives(
        ("depth",), ("m",), ("vehicle.mass",), np.ones(1), np.full((1, 1), np.nan), np.full((1, 1), np.nan),
        np.full((1, 1), np.nan), {"depth by vehicle.mass": "there is none"},
    )  # fmt: skip


FOUND = {
    "tradeoff": lambda: tradeoff_of(4.0), "estimate": answer, "sensitivity": sobol, "stability": region, "rare": Rare,
    "derivatives": slopes, "margins": lambda: loops("", "", "does not settle", ""), "worst-case": worst, "trim": steady,
    "tune-gains": tuned,
}  # fmt: skip
BOUNDS = {"vehicle.buoyancy": (297.0, 302.0)}
RARE = {"limit": "position[0] above 60"}
MASS = {"of": ["depth"], "by": ["vehicle.mass"]}
# Options of a verb, and the arguments that its function is called with.
CASES = [
    ("tradeoff", "", {}),
    ("tradeoff", "--of depth --methods rk4,kl8(psi_x) --methods psi --seconds 3 --members 7",
     {"of": "depth", "methods": ["rk4", "kl8(psi_x)", "psi"], "seconds": 3.0, "members": 7}),
    ("estimate", "--of depth --error 0.1", {"of": "depth", "error": 0.1}),
    ("estimate", "--of max(depth) --relative-error 0.01 --risk cvar:0.1 --cheaper controller.delay=0 --step 0.1 --method rk4 "
     "--seed 7 --threads 1 --dtype float32 --store kept --heavy-tail --duration 3",
     {"of": "max(depth)", "relative_error": 0.01, "risk": lw.metrics.CVaR(0.1), "cheaper": [{"controller.delay": 0.0}],
      "h": 0.1, "method": "rk4", "seed": 7, "threads": 1, "dtype": "float32", "store": "kept", "heavy_tail": True,
      "t1": 3.0}),
    ("estimate", "--of depth --risk 0.95 --error none --no-heavy-tail",
     {"of": "depth", "risk": 0.95, "error": None, "heavy_tail": False}),
    ("sensitivity", "--of depth", {"of": ["depth"]}),
    ("sensitivity", "--of depth --of speed --no-second-order --samples 8 --replicates 4 --failed drop --threads 3 "
     "--groups start=start.position,start.velocity --groups mass=vehicle.mass",
     {"of": ["depth", "speed"], "second_order": False, "samples": 8, "replicates": 4, "failed": "drop", "threads": 3,
      "groups": {"start": ["start.position", "start.velocity"], "mass": ["vehicle.mass"]}}),
    ("sensitivity", "--of depth --analysis morris --levels 6", {"of": ["depth"], "levels": 6}),
    ("stability", "", {}),
    ("stability", "--x h=0.1:1 --y vehicle.mass --methods psi --points 5,4 --error 0.5 --of depth --duration 9 --seed 11",
     {"x": "h=0.1:1", "y": "vehicle.mass", "methods": ["psi"], "points": (5, 4), "error": 0.5, "of": "depth", "t1": 9.0,
      "seed": 11}),
    ("rare", "--limit position[0]_above_60", RARE),
    ("rare", "--limit position[0]_above_60 --relative-error 0.2 --cheaper h=0.1,dtype=float32 --cheaper vehicle.mass=5 "
     "--failed refuse --most 5e4 --seed 7 --threads 2 --by splitting --intervals 20 --store kept",
     RARE | {"relative_error": 0.2, "cheaper": [{"h": 0.1, "dtype": "float32"}, {"vehicle.mass": 5.0}],
             "failed": "refuse", "most": 50_000, "seed": 7, "threads": 2, "by": "splitting", "intervals": 20,
             "store": "kept"}),
    ("derivatives", "--of depth --by vehicle.mass", MASS),
    ("derivatives", "--of depth --by vehicle.mass,start.position[2] --smooth --threads 2 --seed 7",
     {"of": ["depth"], "by": ["vehicle.mass", "start.position[2]"], "smooth": True, "threads": 2, "seed": 7}),
    ("margins", "", {}),
    ("margins", "--loop depth_pid --of disk,gain --of peak --to position[2] --by runs --skew -0.5 --tilt 1e-4 --most 20",
     {"loop": "depth_pid", "of": ["disk", "gain", "peak"], "to": ["position[2]"], "by": ["runs"], "skew": -0.5,
      "tilt": 1e-4, "most": 20.0}),
    ("worst-case", "--of depth --within vehicle.buoyancy=297:302", {"of": "depth", "within": BOUNDS}),
    ("worst-case", "--of depth --within vehicle.buoyancy=297:302,heading_pid.kp=0.5:5:log --worst smallest --budget 400 "
     "--restarts 2 --seed 9 --threads 1",
     {"of": "depth", "within": BOUNDS | {"heading_pid.kp": (0.5, 5.0, "log")}, "worst": "smallest", "budget": 400,
      "restarts": 2, "seed": 9, "threads": 1}),
    ("tune-gains", "--over heading_pid.kp=0.1:10:log --minimise depth --risk cvar:0.1 --fresh none --budget 1e3",
     {"over": {"heading_pid.kp": (0.1, 10.0, "log")}, "minimise": "depth", "risk": lw.metrics.CVaR(0.1), "fresh": None,
      "budget": 1000}),
    ("trim", "", {}),
    ("trim", "--speed 0.5 --fixed pitch=0 --fixed control_fins[0]=-0.1 --free roll,drift",
     {"speed": 0.5, "fixed": {"pitch": 0.0, "control_fins[0]": -0.1}, "free": ["roll", "drift"]}),
]  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize(("verb", "options", "expected"), CASES)
def test_options_reach_the_function(verb, options, expected, tmp_path, capsys):
    """An absent option is not passed on: the function's own default holds."""
    study = Study(FOUND[verb]())
    words = [word.replace("_above_", " above ") for word in options.split()]
    for loud in ([], ["-q"]):
        assert main([verb, SCENE, *words, "--out", str(tmp_path), *loud], study=study, draw=draw) == 0
    ((scene,), settings), (_, quiet) = study.calls
    assert (bool(settings.pop("progress", True)), quiet.pop("progress", False)) == (True, False)
    assert settings == quiet == expected
    # A seed of the function leaves that of the members alone.
    assert scene.ensemble_settings.seed == 1
    said = capsys.readouterr().out
    assert said.endswith(f"{FOUND[verb]()}\n")
    stem = verb.replace("-", "_")
    assert json.loads((tmp_path / f"{stem}.json").read_text())["answer"] == said.splitlines()[-1]
    assert f"file        {tmp_path}/{stem}.json" in said
    assert (tmp_path / f"{stem}.png").exists() == (verb in ("tradeoff", "sensitivity", "stability", "rare", "margins"))


ESTIMATE = ["estimate", PAPER, "--of", "depth", "--error", "1"]


@pytest.mark.parametrize(("inputs", "words"), [
    (["sensitivity", PAPER, "--of", "depth", "--groups", "start"], ["--groups = 'start' names nothing. Give NAME=A,B"]),
    (["sensitivity", PAPER, "--of", "depth", "--levels", "4"], ["--levels = '4' is an option of morris. Leave it out"]),
    (["rare", PAPER, "--limit", "depth above 3", "--cheaper", "h"], ["--cheaper = 'h' names no value. Give A=X,B=Y"]),
    ([*ESTIMATE, "--risk", "large", "--cheaper", "a", "--seed", "1.5"],
     ["--risk = 'large' is not a risk", "--cheaper = 'a' names no value", "--seed = '1.5' is not a whole",
      "3 faults"]),
    ([*ESTIMATE, "--risk", "cvar:2"], ["is not a part"]),
    (["stability", PAPER, "--points", "3,x", "--error", "low"],
     ["--points = '3,x' is not a whole number", "--error = 'low' is not a number. Give one, as 0.5"]),
    *[(["stability", PAPER, "--grid", "mass", axis, "h"],
       ["--grid mass names the same axes as --x and --y. Leave out --grid, or both of them"]) for axis in ("--x", "--y")],
    (["worst-case", SCENE, "--of", "depth", "--within", "=1:2", "--within", "a"],
     ["--within = '=1:2' names no value. Give NAME=LOW:HIGH", "--within = 'a'"]),
    (["worst-case", SCENE, "--of", "depth", "--within", "vehicle.mass=4", "--within", "vehicle.buoyancy=1:2:lg"],
     ['within."vehicle.mass" = 4.0', 'within."vehicle.buoyancy"']),
    (["worst-case", SCENE, "--of", "depth", "--within", "vehicle.buoyance=4:5"],
     ["within.\"vehicle.buoyance\" = '...' does not name what the scene has. Did you mean 'vehicle.buoyancy'?"]),
    (["worst-case", SCENE, "--of", "depth", "--within", "start.velocity=4:5"],
     ["within.\"start.velocity\" = '...' is not a single number"]),
    (["trim", SCENE, "--fixed", "pitch", "--fixed", "roll=low", "--fixed", "=2"],
     ["--fixed = 'pitch' is not a value. Give NAME=0.1", "'roll=low'", "'=2'"]),
    (["margins", SCENE, "--loop", "heading", "--skew", "2"],
     ["loop = 'heading' is not a law of the controller. Did you mean 'heading_pid'?",
      "skew = 2.0 is above 1. Give a number from -1 to 1"]),
    (["margins", PAPER],
     ["controller = None is not in the scene, and margins are those of a loop. Give [controller]"]),
    *[(["rare", PAPER, "--limit", limit], [remedy]) for limit, remedy in [
        ("peak depth over 12", 'Write "peak depth above 12"'), ("max(depth) > 4 m", 'Write "max(depth) above 4"'),
        ("depth under", 'Write "depth below 12.0"'), ("depth", 'Write "depth above 12.0"'),
        ("max(dpeth) above 3", "Did you mean 'depth'?"), ("dpeth", "is neither a quantity nor an event"),
    ]],
])  # fmt: skip
def test_odd_arguments_are_refused_all_at_once(inputs, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main([*inputs, "-q"]) == 2
    out = capsys.readouterr()
    assert all(text in out.err for text in words), out.err
    assert out.out == ""
    assert not list(tmp_path.rglob("*.json"))


def test_files_are_named_after_the_scene(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["tradeoff", PAPER, "-q"], study=Study(tradeoff_of(4.0)), draw=draw) == 0
    assert capsys.readouterr() == ("", "")
    files = sorted(path.name for path in (tmp_path / "runs" / "paper_tradeoff").iterdir())
    assert files == [f"tradeoff.{end}" for end in ("csv", "json", "png")]


def test_a_method_that_was_asked_for_and_has_no_measurement_ends_with_1(tmp_path, capsys):
    found = dataclasses.replace(tradeoff_of(4.0), missing={"rk8": "members failed at every step that was tried"})
    verb = ["tradeoff", PAPER, "--methods", "rk4,rk8", "--out", str(tmp_path / "b")]
    assert main(verb, study=Study(found), draw=draw) == 1
    out, err = capsys.readouterr()
    assert "lgvi-warp: --methods rk8 has no measurement: members failed at every step" in err
    assert "\n\nmissing     rk8: members failed" in out
    assert (tmp_path / "b" / "tradeoff.png").exists()
    assert json.loads((tmp_path / "b" / "tradeoff.json").read_text())["missing"] == found.missing


def test_a_picture_that_fails_is_an_exit_code(tmp_path, capsys):
    for error, code, text in ((OSError("no room"), 1, "no room"), (NothingToDraw("no rows"), 0, "no rows")):
        parts = {"study": Study(tradeoff_of(4.0)), "draw": Study(error)}
        assert main(["tradeoff", PAPER, "--out", str(tmp_path), "-q"], **parts) == code
        picture = tmp_path / "tradeoff.png"
        assert capsys.readouterr().err == f"lgvi-warp: {picture} was not written: {text}\n"


@pytest.mark.parametrize(
    ("error", "code"), [(uq.FailedMembers("3 members failed"), 1), (MissingExtra("studies", "SALib", "uq"), 2)]
)
def test_a_sensitivity_study_that_fails_is_one_line(tmp_path, capsys, error, code):
    assert main(["sensitivity", PAPER, "--of", "depth", "--out", str(tmp_path), "-q"], study=Study(error)) == code
    assert capsys.readouterr() == ("", f"lgvi-warp: {error}\n")
    assert not list(tmp_path.iterdir())


def test_grids_of_a_stability_study(tmp_path, capsys):
    study = Study(region())
    verb = ["stability", PAPER, "--out", str(tmp_path)]
    assert main([*verb, "--grid", "mass"], study=study, draw=draw) == 0
    assert (tmp_path / "stability_mass.png").exists()
    assert main([*verb, "--grid", "all"], study=study, draw=draw) == 0
    assert [(settings["x"], settings["y"]) for _, settings in study.calls] == [GRIDS["mass"], *GRIDS.values()]
    assert all(callable(settings["progress"]) for _, settings in study.calls)
    assert {path.name for path in tmp_path.glob("*.json")} == {f"stability_{name}.json" for name in GRIDS}
    # One report for each, and a blank line between them.
    report = str(region())
    assert capsys.readouterr().out.endswith(f"\n\n{report}\n\n{report}\n\n{report}\n")


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
    _, (((), settings),), found = sweep()
    assert (settings["members"], settings["seed"]) == (40, 1)
    assert settings["progress"] is not None
    assert found.runs == []  # nothing is recorded that was not asked for
    lines = capsys.readouterr().out.split("\n")
    assert lines[-3:] == ["", "the sweep in words", ""]
    assert [line.partition(" (")[0] for line in lines[:-3]] == [
        f"file        {tmp_path}/out/sweep.json", f"file        {tmp_path}/out/a.png"]  # fmt: skip
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


def test_an_estimate_is_written_and_run_again_by_its_file(tmp_path, capsys):
    """The folder has the answer with its recipe, which --recipe gives to the next."""
    recipe = {"setting": {"method": "psi_x", "h": 0.025}, "levels": [], "seed": 3}
    study = Study(dataclasses.replace(answer(), recipe=recipe))
    verb = ["estimate", PAPER, "--of", "mean depth"]
    assert main([*verb, "--error", "0.1", "--out", str(tmp_path), "-q"], study=study) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["estimate.csv", "estimate.json", "estimate.txt"]
    assert main([*verb, "--recipe", str(tmp_path / "estimate.json"), "--heavy-tail", "-q"], study=study) == 0
    (_, first), (_, second) = study.calls
    assert "recipe" not in first
    assert (second["recipe"], second["heavy_tail"]) == (recipe, True)
    (tmp_path / "odd.json").write_text("[1]")
    assert main([*verb, "--recipe", str(tmp_path / "odd.json")]) == 2
    assert "is not a recipe of an answer" in capsys.readouterr().err


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


def test_the_worst_member_is_run_again_by_a_line(tmp_path, capsys):
    given = ["worst-case", SCENE, "--of", "max(depth)", "--within", "vehicle.buoyancy=297:302", "--out", str(tmp_path),
             "--method", "rk4", "--step", "0.05", "--duration", "20", "--set", "run.save_every=0.5"]  # fmt: skip
    study = Study(worst())
    assert main(given, study=study) == 0
    (((scene,), settings),) = study.calls
    assert (scene.run.step, scene.run.duration, settings["h"], settings["t1"]) == (0.05, 20.0, 0.05, 20.0)
    lines = capsys.readouterr().out.splitlines()
    again = next(i for i, line in enumerate(lines) if line.startswith("again "))
    assert lines[again + 1 :] == str(worst()).splitlines()
    command = shlex.split(lines[again].removeprefix("again "))
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


def test_a_trim_gives_the_start_of_a_scene(tmp_path, capsys):
    study = Study(steady())
    assert main(["trim", SCENE, "--method", "psi_s", "--step", "0.02"], study=study) == 0
    (((scene,), settings),) = study.calls
    assert (scene.run.step, settings) == (0.02, {"method": "psi_s", "h": 0.02})
    told = capsys.readouterr().out
    start = {"euler_deg": [0.0, 0.0, 90.0], "velocity": [0.5, 0.0, 0.0]}
    assert told == "".join(["[start]\n", *(f"{name} = {value}\n" for name, value in start.items()), f"\n{steady()}\n"])
    content = document(["trim", SCENE], capsys, study=study)
    assert (content["start"], content["commands"]) == (start, {"thrusters": [0.25, -0.5]})
    assert (content["method"], content["step"], len(content["residual"])) == ("psi_s", 0.02, 6)
    content = document(["trim", SCENE, "--out", str(tmp_path)], capsys, name="trim with out", study=study)
    assert content["content"]["trim"] == json.loads((tmp_path / "trim.json").read_text())


def test_derivatives_of_a_fleet(tmp_path, capsys):
    study = Study(slopes())
    verb = ["derivatives", PAPER, "--of", "depth", "--by", "vehicle.mass", "--out", str(tmp_path)]
    assert main([*verb, "--fleet", "--members", "9"], study=study) == 0
    assert "undefined   depth by vehicle.mass: there is none" in capsys.readouterr().out
    content = document([*verb], capsys, study=study)["content"]["derivatives"]
    assert content["jacobian"] == [[None]]
    ((fleet,), _), ((scene,), _) = study.calls
    assert (type(fleet), fleet.members, type(scene)) == (lw.Ensemble, 9, lw.Scene)
