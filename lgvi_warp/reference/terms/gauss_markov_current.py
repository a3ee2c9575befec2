# SPDX-License-Identifier: Apache-2.0
"""A uniform current with random variation: a first-order Gauss-Markov process."""

import math

import numpy as np

from lgvi_warp.reference.random import draws_of_step
from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Flow, Law, View


class GaussMarkovCurrent(Law):
    """Attributes as in `lw.terms.GaussMarkovCurrent`; the key of its noise; initial (3,) [m/s]."""

    channel = 0
    seed0 = 0
    seed1 = 0
    noise_step = None
    initial = np.zeros(3)

    def start(self) -> Array:
        """Memory: u during a kick, u at its end, du/dt."""
        return np.concatenate([self.initial, self.initial, np.zeros(3)])

    def evolve(self, view: View, second: bool) -> Array:
        """Exact solution over each draw (Gillespie 1996); during a draw, the mean of its old and new value.

        docs/theory/water.md, (W9).
        """
        _, old, rate = np.split(view.memory, 3)
        if second:
            return np.concatenate([old, old, rate])
        draws = draws_of_step(self, view)
        decay = math.exp(-view.h / len(draws) / self.time_constant)
        new = old
        for xi in draws:
            new = decay * new + self.standard_deviation * math.sqrt(1.0 - decay**2) * xi
        return np.concatenate([0.5 * (old + new), new, (new - old) / view.h])

    def flow(self, view: View) -> Flow:
        """The velocity and the rate in the memory."""
        return Flow(view.memory[:3], view.memory[6:], np.zeros((3, 3)))
