# SPDX-License-Identifier: Apache-2.0
"""Compiler, runner and cost meter of the plans of a comparison."""

from __future__ import annotations

from collections.abc import Sequence

from lgvi_warp.engine.executors.threads import ThisThread
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring import cost
from lgvi_warp.results.result import Result
from lgvi_warp.runs.run import run_plan


class Kernels:
    """Compiles, runs and prices plans with this machine's kernels, in this thread."""

    def compile(self, plan: Plan) -> float:
        """Load the kernel of a plan; returns the time that loading took [s]."""
        return plan.compile()

    def run(self, plan: Plan) -> Result:
        """Run a plan in this thread, so that the thread's processor time is the run's."""
        return run_plan(plan, 1, executor=ThisThread())

    def clock(self) -> float:
        """The processor time of this thread [s]."""
        return cost.thread_seconds()

    def costs(self, plans: Sequence[Plan], rounds: int = 5) -> list[cost.Cost]:
        """Measure the cost of plans (see cost.py)."""
        return cost.costs(plans, rounds)


KERNELS = Kernels()
