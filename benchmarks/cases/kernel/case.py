# SPDX-License-Identifier: Apache-2.0
"""ns per vehicle and step of every method, dtype and width on one core, beside the core's peak."""

from benchmarks.counted import operations
from benchmarks.timing import interleaved
from lgvi_kernels.lanes.arithmetic import WIDTHS
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.measuring import speed
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.runs.settle import make_plan

# Methods and widths that are measured quickly.
QUICK = ("psi_s", "psi_x"), (8,)


def run(quick):
    members, steps = (512, 100) if quick else (4096, 400)
    for dtype in ("float64", "float32"):
        peak = fma_peak(dtype)
        for width in QUICK[1] if quick else WIDTHS if dtype == "float32" else WIDTHS[:-1]:
            fleet = speed.fleet(members)
            names = QUICK[0] if quick else PROGRAMS
            plans = [make_plan(fleet, name, h=0.01, t1=0.01 * steps, dtype=dtype, width=width) for name in names]
            seconds = interleaved([speed.stepper(plan) for plan in plans])
            for plan, one in zip(plans, seconds, strict=True):
                yield speed.record(plan, one / (members * steps), peak, operations(plan.method))
