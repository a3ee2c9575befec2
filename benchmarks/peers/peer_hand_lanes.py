# SPDX-License-Identifier: Apache-2.0
"""Lanes written by hand in C++ for one vehicle, compiled when it runs: what the other figures may hope for.

The state of a packet is 15 numbers: b, the first and the last row of R, nu, Om. The vehicle's numbers are constants of the
code, the commands of thrusters a member's own; there are no checks, no samples and no other force. Thrusts are evaluated
once where commands are held; "lagged" follows each thruster on its way to its command, as commands that change need.
CXX names the compiler, else clang++ or g++; without any the peer is missing.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers import equations
from benchmarks.peers.body import Thrusters
from benchmarks.peers.problem import DRIVEN, End, Problem, Run, Runs
from benchmarks.peers.tableaus import ORDERS, TABLEAUS, Tableau

PROBLEMS = ("vehicle", *DRIVEN)
FLAGS = ("-O2", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-std=c++17", "-shared", "-fPIC")
METHODS = {"rk4": "rk4", "rk8": "dop853"}
# One register of 512 bits, and two.
LANES = {"float64": (8, 16), "float32": (16, 32)}
TYPES = {"float64": ("double", ctypes.c_double), "float32": ("float", ctypes.c_float)}
ROWS = "xz"
NAMES = equations.rows_of_names(ROWS)
SIZE = len(NAMES)
# Members and steps by which the better number of lanes is chosen.
TRIAL_MEMBERS, TRIAL_STEPS = 256, 50

Advance = Callable[[np.ndarray, np.ndarray, float, int], None]


def ready() -> None:
    """Raise ModuleNotFoundError where it cannot run."""
    compiler()


@functools.cache
def compiler() -> list[str]:
    """The command of a C++ compiler; raises ModuleNotFoundError where there is none."""
    if chosen := os.environ.get("CXX", "").split():
        return chosen
    found = next((path for name in ("clang++", "g++") if (path := shutil.which(name))), None)
    if found is None:
        raise ModuleNotFoundError("no C++ compiler", name="a C++ compiler (clang++ or g++)")
    return [found]


def cpp_number(x: float) -> str:
    """A constant of the packet's own precision."""
    return f"real({float(x)!r})"


def source(problem: Problem, tableau: Tableau, dtype: str, lanes: int, lagged: bool = False) -> str:
    """The text of an advance of packets."""
    thrusters = problem.body.thrusters
    count = 0 if thrusters is None else len(thrusters.command)
    words = {
        "RATES": indented(rate_lines(problem), 4),
        "THRUSTS": indented([] if thrusters is None else thrust_lines(thrusters), 4),
        "FADES": indented(fade_lines(thrusters, tableau) if lagged else [], 4),
        "STEP": indented(step_lines(tableau, lagged), 12),
        "THRUSTERS": str(count),
        "ROW": str(SIZE + 2 * count),
        "NUMBERS": str(SIZE),
        "REAL": TYPES[dtype][0],
        "LANES": str(lanes),
    }
    text = Path(__file__).with_name("lanes.cpp").read_text()
    for word, replacement in words.items():
        text = text.replace(word, replacement)
    return text


def indented(lines: list[str], count: int) -> str:
    return "\n".join(" " * count + line for line in lines)


def rate_lines(problem: Problem) -> list[str]:
    """C++ from `state` and `wrench` to `rate`."""
    writer = equations.Writer(cpp_number)
    acting = problem.body.thrusters is not None
    found = equations.with_rows(problem.body, writer, ROWS, [f"wrench[{i}]" for i in range(6)] if acting else ())
    lines = [f"const Lane {name} = state[{i}];" for i, name in enumerate(NAMES)]
    lines += [f"const Lane {name} = {text};" for name, text in writer.lines]
    return lines + [f"rate[{i}] = {text};" for i, text in enumerate(found)]


def thrust_lines(thrusters: Thrusters) -> list[str]:
    """C++ from `command` to `wrench`: curves of one polynomial for either side, odd where both sides are one."""
    assert np.array_equal(thrusters.ahead, thrusters.astern)
    lines = []
    for i, (curve, limit) in enumerate(zip(thrusters.ahead, thrusters.limit, strict=True)):
        lines.append(f"const Lane w{i} = limited<real, Lane>(command[{i}], {cpp_number(limit)});")
        lines.append(f"const Lane a{i} = size_of<real, lanes, Lane>(w{i});")
        value = "real(0)"
        for coefficient in curve[:0:-1]:
            value = f"({value} + {cpp_number(coefficient)}) * a{i}"
        # p1 w + p2 |w| w + ...: the curve of |w| with the sign of w.
        lines.append(f"const Lane t{i} = ({value} + {cpp_number(curve[0])}) * w{i};")
    names = [f"t{i}" for i in range(len(thrusters.command))]
    writer = equations.Writer(cpp_number)
    for j, column in enumerate(thrusters.wrenches.T):
        if sum_ := writer.total(column, names):
            lines.append(f"wrench[{j}] = {sum_};")
    return lines


def nodes(tableau: Tableau) -> list[float]:
    """The times of the stages in steps."""
    return [0.0, *(round(sum(row), 12) for row in tableau[0])]


def fade_lines(thrusters: Thrusters, tableau: Tableau) -> list[str]:
    """C++ of what is left of a thruster's way to its command at each time of a stage."""
    assert np.ptp(thrusters.lag) == 0.0
    assert max(nodes(tableau)) == 1.0
    times = sorted(set(nodes(tableau)) - {0.0})
    return [
        f"const real fade{i} = real(std::exp(step * {float(-c / thrusters.lag[0])!r}));" for i, c in enumerate(times)
    ]


