# SPDX-License-Identifier: Apache-2.0
"""The command for people and for programs: help, faults, colors, completion, lists, and one JSON document for each verb."""

import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.accuracy.stability.grid import Line
from lgvi_warp.accuracy.stability.map import StabilityMap
from lgvi_warp.accuracy.tradeoff import Tradeoff
from lgvi_warp.calls import predict as prediction
from lgvi_warp.cli import arguments, command, completion, output, signals
from lgvi_warp.uncertainty.sensitivity.indices import Indices, MorrisEffects, SobolIndices
from tests.conftest import ROOT
from tests.support.json_page import TABLES, differing
from tests.support.verbs import Study, main
from tests.unit.measuring.test_cost import found as tradeoff_of

PAPER = str(ROOT / "examples" / "paper.toml")
SMALL = ["--members", "20", "--duration", "2", "--set", "run.save_every=0.5"]


def ended(arguments):
    """The exit code of a command that its parser ends."""
    with pytest.raises(SystemExit) as end:
        cli.main(arguments)
    return end.value.code


# Help and faults ---------------------------------------------------------------------------------------------------------


def test_the_version(capsys):
    assert ended(["--version"]) == 0
    assert capsys.readouterr().out == f"lgvi-warp {lw.__version__}\n"


@pytest.mark.parametrize("module", ["lgvi_warp", "lgvi_warp.cli"])
def test_python_runs_the_package(module):
    done = subprocess.run([sys.executable, "-m", module, "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"lgvi-warp {lw.__version__}\n", "")


def test_alone_it_helps(capsys):
    assert cli.main([]) == 0
    out = capsys.readouterr()
    assert out.out == cli.parser().format_help()
    assert out.err == ""


@pytest.mark.parametrize(("inputs", "usage", "words"), [
    (["rnu"], "lgvi-warp", "'rnu' is not known. Did you mean 'run'?"),
    (["run", PAPER, "--sed", "1", "--stepp", "2"], "lgvi-warp run", "'--stepp' is not known. Did you mean '--step'?"),
    (["run", PAPER, "--store", "zar"], "lgvi-warp run", "'zar' is not known. Did you mean 'zarr'?"),
    (["list", "vehicle"], "lgvi-warp list", "'vehicle' is not known. Did you mean 'vehicles'?"),
    (["check", PAPER, "more"], "lgvi-warp check", "'more' is not known"),
    (["check", "--color", "allways", PAPER], "lgvi-warp check", "Did you mean 'always'?"),
    (["merge", "a"], "lgvi-warp merge", "--out"), (["--json"], "lgvi-warp", "VERB"),
])  # fmt: skip
def test_a_fault_has_the_verbs_usage_and_the_nearest_name(inputs, usage, words, capsys):
    assert ended(inputs) == 2
    text = capsys.readouterr().err
    assert text.startswith(f"usage: {usage} [-h]")
    assert words in text.splitlines()[-1]


def test_every_verb_says_what_it_does(capsys):
    for verb in cli.parser().verbs:
        assert ended([verb, "--help"]) == 0
        out = " ".join(capsys.readouterr().out.split())
        assert cli.parser().verbs[verb].description in out
        assert "--json" in out


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("name", ["quiet", "verbose", "json", "color"])
def test_the_options_of_every_verb_stand_before_or_after_it(name, place):
    option = ["--color", "never"] if name == "color" else [f"--{name}"]
    words = [["check", PAPER]]
    words.insert(place, option)
    chosen = arguments.parsed([word for group in words for word in group])
    expected = arguments.DEFAULTS | {name: "never" if name == "color" else True}
    assert {key: getattr(chosen, key) for key in expected} == expected


def test_verbose_says_where_an_error_came_from(capsys):
    bad = ["check", PAPER, "--set", "vehicle.mass=-1"]
    assert cli.main(bad) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert cli.main([*bad, "-v"]) == 2
    text = capsys.readouterr().err
    assert "Traceback" in text
    assert text.splitlines()[-1].startswith("lgvi-warp: vehicle.mass = -1")


def test_every_verb_is_of_those_that_write_or_of_those_that_do_not():
    writing = {"run", "resume", "merge", "export", "tradeoff", "sensitivity", "stability", "sweep", "rare",
               "derivatives", "margins", "worst-case", "tune-gains", "new", "plot", "report", "view",
               "footprint"}  # fmt: skip
    assert writing | set(command.READING) == set(command.VERBS) == set(cli.parser().verbs)
    assert not writing & set(command.READING)


# Colors ------------------------------------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("terminal", "choice", "environment", "expected"), [
    (True, "auto", {}, True), (False, "auto", {}, False), (True, "auto", {"NO_COLOR": "1"}, False),
    (True, "auto", {"NO_COLOR": ""}, True), (True, "auto", {"TERM": "dumb"}, False), (True, "never", {}, False),
    (False, "always", {"NO_COLOR": "1"}, True),
])  # fmt: skip
def test_when_there_are_colors(terminal, choice, environment, expected, monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    stream = signals.Lasting(Terminal() if terminal else io.StringIO())
    stream.color = choice
    assert output.colored(stream) is expected


def test_labels_and_faults_are_in_colors_and_texts_stay_the_same(capsys):
    plain, painted = [], []
    for texts, color in ((plain, "never"), (painted, "always")):
        assert cli.main(["check", PAPER, "--set", "start.euler_deg=[1,2,3]", "--color", color]) == 2
        assert cli.main(["check", PAPER, "--color", color]) == 0
        texts += capsys.readouterr()
    assert "\x1b" not in "".join(plain)
    assert "\x1b[1mscene\x1b[0m       " in painted[0]
    assert painted[1].startswith("\x1b[31mlgvi-warp:\x1b[0m ")
    assert [re.sub(r"\x1b\[\d*m", "", text) for text in painted] == plain


# Lists, scenes to begin with, completion ----------------------------------------------------------------------------------


def listed(what, capsys):
    assert cli.main(["list", what]) == 0
    return dict(re.split(r" {2,}", line, maxsplit=1) for line in capsys.readouterr().out.splitlines())


def test_every_method_that_is_listed_is_one(capsys):
    methods = listed("methods", capsys)
    assert {"psi_s", "kl8(psi_x)", "bm4(psi_x)", "rk4", "gauss6", "rkn6_14"} <= methods.keys()
    for name, text in methods.items():
        assert text.startswith(f"order {lw.Method(name).order}, ")


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_but("remus_100", "eca_a9")
@pytest.mark.parametrize("name", lw.vehicles.names())
def test_a_new_scene_can_run_and_is_not_odd(name, tmp_path, capsys):
    path = tmp_path / "scenes" / "dive.toml"
    assert cli.main(["new", str(path), "--vehicle", name]) == 0
    assert capsys.readouterr().out == f"file        {path}\nnext        lgvi-warp check {path}\n"
    assert cli.main(["check", str(path)]) == 0
    # The published inertia of the ECA A9 is none that a body can have: said, and nothing else.
    noted = name == "eca_a9"
    told = capsys.readouterr().out.splitlines()
    assert [line.startswith("note") for line in told].count(True) == noted
    assert told[-1] == "result      can run" + (", with notes: nothing is refused for them" if noted else "")
    # What is in comments is right too.
    free = re.sub(r"^# (?=\w+ = |\[\[?\w+\]\]?$)", "", path.read_text(), flags=re.MULTILINE)
    path.write_text(free)
    assert lw.Scene.load(path).run.method == "psi_x"
    assert "current" in [term.type for term in lw.Scene.load(path).terms]


def test_new_keeps_a_file_that_is_there_and_knows_its_vehicles(tmp_path, capsys):
    path = tmp_path / "dive.toml"
    path.write_text("mine")
    assert cli.main(["new", str(path)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert path.read_text() == "mine"
    assert cli.main(["new", str(tmp_path / "a.toml"), "--vehicle", "remus"]) == 2
    assert "Did you mean 'remus_100'?" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [path]


def test_the_schema_is_json(capsys):
    assert cli.main(["schema", "-q"]) == 0
    assert set(json.loads(capsys.readouterr().out)["properties"]) >= {"vehicle", "terms", "controller"}


def listed_methods():
    """Methods by the words of their error."""
    with pytest.raises(lw.SceneError) as refused:
        lw.Method("none such")
    return re.findall(r"[a-z]+\w*", str(refused.value))


@pytest.fixture(scope="module")
def bash(tmp_path_factory):
    """A function of words, of which the last is begun: what bash would offer."""
    shell = shutil.which("bash")
    if shell is None:
        pytest.skip("there is no bash")
    folder = tmp_path_factory.mktemp("bash")
    (folder / "scene file.toml").touch()
    with (folder / "script").open("w") as file:
        subprocess.run([sys.executable, "-m", "lgvi_warp", "completion", "bash"], stdout=file, check=True, cwd=ROOT)

    def offered(*words):
        code = 'source ./script; COMP_WORDS=("$@"); COMP_CWORD=$(($#-1)); _shtab_lgvi_warp; printf "%s\\n" "${COMPREPLY[@]}"'
        done = subprocess.run([shell, "-c", code, "-", "lgvi-warp", *words], capture_output=True, text=True, cwd=folder)
        assert done.stderr == ""
        return done.stdout.split("\n")[:-1]

    return offered


def test_bash_completes_verbs_options_values_and_files(bash):
    assert bash("res") == ["resume"]
    assert set(bash("")) == set(cli.parser().verbs)
    assert "--version" in bash("--")
    assert bash("run", "x", "--store-") == ["--store-dtype"]
    assert bash("run", "x", "--store", "") == ["npz", "zarr"]
    assert bash("list", "ve") == ["vehicles"]
    assert bash("--json", "check", "--colo") == ["--color"]
    assert bash("-q", "run", "--color", "a") == ["auto", "always"]
    assert {"psi", "psi_s", "psi_x"} <= set(bash("run", "x", "--method", "ps")) <= set(listed_methods())
    assert bash("new", "x", "--vehicle", "re") == ["remus_100", "rexrov"]
    assert bash("export", "x", "--to", "n") == ["netcdf"]
    assert bash("run", "x", "--dtype", "f") == ["float64", "float32", "float32_compensated"]
    assert bash("--color", "ne") == ["never"]
    assert bash("--color", "never", "exp") == ["export"]
    assert bash("help", "tr") == ["tradeoff", "trim"]
    assert bash("--color", "auto", "run", "--solver", "new") == ["newton"]
    assert bash("check", "sce") == ["scene file.toml"]
    assert bash("run", "sce") == ["scene file.toml"]
    assert bash("run", "x", "--out", "sce") == ["scene file.toml"]


def test_help_of_a_verb_is_what_its_option_prints(capsys):
    for words, same in ((["help", "run"], ["run", "--help"]), (["help"], [])):
        assert cli.main(words) == 0
        text = capsys.readouterr().out
        if same:
            with pytest.raises(SystemExit):
                cli.main(same)
        else:
            assert cli.main(same) == 0
        assert text == capsys.readouterr().out
        assert "usage: lgvi-warp" in text
    with pytest.raises(SystemExit):
        cli.main(["help", "rum"])
    assert "Did you mean 'run'?" in capsys.readouterr().err


def test_the_options_of_run_stand_in_groups():
    groups = {group.title: [option for action in group._group_actions for option in action.option_strings]
              for group in cli.parser().verbs["run"]._action_groups}  # fmt: skip
    assert all(len(options) <= 9 for options in groups.values())
    assert len(groups) >= 7
    assert {"--method", "--step"} <= set(groups["method, step and precision"])
    assert "--store" in groups["files"]
    assert groups["options"] == ["-h", "--help"]
    assert "--color" in groups["options of every verb"]


@pytest.mark.parametrize("shell", completion.SHELLS)
def test_completion_has_every_verb_and_option(shell, capsys, tmp_path):
    assert cli.main(["completion", shell, "--quiet"]) == 0
    text = capsys.readouterr().out
    words = set(re.findall(r"[-\w]+", text))
    for name, verb in cli.parser().verbs.items():
        options = {option for action in verb._actions for option in action.option_strings}
        assert {name, *(option.lstrip("-") if shell in ("fish", "tcsh") else option for option in options)} <= words
    if program := shutil.which(shell):
        (tmp_path / "script").write_text(text)
        done = subprocess.run([program, "-n", str(tmp_path / "script")], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")


# One JSON document for each verb ------------------------------------------------------------------------------------------


def document(inputs, capsys, code=0, name="", **parts):
    """The document that a verb prints, which is as the page states."""
    assert main([*inputs, "--json", "--quiet"], **parts) == code
    content = json.loads(capsys.readouterr().out)
    assert differing(content, name or inputs[0]) == []
    assert (content["verb"], content["version"]) == (inputs[0], lw.__version__)
    return content


def test_the_page_has_every_verb():
    assert set(TABLES) >= set(cli.parser().verbs) - {"schema"}


def test_the_check_of_documents_finds_each_kind_of_fault():
    good = {"verb": "check", "version": "1", "scene": "a", "members": 3, "method": None, "notes": ["odd"]}
    assert differing(good, "check") == []
    for key, value, text in (
        ("members", 3.5, "check.members: 3.5 is not a whole number"),
        ("members", True, "check.members: True is not a whole number"),
        ("notes", [1], "check.notes[0]: 1 is not a text"),
        ("notes", "odd", "check.notes: no list"),
        ("more", 1, "check.more: not stated"),
    ):
        assert differing(good | {key: value}, "check") == [text]
    assert differing({key: good[key] for key in good if key != "scene"}, "check") == ["check.scene: missing"]


def test_documents_of_verbs_that_run_nothing(tmp_path, capsys):
    assert document(["check", PAPER, "--members", "7"], capsys)["members"] == 7
    odd = document(["check", PAPER, "--set", "vehicle.buoyancy=9000.0"], capsys)
    assert odd["notes"]
    for what in ("methods", "vehicles", "terms", "laws"):
        assert document(["list", what], capsys)["names"]
    assert document(["new", str(tmp_path / "a.toml")], capsys)["vehicle"] == "remus_100"
    assert "complete" in document(["completion", "fish"], capsys)["script"]
    assert document(["help", "run"], capsys)["of"] == "run"
    assert document(["help"], capsys)["of"] is None


def test_a_refused_verb_prints_no_document(capsys):
    assert cli.main(["check", PAPER, "--set", "vehicle.mass=-1", "--json"]) == 2
    assert capsys.readouterr().out == ""


def test_the_document_of_a_prediction(capsys):
    study = Study(prediction.Prediction(5, 4, 3, 2, 0.1, 0.2, 0.3, 0.4, 5, 6, None, 7))
    assert document(["plan", PAPER], capsys, study=study)["seconds"] == 0.2 + 0.4
    assert main(["predict", PAPER, "-q"], study=study) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.ci
@pytest.mark.kernel
def test_documents_of_a_run_and_its_folder(tmp_path, capsys):
    out = str(tmp_path / "paper")
    statistics = 'run.statistics=[{type = "mean", of = "depth"}, {type = "extremes", of = "speed"}]'
    run = ["run", PAPER, *SMALL, "--set", statistics, "--out", out]
    ran = document(run, capsys)
    assert ran["outcomes"] == {"ok": 20}
    assert ran["energy"]["all"]
    assert ran["samples"]["times"] == 5
    assert [path.rpartition("/")[2] for path in ran["files"]] == ["result.npz", "fleet.png", "fleet.rrd",
                                                                  "statistics.png"]  # fmt: skip
    depth = next(entry for entry in ran["statistics"] if entry["label"] == "mean depth")
    result = lw.Result.load(tmp_path / "paper" / "result.npz")
    assert depth["value"] == result.statistics["mean depth"].value[-1, 0]
    assert depth["unit"] == "m"
    assert next(entry for entry in ran["statistics"] if "maximum" in entry["label"])["lower"] is None
    (held,) = document(["info", out], capsys, name="info of a folder")["holds"]
    assert {key: held[key] for key in ran.keys() & held.keys()} == {key: ran[key] for key in ran.keys() & held.keys()}
    assert document(["report", out], capsys)["file"] == f"{out}/report.html"
    (tmp_path / "paper" / "fleet.png").unlink()
    drawn = document(["plot", out], capsys)["files"]
    assert sorted(path.rpartition("/")[2] for path in drawn) == ["fleet.png", "fleet.rrd", "statistics.png"]
    assert (tmp_path / "paper" / "fleet.png").exists()
    assert cli.main(["info", out, "-v"]) == 0
    said = capsys.readouterr().out
    assert "mean depth" in said
    assert "how         seed 1, " in said


@pytest.mark.ci
@pytest.mark.kernel
def test_documents_of_stores(tmp_path, capsys):
    run = ["run", PAPER, "--members", "300", *SMALL[2:], "--store", "zarr"]
    for name, part in (("a", "0:1"), ("b", "1:2")):
        content = document([*run, "--out", str(tmp_path / name), "--blocks", part], capsys)
        assert content["files"] == [str(tmp_path / name / "run.zarr")]
    one = document(["info", str(tmp_path / "a")], capsys, 1, "info of a folder")
    assert not one["complete"]
    assert one["holds"][0]["finished"] == 1
    parts = [str(tmp_path / "a"), str(tmp_path / "b")]
    assert document(["merge", parts[0], "--out", str(tmp_path / "half")], capsys, 1)["missing"] == 1
    assert document(["merge", *parts, "--out", str(tmp_path / "all")], capsys)["complete"]
    assert document(["info", str(tmp_path / "all")], capsys, name="info of a folder")["complete"]
    assert document(["resume", str(tmp_path / "all")], capsys)["vehicle_steps_per_second"] is None
    assert document(["export", str(tmp_path / "all"), "--to", "parquet"], capsys)["bytes"] > 0
    drawn = document(["plot", str(tmp_path / "all" / "run.zarr")], capsys)["files"]
    assert drawn == [f"{tmp_path}/all/{name}" for name in ("fleet.png", "fleet.rrd")]
    assert any(
        path.endswith(".parquet")
        for path in document(["info", str(tmp_path / "all")], capsys, name="info of a folder")["files"]
    )


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.skipif(os.name == "nt", reason="there are no pseudo-terminals")
def test_a_run_on_a_terminal(tmp_path):
    """Phases in place, to the end; then the line is blank, and the summary in colors."""
    import pty

    primary, secondary = pty.openpty()
    run = [sys.executable, "-m", "lgvi_warp", "run", PAPER, *SMALL, "--out", str(tmp_path), "-v"]
    environment = {name: value for name, value in os.environ.items() if name != "NO_COLOR"} | {"TERM": "xterm"}
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), secondary)
    with subprocess.Popen(run, cwd=ROOT, env=environment, **streams) as process:
        os.close(secondary)
        said = bytearray()
        with contextlib.suppress(OSError):  # EIO: the other end is closed
            while piece := os.read(primary, 4096):
                said += piece
        os.close(primary)
    text = said.decode().replace("\r\n", "\n")
    assert process.returncode == 0
    phases, _, summary = text.rpartition("\r")
    parts = [part.strip() for part in phases.split("\r")]
    names = [part.partition(",")[0].partition(" ")[0] for part in parts if part]
    assert list(dict.fromkeys(names)) in (["compiling", "writing"], ["compiling", "running", "writing"])
    assert parts[-1] == ""
    assert summary.startswith("\x1b[1mmembers\x1b[0m     20, psi_s")
    assert "\x1b[1mhow\x1b[0m         seed 1, " in summary
    look = f"\x1b[1mlook\x1b[0m        rerun {tmp_path}/fleet.rrd, or open {tmp_path}/fleet.png\n"
    assert summary.partition(look)[2] == "All 20 members end ok at 2 s.\n"


# Studies: their files are read back ----------------------------------------------------------------------------------------


def sobol():
    """Indices of two quantities and two factors, one of which did not vary."""
    first = np.array([[0.5, 0.25], [np.nan, np.nan]])
    second = np.full((2, 2, 2), np.nan)
    second[0, 0, 1] = second[0, 1, 0] = 0.125
    common = (("a", "b"), ("depth", "speed"), np.array([1.0, 2.0]), np.array([0.5, 0.0]), 8, 48, 1, 0.95, ("a note",),
              {"x": 1})  # fmt: skip
    return SobolIndices(*common, first, first / 8.0, first / 2.0, first / 16.0, second, second / 2.0)


def morris():
    """Effects of one factor."""
    one = np.array([[1.5]])
    return MorrisEffects(("a",), ("depth",), one[0], one[0], 4, 8, 0, 0.9, (), {}, one, one / 3.0, one * np.nan, one)


def region():
    """A map of two cells."""
    arrays = [{"psi": np.array([[0.0, np.inf]])}, {"psi": np.array([[0.5, 2.0]])}]
    lines = [Line("h", "step", "s", True, np.array([0.1, 1.0])), Line("speed", "speed", "m/s", False, np.array([2.0]))]
    classes, statuses = {"psi": np.array([[0, 3]])}, {"psi": np.array([[0, 4]])}
    ratios = {"psi": {"munk": np.array([[0.5, 5.0]])}}
    return StabilityMap(
        *lines, classes, *arrays, statuses, ratios, "attitude", 0.01, 1.0, 2.0, 4, "conservative", "itself", 0, {}
    )


STUDIES = {"tradeoff": lambda: tradeoff_of(4.0), "sensitivity": sobol, "stability": region}


@pytest.mark.parametrize(
    "make", [lambda: tradeoff_of(4.0), sobol, morris, region], ids=["tradeoff", "sobol", "morris", "map"]
)
def test_a_study_is_read_back_from_its_file(make, tmp_path):
    found = make()
    path = next(path for path in found.save(tmp_path) if path.suffix == ".json")
    kind = Indices if isinstance(found, Indices) else type(found)
    again = kind.load(path)
    assert type(again) is type(found)
    assert again.to_dict() == found.to_dict() == json.loads(path.read_text())
    if isinstance(found, Tradeoff):
        assert again.measurements == found.measurements
        assert again.front() == found.front()


@pytest.mark.ci
@pytest.mark.parametrize("verb", STUDIES)
def test_studies_print_a_document_and_info_and_plot_know_their_folders(verb, tmp_path, capsys):
    make = STUDIES[verb]
    study = Study(make())
    out = str(tmp_path)
    given = [verb, PAPER, *(["--of", "depth"] if verb == "sensitivity" else []), "--out", out]
    content = document(given, capsys, study=study)
    assert content["content"] == {verb: make().to_dict()}
    assert content["faults"] == []
    assert f"{out}/{verb}.png" in content["files"]
    assert main(given, study=study) == 0
    said = capsys.readouterr().out
    (held,) = document(["info", out], capsys, name="info of a folder")["holds"]
    assert (held["kind"], held["content"]) == (verb, make().to_dict())
    assert cli.main(["info", out]) == 0
    # The report of info is that of the verb.
    assert said.partition("\n\n")[2].strip() in capsys.readouterr().out
    (tmp_path / f"{verb}.png").unlink()
    assert document(["plot", out], capsys)["files"] == [f"{out}/{verb}.png"]
    (tmp_path / f"{verb}.json").write_text('{"name": 3}')
    assert cli.main(["info", out]) == 2
    assert f"{verb}.json is damaged" in capsys.readouterr().err
