# SPDX-License-Identifier: Apache-2.0
"""Reductions of a path to one number, which process its samples one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


def _as_it_is(x: np.ndarray) -> np.ndarray:
    return x


@dataclass(frozen=True)
class Reduction:
    """Reduction of the samples of paths to one number for each path.

    step: function (state, before, x, dt, share) that returns the state after another sample x. `before` is the sample
        before, dt the time [s] between the two, share this time divided by the time since the first sample.
    """

    step: Callable[[np.ndarray, np.ndarray, np.ndarray, float, float], np.ndarray]
    start: Callable[[np.ndarray], np.ndarray] = _as_it_is
    finish: Callable[[np.ndarray], np.ndarray] = _as_it_is
    of_samples: bool = False

    def over(self, samples: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Return the numbers of whole paths from samples (k, ...) at times (k,) [s]."""
        state = self.start(samples[0])
        for t in range(1, len(samples)):
            dt = float(time[t] - time[t - 1])
            state = self.step(state, samples[t - 1], samples[t], dt, dt / float(time[t] - time[0]))
        return self.finish(state)


def _towards(state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
    """Move the average so far towards the average of the last interval."""
    return np.asarray(state + share * (0.5 * (before + x) - state))


MAXIMUM = Reduction(lambda state, before, x, dt, share: np.maximum(state, x), of_samples=True)
MINIMUM = Reduction(lambda state, before, x, dt, share: np.minimum(state, x), of_samples=True)
# The state: smallest and largest value.
RANGE = Reduction(
    lambda state, before, x, dt, share: np.stack([np.minimum(state[0], x), np.maximum(state[1], x)]),
    lambda x: np.stack([x, x]),
    lambda state: np.asarray(state[1] - state[0]),
)
# Over time, by the trapezoidal rule.
MEAN = Reduction(_towards)
ROOT_MEAN_SQUARE = Reduction(
    lambda state, before, x, dt, share: _towards(state, before * before, x * x, dt, share),
    lambda x: np.asarray(x * x),
    lambda state: np.asarray(np.sqrt(state)),
)
