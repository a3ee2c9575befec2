# SPDX-License-Identifier: Apache-2.0
"""Thread scaling on 10^5 members: time of one thread over time of n threads and n, the whole solve, start and end kept.

placement: "free", where the system puts the threads; "compact", where the process may use n cores alone, those of one node of
memory before those of the next; "spread", n cores from all nodes in turn, where there are several. The thread that works on a
block is the first to touch its memory, unless the block takes over the memory of a finished one.
"""

import contextlib
import itertools
import os
from pathlib import Path

from benchmarks.timing import interleaved
from lgvi_warp.common import machine
from lgvi_warp.measuring import speed
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan

NODES = Path("/sys/devices/system/node")


def cores_of(text):
    """Cores of a list such as "0-3,8"."""
    bounds = [part.partition("-") for part in text.strip().split(",") if part]
    return [core for first, _, last in bounds for core in range(int(first), int(last or first) + 1)]


def cores_by_node(folder=NODES):
    """The cores that this process may use, by node of memory; one node where the system tells of none."""
    allowed = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    files = sorted(folder.glob("node[0-9]*/cpulist"), key=lambda path: int(path.parent.name[4:]))
    nodes = [[core for core in cores_of(path.read_text()) if core in allowed] for path in files]
    return [cores for cores in nodes if cores] or [sorted(allowed)]


def placements(nodes):
    """Placement -> cores, those to be used first in front; None where the system chooses."""
    found = {"free": None}
    if any(nodes):
        found["compact"] = list(itertools.chain(*nodes))
    if len(nodes) > 1:
        found["spread"] = [core for cores in itertools.zip_longest(*nodes) for core in cores if core is not None]
    return found


@contextlib.contextmanager
def on_cores(cores):
    """Let this thread, and those that it starts, run on these cores alone; None changes nothing."""
    if cores is None:
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def run(quick):
    members, steps = (10_000, 100) if quick else (100_000, 2000)
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=0.01 * steps)
    most, nodes = machine.thread_count(), cores_by_node()
    counts = sorted({1, *(n for n in (2, 3, 4, 8, 16, 32, 64) if n < most), most})
    kinds = [(name, n, cores) for name, cores in placements(nodes).items() for n in counts]

    def solve(threads, cores):
        def call():
            with on_cores(cores and cores[:threads]):
                run_plan(plan, threads)

        return call

    seconds = interleaved([solve(n, cores) for _, n, cores in kinds], 1 if quick else 3)
    for (name, threads, _), one in zip(kinds, seconds, strict=True):
        yield {
            "placement": name,
            "nodes": len(nodes),
            "threads": threads,
            "members": members,
            "steps": steps,
            "ns_per_vehicle_step": round(1e9 * one / (members * steps), 2),
            "speed_up": round(seconds[0] / one, 2),
            "efficiency": round(seconds[0] / one / threads, 3),
        }
