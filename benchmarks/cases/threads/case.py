# SPDX-License-Identifier: Apache-2.0
"""Thread scaling on 10^5 members: time of one thread over time of n threads and n, the whole solve, start and end kept."""

from lgvi_warp.common import machine
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.studies import speed


def run(quick):
    members, steps = (10_000, 100) if quick else (100_000, 2000)
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=0.01 * steps)
    counts = sorted({1, *(n for n in (2, 3, 4, 8, 16, 32, 64) if n < machine.thread_count()), machine.thread_count()})

    def solve(threads):
        return lambda: speed.void(run_plan(plan, threads))

    seconds = speed.interleaved([solve(n) for n in counts], 1 if quick else 3)
    for threads, one in zip(counts, seconds, strict=True):
        yield {
            "threads": threads,
            "members": members,
            "steps": steps,
            "ns_per_vehicle_step": round(1e9 * one / (members * steps), 2),
            "speed_up": round(seconds[0] / one, 2),
            "efficiency": round(seconds[0] / one / threads, 3),
        }
