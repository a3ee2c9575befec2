# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 learns to keep its depth: trained as an environment of Gymnasium, then run in the lanes as lw.control.Policy.

    python examples/controllers/train_a_policy.py [minutes] [picture]

A small perceptron looks at the depth error, the pitch, the heave and the pitch rate, and commands the stern planes; a PID in
the kernel keeps the heading. The learner is CMA-ES (pip install cma): each generation all candidates steer the same vehicles,
whose ballast, start and depth differ. Needs the extra gym and the package cma. docs/controllers/gym.md explains it.
"""

import sys
import time
from pathlib import Path

import cma
import numpy as np

import lgvi_warp as lw

INPUTS = ["depth_error", "down[0]", "velocity[2]", "angular_velocity[1]"]
HIDDEN, CANDIDATES, VEHICLES = 8, 32, 32
MOST_PLANES = 0.35  # rad of the stern planes, by an action of 1
WANTED, EPISODE, PERIOD = 10.0, 40.0, 0.1  # m, s, s
SHAPES = [(HIDDEN, len(INPUTS)), (HIDDEN,), (1, HIDDEN), (1,)]
NUMBERS = sum(int(np.prod(shape)) for shape in SHAPES)
VARY = {
    "vehicle.buoyancy": lw.distributions.Uniform(low=297.0, high=302.0),
    "start.position[2]": lw.distributions.Uniform(low=5.0, high=15.0),
    "start.velocity[0]": lw.distributions.Uniform(low=1.2, high=1.8),
}
# Of these demands the matrix makes radians of the planes: K M N -> rudder, stern planes.
PLANES = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])
HEADING = lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0, integral_limit=20.0)
DEPTH = lw.control.DepthPID(
    kp=0.1, ki=0.001, pitch_limit=0.5, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, integral_limit=[20, 20]
)


def scene(depth_law):
    """REMUS 100 with a heading law and a depth law."""
    wanted = lw.control.SetPoint(depth=WANTED, heading=0.5)
    controller = lw.Controller(period=PERIOD, guidance=[wanted], laws=[depth_law, HEADING], allocation=[PLANES])
    return lw.Scene.named("remus_100", start={"velocity": [1.54, 0.0, 0.0]}, controller=controller)


def weights(numbers):
    """Weights and biases (..., *shape) of the layers, from (..., NUMBERS) of the learner."""
    ends = np.cumsum([int(np.prod(shape)) for shape in SHAPES])
    parts = np.split(numbers, ends[:-1], axis=-1)
    return [part.reshape(*numbers.shape[:-1], *shape) for part, shape in zip(parts, SHAPES, strict=True)]


def environment():
    """CANDIDATES times the same vehicles, which a seed draws anew."""
    fleet = lw.Ensemble(scene(DEPTH), VEHICLES, 1, VARY).subset(np.tile(np.arange(VEHICLES), CANDIDATES))
    return lw.gym.VectorEnv(
        fleet,
        observe=INPUTS,
        instead_of="depth_pid",
        outputs=["M"],
        scale=MOST_PLANES,
        reward=lambda t, y, r, action: -np.minimum(np.abs(r.depth - y.depth), 5.0) - 0.1 * action[:, 0] ** 2,
        duration=EPISODE,
        autoreset_mode="Disabled",
        method="psi_x",
        h=0.02,
    )


def costs(env, candidates, seed):
    """Mean cost a second of each candidate (CANDIDATES,), over all vehicles and an episode."""
    W0, b0, W1, b1 = weights(np.array(candidates))
    seen, total = env.reset(seed=seed)[0], np.zeros(env.num_envs)
    for _ in range(round(EPISODE / PERIOD)):
        x = seen.reshape(CANDIDATES, VEHICLES, -1)
        x = np.tanh(np.einsum("chi,cvi->cvh", W0, x) + b0[:, None])
        actions = np.tanh(np.einsum("coh,cvh->cvo", W1, x) + b1[:, None])
        seen, reward, ended, _, _ = env.step(actions.reshape(env.num_envs, 1))
        assert not ended.any()
        total -= reward
    return total.reshape(CANDIDATES, VEHICLES).mean(axis=1) * PERIOD / EPISODE


def train(minutes):
    """Numbers of the best policy, and the lowest cost of each generation."""
    env, history, begun = environment(), [], time.perf_counter()
    learner = cma.CMAEvolutionStrategy(np.zeros(NUMBERS), 0.5, {"popsize": CANDIDATES, "seed": 1, "verbose": -9})
    while time.perf_counter() - begun < 60.0 * minutes:
        candidates = learner.ask()
        cost = costs(env, candidates, len(history))
        learner.tell(candidates, cost)
        history.append(cost.min())
        if len(history) % 10 == 1:
            print(f"generation {len(history)}: least cost {history[-1]:.3f}, after {time.perf_counter() - begun:.0f} s")
    # The centre of the search has met all vehicles so far, the best of a generation only some.
    return learner.result.xfavorite, history


def save(numbers, path):
    """Write the file that lw.control.Policy reads."""
    names = ("weights_0", "biases_0", "weights_1", "biases_1")
    np.savez(path, **dict(zip(names, weights(numbers), strict=True)))
    return path


def errors(law, members=1000):
    """Depth errors (k, members) [m] of vehicles that nobody was trained on, and the times."""
    fleet = lw.Ensemble(scene(law), members, 99, VARY)
    result = lw.solve(fleet, "psi_x", h=0.02, t1=60.0, save=lw.SaveAt(every=0.5, fields=("position",)))
    assert result.status.counts() == {"ok": members}
    return result.position[:, :, 2] - WANTED, result.time


def plot(history, each, path):
    """The learning curve, and depths of the members: median and the middle 90 %."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    learning, depths = figure.subplots(1, 2)
    learning.plot(np.arange(1, len(history) + 1), history)
    learning.set(title="Learning", xlabel="generation", ylabel="least cost [m]", yscale="log")
    for i, (name, (error, t)) in enumerate(each.items()):
        low, middle, high = np.quantile(error, [0.05, 0.5, 0.95], axis=1)
        depths.plot(t, middle, color=f"C{i}", label=name)
        depths.fill_between(t, low, high, color=f"C{i}", alpha=0.25)
    depths.set(title="1000 new vehicles: median, 5 % to 95 %", xlabel="time [s]", ylabel="depth error [m]")
    depths.legend()
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 3.0
    target = Path(sys.argv[2] if len(sys.argv) > 2 else "runs/policy.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    best, history = train(minutes)
    file = save(best, target.with_suffix(".npz"))
    settings = dict(inputs=INPUTS, outputs=["M"], scale=[MOST_PLANES], output_activation="tanh")
    each = {"policy": errors(lw.control.Policy(file=str(file), **settings)), "depth_pid": errors(DEPTH)}
    for name, (error, t) in each.items():
        late = error[t >= 30.0]
        print(f"{name}: root mean square depth error after 30 s {np.sqrt(np.mean(late**2)):.3f} m")
    print(plot(history, each, target))
