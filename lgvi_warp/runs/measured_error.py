# SPDX-License-Identifier: Apache-2.0
"""Error of a planned run, measured on its first member by a comparison of the step with half the step.

Estimates from rates (`step_error`) linearise the motion at the start. They miss the error of damping near a method's limit.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lgvi_warp.common.status import failed
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods.limits import drag_limit
from lgvi_warp.methods.saveat import SaveAt, time_grid
from lgvi_warp.runs.default_method import CHEAPER, DAMPED, h_rates
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.step_error import rates

# Most steps of both runs together, in `check` and before a run.
MOST_STEPS, FEW_STEPS = 20_000, 2_000
# Intervals of the path whose ends are compared.
INTERVALS = 64
# Part of a method's limit of damping from which on a run measures its error first.
NEAR = 1.0 / 3.0


def measured_error(plan: Plan, most: int = MOST_STEPS) -> tuple[float, float] | None:
    """Measure the difference of the first member's positions between the step and half the step, relative to its path.

    most: Largest number of steps of both runs together; of a longer run only the first part is measured.
    Returns: The error divided by the length of the path [1], infinite if a run fails, and the simulated time [s]; None
        if a second run would not be the same motion, or nothing moves.
    """
    fleet, choice = plan.ensemble, plan.kernel_choice
    if fleet.final is not None or fleet.given is not None or fleet.copies is not None or choice.has_callback:
        return None
    if any(getattr(module, "NOISE", False) for _, module in choice.laws):  # whose path is another at half the step
        return None
    h, steps = plan.grid.h, min(plan.grid.steps, most // 3)
    every = max(1, -(-steps // INTERVALS))
    t0 = plan.grid.first * h
    times = t0 + h * np.unique([*range(0, steps, every), steps])
    at = SaveAt(at=times.tolist(), fields=("position",))
    paths = []
    for step in (h, 0.5 * h):
        result = run_plan(plan.subplan([0], ("position",), time_grid(step, float(times[-1]), at, t0)), 1)
        if failed(result.status).any():
            return math.inf, steps * h
        paths.append(result.position[:, 0])
    coarse, fine = paths
    length = np.linalg.norm(np.diff(fine, axis=0), axis=1).sum()
    with np.errstate(all="ignore"):
        error = float(np.linalg.norm(coarse - fine, axis=1).max() / length)
    return None if length == 0.0 else (error if math.isfinite(error) else math.inf, steps * h)


def telling_error(plan: Plan) -> Plan:
    """Add a warning to a plan with a default method whose step is near the damping limit and whose error is large."""
    said = any(text.startswith("step h =") for text in plan.grid.messages)
    return plan if not plan.method.reason or plan.method.name not in DAMPED or said else _near_the_limit(plan)


def _near_the_limit(plan: Plan) -> Plan:
    """Measure the error of a plan with a method of DAMPED near its limit, and add a warning if it is large."""
    name = plan.method.name
    drag, limit = h_rates(rates(plan.ensemble), plan.grid.h)["drag"], drag_limit(name)
    measured = measured_error(plan, FEW_STEPS) if NEAR * limit < drag < math.inf else None
    if measured is None or measured[0] <= CHEAPER:
        return plan
    how = f"off by about {100.0 * measured[0]:.2g} % of the path" if measured[0] < 1.0 else "off by more than the path"
    text = f"step h = {plan.grid.h:g} s: {name} is {how} in {measured[1]:.3g} s, by a run of the first member at half the step"
    return replace(plan, grid=plan.grid.telling(f"{text}. Shorten the step, or ask for an error: lw.suggest, --error"))