def step_lines(tableau: Tableau, lagged: bool) -> list[str]:
    """C++ of one step of y: stage after stage, number after number."""
    rows, last = tableau
    times = sorted(set(nodes(tableau)) - {0.0}) if lagged else []
    lines = ["Lane s[NUMBERS];"]
    for i in range(len(times)):
        lines += [f"Lane w{i}[6] = {{}};", f"lagged<real, lanes, Lane>(command, place, fade{i}, w{i});"]
    for stage, (row, c) in enumerate(zip([[], *rows], nodes(tableau), strict=True)):
        lines += [f"s[{i}] = {_moved(i, row)};" for i in range(SIZE)] if row else []
        lines.append(f"Lane k{stage}[NUMBERS];")
        wrench = f"w{times.index(c)}" if lagged and c else "wrench"
        lines.append(f"rates<real, lanes, Lane>({'s' if row else 'y'}, {wrench}, k{stage});")
    lines += [f"y[{i}] = {_moved(i, last)};" for i in range(SIZE)]
    if lagged:
        end = len(times) - 1
        lines.append(
            f"for (int i = 0; i < THRUSTERS; ++i) place[i] = command[i] + fade{end} * (place[i] - command[i]);"
        )
        lines.append(f"for (int i = 0; i < 6; ++i) wrench[i] = w{end}[i];")
    return lines


def _moved(i: int, weights: list[float]) -> str:
    terms = " + ".join(f"(h * {cpp_number(a)}) * k{stage}[{i}]" for stage, a in enumerate(weights) if a != 0.0)
    return f"y[{i}] + {terms}"


def compiled(text: str, dtype: str) -> Advance:
    """Compile and load a text."""
    with tempfile.TemporaryDirectory() as name:
        file, library = Path(name) / "lanes.cpp", Path(name) / "lanes.so"
        file.write_text(text)
        done = subprocess.run([*compiler(), *FLAGS, "-o", library, file], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        run = ctypes.CDLL(str(library)).run
    real = TYPES[dtype][1]
    run.argtypes = [ctypes.POINTER(real), ctypes.POINTER(real), ctypes.c_double, ctypes.c_long, ctypes.c_long]
    run.restype = None

    def advance(start: np.ndarray, end: np.ndarray, h: float, steps: int) -> None:
        run(*(x.ctypes.data_as(ctypes.POINTER(real)) for x in (start, end)), h, steps, len(start))

    return advance


class Lanes:
    """The members of a problem in packets of so many lanes, and an advance of them."""

    def __init__(self, problem: Problem, method: str, dtype: str, lanes: int, lagged: bool = False):
        self.members, self.lanes = problem.members, lanes
        self.advance = compiled(source(problem, TABLEAUS[METHODS[method]], dtype, lanes, lagged), dtype)
        self.start = packed(row_state(problem), lanes).astype(dtype)

    def run(self, problem: Problem, method: str, dtype: str, rate: float, threads: int, pool: Any) -> Run:
        """One setting: each thread has its part of the packets."""
        end, (h, steps) = np.empty_like(self.start), problem.steps(rate)
        edges = np.linspace(0, len(self.start), threads + 1).astype(int)
        parts = [(self.start[a:b], end[a:b]) for a, b in zip(edges[:-1], edges[1:], strict=True)]

        def call() -> None:
            if threads == 1:
                return self.advance(self.start, end, h, steps)
            list(pool.map(lambda part: self.advance(*part, h, steps), parts))

        return Run(method, f"h={h:g}, {self.lanes} lanes", self.members, call, lambda: self.end(end), dtype)

    def end(self, end: np.ndarray) -> End:
        """Position and attitude of packets."""
        rows = end.transpose(0, 2, 1).reshape(-1, end.shape[1])[: self.members].astype(np.float64)
        first, last = rows[:, 3:6], rows[:, 6:9]
        return rows[:, :3], np.stack([first, np.cross(last, first), last], axis=1)


def row_state(problem: Problem) -> np.ndarray:
    """The start as (members, 15), and behind it the commands of thrusters and where these are."""
    columns, thrusters = [problem.b, problem.R[:, 0], problem.R[:, 2], problem.nu, problem.Om], problem.body.thrusters
    if thrusters is not None:
        columns.append(np.tile(thrusters.command, (problem.members, 2)))
    return np.concatenate(columns, axis=1)


def packed(states: np.ndarray, lanes: int) -> np.ndarray:
    """Rows (members, n) as packets (., n, lanes), the last filled with copies."""
    packets = -(-len(states) // lanes)
    padded = np.resize(states, (packets * lanes, states.shape[1]))
    return np.ascontiguousarray(padded.reshape(packets, lanes, -1).transpose(0, 2, 1))


def best(problem: Problem, method: str, dtype: str, lagged: bool) -> Lanes:
    """The number of lanes that is faster here."""
    from benchmarks.timing import least

    part = problem.first(TRIAL_MEMBERS)
    tried = [Lanes(part, method, dtype, lanes, lagged) for lanes in LANES[dtype]]
    calls = [functools.partial(one.advance, one.start, np.empty_like(one.start), 1e-3, TRIAL_STEPS) for one in tried]
    chosen = tried[int(np.argmin(least(calls, 7)))]
    chosen.members, chosen.start = problem.members, packed(row_state(problem), chosen.lanes).astype(dtype)
    return chosen


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    pool = ThreadPoolExecutor(threads) if threads > 1 else None
    ways = (False,) if problem.body.thrusters is None else (False, True)
    for method, dtype, lagged in itertools.product(METHODS, LANES, ways):
        lanes, name = best(problem, method, dtype, lagged), f"{method}, lagged" if lagged else method
        for rate in problem.rates(ORDERS[METHODS[method]]):
            yield lanes.run(problem, name, dtype, rate, threads, pool)
