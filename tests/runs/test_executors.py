# SPDX-License-Identifier: Apache-2.0
"""Blocks in threads, processes and Dask workers: the same bytes from each, also where a worker is killed on the way."""

import ast
import itertools
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections import Counter

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.executors import executor_of
from lgvi_warp.engine.executors.base import received, sent
from lgvi_warp.engine.executors.processes import Processes
from lgvi_warp.engine.keepers.memory import Outcomes, Samples
from lgvi_warp.engine.kernel_cache import one_at_a_time
from lgvi_warp.engine.work import Work
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan
from tests.conftest import ROOT
from tests.support.stores import SETTINGS, STATISTICS, UNTIL, bits, differing, fleet, markers
from tests.support.toy_work import STEPS, Traced

FIELDS = ("position", "attitude", "velocity", "angular_velocity")
# Long enough that a worker can be killed before the end: 16 blocks of 256 members.
LONG = {"method": "psi_s", "h": 0.01, "t1": 60.0, "save": lw.SaveAt(every=1.0)}
MANY = 4096
# Of a scheduler's own pages: where tests run side by side, its usual port is taken.
ANY_PORT = {"dashboard_address": "127.0.0.1:0"}


@pytest.fixture(scope="module")
def memory():
    return lw.solve(fleet(), **SETTINGS)


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """Result of the long run, from threads."""
    path = tmp_path_factory.mktemp("executors") / "run.zarr"
    lw.solve(fleet(MANY), **LONG, store=path)
    return path


@pytest.fixture(scope="module")
def client():
    """Client of two workers, which start again when they are killed."""
    import logging

    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, memory_limit=None,
                     scheduler_kwargs=ANY_PORT, silence_logs=logging.CRITICAL) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):  # fmt: skip
        yield client


def same(x, y):
    return all(x.samples[name].tobytes() == y.samples[name].tobytes() for name in FIELDS) and (
        x.status.tobytes() == y.status.tobytes()
    )


class Killer:
    """Progress that kills a worker once some blocks are finished and others are not, and notes which were."""

    def __init__(self, pids, store=None):
        self.pids, self.store, self.killed, self.finished = pids, store, None, {}

    def __call__(self, fraction):
        pids = self.pids()
        if self.killed is None and 0.1 < fraction < 0.9 and pids:
            self.finished = markers(self.store) if self.store else {}
            if self.store and not self.finished:
                return
            self.killed = pids[0]
            os.kill(self.killed, signal.SIGKILL)


def children():
    import multiprocessing

    return [child.pid for child in multiprocessing.active_children()]


def check_killed(killer, store, complete):
    """One was killed, what was finished then was not run again, and the bytes are those of the whole run."""
    assert killer.killed is not None
    assert 0 < len(killer.finished) < 16
    after = markers(store)
    assert all(after[name] == written for name, written in killer.finished.items())
    assert differing(store, complete) == []


def run_and_kill(executor, work):
    """Run 8 blocks of 256 members and kill one of the two workers in the middle of its third block.

    Returns (block killed, [(block, process)] in the order they finished, [(block, steps told)]).
    """
    told, finished, killed = [], [], None
    for block, pid in executor.run(work, blocks(2048), lambda block, steps: told.append((block.first, steps))):
        finished.append((block.first, pid))
        deadline = time.monotonic() + 30.0
        while killed is None and len(finished) >= 4 and time.monotonic() < deadline:
            at_work = [(first, pid) for first, pid in work.begun() if first not in dict(finished)]
            if at_work:
                killed, pid = at_work[-1]
                os.kill(pid, signal.SIGKILL)
    return killed, finished, told


def check_run_and_kill(work, killed, finished, reported):
    """Every block once, what was finished by then begun once, what the killed worker was at twice; both told how far."""
    assert sorted(first for first, _ in finished) == list(range(0, 2048, 256))
    times = Counter(first for first, _ in work.begun())
    assert times[killed] == 2
    assert all(times[first] == 1 for first, _ in finished[:4])
    pids = dict(finished)
    half_done = {pids[first] for first, steps in reported if 0 < steps < 256 * STEPS and first in dict(finished[:4])}
    assert half_done == {pid for _, pid in finished[:4]}
    assert len(half_done) == 2
    return times


@pytest.mark.slow
def test_a_killed_process_costs_what_is_at_work(tmp_path):
    """Python ends the whole pool when a process of it dies: the other one's block runs again, too."""
    work = Traced(tmp_path)
    times = check_run_and_kill(work, *run_and_kill(Processes(2), work))
    assert sum(times.values()) <= 8 + 2


