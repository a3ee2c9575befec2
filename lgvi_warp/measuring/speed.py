# SPDX-License-Identifier: Apache-2.0
"""Speed of the kernel on this machine, compared with the core's peak speed, measured in the same run."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring.cost import in_turn
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import Environment, Start

# Operations of a step of the example by psi_s: additions and multiplications, two for a fused pair; divisions do not count.
OPERATIONS = 459


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
    """Ensemble of the example with angular velocities that vary by 10 %."""
    from lgvi_warp.sampling.distributions.basic import Normal

    return Ensemble(
        dataclasses.replace(example(), terms=terms), members, 1, {"start.angular_velocity": Normal(relative=0.1)}
    )


def stepper(plan: Plan, *, make: Callable[..., Packets] = Packets) -> Callable[[], None]:
    """Prepare a call that makes all steps of a plan on one thread, without samples and preparation."""
    plan.compile()
    packets = make(plan, plan.ensemble.select(0, plan.ensemble.members))
    return lambda: void(packets.advance(0, plan.grid.steps))


def void(_: Any) -> None:
    """Accept any value and return nothing."""


def least(
    calls: Sequence[Callable[[], None]], rounds: int = 15, *, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Smallest wall time of each of several calls, timed in turn [s]; other programs can only lengthen a reading."""
    return [min(seconds) for seconds in in_turn(calls, rounds, clock)]


def measure(
    members: int = 4096, steps: int = 1000, *, prepare: Callable[[Plan], Callable[[], None]] = stepper,
    timed: Callable[[Sequence[Callable[[], None]]], list[float]] = least, peak_of: Callable[[str], float] = fma_peak,
) -> Iterator[str]:  # fmt: skip
    """Measure psi_s in both precisions, and the core's peak speed."""
    for dtype in ("float64", "float32"):
        plan = make_plan(fleet(members), "psi_s", h=0.01, t1=0.01 * steps, dtype=dtype)
        seconds = timed([prepare(plan)])[0] / (members * steps)
        yield json.dumps(record(plan, seconds, peak_of(dtype), OPERATIONS))


def record(plan: Plan, seconds: float, peak: float, operations: int | None) -> dict[str, Any]:
    """Record of one measurement of a kernel, `seconds` per vehicle and step, with the core's peak [1/s]."""
    return {
        "method": plan.method.name,
        "dtype": plan.dtype,
        "width": plan.spec.width,
        "ns_per_vehicle_step": round(1e9 * seconds, 2),
        "operations": operations,
        "peak_gfma": round(peak / 1e9, 1),
        "part_of_peak": None if operations is None else round(float(np.divide(operations / seconds, 2.0 * peak)), 3),
    }
