# SPDX-License-Identifier: Apache-2.0
"""Warp as a competent user writes it: one vehicle a thread, in Warp's default module options.

The paper's vehicle: mat33, Newton on the exponential map (cases/ordinary). Driven vehicles: rk4 on 13 numbers with the
vehicle's numbers as constants. Warp's processor device runs a launch on one thread, so more threads are not asked for.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from benchmarks.cases.ordinary.kernel import command
from benchmarks.peers import equations
from benchmarks.peers.problem import DRIVEN, End, Problem, Run, Runs, end_of

PROBLEMS = ("vehicle", *DRIVEN)
MEMBERS = 512
STEPS = (2, 4, 8, 16, 32, 64, 128, 256)  # a second
DRIVEN_TEXT = """import warp as wp

State = wp.types.vector(13, wp.float64)


@wp.func
def absolute(x: wp.float64):
    return wp.abs(x)


@wp.func
def root(x: wp.float64):
    return wp.sqrt(x)


@wp.func
def rates(s: State):
    {lines}
    return State({found})


@wp.kernel(module="unique")
def rk4(state: wp.array(dtype=State), h: wp.float64, steps: int):
    i = wp.tid()
    half = wp.float64(0.5) * h
    y = wp.float64(1.0) * state[i]
    for _ in range(steps):
        k1 = rates(y)
        k2 = rates(y + half * k1)
        k3 = rates(y + half * k2)
        k4 = rates(y + h * k3)
        y = y + (h / wp.float64(6.0)) * (k1 + wp.float64(2.0) * (k2 + k3) + k4)
    state[i] = y
"""


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    if threads > 1:
        return
    problem = problem.first(MEMBERS)
    if problem.driven:
        kernel = rk4_kernel(problem)
        for rate in problem.rates(4):
            yield make_driven_run(problem, kernel, rate)
        return
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


def rk4_kernel(problem: Problem) -> Any:
    """The kernel of a driven vehicle, from a file: Warp reads the source of its functions."""
    writer = equations.Writer(lambda x: f"wp.float64({float(x)!r})")
    found = equations.with_quaternion(problem.body.held(), writer)
    lines = [f"{name} = s[{i}]" for i, name in enumerate(equations.QUATERNION)]
    lines += [f"{name} = {text}" for name, text in writer.lines]
    # The constants of the equations themselves are plain numbers, which Warp takes for single precision.
    lines = [re.sub(r"(?<![\w.(])\d+\.\d+", r"wp.float64(\g<0>)", line) for line in lines]
    found = [re.sub(r"(?<![\w.(])\d+\.\d+", r"wp.float64(\g<0>)", line) for line in found]
    text = DRIVEN_TEXT.format(lines="\n    ".join(lines), found=", ".join(found))
    name = f"ordinary_{problem.name}_{hashlib.sha256(text.encode()).hexdigest()[:12]}"
    file = Path(tempfile.mkdtemp()) / f"{name}.py"
    file.write_text(text)
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.rk4


def make_driven_run(problem: Problem, kernel: Any, rate: float) -> Run:
    """One setting."""
    state = wp.types.vector(13, wp.float64)
    start = wp.array(problem.state(), dtype=state, device="cpu")
    here = wp.clone(start)
    h, steps = problem.steps(rate)

    def call() -> None:
        wp.copy(here, start)
        wp.launch(kernel, dim=problem.members, inputs=[here, h, steps], device="cpu")

    return Run("rk4", f"h={h:g}", problem.members, call, lambda: end_of(here.numpy()))
