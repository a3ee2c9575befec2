# SPDX-License-Identifier: Apache-2.0
"""A uniform current that wanders: a first-order Gauss-Markov (Ornstein-Uhlenbeck) process, u' = -u / tau + noise."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *

FLOW = "uniform"
NOISE = True


@functools.cache
def params(width, real, Key):
    """Params: decay, e^(-h / tau), and spread, the standard deviation of the noise [m/s, inertial], over the h of one draw.

    key: of the random numbers (see lanes/noise.py).
    memory: the first of its rows: u while the kick lasts (3), u at its end (3), du/dt (3).
    """
    Lane, Lane3 = lane(width, real), lane3(width, real)
    return struct("GaussMarkovCurrent", decay=Lane, spread=Lane3, memory=wp.int32, key=Key)


@wp.func
def recall(view: Any, row: int):
    """Read three rows of the law's memory."""
    return vec3(remembered(view, row), remembered(view, row + 1), remembered(view, row + 2))


@wp.func
def keep(view: Any, row: int, v: Any):
    """Write three rows of the law's memory."""
    remember(view, row, v.x)
    remember(view, row + 1, v.y)
    remember(view, row + 2, v.z)


@wp.func
def evolve(state: Any, view: Any, p: Any):
    """u <- e^(-h/tau) u + spread xi, exact over each draw's h (Gillespie 1996): during the kick, the mean of old and new.

    All is drawn before the first half of a kick; the second half ends with the new u.
    """
    at = p.memory
    if view.second > 0:
        keep(view, at, recall(view, at + 3))
    else:
        unity = ones(p.decay)
        old = recall(view, at + 3)
        new = wandered(view, p.key, 0, old, p.decay, p.spread)
        keep(view, at, view.h.dtype(0.5) * (old + new))
        keep(view, at + 3, new)
        keep(view, at + 6, (unity / (view.h * unity)) * (new - old))
    return state


@wp.func
def flow(f: Any, view: Any, p: Any):
    """u and du/dt from the memory; du/dt h is the change of u over a kick."""
    f.velocity = f.velocity + recall(view, p.memory)
    f.rate = f.rate + recall(view, p.memory + 6)
    return f
