# SPDX-License-Identifier: Apache-2.0
"""ns per vehicle and step of each term alone and of all together, of driven vehicles, and of coupled inertia, on one core.

All scenes of one precision take turns in one run. `more_than_none` is what a term adds to the same method with weight,
buoyancy and restoring moment alone; `over_none` is the ratio to psi_s with these. rk4 takes no noisy current: its "all
terms" are without noise.
"""

from benchmarks import problems
from benchmarks.peers.plot import DRIVEN
from benchmarks.peers.problem import driven_scene
from benchmarks.timing import interleaved
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.sampling.distributions.basic import Normal, Uniform
from lgvi_warp.scene.ensemble import Ensemble

STEP = 0.01
SPREAD = {"start.angular_velocity": Normal(relative=0.1)}
# Of scenes with a grid: places within it, so that the members of a packet are in cells of their own.
PLACES = {"start.position": Uniform(low=[-35.0, -35.0, 2.0], high=[35.0, 35.0, 38.0])}
GRIDS = ("current_field", "current_field, 4 times", "events: floor on a grid")
# Of driven vehicles: explicit methods, and a splitting.
DRIVEN_METHODS = ("rk4", "rk8", "psi_x")
# What is measured quickly.
FEW = ("none", "drag", "current")


def entries(quick=False):
    """(name, method, scene) of all that is measured, "none" first."""
    alone = problems.each_term()
    alone = {name: alone[name] for name in FEW} if quick else alone
    found = [(name, "psi_s", scene) for name, scene in alone.items()]
    if quick:
        return [*found, ("none", "rk4", alone["none"])]
    vehicles = {"none": alone["none"]} | problems.coupled()
    found += [("all terms", "psi_s", problems.all_terms())]
    found += [(name, "rk4", scene) for name, scene in alone.items() if name != "gauss_markov_current"]
    # A splitting advances one inertia.
    found += [("moving_mass with its inertia", "rk4", problems.scene(problems.moving_mass(inertia=True)))]
    found += [("all terms", "rk4", problems.all_terms(noise=False))]
    found += [(name, method, driven_scene(name)) for name in DRIVEN for method in DRIVEN_METHODS]
    return found + [(name, method, scene) for name, scene in vehicles.items() for method in ("psi_x", "psi_x8")]


def spread(name):
    """Variations of the scene of this name."""
    return SPREAD | (PLACES if name in GRIDS else {})


def run(quick):
    members, steps, rounds = (512, 50, 3) if quick else (4096, 200, 7)
    chosen = entries(quick)
    for dtype in ("float64", "float32"):
        plans = [
            make_plan(Ensemble(scene, members, 1, spread(name)), method, h=STEP, t1=STEP * steps, dtype=dtype)
            for name, method, scene in chosen
        ]
        seconds = interleaved([speed.stepper(plan) for plan in plans], rounds)
        times = [1e9 * one / (members * steps) for one in seconds]
        none = {method: ns for (name, method, _), ns in zip(chosen, times, strict=True) if name == "none"}
        for (name, method, scene), plan, ns in zip(chosen, plans, times, strict=True):
            about = {"vehicle" if name in DRIVEN and scene.terms else "term": name, "method": method}
            yield about | {
                "dtype": dtype,
                "width": plan.spec.width,
                "ns_per_vehicle_step": round(ns, 2),
                "more_than_none": round(ns - none.get(method, times[0]), 2),
                "over_none": round(ns / times[0], 2),
            }
