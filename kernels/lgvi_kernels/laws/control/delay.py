# SPDX-License-Identifier: Apache-2.0
"""The way of commands to the actuators takes time: the commands of the last ticks, the latest first."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# Delay = periods * period + steps * h of each lane; first row of the sets; how many; commands in a set.
# fresh, acting, before, begin: first row of the new commands, of those that act from a step on and before, of that step.
params = make_params("Delay", lanes="periods steps", words="memory sets count fresh acting before begin")


@wp.func
def send(y: Any, p: Any):
    """Put the new commands before the others; those of `periods` ticks ago act from `steps` on, those before until then.

    docs/theory/control_loop.md, (C3), (C4).
    """
    unity = ones(p.periods)
    half = y.h.dtype(0.5) * unity
    for i in range(p.count):
        acting = unity - unity
        before = acting
        value = remembered(y, p.fresh + i)
        for age in range(p.sets):
            # Members may remember more sets than they need: none depends on how many there are.
            at = p.memory + age * p.count + i
            older = remembered(y, at)
            remember(y, at, value)
            apart = y.h.dtype(age) * unity - p.periods
            acting = positive(half - absolute(apart), value, acting)
            before = positive(half - absolute(apart - unity), value, before)
            value = older
        remember(y, p.acting + i, acting)
        remember(y, p.before + i, before)
    remember(y, p.begin, y.h.dtype(y.step) * unity + p.steps)
    return y
