"""What actuators have in common that a controller drives, or that follow a schedule with a lag and at a limited rate."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, knots, side_by_side
from lgvi_warp.physics.terms.wrench import at_start, commands

# 1 / time constant of a channel without lag: faster than any step, and within float32. A limit of a rate that counts as none.
FAST, UNLIMITED = 1e20, 1e6


def packed_following(
    term: Any, numbers: Numbers, blocks: np.ndarray, shared: np.ndarray | None = None, size: int = 0, work: int = 0
) -> Packed:
    """Pack an actuator whose device code is made by lgvi_kernels.laws.driven or .scheduled.

    Args:
        term: The term. Its numbers are `limit`, where it has them `time_constant` and `rate_limit`, each (n, channels), and
            its schedule where no controller drives it.
        numbers: Its numbers by field, (m, ...).
        blocks: Other rows of each channel, (m, channels, rows).
        shared: Rows behind those of all channels, (m, rows); None, the default, for none.
        size: How many of these there are of a kind; 0 by default.
        work: Scratch rows of its device code; 0 by default.

    Returns:
        Rows of each channel: the blocks, limit, 1 / lag and limit of the rate; its schedule; the shared rows; and the memory
        of places, where they move: 0 of a driven actuator, else the command at the start.
    """
    limit = numbers["limit"]
    none = np.zeros_like(limit)
    with np.errstate(divide="ignore"):
        time = numbers.get("time_constant", none)
        lag = np.where(time > 0.0, 1.0 / time, FAST)
    rate = numbers.get("rate_limit", none + UNLIMITED)
    channels = side_by_side(blocks, *(value[..., None] for value in (limit, lag, rate)))
    count = channels.shape[1]
    rows = [channels.reshape(len(channels), -1)]
    values = {"count": count, "moving": int(term.memory)} | ({} if work else {"work": 0})
    start = np.zeros((1, count))
    if term.driver is not None:
        values |= term.driver.values_of(term.key)
    else:
        times, schedule = commands(numbers)
        rows += [knots(times, schedule[:, :, i : i + 1]) for i in range(count)]
        values |= {"knots": times.shape[1] - 1}
        start = np.clip(at_start(times, schedule), -limit, limit)
    values |= {"shared": sum(part.shape[1] for part in rows), "size": size}
    rows += [] if shared is None else [shared]
    if not term.memory:
        return Packed(values | {"memory": 0}, side_by_side(*rows), work=work)
    return Packed(values, side_by_side(*rows), start, work)
