# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's rollout: a free rigid body. It has no added mass, so it runs the problem "rigid"; the net weight is gravity."""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from benchmarks.peers.problem import End, Problem, Run, Runs, end_of

PROBLEMS = ("rigid",)
MEMBERS = 64
STEPS = {"RK4": (0.5, 1, 2, 4, 8, 16, 32, 64, 128), "implicitfast": (2, 8, 32, 128, 512), "Euler": (2, 8, 32, 128, 512)}
CHUNK = 64  # steps a call: every one of its states is returned

MODEL = """
<mujoco>
  <option timestep="{h!r}" integrator="{integrator}" gravity="0 0 {gravity!r}">
    <flag constraint="disable" contact="disable"/>
  </option>
  <worldbody>
    <body>
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass!r}" diaginertia="{J[0]!r} {J[1]!r} {J[2]!r}"/>
    </body>
  </worldbody>
</mujoco>
"""


def make_model(problem: Problem, integrator: str, h: float) -> mujoco.MjModel:
    """The vehicle as a free body."""
    assert np.ptp(problem.M) == 0.0
    assert not np.any(problem.d)
    mass, J = float(problem.M[0]), [float(x) for x in problem.J]
    text = MODEL.format(h=h, integrator=integrator, gravity=problem.net / mass, mass=mass, J=J)
    return mujoco.MjModel.from_xml_string(text)


def start_of(problem: Problem) -> np.ndarray:
    """Time, position, quaternion, velocity in inertial axes, angular velocity in body axes."""
    state = problem.state()
    state[:, 7:10] = np.einsum("nij,nj->ni", problem.R, problem.nu)
    return np.concatenate([np.zeros((len(state), 1)), state], axis=1)


def make_run(problem: Problem, threads: int, integrator: str, rate: float) -> Run:
    """One setting."""
    model, start = make_model(problem, integrator, problem.steps(rate)[0]), start_of(problem)
    datas, pool = [mujoco.MjData(model) for _ in range(threads)], Rollout(nthread=threads)
    h, steps = problem.steps(rate)
    ends = [start]

    def call() -> None:
        state = start
        for first in range(0, steps, CHUNK):
            # A new array each time: what rollout returns may not be what it is given.
            state = np.ascontiguousarray(pool.rollout(model, datas, state, nstep=min(CHUNK, steps - first))[0][:, -1])
        ends[0] = state

    def end() -> End:
        return end_of(ends[0][:, 1:])

    return Run(integrator, f"h={h:g}", problem.members, call, end)


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    problem = problem.first(MEMBERS)
    for integrator, rates in STEPS.items():
        for rate in rates:
            yield make_run(problem, threads, integrator, rate)
