# SPDX-License-Identifier: Apache-2.0
"""Damped bodies that come to rest: processor time of a step early and late in 400 s, when their rates are next to nothing."""

import time

import numpy as np

from lgvi_warp.engine.packets import Packets
from lgvi_warp.measuring import speed
from lgvi_warp.physics.terms.drag import Drag
from lgvi_warp.runs.settle import make_plan

DTYPES = ("float64", "float32", "float32_compensated")
H, STEPS, PARTS = 0.01, 40_000, 20
# Rates fall by e in 2 s: float32 leaves the normal numbers after 170 s, products of two rates after half of it.
DRAG = Drag(linear=(70.0, 70.0, 70.0, 3.0, 3.0, 3.0))


def seconds_of_parts(plan):
    """Processor time of each part of a run [s]."""
    plan.compile()
    packets, length = Packets(plan, plan.ensemble.select(0, plan.ensemble.members)), STEPS // PARTS
    for k in range(0, STEPS, length):
        begun = time.thread_time()
        packets.advance(k, k + length)
        yield time.thread_time() - begun


def run(quick):
    members, rounds = (32, 1) if quick else (256, 3)
    fleet = speed.fleet(members, DRAG)
    plans = [make_plan(fleet, "psi_s", h=H, t1=H * STEPS, dtype=dtype) for dtype in DTYPES]
    readings = [[list(seconds_of_parts(plan)) for plan in plans] for _ in range(rounds)]
    seconds = np.min(readings, axis=0) * 1e9 * PARTS / (members * STEPS)
    float64 = seconds[0].sum()
    for plan, parts in zip(plans, seconds, strict=True):
        yield {
            "dtype": plan.dtype,
            "width": plan.spec.width,
            "early_ns": round(parts[:3].mean(), 2),
            "late_ns": round(parts[-3:].mean(), 2),
            "late_over_early": round(parts[-3:].mean() / parts[:3].mean(), 2),
            "float64_over_this": round(float64 / parts.sum(), 2),
        }
