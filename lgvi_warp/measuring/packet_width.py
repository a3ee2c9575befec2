# SPDX-License-Identifier: Apache-2.0
"""The width of packets by measurement: each kind of kernel at the widths that may suit, in turn on one thread."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.engine import widths
from lgvi_warp.engine.kernel_spec import kind_of
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring import speed
from lgvi_warp.physics.terms.drag import DragMatrix
from lgvi_warp.runs import measured_width
from lgvi_warp.runs.settle import make_plan

# Kind of kernel -> the method that stands for it.
METHODS = {"plain": "psi_s", "single": "psi_1", "chained": "psi_x", "dense": "psi_s", "explicit": "rk8"}
# The damping of the kind dense: every entry of the matrix acts.
LINEAR = np.array([20.0, 60.0, 60.0, 4.0, 6.0, 6.0])
TERMS = {"dense": (DragMatrix(linear=np.diag(LINEAR) + 0.1 * np.sqrt(np.outer(LINEAR, LINEAR))),)}
# A number of a packet fills so many SIMD registers.
REGISTERS = (1, 2, 4)
H, STEPS, MEMBERS, ROUNDS = 0.01, 128, 512, 20


class WidthSpeeds(NamedTuple):
    """Speeds of one kind of kernel: width -> time per vehicle and step [ns], the width of the table, and the fastest."""

    kernel: str
    ns: dict[int, float]
    before: int
    best: int


def calibrate(
    rounds: int = ROUNDS, *, prepare: Callable[[Plan], Callable[[], None]] = speed.stepper,
    clock: Callable[[], float] = time.perf_counter, register_width: Callable[[str], int] = machine.register_width,
) -> Iterator[WidthSpeeds]:  # fmt: skip
    """Measure every kind of kernel at every width that may suit this machine; of its readings the least counts."""
    for kernel in widths.KERNELS:
        kind, dtype = widths.parts(kernel)
        lanes = [n * register_width(dtype) for n in REGISTERS]
        fleet = speed.fleet(MEMBERS, *TERMS.get(kind, ()))
        plans = {
            width: make_plan(fleet, METHODS[kind], h=H, t1=H * STEPS, dtype=dtype, width=width)
            for width in lanes
            if width in widths.WIDTHS
        }
        seconds = speed.least([prepare(plan) for plan in plans.values()], rounds, clock=clock)
        ns = {width: 1e9 * spent / (MEMBERS * STEPS) for width, spent in zip(plans, seconds, strict=True)}
        before = widths.of_table(kind, dtype).lanes
        fastest = min(ns, key=lambda width: ns[width])
        better = ns[fastest] < (1.0 - measured_width.WORTH) * ns[before]
        yield WidthSpeeds(kernel, ns, before, fastest if better else before)


def calibrate_scene(plan: Plan, rounds: int = ROUNDS) -> WidthSpeeds:
    """Measure the kernel of one run at every width that may suit this machine, and keep the best for its later runs."""
    table = plan.of_width(widths.of_table(kind_of(plan.method, plan.kernel_choice), plan.dtype).lanes, "asked for")
    found = measured_width.measure(table, measured_width.candidates(plan, REGISTERS), rounds)
    widths.keep_measured(table.kernel.hash, found.best)
    return WidthSpeeds(f"{plan.method.name} {plan.dtype}", found.ns, found.before, found.best)
