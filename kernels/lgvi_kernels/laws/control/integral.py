# SPDX-License-Identifier: Apache-2.0
"""The integral of a law's error, which stops where the actuators deliver no more (conditional integration)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *


@wp.func
def integral(y: Any, row: int, limit: Any, unmet: Any, conditional: int):
    """I at this tick, from I and the error of the last one, in two rows of the memory: I + T e within +-limit.

    docs/theory/control_loop.md, (C8).

    Where conditional, I stays as it was if more of the demand, of which `unmet` was not delivered, would go the same way.
    """
    old = remembered(y, row)
    error = remembered(y, row + 1)
    new = clamp(old + y.period * error, -limit, limit)
    if conditional > 0:
        new = positive(unmet * error, old, new)
    remember(y, row, new)
    return new


@wp.func
def keep_error(y: Any, row: int, error: Any):
    """Keep the error of this tick for the next one's integral."""
    remember(y, row + 1, error)


@wp.func
def remembered3(y: Any, row: int):
    """Three rows of the memory as a vector."""
    return vec3(remembered(y, row), remembered(y, row + 1), remembered(y, row + 2))


@wp.func
def remember3(y: Any, row: int, v: Any):
    """Write a vector into three rows of the memory."""
    remember(y, row, v.x)
    remember(y, row + 1, v.y)
    remember(y, row + 2, v.z)


@wp.func
def unhindered(error: Any, unmet: Any, conditional: int):
    """An error (a vector in the axes in which actuators push) without the parts that must wait, as of `integral`."""
    if conditional > 0:
        zero = ones(error.x) - ones(error.x)
        error = vec3(
            positive(unmet.x * error.x, zero, error.x),
            positive(unmet.y * error.y, zero, error.y),
            positive(unmet.z * error.z, zero, error.z),
        )
    return error


@wp.func
def integral3(y: Any, row: int, limit: Any, error: Any):
    """A vector I + T error, each number within +-limit, in three rows of the memory."""
    new = remembered3(y, row) + y.period * error
    new = vec3(clamp(new.x, -limit, limit), clamp(new.y, -limit, limit), clamp(new.z, -limit, limit))
    remember3(y, row, new)
    return new
