# SPDX-License-Identifier: Apache-2.0
"""The verbs about the machine and about names, what they print in full; how the command ends; scripts for shells."""

import argparse
import errno
import gc
import inspect
import io
import json
import os
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli import command, completion, lists, machine, output, writing
from lgvi_warp.cli.signals import Lasting, Signals
from lgvi_warp.common import container
from lgvi_warp.common import machine as common
from lgvi_warp.common.phases import Phases
from lgvi_warp.engine import widths
from tests.conftest import ROOT
from tests.unit.cli.test_study_verbs import Study

PAPER = str(ROOT / "examples" / "paper.toml")


@pytest.fixture
def known(monkeypatch, tmp_path):
    """A machine of known numbers."""
    monkeypatch.setattr(common, "describe", lambda: {"cpu": "a cpu", "simd": "avx2", "threads": 4})
    monkeypatch.setattr(common, "memory_bytes", lambda: 3 * 2**30)
    monkeypatch.setattr(common, "physical_memory", lambda: 8 * 2**30)
    monkeypatch.setattr(common, "affinity", lambda: 4)
    monkeypatch.setattr(common, "versions", lambda: {"numpy": "2", "warp": "1"})
    monkeypatch.setattr(container, "cpu_quota", lambda: 1.5)
    monkeypatch.setattr(machine, "fma_peak", lambda dtype: {"float64": 1.25e10, "float32": 2.5e10}[dtype])
    monkeypatch.setattr(widths, "path", lambda: tmp_path / widths.FILE)
    monkeypatch.setattr(widths, "KERNELS", ("plain float64", "plain float32", "dense float64"))
    sources = {"plain": "tuned", "dense": "table"}
    monkeypatch.setattr(widths, "parts", lambda kernel: tuple(kernel.split()))
    width = lambda kind, dtype: SimpleNamespace(lanes=8 if dtype == "float64" else 16, source=sources[kind])  # noqa: E731
    monkeypatch.setattr(widths, "default_width", width)


