# SPDX-License-Identifier: Apache-2.0
"""Newton: free rigid bodies in one model, single precision. It has no added mass, so it runs the problem "rigid".

Warp's processor device runs a launch on one thread, so more threads are not asked for.
"""

from __future__ import annotations

from typing import Any

import newton
import numpy as np
import warp as wp

from benchmarks.peers.problem import End, Problem, Run, Runs, end_of

PROBLEMS = ("rigid",)
STEPS = (2, 8, 32, 128)  # a second
SOLVERS = {
    "semi-implicit": lambda model: newton.solvers.SolverSemiImplicit(model, angular_damping=0.0),
    "XPBD": lambda model: newton.solvers.SolverXPBD(model, angular_damping=0.0),
    "Featherstone": lambda model: newton.solvers.SolverFeatherstone(model, angular_damping=0.0),
}


def make_model(problem: Problem) -> Any:
    """A free body for each member, its inertia kept as given, the net weight as gravity."""
    assert np.ptp(problem.M) == 0.0
    assert not np.any(problem.d)
    mass, inertia = float(problem.M[0]), wp.mat33(*np.diag(problem.J).ravel())
    builder = newton.ModelBuilder(gravity=wp.vec3(0.0, 0.0, problem.net / mass))
    for one in problem.state():
        w, *xyz = one[3:7]
        builder.add_body(xform=wp.transform(one[:3], wp.quat(*xyz, w)), mass=mass, inertia=inertia, lock_inertia=True)
    return builder.finalize(device="cpu")


def make_run(problem: Problem, model: Any, name: str, rate: float) -> Run:
    """One setting."""
    solver, steps, h = SOLVERS[name](model), round(problem.t1 * rate), 1.0 / rate
    first, states, control = model.state(), [model.state(), model.state()], model.control()
    set_velocities(problem, model, first)

    def call() -> None:
        states[0].assign(first)
        for _ in range(steps):
            states[0].clear_forces()
            solver.step(states[0], states[1], control, None, h)
            states.reverse()

    def end() -> End:
        q = states[0].body_q.numpy()
        return end_of(q[:, [0, 1, 2, 6, 3, 4, 5]])

    return Run(name, f"h={h:g}", problem.members, call, end, "float32")


def set_velocities(problem: Problem, model: Any, state: Any) -> None:
    """Linear and angular, in inertial axes, of bodies and joints."""
    twists = [np.einsum("nij,nj->ni", problem.R, v) for v in (problem.nu, problem.Om)]
    state.body_qd.assign(np.concatenate(twists, axis=1).astype(np.float32))
    newton.eval_ik(model, state, state.joint_q, state.joint_qd)


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    if threads > 1:
        return
    model = make_model(problem)
    for name in SOLVERS:
        for rate in STEPS:
            yield make_run(problem, model, name, rate)
