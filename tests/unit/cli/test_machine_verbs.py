# SPDX-License-Identifier: Apache-2.0
"""The verbs about the machine and about names, what they print in full; how the command ends; scripts for shells."""

import argparse
import contextlib
import errno
import inspect
import io
import json
import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli import command, completion, installed, lists, output, writing
from lgvi_warp.cli.machine import machine_lines
from lgvi_warp.cli.signals import Lasting, Signals
from lgvi_warp.common import container, machine
from lgvi_warp.common.phases import Phases
from lgvi_warp.engine import widths
from tests.conftest import ROOT
from tests.support.verbs import Study, main
from tests.unit.cli.test_terminal import document

PAPER = str(ROOT / "examples" / "paper.toml")


def test_info_of_the_machine(capsys, monkeypatch):
    cache = installed.kernel_cache()
    monkeypatch.setattr(installed, "kernel_cache", lambda: cache)  # other tests compile meanwhile
    peak = {"float64": 1.25e10, "float32": 2.5e10}
    content = document(["info"], capsys, peak_of=peak.get)
    assert content["machine"] == machine.describe()
    assert content["memory"] == machine.memory_bytes()
    assert content["versions"] == machine.versions()
    assert content["peak"] == peak
    assert content["cache"] == {"path": str(cache["path"]), "bytes": cache["bytes"]}
    assert content["packets"] == {kernel: {"vehicles": width.lanes, "source": width.source} for kernel in widths.KERNELS
                                  for width in [widths.of_table(*widths.parts(kernel))]}  # fmt: skip
    assert main(["info"], peak_of=peak.get) == 0
    said = capsys.readouterr().out
    limits = container.cpu_quota(), machine.affinity(), machine.physical_memory()
    assert said.split("\n")[:-1] == list(machine_lines(content, *limits))


def test_what_is_installed(tmp_path, monkeypatch):
    extras = installed.missing_by_extra()
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(extras) == set(stated) - {"all", "test", "docs", "arm", "dev"}
    there = {item.metadata["Name"].lower() for item in metadata.distributions()}
    for extra, missing in extras.items():
        plain = [re.match(r"[\w-]+", line)[0] for line in stated[extra] if "[" not in line]
        assert [name for name in missing if name in plain] == [name for name in plain if name.lower() not in there]
    monkeypatch.setattr(installed, "is_there", lambda library: library != "zarr")
    assert installed.missing_by_extra()["export"] == ["zarr"]
    (tmp_path / "wp_a").mkdir()
    (tmp_path / "wp_a" / "a.o").write_bytes(b"x" * 1000)
    (tmp_path / "b").write_bytes(b"x" * 24)
    monkeypatch.setattr("warp.config.kernel_cache_dir", str(tmp_path))
    assert installed.kernel_cache() == {"path": tmp_path, "bytes": 1024}
    monkeypatch.setitem(sys.modules, "rerun_cli", None)
    assert installed.viewer() is None


def test_a_machine_in_words():
    sources = {"plain": "table: avx2", "dense": "another"}
    content = {
        "machine": {"cpu": "a cpu", "simd": "avx2", "threads": 4}, "memory": 3 * 2**30,
        "versions": {"numpy": "2", "warp": "1"}, "peak": {"float64": 1.25e10, "float32": 2.5e10},
        "packets": {kernel: {"vehicles": 8, "source": sources[kernel.split()[0]]}
                    for kernel in ("plain float64", "plain float32", "dense float64")},
        "extras": {"viz": [], "uq": ["SALib"]}, "cache": {"path": "a/cache", "bytes": 3 * 2**19}, "viewer": None,
    }  # fmt: skip
    assert list(machine_lines(content, 1.5, 4, 8 * 2**30)) == [
        "cpu         a cpu, avx2, 4 threads (a quota of 1.5 CPUs; 4 cores)",
        "memory      3.0 GiB (the container's limit; 8.0 GiB in the machine)",
        "versions    numpy 2, warp 1",
        "float64     one core's peak 12.5 GFMA/s",
        "float32     one core's peak 25.0 GFMA/s",
        "packets     vehicles, table: avx2: plain float64 8, plain float32 8",
        "packets     vehicles, another: dense float64 8",
        "extra       viz: installed",
        "extra       uq: without SALib",
        "cache       a/cache, 1.5 MiB of kernels",
        "viewer      not found; it comes with the extra viz",
    ]
    assert [*machine_lines(content | {"viewer": "a/rerun"}, 1.5, 4, None)][-1] == "viewer      a/rerun"
    for memory, physical in ((0, 1), (2**30, 2**30), (2**30, None)):
        said = list(machine_lines(content | {"memory": memory}, None, 4, physical))
        assert said[0] == "cpu         a cpu, avx2, 4 threads"
        assert ("memory      1.0 GiB" in said) == bool(memory)
        assert any(line.startswith("memory") for line in said) == bool(memory)
    for quota in (4.0, None, 5.0):
        assert next(machine_lines(content, quota, 4, None)) == "cpu         a cpu, avx2, 4 threads"


