"""What actuators that a controller drives have in common: rows of their limits, and their place at the start."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, side_by_side

# 1 / time constant of a channel without lag: faster than any step, and within float32. A limit of a rate that counts as none.
FAST, UNLIMITED = 1e20, 1e6


def packed_driven(term: Any, numbers: Numbers, blocks: np.ndarray, work: int = 0) -> Packed:
    """Pack an actuator that a controller drives.

    Args:
        term: The term, driven. Its numbers are `limit`, and where it has them `time_constant` and `rate_limit`, (n, channels).
        numbers: Its numbers by field, (m, ...).
        blocks: Other rows of each channel, (m, channels, rows).
        work: Scratch rows of its device code; 0 by default.

    Returns:
        Rows of each channel: the blocks, limit, 1 / lag and limit of the rate; the memory of places, at 0, where they move.
    """
    limit = numbers["limit"]
    none = np.zeros_like(limit)
    with np.errstate(divide="ignore"):
        time = numbers.get("time_constant", none)
        lag = np.where(time > 0.0, 1.0 / time, FAST)
    rate = numbers.get("rate_limit", none + UNLIMITED)
    rows = side_by_side(blocks, *(value[..., None] for value in (limit, lag, rate)))
    count = rows.shape[1]
    values = {"count": count, "moving": int(term.memory), **term.driver.values_of(term.key)}
    values |= {} if work else {"work": 0}
    flat = rows.reshape(len(rows), -1)
    if not term.memory:
        return Packed(values | {"memory": 0}, flat, work=work)
    return Packed(values, flat, np.zeros((1, count)), work)
