# SPDX-License-Identifier: Apache-2.0
"""Operations of a step by scene and method, counted on an emulated ARM core: no figure depends on this machine.

`operations` are additions and multiplications in float64, two for a fused pair; `instructions` counts such a pair as one;
`slow` are divisions and square roots. Those of the steps of one vehicle, with their part of the checks. It needs the extra
arm, and some seconds a kernel.
"""

import tempfile
from pathlib import Path

import lgvi_warp as lw
from benchmarks import problems
from benchmarks.arm import cross, step
from lgvi_warp.common.errors import SceneError
from lgvi_warp.measuring import speed
from lgvi_warp.methods import method as methods

# Every method of `lgvi-warp list methods`; compositions are of psi_x there.
METHODS = (*methods.PROGRAMS, *methods.TWO_PART, *methods.GAUSS, *methods.RUNGE_KUTTA,
           *(f"{name}(psi_x)" for name in (*methods.COMPOSITIONS, *methods.HALVES)))  # fmt: skip
OF_VEHICLES = ("psi_s", "psi_x", "rk4", "rk5", "rk8", "rkw3")
OF_TERMS = ("psi_s", "rk4")
QUICK = {("paper", "psi_s"), ("remus_100", "rk4")}


def vehicle(name, ahead):
    """A named vehicle under way."""
    return lw.Scene.named(name, start={"velocity": [ahead, 0.1, 0.05], "angular_velocity": [0.02, 0.01, 0.03]})


def scenes():
    """Name -> scene, methods and step [s]."""
    named = {
        "paper": (speed.example(), METHODS, 0.01),
        "remus_100": (vehicle("remus_100", 1.54), OF_VEHICLES, 0.02),
        "bluerov2_heavy": (vehicle("bluerov2_heavy", 0.5), OF_VEHICLES, 0.02),
    }
    alone = problems.each_term() | {"all terms": problems.all_terms()}
    return named | {name: (scene, OF_TERMS, 0.01) for name, scene in alone.items()}


def entries(quick):
    """(scene's name, scene, method, step) of all that is counted."""
    return [
        (name, scene, method, h)
        for name, (scene, chosen, h) in scenes().items()
        for method in chosen
        if not quick or (name, method) in QUICK
    ]


def run(quick, known=()):
    """known: records of earlier runs, which are taken for the kernels that have not changed."""
    if cross.missing():
        yield {"operations": f"not counted: {cross.REMEDY}"}
        return
    kept = {(one["scene"], one["method"], one["kernel"]): one for one in known}
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, scene, method, h) in enumerate(entries(quick)):
            try:
                plan = step.plan_of(scene, method, h)
            except SceneError:
                continue  # the method does not take the term
            record = {"scene": name, "method": method, "h": h, "kernel": plan.kernel.hash}
            if (name, method, record["kernel"]) in kept:
                yield kept[name, method, record["kernel"]]
                continue
            tally = step.of_a_step(plan, Path(folder) / str(number))
            yield record | {key: round(getattr(tally, key), 1) for key in ("operations", "instructions", "slow")}
