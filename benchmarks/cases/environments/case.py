# SPDX-License-Identifier: Apache-2.0
"""Vehicles as environments of Gymnasium, and a law in Python, beside the law in the kernel and environments of others."""

import time
from functools import partial

import numpy as np

import lgvi_warp as lw
from benchmarks.cases.environments import others
from benchmarks.cases.environments.others import EVERY, STEP
from benchmarks.timing import least
from lgvi_warp.extensions.learning.episodes import Episodes
from lgvi_warp.runs.settle import make_plan

EPISODE = 20.0
VARY = {
    "vehicle.buoyancy": lw.distributions.Uniform(low=297.0, high=302.0),
    "start.position[2]": lw.distributions.Uniform(low=5.0, high=15.0),
}
GAINS = dict(kp=1.0, kd=2.0)
PLANES = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])
DEPTH = lw.control.DepthPID(
    kp=0.1, ki=0.001, pitch_limit=0.5, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, integral_limit=[20, 20]
)


def scene(*laws, every=EVERY):
    """REMUS 100 with these laws; every: steps a period."""
    wanted = lw.control.SetPoint(depth=10.0, heading=0.5)
    controller = lw.Controller(period=every * STEP, guidance=[wanted], laws=laws, allocation=[PLANES])
    return lw.Scene.named("remus_100", start={"velocity": [1.54, 0.0, 0.0]}, controller=controller)


def heading(t, y, r, members):
    """The heading law in NumPy."""
    s, c = r.attitude[:, :2, 0], y.attitude[:, :2, 0]
    e = np.arctan2(s[:, 1] * c[:, 0] - s[:, 0] * c[:, 1], np.sum(s * c, axis=1))
    demand = np.zeros((len(members), 6))
    demand[:, 5] = GAINS["kp"] * e + GAINS["kd"] * (r.angular_velocity[:, 2] - y.angular_velocity[:, 2])
    return demand


def environments(members, steps, rounds):
    """Steps of environments whose episodes end at different times, beside a run with all laws in the kernel."""
    fleet = lw.Ensemble(scene(DEPTH, lw.control.HeadingPID(**GAINS)), members, 1, VARY)
    env = lw.gym.VectorEnv(
        fleet,
        observe=["depth_error", "down[0]", "velocity", "angular_velocity"],
        reward=lambda t, y, r: -np.abs(r.depth - y.depth),
        terminated=lambda t, y, r: np.random.default_rng(round(t / STEP)).random(members) < EVERY * STEP / EPISODE,
        instead_of="depth_pid",
        outputs=["M"],
        scale=0.35,
        method="psi_x",
        h=STEP,
    )
    actions, acts = np.zeros((members, 1)), {}

    def act(some):
        for _ in range(steps):
            some.step(actions)

    whole = lw.Ensemble(scene(DEPTH, lw.control.HeadingPID(**GAINS)), members, 1, VARY)
    begun = dict(method="psi_x", h=STEP, t1=STEP * EVERY * steps, threads=1, save=lw.SaveAt(fields=("position",)))
    lw.solve(whole, **begun)
    env.reset(seed=1)
    acts["step"] = partial(act, env)
    try:
        acts["sb3"] = partial(act, lw.gym.sb3(env))
    except ImportError as error:
        missing = {"stable_baselines3_missing": error.name}
    else:
        missing = {}
    for each in acts.values():
        each()
    *taken, fused = least([*acts.values(), lambda: lw.solve(whole, **begun)], rounds, clock=time.process_time)
    told = {"environments": members, "steps_a_period": EVERY, "environment_steps_per_s": round(members * steps / taken[0]),
            "to_a_run_of_the_same_loop": round(taken[0] / fused, 2)}  # fmt: skip
    through = {} if missing else {"through_stable_baselines3_to_without": round(taken[1] / taken[0], 2)}
    return told | through | missing


def ticks(members, steps, rounds):
    """Cost of an exchange with the host beside the launches: answers written, ticks read."""
    fleet = lw.Ensemble(scene(lw.control.Callback(heading), lw.control.HeadingPID(**GAINS)), members, 1, VARY)
    plan = make_plan(fleet, "psi_x", STEP, STEP * EVERY * steps * (2 * rounds + 2), lw.SaveAt(fields=("position",)))
    plan.compile()
    episodes, values = Episodes(plan, fleet.select(0, members)), np.zeros((members, 6))

    def launch():
        for _ in range(steps):
            episodes.packets.launch(episodes.steps, episodes.steps + EVERY)
            episodes.steps += EVERY

    def exchanged():
        for _ in range(steps):
            episodes.advance(values)
            episodes.signals()

    alone, both = least([launch, exchanged], rounds, clock=time.process_time)
    return {"members": members, "steps_a_period": EVERY, "part_of_the_exchange": round(1.0 - alone / both, 3)}


def exchange(members, every, steps, rounds):
    """A run whose heading law is in NumPy, beside the same law in the kernel; every: steps a period."""
    laws = {"callback": lw.control.Callback(heading), "fused": lw.control.HeadingPID(**GAINS)}
    settings = dict(method="psi_x", h=STEP, t1=STEP * steps, threads=1, save=lw.SaveAt(fields=("position",)))
    fleets = {name: lw.Ensemble(scene(DEPTH, law, every=every), members, 1, VARY) for name, law in laws.items()}
    for fleet in fleets.values():
        lw.solve(fleet, **settings)
    runs = [partial(lw.solve, fleet, **settings) for fleet in fleets.values()]
    asked, fused = least(runs, rounds, clock=time.process_time)
    return {"members": members, "steps_a_period": every, "callback_to_fused": round(asked / fused, 2)}


def run(quick):
    rounds, steps = (2, 5) if quick else (6, 100)
    ours = 0.0
    for members in (256,) if quick else (1024, 4096):
        record = environments(members, steps, rounds)
        ours = max(ours, record["environment_steps_per_s"])
        yield record
        yield ticks(members, steps, rounds)
    for members, every in ((256, EVERY),) if quick else ((256, EVERY), (1024, EVERY), (4096, EVERY), (4096, 1)):
        yield exchange(members, every, steps * EVERY if members > 1024 else steps * EVERY * 4, rounds)
    yield from others.measure(quick, ours)