@pytest.mark.slow
def test_a_killed_dask_worker_costs_the_block_it_is_at(client, tmp_path):
    from lgvi_warp.engine.executors.dask import Dask

    work = Traced(tmp_path)
    times = check_run_and_kill(work, *run_and_kill(Dask(client), work))
    assert sum(times.values()) == 8 + 1


@pytest.mark.slow
def test_processes(memory):
    shown = []
    result = lw.solve(fleet(), **SETTINGS, executor="processes", threads=2, progress=shown.append)
    assert same(result, memory)
    assert shown == sorted(shown)
    assert shown[-1] == 1.0


@pytest.mark.slow
def test_a_killed_process_costs_its_block_only(tmp_path, complete):
    killer = Killer(children, tmp_path / "run.zarr")
    lw.solve(fleet(MANY), **LONG, executor=Processes(2), store=tmp_path / "run.zarr", progress=killer)
    check_killed(killer, tmp_path / "run.zarr", complete)


@pytest.mark.slow
@pytest.mark.slow
def test_a_killed_process_in_memory(complete):
    killer = Killer(children)
    result = lw.solve(fleet(MANY), **LONG, executor="processes", threads=2, progress=killer)
    assert killer.killed is not None
    assert same(result, lw.open_run(complete))


@pytest.mark.slow
def test_dask(client, memory, tmp_path):
    from lgvi_warp.engine.executors.dask import Dask

    shown = []
    result = lw.solve(fleet(), **SETTINGS, executor=Dask(client), progress=shown.append)
    assert same(result, memory)
    assert shown[-1] == 1.0
    address = client.scheduler_info()["address"]
    stored = lw.solve(fleet(), **SETTINGS, executor="dask", scheduler=address, store=tmp_path / "run.zarr")
    assert same(stored, memory)


