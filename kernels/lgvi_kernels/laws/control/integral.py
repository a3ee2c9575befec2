"""The integral of a law's error, which stops where the actuators deliver no more (conditional integration)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import add, clamp, mul, neg, positive, remember, remembered  # noqa: F401


@wp.func
def integral(y: Any, row: int, limit: Any, unmet: Any, conditional: int):
    """I at this look, from I and the error of the last one, in two rows of the memory: I + T e within +-limit.

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
    """Keep the error of this look for the next one's integral."""
    remember(y, row + 1, error)
