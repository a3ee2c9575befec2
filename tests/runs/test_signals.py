# SPDX-License-Identifier: Apache-2.0
"""Signals, terminals that vanish, streams that are closed: one line, what is finished is kept, nothing waits for ever."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli import progress
from lgvi_warp.cli.signals import Lasting, Signals
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors.threads import Threads
from tests.conftest import ROOT
from tests.support.stores import SETTINGS, bits, differing, fleet
from tests.support.verbs import Study, main

PAPER = str(ROOT / "examples" / "paper.toml")
# 16 blocks of 256 members, half a second each or less.
LONG = ["run", PAPER, "--members", "4096", "--duration", "150", "--threads", "1"]
CODES = {"SIGINT": 130, "SIGTERM": 143, "SIGHUP": 129}
SECONDS = 60.0

# The command, whose progress says every step.
DRIVER = """
import os, sys
from lgvi_warp.__main__ import entry
if "quick" in os.environ.get("TEST_PROGRESS", ""):
    from lgvi_warp.cli import progress
    class Quick(progress.Progress):
        def __init__(self, *given):
            super().__init__(*given)
            self._interval = 0.0
    progress.Progress = Quick
entry()
"""


@contextlib.contextmanager
def begun(arguments, code=DRIVER, shown="quick", **settings):
    """The command in a process of its own, which does not outlive the test."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "TEST_PROGRESS": shown}
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | settings
    process = subprocess.Popen([sys.executable, "-c", code, *arguments], env=env, text=True, start_new_session=True,
                               **settings)  # fmt: skip
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def until(process, share):
    """Read progress until so much is done."""
    deadline = time.monotonic() + SECONDS
    for line in process.stderr:
        told = re.match(r"running ([0-9.]+)%", line)
        if told and float(told[1]) >= 100.0 * share:
            return
        assert time.monotonic() < deadline
    raise AssertionError(f"it ended with {process.wait()}")


def ended(process):
    """Exit code, and what it said on stdout and stderr but for progress."""
    out, err = process.communicate(timeout=SECONDS)
    said = [line for line in err.splitlines() if not re.match(r"(compiling|running|writing)( |,)", line)]
    return process.returncode, out, said


def check_part(path, total=4096):
    """A part of the run, in whole blocks."""
    part = lw.Result.load(path)
    assert 0 < part.members < total
    assert part.members % 256 == 0
    assert part.provenance["members"] == part.members
    assert not part.status.any()
    assert np.isfinite(part.position).all()
    assert "were finished" in part.messages[-1]
    return part.members


@pytest.mark.ci
@pytest.mark.parametrize(
    "name", ["SIGTERM", *(pytest.param(name, marks=pytest.mark.slow) for name in ("SIGINT", "SIGHUP"))]
)
def test_a_run_in_memory_saves_what_is_finished(name, tmp_path):
    with begun([*LONG, "--out", str(tmp_path)]) as process:
        until(process, 0.3)
        process.send_signal(getattr(signal, name))
        code, out, lines = ended(process)
    members = check_part(tmp_path / "result.npz")
    text = "interrupted" if name == "SIGINT" else f"interrupted by {name}"
    assert (code, out) == (CODES[name], "")
    assert lines == [
        f"lgvi-warp: {text}; the first {members:,} of 4,096 members are saved in {tmp_path / 'result.npz'}; a run with "
        "--store zarr can go on where it stopped"
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["result.npz"]


@pytest.mark.slow
def test_the_result_of_an_earlier_run_stays(tmp_path):
    (tmp_path / "result.npz").write_bytes(b"of a week")
    with begun([*LONG, "--out", str(tmp_path)]) as process:
        until(process, 0.3)
        process.terminate()
        code, _, (line,) = ended(process)
    assert code == 143
    assert (tmp_path / "result.npz").read_bytes() == b"of a week"
    check_part(tmp_path / "result_part.npz")
    assert "result_part.npz" in line


@pytest.mark.slow
@pytest.mark.parametrize("name", CODES)
@pytest.mark.parametrize("executor", ["threads", "processes"])
def test_a_run_in_a_store_goes_on(name, executor, tmp_path):
    store = [*LONG, "--store", "zarr", "--executor", executor, "--out", str(tmp_path)]
    with begun(store) as process:
        until(process, 0.3)
        os.killpg(process.pid, getattr(signal, name))
        code, out, lines = ended(process)
    assert (code, out) == (CODES[name], "")
    assert len(lines) == 1
    assert lines[0].endswith(f"finished blocks are kept: go on with lgvi-warp resume {tmp_path}")
    assert 0 < len(list(tmp_path.glob("run.zarr/blocks/*.json"))) < 16
    with begun(["resume", str(tmp_path), "--threads", "1"]) as process:
        until(process, 0.6)
        process.send_signal(getattr(signal, name))
        code, _, lines = ended(process)
    assert code == CODES[name]
    assert len(lines) == 1
    assert "resume" in lines[0]
    with begun(["resume", str(tmp_path), "--quiet"]) as process:
        assert ended(process)[:2] == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["tradeoff", "stability", "sensitivity", "bench"])
