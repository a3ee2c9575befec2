"""A uniform current that wanders: a first-order Gauss-Markov (Ornstein-Uhlenbeck) process, u' = -u / tau + noise."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import (  # noqa: F401
    add,
    div,
    int_lane,
    lane,
    lane3,
    mul,
    normals3,
    ones,
    remember,
    remembered,
    struct,
    sub,
    vec3,
)

FLOW = "uniform"
NOISE = True


@functools.cache
def params(width, real):
    """Params: decay, e^(-h / tau), and spread, the standard deviation of one step's noise [m/s, inertial], of a step h.

    member, seed0, seed1, channel: with the step, the key of the random numbers.
    memory: the first of its rows: u while the kick lasts (3), u at its end (3), du/dt (3).
    """
    Lane, Lane3 = lane(width, real), lane3(width, real)
    key = {"member": int_lane(width), "seed0": wp.int32, "seed1": wp.int32, "channel": wp.int32}
    return struct("GaussMarkovCurrent", decay=Lane, spread=Lane3, memory=wp.int32, **key)


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
    """u <- e^(-h/tau) u + spread xi, exact over a kick of h (Gillespie 1996): during the kick, the mean of old and new.

    All is drawn before the first half of a kick; the second half ends with the new u.
    """
    at = p.memory
    if view.second > 0:
        keep(view, at, recall(view, at + 3))
    else:
        unity = ones(p.decay)
        old = recall(view, at + 3)
        noise = normals3(p.decay, p.member, view.step, p.channel, p.seed0, p.seed1)
        new = p.decay * old + p.spread * noise
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
