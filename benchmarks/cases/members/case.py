# SPDX-License-Identifier: Apache-2.0
"""Cost of a solve from 1 to 10^6 members with all threads: time per vehicle and step, and memory of the result."""

import time

from lgvi_warp.common import machine
from lgvi_warp.measuring import speed
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan


def run(quick):
    steps = 100 if quick else 1000
    for members in (1, 10, 100, 1000, 10_000) if quick else (1, 10, 100, 1000, 10_000, 100_000, 1_000_000):
        begun = time.perf_counter()
        plan = make_plan(speed.fleet(members), "psi_s", h=0.01, t1=0.01 * steps)
        set_up = time.perf_counter() - begun
        plan.compile()
        result = run_plan(plan, machine.thread_count())
        yield {
            "members": members,
            "threads": machine.thread_count(),
            "steps": steps,
            "set_up_s": round(set_up, 4),
            "run_s": round(result.run_seconds, 4),
            "ns_per_vehicle_step": round(1e9 * result.run_seconds / (members * steps), 2),
            "result_MB": round(sum(x.nbytes for x in result.samples.values()) / 1e6, 2),
        }
