# SPDX-License-Identifier: Apache-2.0
"""Cost of a derivative by dual lanes beside the run without: plain simulations a tangent, kernels alone.

The paper's vehicle and REMUS 100, one thread, by its time, in turn; with one tangent and with two. Central differences cost
2. heyoka's variational equations in its batch integrator, on the paper's vehicle, where that package is there.
"""

import time

import numpy as np

import lgvi_warp as lw
from lgvi_warp.measuring import speed
from lgvi_warp.runs import tangents
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.copies import with_copies

NAMES = {
    "paper": ("vehicle.mass", "vehicle.center_of_buoyancy[2]"),
    "remus_100": ("vehicle.buoyancy", "drag_matrix.quadratic[0,0]"),
}
ENTRIES = (("paper", "psi_s", 0.01), ("paper", "psi_x", 0.01), ("paper", "rk4", 0.05), ("paper", "rk8", 0.1),
           ("remus_100", "rk4", 0.02))  # fmt: skip
HEYOKA_TOLERANCE, END = 1e-9, 20.0


def fleet_of(name, members):
    """Members of a vehicle, of which the start varies."""
    if name == "paper":
        return speed.fleet(members)
    scene = lw.Scene.named(name, start={"velocity": [1.54, 0.1, 0.05], "angular_velocity": [0.02, 0.01, 0.03]})
    return lw.Ensemble(scene, members, vary={"start.velocity": lw.distributions.Normal(std=0.05)})


def run(quick):
    members, steps, rounds = (64, 20, 1) if quick else (2048, 500, 5)
    for name, method, h in ENTRIES[:1] if quick else ENTRIES:
        fleet, names = fleet_of(name, members), NAMES[name]
        plan = make_plan(fleet, method, h=h, t1=steps * h)
        every = with_copies(fleet, names)
        dual = [tangents.plan_of(plan, names[:count], every) for count in (1, 2)]
        calls = [speed.stepper(each) for each in (plan, *dual)]
        plain, *carried = speed.least(calls, rounds, clock=time.thread_time)
        yield {
            "scene": name,
            "method": method,
            "plain_ns_a_step": round(1e9 * plain / (members * steps), 1),
            "simulations_a_tangent": [round((each / plain - 1.0) / k, 2) for k, each in enumerate(carried, 1)],
            "compile_seconds": [round(sum(each.phases), 1) for each in (plan, *dual)],
        }
    yield heyoka(quick)


def heyoka(quick):
    """The same ratio of heyoka's batch integrator, with the variational equations by one and by two of the start's numbers."""
    try:
        import heyoka as hy
    except ImportError:
        return {"peer": "heyoka is not installed"}
    from benchmarks.peers.peer_heyoka import SIZE, system
    from benchmarks.peers.problem import make_problem

    problem = make_problem(8, END)
    equations = system(problem)
    width = 2 * hy.recommended_simd_size(float)
    start = np.repeat(problem.matrix_state()[:1].T, width, axis=1)
    systems = [equations] + [
        hy.var_ode_sys(equations, [variable for variable, _ in equations[-count:]], order=1) for count in (1, 2)
    ]
    integrators = [
        hy.taylor_adaptive_batch(each, np.ascontiguousarray(start), tol=HEYOKA_TOLERANCE) for each in systems
    ]
    begins = [each.state.copy() for each in integrators]
    assert len(begins[0]) == SIZE

    def call(integrator, begin):
        def propagate():
            integrator.set_time(0.0)
            integrator.state[:] = begin
            integrator.propagate_until(1.0 if quick else END)

        return propagate

    calls = [call(*pair) for pair in zip(integrators, begins, strict=True)]
    plain, *carried = speed.least(calls, 1 if quick else 15, clock=time.thread_time)
    ratios = [round((each / plain - 1.0) / k, 2) for k, each in enumerate(carried, 1)]
    return {"peer": f"heyoka {hy.__version__}, batch, tol {HEYOKA_TOLERANCE:g}", "simulations_a_tangent": ratios}
