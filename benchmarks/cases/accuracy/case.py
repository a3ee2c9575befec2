# SPDX-License-Identifier: Apache-2.0
"""ns per vehicle and simulated second of each method, at the step that makes an error of 1e-2 to 1e-10 at t = 5."""

import math
from functools import partial

import numpy as np

import lgvi_warp as lw
from benchmarks.problems import difference
from benchmarks.timing import interleaved
from lgvi_warp.engine.packets import Packets
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan

METHODS = ("psi_s", "psi_x", "su4(psi_x)", "bm4(psi_x)", "rkn4_6", "kl6(psi_x)", "ss6_13(psi_x)", "bm6(psi_x)", "rkn6_11",
           "rkn6_14", "kl8(psi_x)", "su8_15(psi_x)", "ss8_21(psi_x)", "gauss4", "gauss6", "gauss8", "gauss12")  # fmt: skip
ERRORS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
END = 5.0
# Larger steps than this are left to those who know that they are stable.
FEWEST_STEPS = 8


def end(method, steps):
    """b, R, nu, Om of the example at t = 5."""
    fleet = lw.Ensemble(speed.example(), 1)
    result = lw.solve(fleet, method, h=END / steps, t1=END, save=lw.SaveAt(every=END), threads=1)
    fields = (result.position, result.attitude, result.velocity, result.angular_velocity)
    return [np.array(field[-1, 0]) for field in fields], result.status.counts() == {"ok": 1}


def error(method, steps, truth):
    """The difference of the end from the truth; infinite where a member failed."""
    state, well = end(method, steps)
    return difference(state, truth) if well else np.inf


def steps_for(method, target, truth):
    """The fewest steps, to a few per cent, with an error below the target."""
    order, steps = lw.Method(method).order, FEWEST_STEPS
    while not (made := error(method, steps, truth)) <= target:
        steps = max(steps + 1, math.ceil(steps * min(2.0, (made / target) ** (1.0 / order))))
    return steps, made


def call_only(call):
    """The call without its value."""
    call()


def run(quick):
    members = 512 if quick else 4096
    truth, _ = end("ss8_21(psi_x)", 200)
    fleet = speed.fleet(members)
    methods, errors = (METHODS[:3], ERRORS[:2]) if quick else (METHODS, ERRORS)
    for target in errors:
        found = [steps_for(method, target, truth) for method in methods]
        runs = []
        for method, (steps, _) in zip(methods, found, strict=True):
            # Steps of all methods that take about as long, of 5 s at most.
            count = min(steps, max(8, 400 // len(lw.Method(method).stages)))
            plan = make_plan(fleet, method, h=END / steps, t1=count * END / steps, save=lw.SaveAt(every=None))
            plan.compile()
            runs.append(Packets(plan, plan.ensemble.select(0, members)))
        calls = [partial(packets.advance, 0, packets.plan.grid.steps) for packets in runs]
        seconds = interleaved([partial(call_only, call) for call in calls], 3 if quick else 5)
        for method, (steps, made), packets, one in zip(methods, found, runs, seconds, strict=True):
            if packets.outcome().status.any():
                continue  # a member that failed costs nothing: no time of a method
            per_step = 1e9 * one / (members * packets.plan.grid.steps)
            yield {
                "error": target,
                "method": method,
                "made": float(f"{made:.2g}"),
                "step": round(END / steps, 6),
                "ns_per_vehicle_step": round(per_step, 2),
                "ns_per_vehicle_second": round(per_step * steps / END, 1),
            }
