# SPDX-License-Identifier: Apache-2.0
"""Proximal policy optimisation in one file, as CleanRL has it, on the vectors of an lw.gym.VectorEnv.

    python examples/controllers/learn_depth_keeping.py

runs it. Nothing but NumPy and PyTorch is between the environment and the network (Schulman et al. 2017, Proximal policy
optimization algorithms; advantages by Schulman et al. 2016). The environment has autoreset "SameStep".
"""

import numpy as np
import torch
from torch import nn

# Layers of the policy and of the value; steps of all environments between two updates.
HIDDEN, JUDGE, ROLLOUT = 16, 64, 128
EPOCHS, BATCH, RATE, CLIP = 10, 256, 1e-3, 0.2
DISCOUNT, TRACE, SPREAD = 0.98, 0.95, -0.5  # SPREAD: log of the first standard deviation of actions


def network(sizes, last):
    """A perceptron of tanh; last: the size of its last weights."""
    layers = []
    for i, (width, height) in enumerate(zip(sizes[:-1], sizes[1:], strict=True)):
        layers += [nn.Tanh(), nn.Linear(width, height)] if i else [nn.Linear(width, height)]
        nn.init.orthogonal_(layers[-1].weight, last if i == len(sizes) - 2 else 2**0.5)
        nn.init.zeros_(layers[-1].bias)
    return nn.Sequential(*layers)


def advantages(rewards, values, ended, following):
    """Advantage of each action over the expectation (k, n); following: the value of what each step led to, 0 if terminated."""
    found, running = np.zeros_like(rewards), np.zeros(rewards.shape[1])
    for k in reversed(range(len(rewards))):
        surprise = rewards[k] + DISCOUNT * following[k] - values[k]
        running = surprise + DISCOUNT * TRACE * np.where(ended[k], 0.0, running)
        found[k] = running
    return found


def train(env, steps, size, gain, seed=1):
    """Learn from so many steps of environments.

    size: what an observation of 1 is, (k,). gain: factor of rewards, so that values are of the order of 1.
    Returns: weights and biases of the policy's layers, which take observations as they are; mean reward of each step.
    """
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    inputs, outputs = env.single_observation_space.shape[0], env.single_action_space.shape[0]
    policy, judge = network((inputs, HIDDEN, HIDDEN, outputs), 0.01), network((inputs, JUDGE, JUDGE, 1), 1.0)
    spread = nn.Parameter(torch.full((outputs,), SPREAD))
    numbers = [*policy.parameters(), *judge.parameters(), spread]
    learner, history = torch.optim.Adam(numbers, RATE, eps=1e-5), []

    def scaled(observed):
        return torch.as_tensor(observed / size, dtype=torch.float32)

    def value(observed):
        with torch.no_grad():
            return judge(scaled(observed))[:, 0].double().numpy()

    seen = env.reset(seed=seed)[0]
    for _ in range(steps // (ROLLOUT * env.num_envs)):
        rows = {name: [] for name in ("seen", "action", "chance", "reward", "value", "following", "ended")}
        for _ in range(ROLLOUT):
            with torch.no_grad():
                likely = torch.distributions.Normal(policy(scaled(seen)), spread.exp())
                action = likely.sample()
                chance = likely.log_prob(action).sum(1)
            after, reward, terminated, truncated, infos = env.step(action.clamp(-1.0, 1.0).double().numpy())
            ended, last = terminated | truncated, after.copy()
            if ended.any():
                last[ended] = np.stack(infos["final_obs"][ended])
            following = np.where(terminated, 0.0, value(last))
            step = (seen, action, chance, gain * reward, value(seen), following, ended)
            for row, number in zip(rows.values(), step, strict=True):
                row.append(number)
            seen = after
        reward, values, ended, following = (np.array(rows[n]) for n in ("reward", "value", "ended", "following"))
        better = advantages(reward, values, ended, following)
        observed, taken, before = (
            scaled(np.concatenate(rows["seen"])),
            torch.cat(rows["action"]),
            torch.cat(rows["chance"]),
        )
        target, better = (torch.as_tensor(x.ravel(), dtype=torch.float32) for x in (better + values, better))
        for _ in range(EPOCHS):
            for part in torch.randperm(len(better)).split(BATCH):
                likely = torch.distributions.Normal(policy(observed[part]), spread.exp())
                ratio = (likely.log_prob(taken[part]).sum(1) - before[part]).exp()
                worth = (better[part] - better[part].mean()) / (better[part].std() + 1e-8)
                gained = torch.minimum(ratio * worth, ratio.clamp(1.0 - CLIP, 1.0 + CLIP) * worth).mean()
                wrong = (judge(observed[part])[:, 0] - target[part]).square().mean()
                learner.zero_grad()
                (0.5 * wrong - gained).backward()
                nn.utils.clip_grad_norm_(numbers, 0.5)
                learner.step()
        history += (reward.mean(axis=1) / gain).tolist()
    layers = [(each.weight, each.bias) for each in policy if isinstance(each, nn.Linear)]
    (W, b), *others = [(W.detach().double().numpy(), b.detach().double().numpy()) for W, b in layers]
    return [(W / size, b), *others], history
