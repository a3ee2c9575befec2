# SPDX-License-Identifier: Apache-2.0
"""The packet kernel against the ordinary one on the same fleet, one core; the ordinary module is compiled first."""

import numpy as np

from benchmarks.cases.ordinary.kernel import command
from benchmarks.counted import operations
from benchmarks.timing import interleaved
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan


def run(quick):
    members, steps = (512, 50) if quick else (4096, 200)
    fleet = speed.fleet(members)
    start = fleet.select(0, members)
    states = (start.position, start.attitude, start.velocity, start.angular_velocity)
    vehicle = fleet.scene.vehicle
    net = vehicle.mass * 9.8 - vehicle.buoyancy
    moment = vehicle.buoyancy * vehicle.center_of_buoyancy
    for method in ("psi", "psi_s"):
        for dtype in ("float64", "float32"):
            ordinary = command(states, vehicle.mass_matrix, vehicle.inertia, net, moment, 0.01, steps, method, dtype)[1]
            ordinary()
            plan = make_plan(fleet, method, h=0.01, t1=0.01 * steps, dtype=dtype)
            slow, fast = interleaved([ordinary, speed.stepper(plan)])
            record = speed.record(plan, fast / (members * steps), fma_peak(dtype), operations(plan.method))
            yield record | {
                "ordinary_ns_per_vehicle_step": round(1e9 * slow / (members * steps), 1),
                "times_faster": round(float(np.divide(slow, fast)), 1),
            }
