# SPDX-License-Identifier: Apache-2.0
"""Cost and memory as steps grow: time per vehicle and step, and the peak memory of a process that does that run alone."""

from benchmarks import own_process
from lgvi_warp.measuring import speed
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan


def alone(members, steps):
    """Seconds of a run, and the peak memory of this process [bytes]."""
    plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=0.01 * steps)
    return run_plan(plan, 1).run_seconds, own_process.peak_memory()


def run(quick):
    members = 1024
    for steps in (10, 100, 1000) if quick else (10, 100, 1000, 10_000, 100_000):
        seconds, peak = own_process.call(alone, members, steps)
        yield {
            "members": members,
            "steps": steps,
            "ns_per_vehicle_step": round(1e9 * seconds / (members * steps), 2),
            "process_peak_MiB": round(peak / 2**20, 1),
        }
