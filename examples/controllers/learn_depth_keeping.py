# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 learns to keep its depth by two learners from 200,000 steps each; then both policies run in the lanes.

    python examples/controllers/learn_depth_keeping.py [steps] [picture]

One learner is PPO of Stable-Baselines3, through lw.gym.sb3; the other ppo.py beside this file, in one file as CleanRL has it.
They see the depth error, the pitch, the heave and the pitch rate, and command the stern planes; a PID in the kernel keeps the
heading. Needs the extra learn. docs/controllers/learn_depth_keeping.md explains it.
"""

import sys
from pathlib import Path

import numpy as np
import ppo
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

import lgvi_warp as lw

INPUTS = ["depth_error", "down[0]", "velocity[2]", "angular_velocity[1]"]
SIZE = np.array([3.0, 0.2, 0.1, 0.1])  # m, 1, m/s, rad/s: what is usual of each
MOST_PLANES = 0.35  # rad of the stern planes, by an action of 1
WANTED, EPISODE, PERIOD, VEHICLES = 10.0, 40.0, 0.1, 32  # m, s, s
DISCOUNT = 0.98
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


def fleet(law, members, seed):
    """REMUS 100 with a heading law and a depth law."""
    wanted = lw.control.SetPoint(depth=WANTED, heading=0.5)
    controller = lw.Controller(period=PERIOD, guidance=[wanted], laws=[law, HEADING], allocation=[PLANES])
    scene = lw.Scene.named("remus_100", start={"velocity": [1.54, 0.0, 0.0]}, controller=controller)
    return lw.Ensemble(scene, members, seed, VARY)


def environment():
    """Vehicles whose stern planes a learner commands."""
    return lw.gym.VectorEnv(
        fleet(DEPTH, VEHICLES, 1),
        observe=INPUTS,
        instead_of="depth_pid",
        outputs=["M"],
        scale=MOST_PLANES,
        reward=lambda t, y, r, action: -np.minimum(np.abs(r.depth - y.depth), 5.0) - 0.1 * action[:, 0] ** 2,
        duration=EPISODE,
        autoreset_mode="SameStep",
        method="psi_x",
        h=0.02,
    )


class Rewards(BaseCallback):
    """Mean reward of each step, before it is normalised."""

    def __init__(self):
        super().__init__()
        self.history = []

    def _on_step(self):
        self.history.append(self.training_env.get_original_reward().mean())
        return True


def by_stable_baselines(steps, seed=1):
    """Layers of the policy that PPO of Stable-Baselines3 finds, and its mean rewards."""
    torch.set_num_threads(1)
    env, rewards = VecNormalize(lw.gym.sb3(environment()), gamma=DISCOUNT), Rewards()
    shape = dict(net_arch=dict(pi=[16, 16], vf=[64, 64]), log_std_init=-0.5)
    settings = dict(n_steps=128, batch_size=256, learning_rate=1e-3, gamma=DISCOUNT, policy_kwargs=shape)
    model = PPO("MlpPolicy", env, seed=seed, device="cpu", **settings)
    model.learn(steps, callback=rewards)
    layers = [each for each in model.policy.mlp_extractor.policy_net if isinstance(each, torch.nn.Linear)]
    layers = [each.state_dict() for each in (*layers, model.policy.action_net)]
    (W, b), *others = [(each["weight"].double().numpy(), each["bias"].double().numpy()) for each in layers]
    # The policy saw (x - mean) / deviation; in the lanes it sees x.
    mean, deviation = env.obs_rms.mean, np.sqrt(env.obs_rms.var + env.epsilon)
    return [(W / deviation, b - W @ (mean / deviation)), *others], rewards.history


def law_of(layers, path):
    """Write the file that lw.control.Policy reads, and give the law."""
    names = ("weights", "biases")
    np.savez(
        path, **{f"{name}_{i}": part for i, layer in enumerate(layers) for name, part in zip(names, layer, strict=True)}
    )
    settings = dict(inputs=INPUTS, outputs=["M"], scale=[MOST_PLANES], output_activation="clip")
    return lw.control.Policy(file=str(path), **settings)


def errors(law, members=1000):
    """Depth errors (k, members) [m] of vehicles that nobody was trained on, and the times."""
    result = lw.solve(
        fleet(law, members, 99), "psi_x", h=0.02, t1=60.0, save=lw.SaveAt(every=0.5, fields=("position",))
    )
    assert result.status.counts() == {"ok": members}
    return result.position[:, :, 2] - WANTED, result.time


def plot(histories, each, path):
    """The mean rewards of episodes while learning, and how far off their depth the vehicles are under each law."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    learning, depths = figure.subplots(1, 2)
    length = round(EPISODE / PERIOD)
    for name, history in histories.items():
        episodes = np.reshape(history[: len(history) // length * length], (-1, length)).mean(axis=1)
        made = length * VEHICLES * np.arange(1, len(episodes) + 1) / 1000.0
        learning.plot(made, episodes, "o-", markersize=4, label=name)
    learning.set(
        title="Learning", xlabel="steps of environments [thousands]", ylabel="mean reward of an episode's steps"
    )
    learning.legend()
    for i, (name, (error, t)) in enumerate(each.items()):
        depths.plot(t, np.sqrt(np.mean(error**2, axis=1)), color=f"C{i}" if name in histories else "0.5", label=name)
    depths.set(title="1000 new vehicles", xlabel="time [s]", ylabel="root mean square depth error [m]", yscale="log")
    depths.legend()
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
    target = Path(sys.argv[2] if len(sys.argv) > 2 else "runs/learn_depth_keeping.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    found = {
        "PPO of Stable-Baselines3": by_stable_baselines(steps),
        "ppo.py": ppo.train(environment(), steps, SIZE, 0.1),
    }
    laws = {
        name: law_of(layers, target.with_name(f"policy_{i}.npz")) for i, (name, (layers, _)) in enumerate(found.items())
    }
    each = {name: errors(law) for name, law in (laws | {"depth_pid": DEPTH}).items()}
    for name, (error, t) in each.items():
        print(f"{name}: root mean square depth error after 30 s {np.sqrt(np.mean(error[t >= 30.0] ** 2)):.3f} m")
    print(plot({name: history for name, (_, history) in found.items()}, each, target))
