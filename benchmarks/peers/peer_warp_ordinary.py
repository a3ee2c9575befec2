# SPDX-License-Identifier: Apache-2.0
"""Warp as a competent user writes it: one vehicle a thread, mat33, Newton on the exponential map (cases/ordinary).

Warp's processor device runs a launch on one thread, so more threads are not asked for.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from benchmarks.cases.ordinary.kernel import command
from benchmarks.peers.problem import End, Problem, Run, Runs

MEMBERS = 512
STEPS = (2, 4, 8, 16, 32, 64, 128, 256)  # a second


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    if threads > 1:
        return
    problem = problem.first(MEMBERS)
    for method in ("psi", "psi_s"):
        for rate in STEPS:
            yield make_run(problem, method, rate)


def make_run(problem: Problem, method: str, rate: float) -> Run:
    """One setting."""
    states = (problem.b, problem.R, problem.nu, problem.Om)
    M, J, (h, steps) = np.diag(problem.M), np.diag(problem.J), problem.steps(rate)
    arrays, launch = command(states, M, J, problem.net, problem.d, h, steps, method)
    starts = [wp.clone(x) for x in arrays]

    def call() -> None:
        for x, start in zip(arrays, starts, strict=True):
            wp.copy(x, start)
        launch()

    def end() -> End:
        return arrays[0].numpy(), arrays[1].numpy()

    return Run(method, f"h={h:g}", problem.members, call, end)
