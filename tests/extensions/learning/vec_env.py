# SPDX-License-Identifier: Apache-2.0
"""Part of Stable-Baselines3's base class that `lw.gym.sb3` uses, for machines without it, such as those of quick tests."""

import sys
from types import ModuleType

NAME = "stable_baselines3.common.vec_env"


class VecEnv:
    """The part of the base class that a subclass relies on, by its documentation."""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
        self._options = [{} for _ in range(num_envs)]
        self._seeds = [None] * num_envs
        self.render_mode = self.get_attr("render_mode")[0]

    def set_options(self, options):
        self._options = [options] * self.num_envs

    def has_attr(self, name):
        try:
            self.get_attr(name)
        except AttributeError:
            return False
        return True

    def step(self, actions):
        self.step_async(actions)
        return self.step_wait()


def stand_in(monkeypatch):
    """Put the class in the place of the library where that is absent."""
    try:
        import stable_baselines3.common.vec_env  # noqa: F401
    except ImportError:
        for i in range(1, 4):
            monkeypatch.setitem(sys.modules, ".".join(NAME.split(".")[:i]), ModuleType(NAME))
        sys.modules[NAME].VecEnv = VecEnv
