# SPDX-License-Identifier: Apache-2.0
"""Environments of others, each another body and another method: steps of ten integration steps a second of processor time.

None of them is our vehicle: they say what a learner gets elsewhere for a step of an environment, and what that step holds.
A package that is missing gives a line that says so.
"""

import time
from pathlib import Path

import gymnasium
import numpy as np

from benchmarks import own_process
from benchmarks.peers.run import keep_to_cores
from benchmarks.timing import least

# Ten steps a period, as in a training.
STEP, EVERY = 0.01, 10
# An ellipsoid of the size of REMUS 100, neutral, in MuJoCo's model of a fluid: drag, lift and the forces of added mass, which
# act as forces beside the inertia of the body alone. Six commands are its wrench.
FREE_BODY = """
<mujoco>
  <option timestep="0.01" integrator="implicitfast" density="1025" viscosity="0.001" gravity="0 0 0">
    <flag constraint="disable" contact="disable"/>
  </option>
  <worldbody>
    <body>
      <freejoint/>
      <geom type="ellipsoid" size="0.67 0.095 0.095" mass="30" fluidshape="ellipsoid"/>
      <site name="origin"/>
    </body>
  </worldbody>
  <actuator>
    <general site="origin" gear="1 0 0 0 0 0"/> <general site="origin" gear="0 1 0 0 0 0"/>
    <general site="origin" gear="0 0 1 0 0 0"/> <general site="origin" gear="0 0 0 1 0 0"/>
    <general site="origin" gear="0 0 0 0 1 0"/> <general site="origin" gear="0 0 0 0 0 1"/>
  </actuator>
</mujoco>
"""


class Plain(gymnasium.Env):
    """A vehicle that sinks and pitches, in Python: less than a tenth of the numbers of ours."""

    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (4,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = [self.np_random.uniform(5.0, 15.0), 0.0, 0.0, 0.0]
        return np.array(self.state, np.float32), {}

    def step(self, action):
        z, pitch, w, q = self.state
        moment = float(action[0])
        for _ in range(EVERY):
            z += STEP * (w - 1.54 * pitch)
            pitch += STEP * q
            w -= STEP * (2.0 * w + 3.0 * abs(w) * w)
            q += STEP * (moment - 2.0 * q - 3.0 * abs(q) * q - 0.5 * pitch)
        self.state = [z, pitch, w, q]
        return np.array(self.state, np.float32), -abs(z - 10.0), False, False, {}


def speed_of(act, members, steps, rounds, clock=time.process_time):
    """Steps of environments a second; act: makes a step of all members."""

    def several():
        for _ in range(steps):
            act()

    several()
    return members * steps / least([several], rounds, clock=clock)[0]


def sync_vector_env(members, steps, rounds):
    """Gymnasium's own vector environment, one vehicle after the other."""
    env = gymnasium.vector.SyncVectorEnv([Plain] * members)
    env.reset(seed=1)
    actions = np.zeros((members, 1), np.float32)
    return speed_of(lambda: env.step(actions), members, steps, rounds)


def async_vector_env(members, steps, rounds):
    """The same with a process for each vehicle; processor time of all of them."""
    env = gymnasium.vector.AsyncVectorEnv([Plain] * members)
    env.reset(seed=1)
    actions = np.zeros((members, 1), np.float32)
    nanoseconds = [Path(f"/proc/{process.pid}/schedstat") for process in env.processes]

    def clock():
        return time.process_time() + 1e-9 * sum(int(path.read_text().split()[0]) for path in nanoseconds)

    speed = speed_of(lambda: env.step(actions), members, steps, rounds, clock)
    env.close()
    return speed


def mujoco_rollout(members, steps, rounds):
    """A free body in MuJoCo's rollout, in the calling thread: commands in, states after ten steps out."""
    import mujoco
    from mujoco.rollout import Rollout

    model = mujoco.MjModel.from_xml_string(FREE_BODY)
    assert model.opt.timestep == STEP
    data, pool = mujoco.MjData(model), Rollout(nthread=0)
    state = np.zeros((members, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    state[:, 4] = 1.0  # time, position, quaternion, velocities
    commands = np.tile(np.random.default_rng(1).normal(size=(members, 1, model.nu)), (1, EVERY, 1))

    def act():
        # A new array each time: what rollout returns may not be what it is given.
        state[...] = pool.rollout(model, [data], state.copy(), commands, nstep=EVERY)[0][:, -1]

    speed = speed_of(act, members, steps, rounds)
    assert np.isfinite(state).all()
    assert (np.abs(state[:, 1:4]).max(axis=1) > 0.0).all()
    return speed


def crazyflow(members, steps, rounds):
    """A quadrotor in JAX: rigid body with four rotors, whose attitude controller looks at every step of 0.002 s."""
    import mujoco

    mujoco.set_mju_user_warning(lambda text: None)  # else a log of warnings is left in this folder
    from crazyflow.dynamics import Dynamics
    from crazyflow.envs import ReachPosEnv

    env = ReachPosEnv(num_envs=members, freq=50, dynamics=Dynamics.first_principles)
    assert env.n_substeps == EVERY
    env.reset(seed=1)
    actions = np.zeros((members, 4), np.float32)
    actions[:, 3] = 0.35  # N: about the weight

    def act():
        observations, rewards, *_ = env.step(actions)
        return [np.asarray(x) for x in (*observations.values(), rewards)]

    return speed_of(act, members, steps, rounds)


# Name -> (function, its body, members and steps, the same with --quick).
OTHERS = {
    "SyncVectorEnv": (sync_vector_env, "4 numbers, plain Python", (64, 100), (64, 5)),
    "AsyncVectorEnv": (async_vector_env, "4 numbers, plain Python", (16, 400), (4, 20)),
    "MuJoCo rollout": (mujoco_rollout, "free ellipsoid in a fluid, float64", (1024, 10), (64, 5)),
    "crazyflow": (crazyflow, "quadrotor, float32", (4096, 50), (256, 5)),
}


def alone(name, members, steps, rounds):
    """The speed of one of them on one core, for a process of its own; or the package that is missing."""
    keep_to_cores(1)  # before JAX counts them
    try:
        return {"environment_steps_per_s": round(OTHERS[name][0](members, steps, rounds))}
    except ModuleNotFoundError as error:
        return {"missing": error.name}


def measure(quick, ours):
    """A line for each.

    ours: steps of our environments a second.
    """
    for name, (_, body, full, few) in OTHERS.items():
        members, steps = few if quick else full
        result = own_process.call(alone, name, members, steps, 2 if quick else 5)
        if "missing" not in result:
            result["ours_to_it"] = round(ours / result["environment_steps_per_s"], 2)
        yield {"other": name, "body": body, "environments": members, "steps_a_period": EVERY} | result