def test_other_verbs_end_in_a_line(verb, tmp_path):
    # predict is not among them: it ends by itself in seconds, however many members there are.
    scene = [] if verb == "bench" else [PAPER]
    out = [] if verb == "bench" else ["--out", str(tmp_path)]
    # Enough work that none has ended before it is told to.
    more = {"bench": ["--members", "100000000"], "sensitivity": ["--duration", "2000", "--of", "depth"]}
    with begun([verb, *scene, *more.get(verb, ["--duration", "2000"]), *out], shown="") as process:
        time.sleep(4.0)
        process.terminate()
        code, _, lines = ended(process)
    assert code == 143
    assert len(lines) == 1
    assert lines[0].startswith("lgvi-warp: interrupted by SIGTERM; nothing was")


@pytest.mark.parametrize(
    "seconds", [0.25, *(pytest.param(seconds, marks=pytest.mark.slow) for seconds in (0.5, 0.75, 1.0, 1.5))]
)
def test_a_signal_while_libraries_are_imported(seconds, tmp_path):
    code = "import sys; print('up', flush=True)\nfrom lgvi_warp.__main__ import entry; entry()"
    with begun([*LONG, "--out", str(tmp_path)], code) as process:
        assert process.stdout.readline() == "up\n"
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        code, out, lines = ended(process)
    assert (code, out) == (130, "")
    assert len(lines) == 1
    assert lines[0].startswith("lgvi-warp: interrupted; ")


@pytest.mark.slow
def test_twice_is_at_once(tmp_path):
    """Also while native code has the main thread: the first is not heard before it is back."""
    code = (
        DRIVER.replace("entry()\n", "")
        + """
import ctypes, threading, time
from lgvi_warp.cli import command
def run(chosen):
    print("up", flush=True)
    ctypes.CDLL(None).poll(None, 0, 100_000)
    time.sleep(100.0)
command.VERBS["info"] = run
entry()
"""
    )
    with begun(["info"], code) as process:
        assert process.stdout.readline() == "up\n"
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        code, out, lines = ended(process)
    assert (code, out) == (130, "")
    assert time.monotonic() - began < 10.0
    assert lines in (["lgvi-warp: interrupted twice, ended at once; nothing was to be written"],
                     ["lgvi-warp: interrupted; nothing was to be written"])  # fmt: skip


@pytest.mark.slow
def test_what_nohup_ignores_stays_ignored(tmp_path):
    out = [*LONG[:3], "600", "--duration", "100", "--threads", "1", "--out", str(tmp_path)]
    with begun(out, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)) as process:
        until(process, 0.2)
        process.send_signal(signal.SIGHUP)
        assert ended(process)[0] == 0
    assert lw.Result.load(tmp_path / "result.npz").members == 600


