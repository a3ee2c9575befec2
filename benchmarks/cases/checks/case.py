# SPDX-License-Identifier: Apache-2.0
"""Cost of each level of checks, and of a fleet in which every tenth member fails, frozen or by divided steps."""

import numpy as np

from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble

METHODS = ("psi_s", "psi", "psi_1", "psi_x", "kl8(psi_x)", "rk8")
LEVELS = ("none", "safe", "all")


def run(quick):
    members, steps = (512, 128) if quick else (4096, 384)
    fleet = speed.fleet(members)
    start = fleet.select(0, members)
    rates = np.where(np.arange(members)[:, None] % 10 == 0, 500.0, start.angular_velocity)
    sick = Ensemble.from_states(fleet.scene, start.position, start.attitude, start.velocity, rates)
    for dtype in ("float64", "float32"):
        for method in METHODS[:1] if quick else METHODS:
            solves = method in ("psi_s", "psi", "psi_1")
            settings = [(fleet, {"checks": checks}) for checks in LEVELS]
            settings += [(sick, {"checks": "safe"})] * solves
            plans = [
                make_plan(one, method, h=0.01, t1=0.01 * steps, dtype=dtype, **setting) for one, setting in settings
            ]
            seconds = speed.least([speed.stepper(plan) for plan in plans])
            none, safe, all_of_them = seconds[:3]
            record = {"method": method, "dtype": dtype} | {
                f"{level}_ns": round(1e9 * one / (members * steps), 2)
                for level, one in zip(LEVELS, seconds[:3], strict=True)
            }
            record |= {"safe_over_none": round(safe / none, 3), "all_over_none": round(all_of_them / none, 3)}
            yield record | ({"tenth_failing_over_none": round(seconds[3] / none, 3)} if solves else {})
    yield substepped(members, steps)


def substepped(members, steps):
    """A fleet of which one member in a hundred needs every step in two parts, beside the same that freezes them."""
    fleet = speed.fleet(members)
    start = fleet.select(0, members)
    rates = np.where(np.arange(members)[:, None] % 100 == 0, [[0.0, 0.0, 250.0]], start.angular_velocity)
    fast = Ensemble.from_states(fleet.scene, start.position, start.attitude, start.velocity, rates)
    plans = [make_plan(fast, "psi_s", h=0.01, t1=0.01 * steps, on_failure=how) for how in ("freeze", "substep")]
    freeze, substep = speed.least([speed.stepper(plan) for plan in plans])
    return {"method": "psi_s", "hundredth_by_substeps_over_frozen": round(substep / freeze, 3)}
