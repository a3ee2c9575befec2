# SPDX-License-Identifier: Apache-2.0
"""Bytes per second into a store, a whole run into a store, and statistics alone with a store.

Beside them: the same bytes in plain files of the same sizes, each synced; the same run in memory; no store.
Both of a pair run in turn, in an order that changes; ratios are the median of the pairs', seconds and MB/s the best of each.
The store writes with as many threads as a run has, one a core, until every block is durable; plain files with two a
core, as each of them waits for the disk.
"""

import os
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.cases.statistics.case import statistics
from benchmarks.problems import DepthSum
from lgvi_warp.common import machine
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.executors.threads import Threads
from lgvi_warp.engine.keepers.observation import Observation, Observing
from lgvi_warp.engine.loop import RunProgress, run_blocks
from lgvi_warp.engine.outcome import MemberStatus
from lgvi_warp.engine.work import Work
from lgvi_warp.measuring import speed
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.provenance import messages, provenance
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.store.block_files import BlockFiles
from lgvi_warp.store.create import create
from lgvi_warp.store.layout import columns
from lgvi_warp.store.run import StoredRun
from lgvi_warp.store.settings import Store


def in_turn(calls, rounds):
    """{name: results} of calls by name, each of them made once a round, in an order that changes."""
    found = {name: [] for name in calls}
    for i in range(rounds):
        for name in list(calls) if i % 2 else reversed(calls):
            found[name].append(calls[name]())
    return found


def ratio(several, others):
    """Median of the ratios of what was measured in turn."""
    return round(median(one / other for one, other in zip(several, others, strict=True)), 2)


def sizes_of(folder):
    """Bytes of each chunk."""
    return [path.stat().st_size for path in folder.rglob("c.*")]


def emptied(folder):
    """Give a run's bytes back to the disk, and leave its files.

    For about a minute ext4 passes by the number of every file that was removed, one at a time, whenever it makes a new one:
    removed runs would slow down those after them.
    """
    for path in folder.rglob("*"):
        if path.is_file():
            os.truncate(path, 0)
    # What the disk still does for this run is not to be the next one's time.
    os.sync()


def into_store(plan, folder, threads, samples):
    """Seconds to put prepared samples into a new store, every block durable; and the sizes of its chunks."""
    chosen = Store(tempfile.mkdtemp(dir=folder) + "/run.zarr")
    create(chosen, plan, provenance(plan), ())
    block_files = BlockFiles(chosen.folder, columns(plan, chosen))
    k, runs = len(plan.grid.times), blocks(plan.ensemble.members)
    members = {block.first: plan.ensemble.select(block.first, block.stop) for block in runs}

    def one(block):
        writer = block_files.open(plan, block, members[block.first])
        for first in range(0, k, 10):
            when = slice(first, min(first + 10, k))
            writer.take(when, {name: values[when, : block.count] for name, values in samples.items()})
        block_files.finish(block, writer.close(MemberStatus.clear(block.count, 0)), (), ())

    start = time.perf_counter()
    with block_files.commits, ThreadPoolExecutor(threads) as pool:
        list(pool.map(one, runs))
    seconds, sizes = time.perf_counter() - start, sizes_of(chosen.folder)
    emptied(chosen.folder)
    return seconds, sizes


def into_files(folder, threads, sizes):
    """Seconds to write plain files of these sizes, each its own part of memory, and sync each."""
    ends = np.cumsum(sizes)
    data = np.arange(-(-int(ends[-1]) // 8)).view(np.uint8)
    place = Path(tempfile.mkdtemp(dir=folder))

    def one(numbered):
        i, size = numbered
        descriptor = os.open(place / str(i), os.O_CREAT | os.O_WRONLY)
        view = memoryview(data)[int(ends[i]) - size : int(ends[i])]
        while len(view):
            view = view[os.write(descriptor, view) :]
        os.fsync(descriptor)
        os.close(descriptor)

    start = time.perf_counter()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(one, enumerate(sizes)))
    seconds = time.perf_counter() - start
    emptied(place)
    return seconds


def sink_record(folder, quick, members, times):
    """Rate at which the store takes finished data."""
    threads = machine.thread_count()
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=0.1 * (times - 1), save=SaveAt(every=0.1))
    count = blocks(members)[0].count
    rng = np.random.default_rng(0)
    shapes = {"position": (3,), "attitude": (3, 3), "velocity": (3,), "angular_velocity": (3,)}
    samples = {name: rng.normal(size=(times, count, *shape)) for name, shape in shapes.items()}
    _, sizes = into_store(plan, folder, threads, samples)
    calls = {
        "store": lambda: into_store(plan, folder, threads, samples)[0],
        "plain": lambda: into_files(folder, 2 * threads, sizes),
    }
    found = in_turn(calls, 2 if quick else 15)
    megabytes = sum(sizes) / 1e6
    return {
        "what": "samples that are ready",
        "members": members,
        "times": times,
        "MB": round(megabytes),
        "files": len(sizes),
        "store_MB_s": round(megabytes / min(found["store"])),
        "disk_MB_s": round(megabytes / min(found["plain"])),
        "part_of_disk": ratio(found["plain"], found["store"]),
    }


