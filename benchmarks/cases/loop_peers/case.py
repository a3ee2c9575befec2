# SPDX-License-Identifier: Apache-2.0
"""One closed loop written four ways: in lanes, NumPy, numba, an ordinary Warp kernel; one thread, processor time, in turn.

The geometric PID of problem.py every ten steps of rk4, float64. All ways must end at the same place, or nothing is measured.
A package that is missing gives a line that says so.
"""

import importlib

import numpy as np

from benchmarks.cases.loop_peers.problem import Problem, make_lanes
from benchmarks.timing import least

PEERS = {"numpy": "numpy_loop", "numba": "numba_loop", "ordinary Warp kernel": "warp_loop"}
# Ways write a rotation in their own numbers, so they differ by what rk4 leaves out, (rate h)^5 / 120 a step: at 2 rad/s, more
# than any member turns, 1.4e-8 in 500 steps.
TOLERANCE = 2e-8  # m, and of each number of R


def make_ways(problem):
    """({name: Way}, names of packages that are missing, by peer)."""
    ways, missing = {"lanes": make_lanes(problem)}, {}
    for name, module in PEERS.items():
        try:
            ways[name] = importlib.import_module(f"benchmarks.cases.loop_peers.{module}").make(problem)
        except ModuleNotFoundError as error:
            missing[name] = error.name
    return ways, missing


def ends_of(ways):
    """{name: (position, attitude)} after a call of each, from the start."""
    ends = {}
    for name, way in ways.items():
        way.begin()
        way.advance()
        ends[name] = way.end()
    return ends


def differences(ends):
    """{name: largest difference from ours [m, 1]} of the ends."""
    ours = ends["lanes"]
    return {name: max(float(np.abs(x - y).max()) for x, y in zip(end, ours, strict=True)) for name, end in ends.items()}


def run(quick):
    members, ticks, rounds = (1024, 20, 2) if quick else (4096, 50, 7)
    problem = Problem(members, ticks)
    ways, missing = make_ways(problem)
    apart = differences(ends_of(ways))
    for name, package in missing.items():
        yield {"way": name, "missing": package}
    for name, difference in apart.items():
        if not difference < TOLERANCE:
            raise SystemExit(
                f"loop_peers: {name} ends {difference:.1e} from ours; until it does not, its time says nothing"
            )
    begins, calls = [way.begin for way in ways.values()], [way.advance for way in ways.values()]
    times = least(calls, rounds, begins)
    for name, seconds in zip(ways, times, strict=True):
        yield {
            "way": name,
            "members": members,
            "seconds": problem.h * problem.every * ticks,
            "ns_per_vehicle_step": round(1e9 * seconds / (members * ticks * problem.every), 1),
            "over_lanes": round(seconds / times[0], 2),
            "ends_within": float(f"{apart[name]:.1g}"),
        }
