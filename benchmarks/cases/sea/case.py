# SPDX-License-Identifier: Apache-2.0
"""ns per vehicle, step and wave: seas of 8 and 20 components, deep and 20 m deep, shared by members or their own; one core."""

import dataclasses

import lgvi_warp as lw
from benchmarks import problems
from benchmarks.timing import least
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan

SPIN = {"start.angular_velocity": lw.distributions.Normal(relative=0.1)}
# So many components in a step of rk4 may cost so much [ns].
GOAL = {20: 160.0}


def seas():
    """Name -> components and term."""
    forecast = lw.terms.SeaState(significant_height=1.0, peak_period=7.0, heading_deg=20.0)
    return {
        "none": (0, None),
        "waves": (8, problems.waves()),
        "waves, 20 components": (20, problems.sea()),
        "waves, 20 components, 20 m deep": (20, dataclasses.replace(problems.sea(), depth=20.0)),
        "sea_state": (20, forecast),
    }


def run(quick):
    members, steps, rounds = (256, 20, 2) if quick else (4096, 100, 9)
    for dtype in ("float64", "float32"):
        for method in ("psi_s", "rk4"):
            found = seas()
            scenes = [problems.scene(*([term] if term else [])) for _, term in found.values()]
            plans = [make_plan(lw.Ensemble(scene, members, 1, SPIN), method, h=0.01, t1=0.01 * steps, dtype=dtype)
                     for scene in scenes]  # fmt: skip
            seconds = least([speed.stepper(plan) for plan in plans], rounds)
            none, *others = (1e9 * one / (members * steps) for one in seconds)
            for (name, (count, _)), ns in zip(list(found.items())[1:], others, strict=True):
                more = ns - none
                goal = {"goal_ns": GOAL[count]} if method == "rk4" and dtype == "float64" and count in GOAL else {}
                about = {"sea": name, "method": method, "dtype": dtype, "ns_a_step_more_than_none": round(more, 1)}
                yield about | {"ns_a_component": round(more / count, 2), "step_over_none": round(ns / none, 2)} | goal