def test_bench_in_full(capsys):
    lines = ['{"a": 1}', '{"a": 2}']
    measure = Study([lines, lines])
    assert main(["bench"], measure=measure) == 0
    assert capsys.readouterr().out == '{"a": 1}\n{"a": 2}\n'
    given = ["bench", "--members", "5", "--steps", "7"]
    assert document(given, capsys, measure=measure)["readings"] == [{"a": 1}, {"a": 2}]
    assert [values for values, _ in measure.calls] == [(4096, 1000), (5, 7)]


def test_warm_in_full(capsys):
    phases, asked = [Phases(0.5, 2.0, 0.25), Phases(0.25, 0.0, 0.5)], []

    def compile_plans(plans, workers):
        asked.append(([(plan.method.name, plan.dtype) for plan in plans], workers))
        return zip(plans, [*phases, *phases], strict=False)

    two = ["--methods", "psi_s, rk4"]
    assert main(["warm", PAPER, *two], compile_plans=compile_plans) == 0
    lines = capsys.readouterr().out.split("\n")
    assert lines[:2] == [f"psi_s float64: {phases[0]}", f"rk4 float64: {phases[1]} (was in the cache)"]
    assert lines[2].startswith("kernels: 2, in ")
    assert lines[2].endswith(" s; one after another their phases take 3.50 s")
    assert 0.0 <= float(lines[2].split(" s;")[0].split()[-1]) < 60.0
    more = [*two, "--dtypes", "float32,float64", "--threads", "3"]
    kernels = document(["warm", PAPER, *more], capsys, compile_plans=compile_plans)["kernels"]
    plain, both = [("psi_s", "float64"), ("rk4", "float64")], {(a, b) for a in ("psi_s", "rk4") for b in machine.DTYPES}
    assert asked[0] == (plain, machine.thread_count())
    assert set(asked[1][0]) == {pair for pair in both if "compensated" not in pair[1]}
    assert asked[1][1] == 3
    assert [kernel["seconds"] for kernel in kernels[:1]] == [{"source": 0.5, "clang": 2.0, "load": 0.25}]
    assert len(kernels) == 4


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
    assert list(names["vehicles"]) == lw.vehicles.names()
    assert names["vehicles"]["sphere"]
    assert list(terms) == sorted(set(lw.laws.Term.kinds) & set(terms))
    assert "weight" not in terms
    assert terms["drag"] == inspect.getdoc(lw.terms.Drag).partition("\n")[0]
    sections = [text.partition(":")[0] for text in laws.values()]
    assert sections[0] == "laws"
    assert laws["heading_pid"].startswith("laws: PID of the heading")
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
    assert "lgvi-warp check dive.toml validates" in text
    assert "{" + '"' not in text
    assert '"start.angular_velocity" = { normal = { std = 0.01 } }' in text
    named = lw.Scene.named("remus_100")
    assert f"# buoyancy = {named.vehicle.buoyancy:g} " in text
    (acting,) = (line for line in lines if line.startswith("# Weight and buoyancy always act"))
    assert acting.startswith("# Weight and buoyancy always act, and of this vehicle: ")
    assert cli.main(["new", str(tmp_path / "b.toml"), "--vehicle", "sphere"]) == 0
    assert "# Weight and buoyancy always act.\n" in (tmp_path / "b.toml").read_text()


def test_a_parser_that_completes_has_the_values_of_options():
    parser = cli.parser()
    completion.add_values(parser, "a file")
    actions = {name: {(action.option_strings or [action.dest])[-1]: action for action in verb._actions}
               for name, verb in parser.verbs.items()}  # fmt: skip
    run = actions["run"]
    assert set(run["--method"].choices) >= {"psi_s", "rk4", "gauss6"}
    assert run["--dtype"].choices[0] == "float64"
    assert actions["new"]["--vehicle"].choices == tuple(lw.vehicles.names())
    assert actions["export"]["--to"].choices == ("netcdf", "parquet")
    assert run["scene"].complete == run["--out"].complete == "a file"
    assert run["--members"].choices is None
    assert not any(hasattr(run[option], "complete") for option in ("--members", "--live", "--store", "--method"))


def test_values_become_plain():
    value = {1: np.float32(0.5), "a": np.array([[1, 2]]), "b": (ROOT, float("nan")), "c": np.bool_(True),
             "d": [np.inf, None]}  # fmt: skip
    plain = output.as_json(value)
    assert plain == {"1": 0.5, "a": [[1, 2]], "b": [str(ROOT), None], "c": True, "d": [None, None]}
    assert type(plain["1"]) is float
    assert plain["c"] is True


