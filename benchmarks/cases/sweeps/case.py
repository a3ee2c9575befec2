# SPDX-License-Identifier: Apache-2.0
"""A sweep with metrics at every tick beside the same closed-loop runs without any, and its memory by number of cases."""

import time

import numpy as np

from benchmarks import own_process
from benchmarks.pages import ROOT

SCENE = ROOT / "examples" / "scenes" / "remus_100_autopilot.toml"
METRICS = ("overshoot heading", "settling_time depth", "iae heading")


def gains(count):
    """The grid: derivative gains of the heading."""
    return {"heading_pid.kd": np.linspace(1.5, 3.0, count).round(3).tolist()}


def beside_runs(cases, members, t1):
    """Processor and wall time of a sweep over those of its runs without metrics.

    Args:
        cases: number of cases.
        members: number of members of each.
        t1: end of the runs [s].
    """
    import lgvi_warp as lw
    from lgvi_warp.robustness.sweeps.setup import setup_of

    def runs(of, end):
        setup = setup_of(SCENE, None, gains(cases), None, of, None, None, METRICS, {})
        for case, point in setup.cells:
            fleet, _ = setup.fleet(case, point)
            lw.solve(fleet, save=lw.SaveAt(fields=()), keep="none", statistics=[], t1=end)

    def sweep(of, end):
        lw.sweep(SCENE, grid=gains(cases), members=of, metrics=METRICS, t1=end)

    seconds = {}
    for name, call in {"runs": runs, "sweep": sweep}.items():
        call(64, 1.0)  # compiled now
        begun = time.process_time(), time.perf_counter()
        call(members, t1)
        seconds[name] = time.process_time() - begun[0], time.perf_counter() - begun[1]
    return [seconds["sweep"][i] / seconds["runs"][i] for i in (0, 1)] + [seconds["sweep"][1]]


def memory(cases, members):
    """Peak memory of a sweep of short runs into a folder [bytes]; see `beside_runs`."""
    import tempfile

    import lgvi_warp as lw

    with tempfile.TemporaryDirectory() as folder:
        lw.sweep(SCENE, grid=gains(cases), members=members, metrics=METRICS, t1=1.0, out=folder)
    return own_process.peak_memory()


def run(quick):
    cases, members, t1 = (3, 1000, 5.0) if quick else (12, 100_000, 60.0)
    processor, wall, seconds = own_process.call(beside_runs, cases, members, t1)
    yield {"cases": cases, "members": members, "duration": t1, "metrics": len(METRICS),
           "over_runs": round(processor, 3), "wall_over_runs": round(wall, 3), "seconds": round(seconds, 1)}  # fmt: skip
    few, many = (own_process.call(memory, count, members) for count in (2, cases))
    yield {"cases": cases, "members": members, "MB": round(many / 1e6), "memory_over_two_cases": round(many / few, 3)}
