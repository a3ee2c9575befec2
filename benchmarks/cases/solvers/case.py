"""psi_s with each solver of equation (24): to the tolerance, and with fixed numbers of Newton steps."""

from lgvi_warp import speed
from lgvi_warp.method import SOLVERS, Method
from lgvi_warp.solving import make_plan


def run(quick):
    members, steps = (512, 100) if quick else (4096, 400)
    fleet = speed.fleet(members)
    for dtype in ("float64", "float32"):
        methods = [
            Method("psi_s", solver, k, None if k is None else 0.5) for solver in SOLVERS for k in (None, 0, 1, 2)
        ]
        plans = [make_plan(fleet, method, h=0.01, t1=0.01 * steps, dtype=dtype) for method in methods]
        seconds = speed.interleaved([speed.stepper(plan) for plan in plans])
        for method, one in zip(methods, seconds, strict=True):
            yield {
                "solver": method.solver,
                "iterations": method.iterations,
                "dtype": dtype,
                "ns_per_vehicle_step": round(1e9 * one / (members * steps), 2),
                "over_default": round(one / seconds[0], 2),
            }