def test_info_of_the_machine(known, tmp_path, monkeypatch, capsys):
    assert cli.main(["info"]) == 0
    assert (
        capsys.readouterr().out
        == f"""cpu         a cpu, avx2, 4 threads (a quota of 1.5 CPUs; 4 cores)
memory      3.0 GiB (the container's limit; 8.0 GiB in the machine)
versions    numpy 2, warp 1
float64     one core's peak 12.5 GFMA/s
float32     one core's peak 25.0 GFMA/s
packets     vehicles, tuned ({tmp_path}/{widths.FILE}): plain float64 8, plain float32 16
packets     vehicles, table: dense float64 8
"""
    )
    assert cli.main(["info", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["memory"] == 3 * 2**30
    assert document["peak"] == {"float64": 1.25e10, "float32": 2.5e10}
    assert document["packets"]["plain float32"] == {"vehicles": 16, "source": "tuned"}
    for memory, physical in ((0, 1), (2**30, 2**30), (2**30, None)):
        monkeypatch.setattr(common, "memory_bytes", lambda memory=memory: memory)
        monkeypatch.setattr(common, "physical_memory", lambda physical=physical: physical)
        cli.main(["info"])
        said = capsys.readouterr().out
        assert ("memory      1.0 GiB\n" in said) == bool(memory)
        assert ("memory  " in said) == bool(memory)
    for quota in (4.0, None, 5.0):
        monkeypatch.setattr(container, "cpu_quota", lambda quota=quota: quota)
        cli.main(["info"])
        assert capsys.readouterr().out.startswith("cpu         a cpu, avx2, 4 threads\n")


def test_bench_and_tune_in_full(known, tmp_path, monkeypatch, capsys):
    study = Study(['{"a": 1}', '{"a": 2}'])
    monkeypatch.setattr(
        "lgvi_warp.studies.speed.measure", lambda *given: study.calls.append(given) or iter(study.result)
    )
    assert cli.main(["bench"]) == 0
    assert capsys.readouterr().out == '{"a": 1}\n{"a": 2}\n'
    assert cli.main(["bench", "--members", "5", "--steps", "7", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["readings"] == [{"a": 1}, {"a": 2}]
    assert study.calls == [(4096, 1000), (5, 7)]
    readings = [("plain float64", {8: 2.0, 16: 1.525}, 8, 16), ("dense float64", {8: 1.0}, 8, 8)]
    monkeypatch.setattr("lgvi_warp.studies.packet_width.tune", lambda: readings)
    kept = []
    monkeypatch.setattr(widths, "keep", lambda best: kept.append(best) or "a file")
    assert cli.main(["tune"]) == 0
    assert kept == [{"plain float64": 16, "dense float64": 8}]
    assert capsys.readouterr().out == (
        "plain float64       8: 2.00 ns, 16: 1.52 ns: 16, 8 by the table\n"
        "dense float64       8: 1.00 ns: 8, as by the table\n"
        "kept in a file, for runs from now on; without that file the table counts\n"
    )


def test_warm_in_full(monkeypatch, capsys):
    plans = [SimpleNamespace(method=SimpleNamespace(name=name), dtype="float64") for name in ("psi_s", "rk4")]
    asked, phases = [], [Phases(0.5, 2.0, 0.25), Phases(0.25, 0.0, 0.5)]
    monkeypatch.setattr("lgvi_warp.calls.warm.plans_of", lambda *given: asked.append(given[1:]) or plans)
    monkeypatch.setattr("lgvi_warp.calls.warm.warm",
                        lambda given, workers: asked.append((given, workers)) or zip(given, phases, strict=True))  # fmt: skip
    monkeypatch.setattr(common, "thread_count", lambda: 7)
    assert cli.main(["warm", PAPER]) == 0
    lines = capsys.readouterr().out.split("\n")
    assert lines[:2] == [f"psi_s float64: {phases[0]}", f"rk4 float64: {phases[1]} (was in the cache)"]
    assert lines[2].startswith("kernels: 2, in ")
    assert lines[2].endswith(" s; one after another their phases take 3.50 s")
    assert 0.0 <= float(lines[2].split(" s;")[0].split()[-1]) < 60.0
    more = ["--methods", "psi_s, rk4", "--dtypes", "float32,float64", "--threads", "3", "--json"]
    assert cli.main(["warm", PAPER, *more]) == 0
    assert asked == [((), ()), (plans, 7), (["psi_s", "rk4"], ["float32", "float64"]), (plans, 3)]
    kernels = json.loads(capsys.readouterr().out)["kernels"]
    assert kernels[0] == {"method": "psi_s", "dtype": "float64", "seconds": {"source": 0.5, "clang": 2.0, "load": 0.25}}


def test_check_in_full(capsys):
    assert cli.main(["check", PAPER, "--members", "1200"]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"scene       {PAPER}, members 1,200, psi_s, step 0.01 s, 15,000 steps\n")
    assert said.endswith("result      can run\n")
    assert said.count("\n") == 2
    assert cli.main(["check", PAPER, "--set", "vehicle.buoyancy=9000.0", "--json"]) == 0
    (note, *_) = json.loads(capsys.readouterr().out)["notes"]
    assert cli.main(["check", PAPER, "--set", "vehicle.buoyancy=9000.0"]) == 0
    lines = capsys.readouterr().out.split("\n")
    assert lines[1] == f"note        {note}"
    assert lines[-2] == "result      can run, with notes: nothing is refused for them"
    assert cli.main(["check", PAPER, "--set", 'run.iterations="auto"']) == 0
    assert "psi_s, step 0.01 s" in capsys.readouterr().out


def test_lists_in_full(capsys):
    assert cli.main(["list", "methods"]) == 0
    lines = capsys.readouterr().out.split("\n")
    said = {line.split()[0]: line for line in lines if line}
    width = max(map(len, said))
    assert all(line[width : width + 2] == "  " and line[width + 2] != " " for line in said.values())
    texts = {name: line[width + 2 :] for name, line in said.items()}
    assert texts["psi_s"] == "order 2, splitting"
    assert texts["rk4"] == "order 4, explicit"
    assert texts["gauss6"] == "order 6, Gauss collocation"
    assert texts["kl8(psi_x)"] == "order 8, composition of 17 stages, of psi_x or another symmetric method of order 2"
    assert texts["bm4(psi_x)"] == "order 4, composition of the halves of psi_x or another such method"
    assert any(text.endswith(", two parts, for weight alone") for text in texts.values())
    names = {}
    for what in ("vehicles", "terms", "laws"):
        assert cli.main(["list", what, "--json"]) == 0
        names[what] = {entry["name"]: entry["text"] for entry in json.loads(capsys.readouterr().out)["names"]}
    terms, laws = names["terms"], names["laws"]
    assert list(names["vehicles"]) == lw.vehicles()
    assert names["vehicles"]["sphere"]
    assert list(terms) == sorted(terms)
    assert terms["drag"] == inspect.getdoc(lw.Drag).partition("\n")[0]
    sections = [text.partition(":")[0] for text in laws.values()]
    assert sections[0] == "laws"
    assert len(dict.fromkeys(sections)) == sum(a != b for a, b in zip(sections, sections[1:])) + 1
    assert [name for name, text in laws.items() if text.startswith("laws:")] == sorted(
        name for name, text in laws.items() if text.startswith("laws:"))  # fmt: skip


def test_comments_of_a_new_scene_stand_in_a_column(tmp_path, capsys):
    path = tmp_path / "a" / "dive.toml"
    assert cli.main(["new", str(path)]) == 0
    text = path.read_text(encoding="utf-8")
    lines = text.split("\n")
    for start in ('name = "remus_100"', "# buoyancy = "):
        (line,) = (line for line in lines if line.startswith(start))
        assert line.rindex("#") == lists.COLUMN
    assert "lgvi-warp check dive.toml says" in text
    assert "{" + '"' not in text
    assert '"start.angular_velocity" = { normal = { std = 0.01 } }' in text
    named = lw.Scene.named("remus_100")
    assert f"# buoyancy = {named.vehicle.buoyancy:g} " in text
    (acting,) = (line for line in lines if line.startswith("# Weight and buoyancy always act"))
    assert acting.startswith("# Weight and buoyancy always act, and of this vehicle: ")
    assert cli.main(["new", str(tmp_path / "b.toml"), "--vehicle", "sphere"]) == 0
    assert "# Weight and buoyancy always act.\n" in (tmp_path / "b.toml").read_text()


VERBS = [
    completion.CompletedVerb("go", "Go: it's on.", {"-q": ("quiet [a]: b", None), "--to": ("where", ("x", "y")),
                                           "--out": ("a file", ())}, ("up", "down")),
    completion.CompletedVerb("see", "See.", {"--all": ("all", None)}, ()),
]  # fmt: skip


def test_scripts_for_shells_in_full():
    values, _, rest = completion.bash(VERBS).partition("        *) case")
    assert values.endswith(
        '    case "$verb $before" in\n        "go --to") words="x y" ;;\n        " --color") words="auto always never" ;;\n'
    )
    assert "if" not in values
    assert '[[ " go see " == *" $each "* ]]' in values
    cases = (
        'go) words="up down -q --to --out" ;;',
        'see) words="--all" files=1 ;;',
        '*) words="go see --help --version -q --quiet -v --verbose --json --color" ;;',
    )
    assert rest.startswith(' "$verb" in\n' + "".join(f"            {case}\n" for case in cases))
    assert completion.zsh(VERBS) == completion.ZSH.format(
        names="        'go:Go: it'\\''s on.'\n        'see:See.'",
        verbs="        go) _arguments -s '*-q[quiet (a); b]' '*--to[where]:value:(x y)' '*--out[a file]:value:_files'"
        " '*:word:(up down)' ;;\n        see) _arguments -s '*--all[all]' '*:file:_files' ;;",
    )
    head = "complete -c lgvi-warp -n"
    assert completion.fish(VERBS) == (
        f"{head} __fish_use_subcommand -f -a go -d 'Go: it'\\''s on.'\n{head} __fish_use_subcommand -f -a see -d 'See.'\n"
        f"{head} '__fish_seen_subcommand_from go' -f -a 'up down'\n"
        f"{head} '__fish_seen_subcommand_from go' -s q -d 'quiet [a]: b'\n"
        f"{head} '__fish_seen_subcommand_from go' -l to -x -a 'x y' -d 'where'\n"
        f"{head} '__fish_seen_subcommand_from go' -l out -r -d 'a file'\n"
        f"{head} '__fish_seen_subcommand_from see' -l all -d 'all'\n"
    )


def test_verbs_are_read_from_the_parser():
    known = {verb.name: verb for verb in completion.verbs(cli.parser())}
    assert known["list"].words == ("methods", "vehicles", "terms", "laws")
    assert known["run"].words == ()
    options = known["run"].options
    assert set(options["--method"][1]) >= {"psi_s", "rk4", "gauss6"}
    assert options["--dtype"][1][0] == "float64"
    assert known["new"].options["--vehicle"][1] == tuple(lw.vehicles())
    assert known["export"].options["--to"][1] == ("netcdf", "parquet")
    assert known["help"].words == tuple(known)
    assert options["--store"][1] == ("npz", "zarr")
    assert options["--out"][1] == ()
    assert options["--live"][1] is None
    assert options["--quiet"] == options["-q"]
    assert options["--out"][0].startswith("folder for the files")
    assert known["list"].text == "Names of methods, vehicles, terms, or laws of controllers."


def test_values_become_plain():
    value = {
        1: np.float32(0.5),
        "a": np.array([[1, 2]]),
        "b": (ROOT, float("nan")),
        "c": np.bool_(True),
        "d": [np.inf, None],
    }
    plain = output.plain(value)
    assert plain == {"1": 0.5, "a": [[1, 2]], "b": [str(ROOT), None], "c": True, "d": [None, None]}
    assert type(plain["1"]) is float
    assert plain["c"] is True


@pytest.mark.parametrize(
    ("quiet", "json_wanted", "text", "said"),
    [
        (False, False, "note        a", "note        a\n"),
        (True, False, "a", ""),
        (False, True, "a", ""),
        (False, False, "", ""),
    ],
)
def test_what_is_said(capsys, quiet, json_wanted, text, said):
    output.say(argparse.Namespace(quiet=quiet, json=json_wanted), text)
    assert capsys.readouterr().out == said


def test_labels_have_their_colors(monkeypatch):
    stream = Lasting(io.StringIO())
    stream.color = "always"
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", stream)
    text = "note        a\ndamage      b\nkept  c\nstatus      d\n  note  e\nno label\nwarnings    f"
    output.say(argparse.Namespace(quiet=False, json=False), text)
    assert output.print_faults(iter(["one", "two"])) == ["one", "two"]
    painted = [f"\x1b[{color}m{label}\x1b[0m" for color, label in
               (("33", "note"), ("31", "damage"), ("1", "kept"), ("1", "status"), ("33", "warnings"))]  # fmt: skip
    assert stream.getvalue() == (
        "{}        a\n{}      b\n{}  c\n{}      d\n  note  e\nno label\n{}    f\n".format(*painted)
        + "".join(f"\x1b[31mlgvi-warp:\x1b[0m {fault}\n" for fault in ("one", "two"))
    )


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (MemoryError(), 1, "out of memory; run fewer members or keep fewer samples"),
        (MemoryError("3 GB"), 1, "3 GB; run fewer members or keep fewer samples"),
        (OSError(errno.ENOSPC, "No space", "a file"), 1, "a file: No space"),
        (OSError("odd"), 1, "odd"),
        (lw.SceneError(["a", "b"]), 2, str(lw.SceneError(["a", "b"]))),
        (KeyboardInterrupt(), 130, "interrupted; nothing was to be written"),
    ],
)
def test_how_the_command_ends(monkeypatch, capsys, error, code, text):
    monkeypatch.setitem(command.VERBS, "info", Study(error))
    assert cli.main(["info"]) == code
    assert capsys.readouterr() == ("", f"lgvi-warp: {text}\n")
    assert cli.main(["info", "-v"]) == code
    assert "Traceback" in capsys.readouterr().err
    signals = Signals(str)
    command.code_of(error, cli.parser().parse_args(["info"]), signals)
    assert signals.said


def test_a_bug_is_raised(monkeypatch):
    monkeypatch.setitem(command.VERBS, "info", Study(KeyError("a bug")))
    with pytest.raises(KeyError, match="a bug"):
        cli.main(["info"])


def test_what_verbs_leave(tmp_path):
    def left(*words):
        return command.left(cli.parser().parse_args(words))

    out, nothing = str(tmp_path), "nothing was to be written"
    kept = "finished blocks are kept: go on with lgvi-warp resume"
    assert left("sweep", "a") == "finished cells are kept: the same command goes on"
    assert left("sweep", "a", "--plan") == left("info") == left("plan", "a") == nothing
    assert left("new", "a") == left("run", "a", "--store", "zarr", "--out", out) == "nothing was written"
    (tmp_path / "run.zarr").mkdir()
    assert left("run", "a", "--store", "zarr", "--out", out) == f"{kept} {out}"
    assert left("resume", "b") == f"{kept} b"
    assert left("run", "a", "--out", out) == "nothing was written"


@pytest.mark.parametrize(
    ("end", "code"),
    [(0, 0), (3, 3), (SystemExit(2), 2), (SystemExit("text"), 0), (SystemExit(None), 0)],
)
def test_the_console_script_ends_the_process(monkeypatch, end, code):
    codes, ended = [], []
    monkeypatch.setattr(command, "main", Study(end))
    monkeypatch.setattr("os._exit", codes.append)
    monkeypatch.setitem(sys.modules, "lgvi_warp.common.warp_setup", SimpleNamespace(end=lambda: ended.append(True)))
    closed, opened = [], []

    def fstat(descriptor):
        closed.append(descriptor)
        if descriptor == 1:
            raise OSError

    monkeypatch.setenv("RUST_LOG", "x")
    monkeypatch.delenv("RUST_LOG")
    monkeypatch.setattr(gc, "disable", lambda: ended.append("gc"))
    with monkeypatch.context() as patched:
        patched.setattr(os, "fstat", fstat)
        patched.setattr(os, "open", lambda *given: opened.append(given))
        command.entry()
    assert codes == [code]
    assert ended == ["gc", True]
    assert os.environ["RUST_LOG"] == "off"
    assert closed == [0, 1, 2]
    assert opened == [(os.devnull, os.O_RDWR)]
    monkeypatch.setenv("RUST_LOG", "debug")
    monkeypatch.delitem(sys.modules, "lgvi_warp.common.warp_setup")
    command.entry()
    assert codes == [code, code]
    assert os.environ["RUST_LOG"] == "debug"
    assert len(ended) == 3


def test_a_stream_that_is_gone_is_silent():
    class Gone(io.StringIO):
        def __init__(self, number):
            super().__init__()
            self.number = number

        def write(self, text):
            raise OSError(self.number, "gone")

        flush = property(lambda self: lambda: self.write(""))

    for number in (errno.EPIPE, errno.EIO, errno.ESHUTDOWN):
        stream = Lasting(Gone(number))
        assert stream.write("abc") == 3
        assert stream.write("ab") == 2
        assert not stream.isatty()
        stream.flush()
    for act in (lambda stream: stream.write("a"), lambda stream: stream.flush()):
        full = Lasting(Gone(errno.ENOSPC))
        for _ in range(2):
            with pytest.raises(OSError, match="gone"):
                act(full)
    assert Lasting(None).write("ab") == 2
    assert Lasting(None).isatty() is False


def test_files_are_written_side_by_side(tmp_path):
    assert writing.side_by_side({}) == {}
    names = [tmp_path / name for name in "ab"]
    jobs = writing.side_by_side(
        {names[0]: lambda path: path.write_text("x") and path, names[1]: Study(OSError("full"))}
    )
    assert list(jobs) == names
    assert jobs[names[0]].result() == names[0]
    with pytest.raises(OSError, match="full"):
        jobs[names[1]].result()


def test_an_interrupt_names_the_files_that_are_finished(tmp_path, monkeypatch):
    waited = []

    def wait(jobs, timeout):
        waited.append(timeout)
        for job in jobs:
            job.exception()
        raise KeyboardInterrupt

    monkeypatch.setattr(writing, "wait", wait)
    names = [tmp_path / name for name in "ab"]
    with pytest.raises(writing.Ended, match=f"^written: {names[0]}$"):
        writing.side_by_side({names[0]: lambda path: path, names[1]: Study(OSError("full"))})
    with pytest.raises(KeyboardInterrupt) as caught:
        writing.side_by_side({names[1]: Study(OSError("full"))})
    assert not isinstance(caught.value, writing.Ended)
    assert waited == [0.2, 0.2]
