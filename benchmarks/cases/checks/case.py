"""What the status of each member costs: the kernel with and without it, and a fleet in which every tenth member fails."""

import numpy as np

from lgvi_warp import speed
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.solving import make_plan


def run(quick):
    members, steps = (512, 100) if quick else (4096, 400)
    fleet = speed.fleet(members)
    start = fleet.select(0, members)
    rates = np.where(np.arange(members)[:, None] % 10 == 0, 500.0, start.angular_velocity)
    sick = Ensemble.from_states(fleet.scene, start.position, start.attitude, start.velocity, rates)
    for dtype in ("float64", "float32"):
        for method in ("psi", "psi_s", "psi_1"):
            plans = [
                make_plan(one, method, h=0.01, t1=0.01 * steps, dtype=dtype, checks=checks)
                for one, checks in ((fleet, "none"), (fleet, "safe"), (sick, "safe"))
            ]
            none, safe, failing = speed.interleaved([speed.stepper(plan) for plan in plans])
            yield {
                "method": method,
                "dtype": dtype,
                "none_ns": round(1e9 * none / (members * steps), 2),
                "safe_ns": round(1e9 * safe / (members * steps), 2),
                "safe_over_none": round(safe / none, 3),
                "tenth_failing_over_none": round(failing / none, 3),
            }
