# SPDX-License-Identifier: Apache-2.0
"""`lw.gym.sb3`: a vector environment as a `VecEnv`, the only type that learners of Stable-Baselines3 accept."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import members_of
from lgvi_warp.common.errors import MissingExtra, refusal
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.extensions.learning.gym import Vehicles, step_by

# What the base class of Stable-Baselines3 calls indices: one, several, or None for all.
Indices = int | Iterable[int] | None


def sb3(env: Vehicles) -> Any:
    """Convert a vector environment to a `VecEnv`, the type that learners of Stable-Baselines3 accept.

    When an episode ends, the step returns the first observation of the next episode, whatever the autoreset mode of `env`.
    In infos[i], for environment i, "terminal_observation" is the last observation of the ended episode.
    "TimeLimit.truncated" is True if the episode ended only because of its duration. "status" is the vehicle's status if the
    vehicle failed or an event stopped it. The environment is shared, not copied: use either `env` or the result, not both.

    Args:
        env: The environment, an `lw.gym.VectorEnv` with bounds of its actions.

    Returns:
        A stable_baselines3.common.vec_env.VecEnv with the environments and spaces of `env`. After `seed(s)`, the next
        `reset()` uses the seed s for all environments. Rewards are float32 (num_envs,).

    Raises:
        SceneError: If `env` is not an `lw.gym.VectorEnv`, or its actions have no bounds.
        MissingExtra: If Stable-Baselines3 is not installed.

    Examples:
        >>> import lgvi_warp as lw
        >>> parts = dict(guidance=[lw.control.SetPoint(depth=9.0)], laws=[lw.control.HeavePID(kp=40.0, kd=60.0)])
        >>> scene = lw.Scene.named("bluerov2_heavy", controller=lw.Controller(period=0.1, **parts))
        >>> env = lw.gym.VectorEnv(scene, observe=["depth_error", "down"], act="thrusters", num_envs=4, h=0.02, duration=8.0)
        >>> for_learners = lw.gym.sb3(env)  # then stable_baselines3.PPO("MlpPolicy", for_learners).learn(100_000)
        >>> for_learners.reset().shape
        (4, 4)
    """
    made = _vec_env(needed())
    if not isinstance(env, Vehicles):
        problem = "is not a lw.gym.VectorEnv"
        raise refusal("env", type(env).__name__, problem, "give it without wrappers; Stable-Baselines3 has its own")
    space: Any = env.single_action_space
    if not np.isfinite([space.low, space.high]).all():
        remedy = "give scale= to lw.gym.VectorEnv, what an action of 1 is"
        raise refusal("env", "", "has actions without bounds, which no learner of Stable-Baselines3 takes", remedy)
    return made(env)


class Baselines:
    """A `VecEnv` that wraps a vector environment; all its vehicles share the environment's attributes."""

    num_envs: int
    _seeds: list[int | None]
    _options: list[dict[str, Any]]

    def __init__(self, env: Any):
        self.env = env
        self._asked: np.ndarray | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)  # type: ignore[call-arg]

    def reset(self) -> np.ndarray:
        """Begin new episodes of all environments.

        Returns:
            Their first observations (num_envs, k).

        Raises:
            ValueError: If options were set, since there are no options.
        """
        if any(self._options):
            raise ValueError(f"options = {self._options[0]}: there are none to set. Vary the ensemble")
        self._asked = None
        observed, _ = self.env.reset(seed=self._seeds[0])
        self._seeds = [None] * self.num_envs
        return observed

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions of the next step.

        Args:
            actions: (num_envs, n).
        """
        self._asked = np.array(actions)

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Do the step whose actions `step_async` stored.

        Returns:
            (observations, rewards, mask of ended episodes, infos); infos of environments under way are empty.

        Raises:
            RuntimeError: If `step_async` was not called before.
        """
        if self._asked is None:
            raise RuntimeError("step_wait: no step was begun. Call step_async(actions) first")
        actions, self._asked = self._asked, None
        observed, rewards, terminated, truncated, infos = step_by("SameStep", self.env, actions)
        done = terminated | truncated
        each: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        status = infos["final_info"].get("status") if done.any() else None
        for i in np.flatnonzero(done):
            each[i]["terminal_observation"] = infos["final_obs"][i]
            each[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
            if status is not None and status[i]:
                each[i]["status"] = int(status[i])
        return observed, rewards.astype(np.float32), done, each

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the seed of draws from the next `reset` on.

        Args:
            seed: One seed for all environments; None, the default, draws one from NumPy's global generator.

        Returns:
            The seed, once for each environment.
        """
        drawn = int(np.random.randint(2**31)) if seed is None else int(seed)
        self._seeds = [drawn] * self.num_envs
        return self._seeds

    def close(self) -> None:
        """Close the environment; a second call does nothing."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Get an attribute of the environment.

        Args:
            attr_name: Name of the attribute.
            indices: Indices of environments; None, the default, for all.

        Returns:
            The value, once for each environment. An array with one row for each environment is divided into its rows.
        """
        return self._of_each(getattr(self.env, attr_name), indices)

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute of the environment, for all vehicles.

        Args:
            attr_name: Name of the attribute.
            value: New value.
            indices: Indices of all environments; None, the default, stands for all.

        Raises:
            ValueError: If `indices` names only some environments.
        """
        if set(self._chosen(indices)) != set(range(self.num_envs)):
            raise ValueError(f"indices = {indices}: all environments share their attributes. Leave it out")
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the environment once, for all vehicles.

        Args:
            method_name: Name of the method.
            method_args: Positional arguments of the call.
            indices: Indices of the environments whose answers are returned; None, the default, for all.
            method_kwargs: Keyword arguments of the call.

        Returns:
            The answer, once for each environment. An array with one row for each environment is divided into its rows.
        """
        return self._of_each(getattr(self.env, method_name)(*method_args, **method_kwargs), indices)

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """Return whether environments are wrapped by a class; none is.

        Args:
            wrapper_class: Class of a wrapper.
            indices: Indices of environments; None, the default, for all.

        Returns:
            False for each environment.
        """
        return [False for _ in self._chosen(indices)]

    def get_images(self) -> list[None]:
        """Return no images; use `lw.record` to show the vehicles of a run.

        Returns:
            None for each environment.
        """
        return [None] * self.num_envs

    def _chosen(self, indices: Indices) -> list[int]:
        if indices is None:
            return list(range(self.num_envs))
        return members_of("indices", [indices] if is_whole(indices, 0) else indices, self.num_envs).tolist()

    def _of_each(self, value: Any, indices: Indices) -> list[Any]:
        by_row = isinstance(value, np.ndarray) and value.shape[:1] == (self.num_envs,)
        return [value[i] if by_row else value for i in self._chosen(indices)]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the environment; the copy is a new environment that has not begun."""
        return sb3, (self.env,)


def needed() -> type:
    """The base class of Stable-Baselines3's vector environments."""
    try:
        from stable_baselines3.common.vec_env import VecEnv
    except ImportError as error:
        raise MissingExtra("learners of Stable-Baselines3", "stable_baselines3", "learn") from error
    return VecEnv


@functools.cache
def _vec_env(base: type) -> type:
    """`Baselines` as a subclass of `VecEnv`, created at its first use, since Stable-Baselines3 may be absent."""
    return type("SB3VecEnv", (Baselines, base), {"__doc__": Baselines.__doc__, "__module__": __name__})
