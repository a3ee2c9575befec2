# SPDX-License-Identifier: Apache-2.0
"""Speed of the kernel on this machine, next to the peak of the core measured in the same run."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Any

import numpy as np

from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring.cost import in_turn
from lgvi_warp.methods.method import COMPOSITIONS, HALVES, Method
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import Environment, Start

# Operations of one step of the example: additions and multiplications, two for a fused pair; divisions are not counted.
# `python -m benchmarks run operations` counts them at a step of 0.01 s, where the start value of (24) is within its tolerance.
OPERATIONS = {
    "phi": 269, "phi_adjoint": 269, "psi": 471, "psi_s": 459, "psi_1": 305, "psi_x": 299, "psi_x8": 377,
    "psi_w": 1375, "rkn4_6": 2125, "rkn6_11": 3895, "rkn6_14": 4959, "gauss4": 2288, "gauss6": 3279, "gauss8": 4146,
    "gauss10": 5080, "gauss12": 5387, "rk4": 529, "rk5": 946, "rk5_ck": 904, "rk8": 2170, "rkw3": 529, "cg3": 1315,
    "rkmk4": 1081,
}  # fmt: skip
SOLVES = {"phi": 1, "phi_adjoint": 1, "psi": 2, "psi_s": 2, "psi_1": 1}
# Of one Newton step of a solve, and of the test against its tolerance, which a fixed number of steps does without.
NEWTON, RESIDUAL = 15, 9
# Of one length of a stage: what a single step forms once, before the first.
LENGTH = 4.75


def operations(method: str, iterations: int | None = None) -> int | None:
    """Arithmetic operations of one step of the example, a fused pair as two; None for methods that were not counted.

    iterations: Newton steps of a solve; None for as many as its tolerance asks for, none at short steps.
    """
    composition, _, base = method.rstrip(")").rpartition("(")
    if base not in OPERATIONS:
        return None
    of_solve = 0 if iterations is None else NEWTON * iterations - RESIDUAL
    count = OPERATIONS[base] + SOLVES.get(base, 0) * of_solve
    if not composition:
        return count
    lengths = 2 if composition in HALVES else 1
    return round(stages_of(composition) * (count + LENGTH * lengths))


def stages_of(composition: str) -> int:
    """Number of steps of its base in a composition."""
    return len(COMPOSITIONS[composition][1] if composition in COMPOSITIONS else HALVES[composition][1])


def example() -> Scene:
    """The example of Nordkvist & Sanyal (2010)."""
    vehicle = Vehicle(
        123.8,
        inertia=[5.46, 5.29, 5.72],
        added_mass=[65.0, 70.0, 75.0],
        buoyancy=1215.8,
        center_of_buoyancy=[0.0, 0.0, -0.007],
    )
    start = Start([0.0, 0.0, 10.0], rotation_vector=[1.0, 2.0, 3.0], velocity_inertial=[0.1, 0.2, 1.0],
                  angular_velocity=[0.3, 0.2, 0.1])  # fmt: skip
    return Scene(vehicle, Environment(gravity=9.8), start=start)


def fleet(members: int, *terms: Term) -> Ensemble:
    """Members around the example, whose angular velocities vary by 10 %."""
    from lgvi_warp.sampling.distributions.basic import Normal

    return Ensemble(
        dataclasses.replace(example(), terms=terms), members, 1, {"start.angular_velocity": Normal(relative=0.1)}
    )


def stepper(plan: Plan, *, make: Callable[..., Packets] = Packets) -> Callable[[], None]:
    """Prepare a call that makes all steps of a plan on one thread, without samples and set-up."""
    plan.compile()
    packets = make(plan, plan.ensemble.select(0, plan.ensemble.members))
    return lambda: void(packets.advance(0, plan.grid.steps))


def void(_: Any) -> None:
    """Accept any value and return nothing."""


def interleaved(
    calls: Sequence[Callable[[], None]], rounds: int = 5, *, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Median wall time of calls in turn [s], after one call of each to warm up."""
    in_turn(calls, 1, clock)
    return [median(seconds) for seconds in in_turn(calls, rounds, clock)]


def least(
    calls: Sequence[Callable[[], None]], rounds: int = 15, *, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Least wall time of calls in turn [s]: other work on the machine can only lengthen a reading."""
    return [min(seconds) for seconds in in_turn(calls, rounds, clock)]


def measure(
    members: int = 4096, steps: int = 1000, *, prepare: Callable[[Plan], Callable[[], None]] = stepper,
    timed: Callable[[Sequence[Callable[[], None]]], list[float]] = interleaved, peak_of: Callable[[str], float] = fma_peak,
) -> Iterator[str]:  # fmt: skip
    """Measure psi_s in both precisions next to the peak of the core."""
    for dtype in ("float64", "float32"):
        plan = make_plan(fleet(members), "psi_s", h=0.01, t1=0.01 * steps, dtype=dtype)
        seconds = timed([prepare(plan)])[0] / (members * steps)
        peak = peak_of(dtype)
        yield json.dumps(record(plan.method, dtype, plan.spec.width, seconds, peak))


def record(method: Method, dtype: str, width: int, seconds: float, peak: float) -> dict[str, Any]:
    """Describe one measurement of a kernel, `seconds` a vehicle and step, next to the core's peak [1/s]."""
    iterations = None if method.iterations is None else int(method.iterations)
    count = None if method.adaptive else operations(method.name, iterations)
    return {
        "method": method.name,
        "dtype": dtype,
        "width": width,
        "ns_per_vehicle_step": round(1e9 * seconds, 2),
        "operations": count,
        "peak_gfma": round(peak / 1e9, 1),
        "part_of_peak": None if count is None else round(float(np.divide(count / seconds, 2.0 * peak)), 3),
    }