@pytest.mark.ci
def test_threads_of_one_dask_worker_share_it(memory):
    """Each thread takes a block of its own; a run that ends early leaves none at work."""
    from distributed import Client, LocalCluster

    from lgvi_warp.engine.executors import dask

    with (
        LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, scheduler_kwargs=ANY_PORT
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        assert same(lw.solve(fleet(), **SETTINGS, executor=dask.Dask(client)), memory)
        work, at_once = Overlapping(), []
        for _ in dask.Dask(client).run(work, blocks(2048), lambda *_: None):
            at_once.append(work.most)
            break
        assert at_once == [2]
        assert sum(dask.tasks_at_work.values()) == 0
        assert work.whole == [0]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Port .* is already in use")
def test_the_client_of_a_run_is_not_the_default_one(memory):
    """xarray takes locks of the default client: one that is closed, or of a run, would hold up a caller's own files."""
    from distributed import Client
    from xarray.backends.locks import get_dask_scheduler

    seen = []

    def shown(_):
        seen.append(get_dask_scheduler())
        with pytest.raises(ValueError, match="No clients found"):
            Client.current()

    assert same(lw.solve(fleet(), **SETTINGS, executor="dask", progress=shown), memory)
    assert seen
    assert "distributed" not in (*seen, get_dask_scheduler())


class Overlapping:
    """Work that notes how many blocks run at once and which run to their end; it is sent as itself within one process.

    The block that begins first ends once another runs beside it, the others when they are halted.
    """

    whole, order, running, most = [], itertools.count(), 0, 0

    class plan:  # noqa: N801
        class grid:  # noqa: N801
            steps = 1

        @staticmethod
        def compile():
            return 0.0

    def __call__(self, block, halted, advanced):
        cls = type(self)
        number = next(cls.order)
        cls.running += 1
        cls.most = max(cls.most, cls.running)
        for _ in range(3000):
            if halted() or (number == 0 and cls.most > 1):
                break
            time.sleep(0.02)
        if not halted():
            cls.whole.append(number)
        cls.running -= 1
        return block.first


@pytest.mark.slow
def test_statistics_on_dask_end_with_the_run(client, tmp_path):
    """Blocks that are at work when there are members enough leave nothing in the store."""
    from lgvi_warp.engine.executors.dask import Dask

    settings = {**SETTINGS, "statistics": STATISTICS, "until": UNTIL}
    lw.solve(fleet(), **settings, threads=1, store=tmp_path / "one.zarr")
    result = lw.solve(fleet(), **settings, executor=Dask(client), store=tmp_path / "run.zarr")
    assert result.members == 512
    assert bits(result) == bits(lw.open_run(tmp_path / "one.zarr"))
    time.sleep(0.5)
    assert differing(tmp_path / "one.zarr", tmp_path / "run.zarr") == []


@pytest.mark.slow
def test_a_killed_dask_worker_costs_its_block_only(client, tmp_path, complete):
    from lgvi_warp.engine.executors.dask import Dask

    pids = list(client.run(os.getpid).values())
    killer = Killer(lambda: pids, tmp_path / "run.zarr")
    lw.solve(fleet(MANY), **LONG, executor=Dask(client), store=tmp_path / "run.zarr", progress=killer)
    check_killed(killer, tmp_path / "run.zarr", complete)


@pytest.mark.slow
def test_a_killed_dask_worker_in_memory(client, complete):
    from lgvi_warp.engine.executors.dask import Dask

    pids = list(client.run(os.getpid).values())
    killer = Killer(lambda: pids)
    result = lw.solve(fleet(MANY), **LONG, executor=Dask(client), progress=killer)
    assert killer.killed is not None
    assert same(result, lw.open_run(complete))


def test_a_worker_of_another_kind_is_refused(client, monkeypatch):
    from lgvi_warp.common import machine
    from lgvi_warp.engine.executors.dask import Dask

    monkeypatch.setattr(machine, "cpu_name", lambda: "abacus")
    with pytest.raises(lw.SceneError, match=r"is not of the kind of the machine that asks.*abacus"):
        lw.solve(fleet(300), **SETTINGS, executor=Dask(client))


@pytest.mark.ci
def test_an_executor_of_your_own(memory):
    class Backwards:
        def run(self, work, blocks, advanced):
            for block in reversed(blocks):
                yield block, work(block)

    assert same(lw.solve(fleet(), **SETTINGS, executor=Backwards()), memory)


@pytest.mark.ci
def test_threads_ask_numpy_to_read_no_types(memory, monkeypatch):
    """Python before 3.11.8 fails now and then to parse in several threads at once (python/cpython#106905)."""

    def parse(text, parse=ast.literal_eval):
        if threading.current_thread() is not threading.main_thread():
            raise SystemError("AST constructor recursion depth mismatch")
        return parse(text)

    monkeypatch.setattr(ast, "literal_eval", parse)
    assert same(lw.solve(fleet(), **SETTINGS, threads=2), memory)


def test_unknown_executors_are_refused(monkeypatch, tmp_path):
    from lgvi_warp.engine.executors import dask

    monkeypatch.setattr(dask, "TIMEOUT", 0.3)
    for arguments, word in (
        ({"executor": "thread"}, "Did you mean 'threads'"),
        ({"executor": object()}, "give an object with run"),
        ({"executor": "processes", "scheduler": "tcp://x"}, "is for the executor dask alone"),
        ({"executor": "processes", "threads": 0}, "threads = 0"),
    ):
        with pytest.raises(lw.SceneError, match=word):
            lw.solve(fleet(10), **SETTINGS, **arguments)
    for address in ("tcp://127.0.0.1:9", "nonsense"):
        with pytest.raises(lw.SceneError, match="does not answer"):
            lw.solve(fleet(10), **SETTINGS, executor="dask", scheduler=address, store=tmp_path / "run.zarr")
    assert list(tmp_path.iterdir()) == []


INTERRUPTED = """
import sys
from lgvi_warp.cli import entry
sys.argv = ["lgvi-warp", *sys.argv[1:]]
entry()
"""


@pytest.mark.ci
@pytest.mark.parametrize(
    "executor", ["threads", *(pytest.param(name, marks=pytest.mark.slow) for name in ("processes", "dask"))]
)
def test_an_interrupted_command_ends_in_a_line_and_goes_on(executor, tmp_path, capsys):
    """From the keyboard: every process of the terminal hears it."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    scene, out = str(ROOT / "examples" / "paper.toml"), str(tmp_path)
    arguments = ["run", scene, "--members", "4096", "--duration", "200", "--store", "zarr", "--out", out,
                 "--executor", executor, "--threads", "1", "--quiet"]  # fmt: skip
    process = subprocess.Popen([sys.executable, "-c", INTERRUPTED, *arguments], env=env, start_new_session=True,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
    while not list(tmp_path.glob("run.zarr/blocks/*.json")) and process.poll() is None:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=60)
    line = f"lgvi-warp: interrupted; finished blocks are kept: go on with lgvi-warp resume {out}\n"
    assert (process.returncode, *said) == (130, "", line)
    assert 0 < len(list(tmp_path.glob("run.zarr/blocks/*.json"))) < 16
    assert cli.main(["info", out]) == 1
    assert "of 16 finished; not complete" in capsys.readouterr().out


def own_law(base):
    """A law that only this call knows."""

    class Local(base):
        type = "local"

    return Local


def test_a_law_that_cannot_be_sent_is_refused_with_the_reason():
    scene = lw.Scene(speed.example().vehicle, terms=[own_law(lw.terms.Wrench)(force=[0.1, 0, 0], torque=[0, 0, 0])])
    work = Work(make_plan(lw.Ensemble(scene, 10), **SETTINGS), ())
    for name in ("processes", "dask"):
        with pytest.raises(lw.SceneError, match=rf"executor = '{name}'.*cannot be sent.*own_law.*Local.*top level"):
            next(executor_of(name, 1).run(work, [Block(0, 10)], print))


def test_work_that_cannot_be_read_is_refused_with_the_reason():
    plan = make_plan(fleet(10), **SETTINGS)
    data = sent(Work(plan, (Samples(plan), Outcomes(plan))), "processes")
    assert isinstance(received(data, "processes").plan.ensemble, lw.Ensemble)
    with pytest.raises(lw.SceneError, match=r"cannot be read by other processes.*ModuleNotFoundError"):
        received(data.replace(b"lgvi_warp.engine.keepers.memory", b"lgvi_warp.engine.kiipers.memory"), "processes")


def test_samples_are_not_sent():
    small, large = (len(sent(Work(plan, (Samples(plan),)), "processes"))
                    for plan in (make_plan(fleet(n), **SETTINGS) for n in (10, 1000)))  # fmt: skip
    # Each member's index, and nothing else.
    assert large - small < 10 * 990


@pytest.mark.slow
def test_a_worker_that_always_dies_is_given_up():
    with pytest.raises(RuntimeError, match="worker processes died 3 times without finishing a block"):
        list(Processes(1).run(Deadly(), blocks(10), lambda block, steps: None))


class Deadly:
    """Work that ends its process."""

    class plan:  # noqa: N801
        @staticmethod
        def compile():
            return 0.0

    def __call__(self, block, halted, advanced):
        os._exit(7)


ORPHANS = """
import sys
from pathlib import Path
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors.processes import Processes
from tests.support.toy_work import Traced
if __name__ == "__main__":
    list(Processes(2).run(Traced(Path(sys.argv[1]), 30.0), blocks(2048), lambda *_: None))
"""


def test_workers_end_with_the_run(tmp_path):
    """A run that is killed leaves no process behind that goes on, in blocks that would take minutes."""
    (tmp_path / "script.py").write_text(ORPHANS)
    work = Traced(tmp_path / "begun")
    work.folder.mkdir()
    run = subprocess.Popen([sys.executable, str(tmp_path / "script.py"), str(work.folder)],
                           env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})  # fmt: skip
    while len(pids := [pid for _, pid in work.begun()]) < 2:
        assert run.poll() is None
        time.sleep(0.05)
    assert all(alive(pid) for pid in pids)
    run.kill()
    run.wait()
    deadline = time.monotonic() + 20.0
    while any(alive(pid) for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(alive(pid) for pid in pids)


def alive(pid):
    """Whether a process runs: one that ended and was not asked for is a zombie."""
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.slow
def test_one_process_compiles_while_others_wait(tmp_path):
    """Four processes with an empty cache: one kernel in it at the end, compiled once, and the same bits from each."""
    code = """
import sys, hashlib
import lgvi_warp as lw
from tests.support.stores import SETTINGS, fleet
result = lw.solve(fleet(300), **SETTINGS)
print(round(result.compile_seconds, 2), hashlib.sha256(result.position.tobytes()).hexdigest())
"""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "WARP_CACHE_PATH": str(tmp_path)}
    runs = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=env) for _ in range(4)
    ]
    texts = [run.communicate()[0].split() for run in runs]
    assert len({text[1] for text in texts}) == 1
    objects = list(tmp_path.rglob("*.o"))
    assert len({path.parent.name for path in objects}) == len(objects)
    assert not [path for path in tmp_path.rglob("*_p*") if path.is_dir()]
    np.testing.assert_array_equal([run.returncode for run in runs], 0)


def test_a_kernel_waits_for_who_compiles_it_and_for_no_other(tmp_path, monkeypatch):
    """A lock is one of the file, whether another process or another thread asks for it."""
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    order = queue.Queue()

    def ask():
        for kernel in ("02cd", "01ab"):
            with one_at_a_time(kernel):
                order.put(kernel)

    other = threading.Thread(target=ask)
    with one_at_a_time("01ab"):
        other.start()
        assert order.get(timeout=10.0) == "02cd"
        with pytest.raises(queue.Empty):
            order.get(timeout=0.3)
    assert order.get(timeout=10.0) == "01ab"
    other.join()
