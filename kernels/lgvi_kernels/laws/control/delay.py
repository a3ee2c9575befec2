# SPDX-License-Identifier: Apache-2.0
"""The way of commands to the actuators takes time: a ring of the commands of the last ticks."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import *


@functools.cache
def params(width, real):
    """Params: delay = periods * period + steps * h of each lane; the ring's first row; sets in it; commands in a set.

    fresh, acting, before, begin: first row of the new commands, of those that act from a step on and before, of that step.
    """
    Lane = lane(width, real)
    words = ("memory", "sets", "count", "fresh", "acting", "before", "begin")
    return struct("Delay", periods=Lane, steps=Lane, **dict.fromkeys(words, wp.int32))


@wp.func
def send(y: Any, p: Any):
    """Put the new commands into the ring; those of `periods` ticks ago act from `steps` steps on, those before until then."""
    newest = y.tick % p.sets
    unity = ones(p.periods)
    half = y.h.dtype(0.5) * unity
    for i in range(p.count):
        remember(y, p.memory + newest * p.count + i, remembered(y, p.fresh + i))
        acting = unity - unity
        before = acting
        for j in range(p.sets):
            age = y.h.dtype((newest - j + p.sets) % p.sets) * unity
            value = remembered(y, p.memory + j * p.count + i)
            acting = positive(half - absolute(age - p.periods), value, acting)
            before = positive(half - absolute(age - p.periods - unity), value, before)
        remember(y, p.acting + i, acting)
        remember(y, p.before + i, before)
    remember(y, p.begin, y.h.dtype(y.step) * unity + p.steps)
    return y
