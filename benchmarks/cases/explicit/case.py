# SPDX-License-Identifier: Apache-2.0
"""Speed against accuracy on one core: the error of R after some seconds and what a simulated second costs, of each method."""

import numpy as np

from benchmarks.timing import interleaved
from lgvi_warp.engine.packets import Packets
from lgvi_warp.measuring import speed
from lgvi_warp.methods.method import Method
from lgvi_warp.runs.settle import make_plan

STEPS = {
    "psi_s": (0.02, 0.01),
    "kl8(psi_s)": (0.1, 0.05),
    "rkmk4": (0.1, 0.05),
    "rk4": (0.1, 0.05),
    "rk5": (0.2, 0.1),
    "rk5_ck": (0.25, 0.2, 0.1),
    "rk8": (0.5, 0.25, 0.2, 0.1),
}
TOLERANCES = (1e-3, 1e-6, 1e-9)


def run(quick):
    members, t1 = (512, 2.0) if quick else (4096, 20.0)
    fleet = speed.fleet(members)
    truth = attitudes(make_plan(fleet, "rk8", h=0.01, t1=t1))
    fixed = [(Method(name), h) for name, steps in STEPS.items() for h in steps]
    chosen = [(Method("rk8", rtol=one, atol=one), t1) for one in TOLERANCES]
    plans = [make_plan(fleet, method, h=h, t1=t1) for method, h in (*fixed, *chosen)]
    seconds = interleaved([speed.stepper(plan) for plan in plans])
    for plan, one in zip(plans, seconds, strict=True):
        errors = np.abs(attitudes(plan) - truth).max(axis=1)
        yield {
            "method": plan.method.name,
            "h": plan.grid.h,
            "rtol": plan.method.rtol,
            "median_error": float(f"{np.median(errors):.2e}"),
            "us_per_vehicle_and_second": round(1e6 * one / (members * t1), 3),
        }


def attitudes(plan):
    """R of all members at the end, (members, 9)."""
    plan.compile()
    packets = Packets(plan, plan.ensemble.select(0, plan.ensemble.members))
    return packets.advance(0, plan.grid.steps)[-1, : plan.ensemble.members, 3:12]
