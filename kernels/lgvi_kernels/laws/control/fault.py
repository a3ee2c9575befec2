# SPDX-License-Identifier: Apache-2.0
"""A fault of an actuator: from a time on its command is another one."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.lost import since

# First step, gain and offset of each lane; rows of the command.
# fresh: of the command; acting, before: where commands are delayed, of the one that acts and of the one before.
params = make_params("Fault", lanes="begin gain offset", words="fresh acting before delayed")


@wp.func
def send(y: Any, p: Any):
    """From the first tick at or after its time on: command <- gain * command + offset.

    docs/theory/control_loop.md, (C5).
    """
    begun = since(y, p.begin)
    u = remembered(y, p.fresh)
    remember(y, p.fresh, positive(begun, p.gain * u + p.offset, u))
    if p.delayed > 0:
        u = remembered(y, p.acting)
        remember(y, p.acting, positive(begun, p.gain * u + p.offset, u))
        u = remembered(y, p.before)
        remember(y, p.before, positive(begun, p.gain * u + p.offset, u))
    return y
