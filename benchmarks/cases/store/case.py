"""Bytes per second into a store, beside the same bytes in plain files of the same sizes, synced, in turn and by as many
threads (two a core, as the executor has them with a store); a whole run into a store beside the same in memory; and
statistics alone with a store beside without."""

import os
import shutil
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from lgvi_warp import machine, speed
from lgvi_warp.blocks import Work, blocks
from lgvi_warp.executors.threads import Threads
from lgvi_warp.packets import Outcome
from lgvi_warp.running import Progress, Stored, run_blocks
from lgvi_warp.saveat import SaveAt
from lgvi_warp.solving import make_plan, messages, provenance, run_plan
from lgvi_warp.store import Sink, Store, create
from lgvi_warp.store_layout import columns
from tests.toy_keeper import DepthSum


def came_through(count):
    """The outcome of so many members without fault."""
    none, long = np.zeros(count), np.zeros(count, np.int64)
    chosen, bits = np.zeros((count, 0), np.int64), np.zeros(count, np.uint16)
    return Outcome(np.zeros(count, np.uint8), long, none, chosen, bits, long, none, long)


def into_store(plan, folder, threads, samples):
    """Seconds to put prepared samples into a new store, every block durable; and the bytes."""
    chosen = Store(folder / "run.zarr", existing="overwrite")
    create(chosen, plan, provenance(plan), ())
    sink = Sink(chosen.folder, columns(plan, chosen))
    k, runs = len(plan.grid.times), blocks(plan.ensemble.members)
    members = {block.first: plan.ensemble.select(block.first, block.stop) for block in runs}

    def one(block):
        writer = sink.open(plan, block, members[block.first])
        for first in range(0, k, 10):
            when = slice(first, min(first + 10, k))
            writer.take(when, {name: values[when, : block.count] for name, values in samples.items()})
        sink.finish(block, writer.close(came_through(block.count)), (), ())

    start = time.perf_counter()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(one, runs))
    seconds = time.perf_counter() - start
    sizes = [path.stat().st_size for path in chosen.folder.rglob("c.*")]
    shutil.rmtree(chosen.folder)
    return seconds, sizes


def into_files(folder, threads, sizes):
    """Seconds to write plain files of these sizes, each its own part of memory, and sync each."""
    ends = np.cumsum(sizes)
    data = np.arange(-(-int(ends[-1]) // 8)).view(np.uint8)
    place = folder / "plain"
    place.mkdir()

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
    shutil.rmtree(place)
    return seconds


def sink_record(folder, quick, members, times):
    """How fast the store takes what is ready."""
    threads = 2 * machine.thread_count()
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=0.1 * (times - 1), save=SaveAt(every=0.1))
    count = blocks(members)[0].count
    rng = np.random.default_rng(0)
    shapes = {"position": (3,), "attitude": (3, 3), "velocity": (3,), "angular_velocity": (3,)}
    samples = {name: rng.normal(size=(times, count, *shape)) for name, shape in shapes.items()}
    pairs = []
    for _ in range(2 if quick else 5):
        seconds, sizes = into_store(plan, folder, threads, samples)
        pairs.append((seconds, into_files(folder, threads, sizes)))
    stored, plain = (min(column) for column in zip(*pairs, strict=True))
    megabytes = sum(sizes) / 1e6
    return {
        "what": "samples that are ready",
        "members": members,
        "times": times,
        "MB": round(megabytes),
        "files": len(sizes),
        "store_MB_s": round(megabytes / stored),
        "disk_MB_s": round(megabytes / plain),
        "part_of_disk": round(plain / stored, 2),
    }


def run_record(folder, quick):
    """A run whose samples are many: in memory, into a store, and the time that its bytes take a disk."""
    members, threads = (8192, machine.thread_count()) if quick else (65536, machine.thread_count())
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=10.0, save=SaveAt(every=0.1))
    plan.compile()
    found = []
    for _ in range(2 if quick else 3):
        memory = run_plan(plan, threads).run_seconds
        start = time.perf_counter()
        chosen = Store(folder / "run.zarr", existing="overwrite")
        Stored(plan, chosen, provenance(plan), messages(plan)).run(Threads(threads))
        stored = time.perf_counter() - start
        sizes = [path.stat().st_size for path in chosen.folder.rglob("c.*")]
        shutil.rmtree(chosen.folder)
        found.append((memory, stored, into_files(folder, threads, sizes)))
    memory, stored, plain = (min(column) for column in zip(*found, strict=True))
    return {
        "what": "a run",
        "members": members,
        "steps": plan.grid.steps,
        "MB": round(sum(sizes) / 1e6),
        "memory_s": round(memory, 2),
        "store_s": round(stored, 2),
        "disk_s": round(plain, 2),
        "over_memory_plus_disk": round(stored / (memory + plain), 2),
    }


def statistics_record(folder, quick):
    """A keeper of sums alone: with a store that takes no samples, beside without a store."""
    members, threads = (8192, machine.thread_count()) if quick else (262_144, machine.thread_count())
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=10.0, save=SaveAt(every=1.0))
    plan.compile()
    found = []
    for _ in range(2 if quick else 5):
        start = time.perf_counter()
        made = Progress(1, None)
        run_blocks(Work(plan, (DepthSum(plan),)), blocks(members), Threads(threads), made.at)
        without = time.perf_counter() - start
        start = time.perf_counter()
        chosen = Store(folder / "run.zarr", fields=(), existing="overwrite")
        Stored(plan, chosen, provenance(plan), messages(plan), (DepthSum(plan),)).run(Threads(threads))
        found.append((without, time.perf_counter() - start))
        shutil.rmtree(chosen.folder)
    without, stored = (min(column) for column in zip(*found, strict=True))
    return {
        "what": "statistics alone",
        "members": members,
        "steps": plan.grid.steps,
        "without_s": round(without, 2),
        "store_s": round(stored, 2),
        "ratio": round(stored / without, 2),
    }


def run(quick):
    with tempfile.TemporaryDirectory(dir=os.environ.get("LGVI_WARP_BENCH_DIR", ".")) as name:
        folder = Path(name)
        yield sink_record(folder, quick, 16384 if quick else 65536, 51)
        if not quick:
            yield sink_record(folder, quick, 262_144, 11)
        yield run_record(folder, quick)
        yield statistics_record(folder, quick)
