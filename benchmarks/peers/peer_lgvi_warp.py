# SPDX-License-Identifier: Apache-2.0
"""lgvi_warp itself: members in packets of lanes, the plan's own kernel, as lw.solve runs it with its default checks."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import warp as wp

from benchmarks.peers.problem import DRIVEN, End, Problem, Run, Runs
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.work import unpacked
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.runs.settle import make_plan

PROBLEMS = ("vehicle", "rigid", *DRIVEN)
# What is measured: a method, its precision, and its steps a second.
Setting = tuple[str | Method, str, tuple[float, ...]]
METHODS: tuple[Setting, ...] = (
    ("psi_s", "float64", (2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)),
    ("psi_x", "float64", (2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)),
    ("psi_1", "float64", (2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)),
    ("psi", "float64", (2, 4, 8, 16, 32, 64, 128, 256)),
    ("su4(psi_s)", "float64", (1, 2, 4, 8, 16, 32, 64, 128)),
    ("su4(psi_x)", "float64", (1, 2, 4, 8, 16, 32, 64, 128)),
    ("kl6(psi_s)", "float64", (1, 2, 4, 8, 16, 32, 64)),
    ("kl6(psi_1)", "float64", (1, 2, 4, 8, 16, 32, 64)),
    ("kl6(psi_x)", "float64", (1, 2, 4, 8, 16, 32, 64)),
    ("kl8(psi_s)", "float64", (1, 2, 4, 8, 16, 32)),
    ("kl8(psi_1)", "float64", (1, 2, 4, 8, 16, 32)),
    ("kl8(psi_x)", "float64", (1, 2, 4, 8, 16, 32)),
    ("bm6(psi_x)", "float64", (1, 2, 4, 8, 16)),
    ("rkn6_14", "float64", (2, 4, 8, 16)),
    ("su4(psi_x)", "float32", (1, 2, 4)),
    ("bm4(psi_x)", "float32", (1, 2, 4)),
    ("psi_s", "float32", (2, 4, 8, 16, 32, 64)),
    ("psi_x", "float32", (2, 4, 8, 16, 32, 64)),
    ("kl6(psi_x)", "float32", (1, 2, 4, 8)),
)
# By their order's steps a second, those of float32 as far as its digits go.
EXPLICIT = {"rk4": 4, "rk5": 5, "rk5_ck": 5, "rk8": 8}
ENOUGH = {4: 64, 5: 128, 8: 32}, {4: 12, 5: 12, 8: 4}
DRIVEN_METHODS: tuple[Setting, ...] = (
    ("psi_x", "float64", (8, 16, 32, 64, 128, 256, 512)),
    ("psi_x", "float32", (8, 16, 32, 64, 128)),
    ("rkw3", "float64", (4, 8, 16, 32, 64, 128)),
)


def methods_of(problem: Problem) -> Iterator[Setting]:
    """Settings measured for a problem."""
    yield from DRIVEN_METHODS if problem.driven else METHODS
    for dtype, enough in zip(("float64", "float32"), ENOUGH, strict=True):
        for method, order in EXPLICIT.items():
            most = enough[order] * (8 if problem.driven else 1)
            yield method, dtype, tuple(rate for rate in problem.rates(order) if rate <= most)


# At the end, and what errors are of.
SAVE = SaveAt(fields=("position", "attitude"))


@functools.cache
def pool_of(threads: int) -> ThreadPoolExecutor:
    """Threads that stay, as those of the other systems do: a new one begins on a core that is busy."""
    return ThreadPoolExecutor(threads)


class Fleet:
    """The members of a plan, in as many parts as threads, and their ends."""

    def __init__(self, problem: Problem, method: str | Method, dtype: str, rate: float, threads: int):
        h, _ = problem.steps(rate)
        self.plan = make_plan(problem.ensemble, method, h=h, t1=problem.t1, save=SAVE, dtype=dtype)
        self.plan.compile()
        edges = np.linspace(0, problem.members, threads + 1).astype(int)
        self.parts = [Packets(self.plan, problem.ensemble.select(a, b)) for a, b in pairwise(edges)]
        self.starts = [wp.clone(part.state) for part in self.parts]
        self.samples: list[np.ndarray] = [np.zeros(0)] * threads

    def advance(self) -> None:
        """All steps, from the start."""
        if len(self.parts) == 1:
            return self._part(0)
        list(pool_of(len(self.parts)).map(self._part, range(len(self.parts))))

    def _part(self, i: int) -> None:
        wp.copy(self.parts[i].state, self.starts[i])
        self.parts[i].status.zero_()
        self.samples[i] = self.parts[i].launch(0, self.plan.grid.steps)

    def end(self) -> End:
        """End of the last call; NaN for a failed member."""
        ends = []
        for part, raw in zip(self.parts, self.samples, strict=True):
            raw = raw[:, -1].transpose(0, 2, 1).reshape(1, -1, raw.shape[2])
            raw = raw[:, : part.members.count].astype(np.float64)
            raw[0, part.outcome().status != 0] = np.nan
            ends.append(unpacked(self.plan.layout.sizes, raw, part.frame))
        return tuple(np.concatenate([one[name][-1] for one in ends]) for name in ("position", "attitude"))


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    for method, dtype, rates in methods_of(problem):
        for rate in rates:
            fleet = Fleet(problem, method, dtype, rate, threads)
            name = fleet.plan.method.name
            yield Run(name, f"h={problem.steps(rate)[0]:g}", problem.members, fleet.advance, fleet.end, dtype)
