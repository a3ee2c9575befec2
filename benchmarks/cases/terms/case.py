# SPDX-License-Identifier: Apache-2.0
"""ns per vehicle and step of each term alone and of all together, and of the methods for coupled inertia, on one core.

All scenes of one precision take turns in one run. `more_than_none` is what a term adds to psi_s with weight, buoyancy and
restoring moment alone; `over_none` is the ratio to it.
"""

from benchmarks import problems
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.sampling.distributions.basic import Normal
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.studies import speed

STEP = 0.01
SPREAD = {"start.angular_velocity": Normal(relative=0.1)}


def entries():
    """(name, method, scene) of all that is measured, "none" first."""
    alone = problems.each_term() | {"all terms": problems.all_terms()}
    vehicles = {"none": alone["none"]} | problems.coupled()
    found = [(name, "psi_s", scene) for name, scene in alone.items()]
    return found + [(name, method, scene) for name, scene in vehicles.items() for method in ("psi_x", "psi_x8")]


def run(quick):
    members, steps, rounds = (512, 50, 3) if quick else (4096, 200, 7)
    chosen = entries()
    for dtype in ("float64", "float32"):
        plans = [
            make_plan(Ensemble(scene, members, 1, SPREAD), method, h=STEP, t1=STEP * steps, dtype=dtype)
            for _, method, scene in chosen
        ]
        seconds = speed.interleaved([speed.stepper(plan) for plan in plans], rounds)
        times = [1e9 * one / (members * steps) for one in seconds]
        for (name, method, _), plan, ns in zip(chosen, plans, times, strict=True):
            yield {
                "term": name,
                "method": method,
                "dtype": dtype,
                "width": plan.spec.width,
                "ns_per_vehicle_step": round(ns, 2),
                "more_than_none": round(ns - times[0], 2),
                "over_none": round(ns / times[0], 2),
            }
