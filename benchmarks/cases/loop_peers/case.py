"""One closed loop written four ways: fused in lanes, NumPy, numba, an ordinary Warp kernel; processor time of one thread, in turn.

The geometric PID of problem.py every ten steps of rk4, float64. All ways must end at the same place, or nothing is measured.
A package that is missing gives a line that says so.
"""

import importlib
import time

import numpy as np

from benchmarks.cases.loop_peers.problem import Problem, make_lanes

PEERS = {"numpy": "numpy_loop", "numba": "numba_loop", "ordinary Warp kernel": "warp_loop"}
# Ways differ by how each writes a rotation, so by a part of what a step of order 4 leaves out; at half the step by a
# sixteenth of it (tests/control/test_loop_peers.py).
TOLERANCE = 1e-6  # m, and of each number of R


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


def least(ways, rounds):
    """{name: the least processor time of a call [s]}, of several rounds in turn."""
    best = dict.fromkeys(ways, np.inf)
    for _ in range(rounds):
        for name, way in ways.items():
            way.begin()
            begun = time.thread_time()
            way.advance()
            best[name] = min(best[name], time.thread_time() - begun)
    return best


def run(quick):
    members, looks, rounds = (1024, 20, 2) if quick else (4096, 50, 7)
    problem = Problem(members, looks)
    ways, missing = make_ways(problem)
    found = differences(ends_of(ways))
    for name, package in missing.items():
        yield {"way": name, "missing": package}
    for name, difference in found.items():
        if not difference < TOLERANCE:
            raise SystemExit(f"loop_peers: {name} ends {difference:.1e} from ours; find out why before its time means anything")
    times = least(ways, rounds)
    for name, seconds in times.items():
        yield {
            "way": name,
            "members": members,
            "seconds": problem.h * problem.every * looks,
            "ns_per_vehicle_step": round(1e9 * seconds / (members * looks * problem.every), 1),
            "over_lanes": round(seconds / times["lanes"], 2),
            "ends_within": float(f"{found[name]:.1g}"),
        }
