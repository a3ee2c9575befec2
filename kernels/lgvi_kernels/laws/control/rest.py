# SPDX-License-Identifier: Apache-2.0
"""Remainder of the demand after an allocation: impossible components, and parts beyond limits."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# Rows of a symmetric projector (6, 6), line by line: it maps a demand to what the actuators cannot make.
ROWS = 36


@wp.func
def combined(y: Any, row: int, force: Any, torque: Any):
    """A line of the projector times the demand."""
    return dot(row3(y, row), force) + dot(row3(y, row + 3), torque)


@wp.func
def rest(w: Any, y: Any, row: int):
    """The projected demand. Where actuators can make all of it, it is 0 to the last digit: anti-windup looks at its sign."""
    force = w.force
    torque = w.torque
    w.force = vec3(
        combined(y, row, force, torque), combined(y, row + 6, force, torque), combined(y, row + 12, force, torque)
    )
    w.torque = vec3(
        combined(y, row + 18, force, torque), combined(y, row + 24, force, torque), combined(y, row + 30, force, torque)
    )
    return w