SHORT = ["run", PAPER, "--members", "20", "--duration", "2"]


@pytest.mark.slow
@pytest.mark.parametrize("closed", [(1,), (2,), (0, 1, 2)])
def test_closed_streams_lose_nothing(closed, tmp_path):
    def close():
        for descriptor in closed:
            os.close(descriptor)

    with begun([*SHORT, "--out", str(tmp_path)], preexec_fn=close) as process:
        code, _, lines = ended(process)
    assert code == 0
    assert lines == []
    assert lw.Result.load(tmp_path / "result.npz").members == 20


@pytest.mark.slow
def test_a_terminal_that_vanished_loses_nothing(tmp_path):
    """Nobody reads stdout and stderr any more: the files are all there."""
    read, write = os.pipe()
    os.close(read)
    with begun([*SHORT, "--out", str(tmp_path)], stdout=write, stderr=write) as process:
        os.close(write)
        assert process.wait(timeout=SECONDS) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fleet.png", "fleet.rrd", "result.npz"]


@pytest.mark.slow
def test_a_full_disk_below_stdout_is_told(tmp_path):
    with open("/dev/full", "w") as full, begun([*SHORT, "--out", str(tmp_path)], stdout=full) as process:
        code, _, lines = ended(process)
    assert code == 1
    assert lines == ["lgvi-warp: No space left on device"]
    assert (tmp_path / "result.npz").exists()


# Without processes -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CODES)
def test_a_signal_is_an_exit_code_and_handlers_are_as_before(name, capsys):
    number = getattr(signal, name)
    before = [signal.getsignal(getattr(signal, one)) for one in CODES]

    def verb(chosen):
        signal.raise_signal(number)
        time.sleep(10.0)

    assert cli.main(["info"], verbs={"info": verb}) == CODES[name]
    assert [signal.getsignal(getattr(signal, one)) for one in CODES] == before
    text = "" if name == "SIGINT" else f" by {name}"
    assert capsys.readouterr().err == f"lgvi-warp: interrupted{text}; nothing was to be written\n"


def test_ignored_signals_stay_ignored_within():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        verbs = {"info": lambda chosen: signal.raise_signal(signal.SIGHUP) or 0}
        assert cli.main(["info"], verbs=verbs) == 0
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_an_interrupt_that_a_library_turns_into_another_error(capsys):
    def verb(chosen):
        try:
            signal.raise_signal(signal.SIGTERM)
            time.sleep(10.0)
        except KeyboardInterrupt:
            raise ImportError("half of it is there") from None

    assert cli.main(["info"], verbs={"info": verb}) == 143
    assert capsys.readouterr().err == "lgvi-warp: interrupted by SIGTERM; nothing was to be written\n"


def test_an_interrupt_where_none_can_be_raised_comes_again(capsys):
    class Deaf:
        def __del__(self):
            signal.raise_signal(signal.SIGTERM)
            time.sleep(0.001)

    def verb(chosen):
        Deaf()
        time.sleep(10.0)

    assert cli.main(["info"], verbs={"info": verb}) == 143
    assert capsys.readouterr().err == "lgvi-warp: interrupted by SIGTERM; nothing was to be written\n"


def test_other_threads_leave_signals_alone():
    verbs = {"info": lambda chosen: 7}
    before, codes = signal.getsignal(signal.SIGTERM), []
    thread = threading.Thread(target=lambda: codes.append(cli.main(["info"], verbs=verbs)))
    thread.start()
    thread.join(SECONDS)
    assert codes == [7]
    assert signal.getsignal(signal.SIGTERM) is before


