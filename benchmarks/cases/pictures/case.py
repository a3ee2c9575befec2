# SPDX-License-Identifier: Apache-2.0
"""Processor time, size and memory of recordings of many members, and of the paper's report, beside what they may cost."""

import tempfile
import time
from pathlib import Path

from benchmarks.own_process import call, peak_memory
from benchmarks.pages import ROOT

STEP = 0.05
# Members and times of a recording, whether it is made of a store, and its limits [s, MB, GiB]; None for no limit of its own.
RECORDINGS = (
    (2_000, 200, False, (1.0, 8.0, None)),
    (100_000, 200, False, (5.0, 15.0, None)),
    (1_000_000, 20, True, (60.0, 15.0, 2.0)),
)
# Limit of the report of the paper's run [s].
REPORT = 5.0


def solved(members, times, folder):
    """A run of the paper's fleet at so many times, in float32; in memory, or in a store in the folder."""
    import lgvi_warp as lw

    scene = lw.Scene.load(ROOT / "examples" / "paper.toml")
    fleet = lw.Ensemble(scene, members, 1, scene.ensemble_settings.vary)
    save = lw.SaveAt(every=STEP)
    store = {"store": Path(folder) / "run.zarr"} if folder else {}
    return lw.solve(fleet, h=STEP, t1=STEP * (times - 1), save=save, dtype="float32", **store)


def store_run(members, times, folder):
    """Write a run into a store, in a process whose memory does not count."""
    solved(members, times, folder)


def recording_cost(members, times, folder):
    """Processor seconds, megabytes and peak GiB of one recording, after a small one that loads what it needs."""
    import lgvi_warp as lw

    with tempfile.TemporaryDirectory() as out:
        lw.record(solved(10, 5, None), Path(out) / "warm.rrd")
        result = lw.open_run(folder) if folder else solved(members, times, None)
        begun = time.process_time()
        path = lw.record(result, Path(out) / "fleet.rrd")
        return time.process_time() - begun, path.stat().st_size / 1e6, peak_memory() / 2**30


def report_cost():
    """Processor seconds and megabytes of the report of the paper's run."""
    import lgvi_warp as lw

    scene = lw.Scene.load(ROOT / "examples" / "paper.toml")
    result = lw.solve(scene, t1=20.0, save=lw.SaveAt(every=0.5))
    with tempfile.TemporaryDirectory() as out:
        begun = time.process_time()
        path = lw.report(result, Path(out) / "report.html")
        return time.process_time() - begun, path.stat().st_size / 1e6


def run(quick):
    """Yield a record of each recording, and one of the report."""
    for members, times, stored, (most_seconds, most_megabytes, most_memory) in RECORDINGS:
        n = members // 100 if quick else members
        with tempfile.TemporaryDirectory() as folder:
            if stored:
                call(store_run, n, times, folder)
            seconds, megabytes, memory = call(recording_cost, n, times, folder if stored else None)
        record = {
            "picture": "recording",
            "members": n,
            "times": times,
            "stored": stored,
            "processor_s": round(seconds, 2),
        }
        record |= {"of_limit": round(seconds / most_seconds, 2), "MB": round(megabytes, 1)}
        record |= {"MB_of_limit": round(megabytes / most_megabytes, 2), "memory_GiB": round(memory, 2)}
        yield record | ({"memory_of_limit": round(memory / most_memory, 2)} if most_memory else {})
    seconds, megabytes = call(report_cost)
    yield {"picture": "report", "processor_s": round(seconds, 2), "of_limit": round(seconds / REPORT, 2),
           "MB": round(megabytes, 2)}  # fmt: skip
