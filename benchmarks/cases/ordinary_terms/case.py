# SPDX-License-Identifier: Apache-2.0
"""The packet kernel against the ordinary one with all terms at once, one core; the ordinary module is compiled first.

Processor time, the least of all rounds: other work on the machine lengthens it least.
"""

from benchmarks import problems
from benchmarks.cases.ordinary_terms.kernel import command
from benchmarks.timing import least
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.sampling.distributions.basic import Normal
from lgvi_warp.scene.ensemble import Ensemble

STEP = 0.01


def run(quick):
    members, steps = (512, 20) if quick else (4096, 100)
    fleet = Ensemble(problems.all_terms(), members, 1, {"start.angular_velocity": Normal(relative=0.1)})
    start = fleet.select(0, members)
    states = (start.position, start.attitude, start.velocity, start.angular_velocity)
    for dtype in ("float64", "float32"):
        ordinary = command(fleet.scene, states, STEP, steps, dtype)[1]
        ordinary()
        plan = make_plan(fleet, "psi_s", h=STEP, t1=STEP * steps, dtype=dtype)
        slow, fast = (1e9 * one / (members * steps) for one in least([ordinary, speed.stepper(plan)], rounds=7))
        yield {
            "method": "psi_s",
            "terms": len(fleet.scene.terms),
            "dtype": dtype,
            "width": plan.spec.width,
            "ns_per_vehicle_step": round(fast, 1),
            "ordinary_ns_per_vehicle_step": round(slow, 1),
            "times_faster": round(slow / fast, 1),
        }
