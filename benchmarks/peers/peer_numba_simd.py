# SPDX-License-Identifier: Apache-2.0
"""numba, written for SIMD by hand: members in packets of 8 lanes, and a step as a loop over the lanes that LLVM vectorises.

The body of that loop is a step of a Runge-Kutta method written out, stage by stage and number by number, by a small
generator: all stages stay in registers and on the stack, and only the state is stored. The rates are inlined in numba's
own code (inlined by LLVM, the loop is not vectorised: five times slower).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba as nb
import numpy as np

from benchmarks.peers.problem import DRIVEN, SIZE, End, Problem, Run, Runs, end_of, make_rates
from benchmarks.peers.tableaus import ORDERS, TABLEAUS, Tableau

PROBLEMS = ("vehicle", *DRIVEN)
LANES = 8
# Without error_model every quotient is tested for a divisor of 0, and the loop over lanes is not vectorised.
FAST = {"fastmath": True, "error_model": "numpy"}
Kernel = Callable[[np.ndarray, np.ndarray, float, int], None]

TEMPLATE = """
def advance(start, y, h, steps):
    y[:] = start
    for _ in range(steps):
        for l in range({lanes}):
{body}
"""


def source(tableau: Tableau) -> str:
    """The text of an advance of one packet: y is a packet's row, number after number, each of all lanes."""
    rows, last = tableau
    lines = [f"y{i} = y[l + {LANES * i}]" for i in range(SIZE)]
    names = ", ".join(f"y{i}" for i in range(SIZE))
    for stage, row in enumerate([[], *rows]):
        lines += [f"s{i} = {_moved(i, row)}" for i in range(SIZE)] if row else []
        lines.append(f"k{stage} = rates(({names if not row else names.replace('y', 's')}))")
    lines += [f"y[l + {LANES * i}] = {_moved(i, last)}" for i in range(SIZE)]
    return TEMPLATE.format(lanes=LANES, body="\n".join(" " * 12 + line for line in lines))


def _moved(i: int, weights: list[float]) -> str:
    terms = " + ".join(f"{a!r} * k{stage}[{i}]" for stage, a in enumerate(weights) if a != 0.0)
    return f"y{i} + h * ({terms})"


def make_kernel(problem: Problem, method: str) -> Kernel:
    """(start, end, h, steps): rows (packets, 13 * lanes)."""
    scope: dict[str, Any] = {
        "rates": nb.njit(**FAST, inline="always")(make_rates(problem, absolute=math.fabs, root=math.sqrt))
    }
    exec(source(TABLEAUS[method]), scope)
    advance = nb.njit(**FAST)(scope["advance"])

    @nb.njit(parallel=True, fastmath=True)
    def kernel(start: np.ndarray, end: np.ndarray, h: float, steps: int) -> None:
        for i in nb.prange(len(start)):
            advance(start[i], end[i], h, steps)

    return kernel


def packed(problem: Problem) -> np.ndarray:
    """The start as packets."""
    packets = -(-problem.members // LANES)
    padded = np.resize(problem.state(), (packets * LANES, SIZE))
    return np.ascontiguousarray(padded.reshape(packets, LANES, SIZE).transpose(0, 2, 1)).reshape(packets, -1)


def unpacked(problem: Problem, end: np.ndarray) -> End:
    """Position and attitude of packets."""
    return end_of(end.reshape(-1, SIZE, LANES).transpose(0, 2, 1).reshape(-1, SIZE)[: problem.members])


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    nb.set_num_threads(threads)
    for name, order in ORDERS.items():
        kernel = make_kernel(problem, name)
        for rate in problem.rates(order):
            yield make_run(problem, name, kernel, rate)


def make_run(problem: Problem, name: str, kernel: Kernel, rate: float) -> Run:
    """One setting."""
    start = packed(problem)
    end, (h, steps) = np.empty_like(start), problem.steps(rate)
    return Run(
        name,
        f"h={h:g}",
        problem.members,
        lambda: kernel(start, end, h, steps),
        lambda: unpacked(problem, end),
    )
