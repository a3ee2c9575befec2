# SPDX-License-Identifier: Apache-2.0
"""Commands of one actuator that a function of the host writes into the memory, once a tick."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# First row of the answer and of the commands; count; first row of the table, the limit of each command.
params = make_params("CallbackCommands", words="answer commands count first")


@wp.func
def allocate(w: Any, y: Any, p: Any):
    """The commands within their limits. They deliver nothing of the demand: the host has not been asked for it."""
    for i in range(p.count):
        most = row1(y, p.first + i)
        remember(y, p.commands + i, clamp(remembered(y, p.answer + i), -most, most))
    return w