@pytest.mark.parametrize(("quiet", "json_wanted", "text", "printed"), [
    (False, False, "note        a", "note        a\n"), (True, False, "a", ""), (False, True, "a", ""),
    (False, False, "", ""),
])  # fmt: skip
def test_what_is_said(capsys, quiet, json_wanted, text, printed):
    output.say(argparse.Namespace(quiet=quiet, json=json_wanted), text)
    assert capsys.readouterr().out == printed


def test_labels_have_their_colors():
    stream = Lasting(io.StringIO())
    stream.color = "always"
    text = "note        a\ndamage      b\nkept  c\nstatus      d\n  note  e\nno label\nwarnings    f"
    with contextlib.redirect_stdout(stream), contextlib.redirect_stderr(stream):
        output.say(argparse.Namespace(quiet=False, json=False), text)
        assert output.print_faults(iter(["one", "two"])) == ["one", "two"]
    painted = [f"\x1b[{color}m{label}\x1b[0m" for color, label in
               (("33", "note"), ("31", "damage"), ("1", "kept"), ("1", "status"), ("33", "warnings"))]  # fmt: skip
    assert stream.getvalue() == (
        "{}        a\n{}      b\n{}  c\n{}      d\n  note  e\nno label\n{}    f\n".format(*painted)
        + "".join(f"\x1b[31mlgvi-warp:\x1b[0m {fault}\n" for fault in ("one", "two"))
    )


@pytest.mark.parametrize(("error", "code", "text"), [
    (MemoryError(), 1, "out of memory. Run fewer members or keep fewer samples"),
    (MemoryError("3 GB"), 1, "3 GB. Run fewer members or keep fewer samples"),
    (OSError(errno.ENOSPC, "No space", "a file"), 1, "a file: No space"), (OSError("odd"), 1, "odd"),
    (lw.SceneError(["a", "b"]), 2, str(lw.SceneError(["a", "b"]))),
    (KeyboardInterrupt(), 130, "interrupted; nothing was to be written"),
])  # fmt: skip
def test_how_the_command_ends(capsys, error, code, text):
    verbs = {"info": Study(error)}
    assert cli.main(["info"], verbs=verbs) == code
    assert capsys.readouterr() == ("", f"lgvi-warp: {text}\n")
    assert cli.main(["info", "-v"], verbs=verbs) == code
    assert "Traceback" in capsys.readouterr().err
    signals = Signals(str)
    command.code_of(error, cli.parser().parse_args(["info"]), signals)
    assert signals.said


def test_a_bug_is_raised():
    with pytest.raises(KeyError, match="a bug"):
        cli.main(["info"], verbs={"info": Study(KeyError("a bug"))})


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


@pytest.mark.parametrize("words", [["list", "methods"], ["list", "odd"], ["--help"], ["info", "none"]])
def test_the_console_script_ends_the_process_as_the_command_does(words):
    """In a process of its own, two of whose descriptors are closed: nothing that is written ends in a file opened later."""
    script = "import sys; from lgvi_warp.cli import entry; import os; os.close(0); entry()"
    one = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=False)
    try:
        code = cli.main(words)
    except SystemExit as end:
        code = end.code
    assert one.returncode == code


@pytest.mark.parametrize("end", [SystemExit("text"), SystemExit(None)])
def test_a_parser_that_ends_without_a_number_ends_with_0(end):
    script = f"from lgvi_warp.cli.command import entry\ndef run():\n    raise {end!r}\nentry(run=run)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_the_console_script_opens_what_is_closed_and_silences_the_recorder():
    script = """
import os, sys
from lgvi_warp.cli.command import entry
def run():
    import gc
    print(os.fstat(0).st_rdev == os.stat(os.devnull).st_rdev, gc.isenabled(), os.environ["RUST_LOG"], flush=True)
    return 3
os.close(0)
entry(run=run)
"""
    for said, environment in (("True False off", {}), ("True False debug", {"RUST_LOG": "debug"})):
        settings = {name: value for name, value in os.environ.items() if name != "RUST_LOG"} | environment
        one = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=settings, check=False)
        assert (one.returncode, one.stdout.strip()) == (3, said), one.stderr


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


def test_an_interrupt_names_the_files_that_are_finished(tmp_path):
    waited = []

    def wait(jobs, timeout):
        waited.append(timeout)
        for job in jobs:
            job.exception()
        raise KeyboardInterrupt

    names = [tmp_path / name for name in "ab"]
    with pytest.raises(writing.Ended, match=f"^written: {names[0]}$"):
        writing.side_by_side({names[0]: lambda path: path, names[1]: Study(OSError("full"))}, wait=wait)
    with pytest.raises(KeyboardInterrupt) as caught:
        writing.side_by_side({names[1]: Study(OSError("full"))}, wait=wait)
    assert not isinstance(caught.value, writing.Ended)
    assert waited == [0.2, 0.2]


def test_documents_of_examples(capsys):
    names = [entry["name"] for entry in document(["example"], capsys)["names"]]
    assert "paper" in names
    assert document(["example", "paper"], capsys)["text"] == (ROOT / "examples" / "paper.toml").read_text()