def test_the_second_signal_ends_the_process():
    """The listener alone: the main thread need not come back."""
    ends = threading.Event()
    listened = Signals(lambda: "", end=lambda signals: ends.set())
    with contextlib.suppress(KeyboardInterrupt), listened as signals:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGHUP)
        assert not ends.wait(0.1)
        signal.raise_signal(signal.SIGINT)
        assert ends.wait(SECONDS)
        assert (signals.exit_code, signals.text) == (129, "interrupted by SIGHUP")


@pytest.mark.ci
def test_solve_gives_what_is_finished():
    whole = lw.solve(fleet(), **SETTINGS, statistics=[lw.statistics.Mean("position")])
    with pytest.raises(lw.Interrupted, match="the first 512 of 1,003 members were finished") as caught:
        lw.solve(fleet(), **SETTINGS, statistics=[lw.statistics.Mean("position")], executor=Interrupting(2))
    part = caught.value.result
    assert isinstance(caught.value, KeyboardInterrupt)
    assert part.members == part.provenance["members"] == 512
    assert part.position.tobytes() == whole.position[:, :512].tobytes()
    assert part.status.shape == (512,)
    again = lw.solve(lw.Ensemble.subset(fleet(), range(512)), **SETTINGS, statistics=[lw.statistics.Mean("position")])
    assert bits(part) == bits(again)


class Interrupting:
    """An executor that is interrupted after some blocks."""

    def __init__(self, count):
        self.count = count

    def run(self, work, blocks, advanced):
        for block in blocks[: self.count]:
            yield block, work(block)
        raise KeyboardInterrupt


def test_solve_without_a_finished_block_is_a_plain_interrupt():
    with pytest.raises(KeyboardInterrupt) as caught:
        lw.solve(fleet(), **SETTINGS, executor=Interrupting(0))
    assert type(caught.value) is KeyboardInterrupt


@pytest.mark.parametrize("threads", [1, 2])
def test_blocks_at_work_come_to_their_end(threads):
    """One launch of a kernel is not broken off: what it made is part of the result."""

    def work(block, halted, advanced):
        began.set()
        deadline = time.monotonic() + SECONDS
        while not halted() and time.monotonic() < deadline:
            time.sleep(0.01)
        return None if block.first == 256 else block.first

    def interrupt():
        began.wait(SECONDS)
        time.sleep(0.2)  # until all blocks are given to the threads
        os.kill(os.getpid(), signal.SIGINT)

    began, got = threading.Event(), []
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    thread = threading.Thread(target=interrupt)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            for _, value in Threads(threads).run(work, blocks(1000), lambda block, steps: None):
                got.append(value)
    finally:
        signal.signal(signal.SIGINT, before)
        thread.join()
    # Block 256 was halted between two launches, others have not begun.
    assert got == [0]


@pytest.mark.parametrize("present", [False, True])
def test_an_interrupt_among_the_pictures_saves_the_result(present, tmp_path, capsys):
    if present:
        (tmp_path / "result.npz").write_bytes(b"of a week")
    assert main([*SHORT, "--out", str(tmp_path), "--quiet"], finish=Study(KeyboardInterrupt())) == 130
    path = tmp_path / ("result_part.npz" if present else "result.npz")
    assert lw.Result.load(path).members == 20
    text = f"lgvi-warp: interrupted; the run is finished: its 20 members are saved in {path}\n"
    assert capsys.readouterr().err == text


def test_an_interrupt_before_a_block_is_done_leaves_nothing(tmp_path, capsys):
    compiling = lambda *given, **settings: signal.raise_signal(signal.SIGINT)  # noqa: E731
    assert main([*SHORT, "--out", str(tmp_path), "--quiet"], simulate=compiling) == 130
    assert capsys.readouterr().err == "lgvi-warp: interrupted; nothing was written\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_signal_while_clang_is_at_work(tmp_path, monkeypatch):
    """No half file is left, neither in the folder nor in the cache, where the next run finds none in its way."""
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path / "cache"))
    out = tmp_path / "out"
    with begun([*SHORT, "--out", str(out)]) as process:
        while not (line := process.stderr.readline()).startswith("compiling, 2 s"):
            assert line.startswith("compiling, ")
        process.send_signal(signal.SIGINT)
        code, said, lines = ended(process)
    assert (code, said, lines) == (130, "", ["lgvi-warp: interrupted; nothing was written"])
    assert list(out.iterdir()) == []
    with begun([*SHORT, "--out", str(out), "--quiet"]) as process:
        assert ended(process) == (0, "", [])
    assert lw.Result.load(out / "result.npz").members == 20