def run_record(folder, quick):
    """A run whose samples are many: in memory, into a store, and the time that its bytes take a disk."""
    members, threads = (8192, machine.thread_count()) if quick else (65536, machine.thread_count())
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=10.0, save=SaveAt(every=0.1))
    plan.compile()

    def stored():
        start = time.perf_counter()
        chosen = Store(tempfile.mkdtemp(dir=folder) + "/run.zarr")
        StoredRun(plan, chosen, provenance(plan), messages(plan)).run(Threads(threads))
        seconds, sizes = time.perf_counter() - start, sizes_of(chosen.folder)
        emptied(chosen.folder)
        return seconds, sizes

    _, sizes = stored()
    calls = {
        "memory": lambda: run_plan(plan, threads).run_seconds,
        "store": lambda: stored()[0],
        "plain": lambda: into_files(folder, 2 * threads, sizes),
    }
    found = in_turn(calls, 2 if quick else 7)
    return {
        "what": "a run",
        "members": members,
        "steps": plan.grid.steps,
        "MB": round(sum(sizes) / 1e6),
        "memory_s": round(min(found["memory"]), 2),
        "store_s": round(min(found["store"]), 2),
        "disk_s": round(min(found["plain"]), 2),
        "store_to_disk": ratio(found["store"], found["plain"]),
        "store_to_memory": ratio(found["store"], found["memory"]),
    }


def statistics_record(folder, quick, what, observed, keepers):
    """Statistics alone: with a store that takes no samples, beside without a store.

    keepers: what makes those of a plan, new ones for each run. The store's creation is told apart from the rest; core_s is the
    time of all cores together, which other work on the machine disturbs less.
    """
    members, threads = (8192, machine.thread_count()) if quick else (262_144, machine.thread_count())
    save = SaveAt(every=1.0)
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=10.0, save=save, observed=observed)
    plan.compile()

    def without():
        start, cores = time.perf_counter(), time.process_time()
        run_blocks(Work(plan, keepers(plan)), blocks(members), Threads(threads), RunProgress(1, None).at)
        return time.perf_counter() - start, time.process_time() - cores

    def stored():
        own, told, start = keepers(plan), (provenance(plan), messages(plan)), time.perf_counter()
        chosen = Store(tempfile.mkdtemp(dir=folder) + "/run.zarr", fields=(), existing="resume")
        create(chosen, plan, *told, own)
        there, cores = time.perf_counter(), time.process_time()
        StoredRun(plan, chosen, *told, own).run(Threads(threads))
        seconds = time.perf_counter() - there, time.process_time() - cores, there - start
        emptied(chosen.folder)
        return seconds

    found = in_turn({"without": without, "store": stored}, 2 if quick else 11)
    alone, own_cores = zip(*found["without"], strict=True)
    rest, cores, creation = zip(*found["store"], strict=True)
    return {
        "what": f"statistics alone: {what}",
        "members": members,
        "steps": plan.grid.steps,
        "without_s": round(min(alone), 3),
        "store_s": round(min(rest), 3),
        "creation_s": round(min(creation), 3),
        "ratio": ratio(rest, alone),
        "core_s_ratio": ratio(cores, own_cores),
    }


def run(quick):
    with tempfile.TemporaryDirectory(dir=os.environ.get("LGVI_WARP_BENCH_DIR", ".")) as name:
        folder = Path(name)
        yield sink_record(folder, quick, 16384 if quick else 65536, 51)
        if not quick:
            yield sink_record(folder, quick, 262_144, 11)
        yield run_record(folder, quick)
        yield statistics_record(folder, quick, "sum of depths", Observation(), lambda plan: (DepthSum(plan),))
        chosen = Observation(statistics(), "none")
        what = "mean, covariance, quantiles, extremes"

        def gathered(plan):
            return Observing(chosen, plan.grid.times, plan.ensemble.members).keepers

        yield statistics_record(folder, quick, what, chosen, gathered)
