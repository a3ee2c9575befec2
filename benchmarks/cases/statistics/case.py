# SPDX-License-Identifier: Apache-2.0
"""Statistics of 10^6 members at ten sample times beside the bare kernel, in turn: psi_s, float64, all threads; peak memory.

Mean, covariance, quantiles and extremes of position, together and one by one, beside runs that keep nothing: with the same
sample times, and without any. The least time of rounds in turn; core_s is that of all threads together, which other work
on the machine disturbs less. Memory is that of a process of its own.
"""

import time
from statistics import median

import lgvi_warp as lw
from benchmarks import own_process
from lgvi_warp.common import machine
from lgvi_warp.engine.keepers.observation import Observation
from lgvi_warp.measuring import speed
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan


def statistics():
    return (
        lw.statistics.Mean("position"),
        lw.statistics.Covariance("position"),
        lw.statistics.Quantiles("position", (0.05, 0.5, 0.95)),
        lw.statistics.Extremes("position"),
    )


def runs(members, steps):
    """Name -> a call that makes the run and returns its seconds, and those of all cores together."""
    fleet, t1 = speed.fleet(members), 0.01 * steps
    every = lw.SaveAt(every=t1 / 10, fields=("position",))
    threads = machine.thread_count()

    def of(save, observed):
        plan = make_plan(fleet, "psi_s", 0.01, t1, save)

        def call():
            start = time.process_time()
            result = run_plan(plan, threads, None, observed)
            return result.run_seconds, time.process_time() - start

        return call

    nothing = Observation(keep="none")
    one_by_one = {one.type: of(every, Observation((one,), "none")) for one in statistics()}
    return {
        "no samples": of(lw.SaveAt(fields=()), nothing),
        "samples dropped": of(every, nothing),
        "statistics": of(every, Observation(statistics(), "none")),
    } | one_by_one


def run(quick):
    members, steps, rounds = (20_000, 200, 2) if quick else (1_000_000, 1000, 5)
    calls = runs(members, steps)
    found = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(rounds):
        for name, call in calls.items():
            found[name].append(call())
    least = {name: [min(column) for column in zip(*times, strict=True)] for name, times in found.items()}
    for name, (wall, cores) in least.items():
        pairs = zip(found[name], found["no samples"], strict=True)
        yield {
            "members": members,
            "steps": steps,
            "run": name,
            "run_s": round(wall, 3),
            "to_no_samples": round(wall / least["no samples"][0], 3),
            "to_samples_dropped": round(wall / least["samples dropped"][0], 3),
            "median_to_no_samples": round(median(one[0] / bare[0] for one, bare in pairs), 3),
            "core_s": round(cores, 3),
            "core_s_to_no_samples": round(cores / least["no samples"][1], 3),
        }
    for n in (members // 10, members):
        yield {"members": n, "steps": steps, "run": "statistics, own process"} | own_process.call(alone, n, steps)


def alone(members, steps):
    """Seconds of a run with all statistics, and the peak memory of this process."""
    seconds, _ = runs(members, steps)["statistics"]()
    return {"run_s": round(seconds, 2), "peak_MiB": round(own_process.peak_memory() / 2**20, 2)}