# The command, whose pictures begin when the result is saved, and last until it is ended.
DRAWING = """
import time
from lgvi_warp import plots
def draw(*given, **more):
    print("drawing", flush=True)
    time.sleep(60.0)
plots.summary = draw
from lgvi_warp.cli import runs
runs.rescued = lambda *given: print("saving", flush=True) or time.sleep(60.0)
from lgvi_warp.__main__ import entry
entry()
"""


@pytest.mark.slow
def test_twice_while_files_are_written_names_what_is_there(tmp_path):
    with begun([*SHORT, "--out", str(tmp_path), "--quiet"], DRAWING) as process:
        assert process.stdout.readline() == "drawing\n"
        end = time.monotonic() + SECONDS
        while not (tmp_path / "fleet.rrd").exists() or not (tmp_path / "result.npz").exists():
            assert time.monotonic() < end
            time.sleep(0.05)
        for _ in range(2):
            process.send_signal(signal.SIGINT)
            time.sleep(0.5)
        code, _, (line,) = ended(process)
    there = [path.name for path in tmp_path.iterdir() if not path.name.startswith(".")]
    assert code == 130
    assert re.fullmatch(
        rf"lgvi-warp: interrupted twice, ended at once; {len(there)} files were written, the last one .*", line
    )
    assert line.rsplit("/", 1)[1] in there


@pytest.mark.ci
def test_an_interrupt_while_files_are_written_leaves_them_whole(tmp_path, monkeypatch, capsys):
    from lgvi_warp import plots

    draw = plots.summary

    def slow(*inputs, **more):
        time.sleep(0.2)  # until the other files are begun
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.2)
        return draw(*inputs, **more)

    monkeypatch.setattr(plots, "summary", slow)
    assert cli.main([*SHORT, "--out", str(tmp_path), "--quiet"]) == 130
    there = sorted(path.name for path in tmp_path.iterdir())
    assert there == ["fleet.png", "fleet.rrd", "result.npz"]
    assert lw.Result.load(tmp_path / "result.npz").members == 20
    said = capsys.readouterr().err
    assert said.startswith("lgvi-warp: interrupted; written: ")
    assert said.count("\n") == 1
    assert all(str(tmp_path / name) in said for name in there)


def test_lasting_streams():
    class Gone:
        def __init__(self, number):
            self.number, self.written = number, 0

        def write(self, text):
            self.written += 1
            raise OSError(self.number, os.strerror(self.number))

        flush, isatty = write, lambda self: True

    for number in (32, 5):
        gone = Gone(number)
        stream = Lasting(gone)
        shown = progress.Progress(stream, interval=0.0)
        shown(0.5)
        shown(0.6)
        shown.close()
        assert gone.written == 1
        assert not stream.isatty()
    with pytest.raises(OSError, match="No space left"):
        Lasting(Gone(28)).write("text")
    assert Lasting(None).write("text") == 4
    assert not Lasting(None).isatty()


@pytest.mark.ci
def test_stores_of_one_interrupted_run_are_those_of_one_that_was_not(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        lw.solve(fleet(), **SETTINGS, executor=Interrupting(2), store=tmp_path / "run.zarr")
    lw.resume(tmp_path / "run.zarr")
    lw.solve(fleet(), **SETTINGS, store=tmp_path / "whole.zarr")
    assert differing(tmp_path / "run.zarr", tmp_path / "whole.zarr") == []
