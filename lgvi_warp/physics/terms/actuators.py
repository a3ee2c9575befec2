# SPDX-License-Identifier: Apache-2.0
"""What actuators have in common that a controller drives, or that follow a schedule with a lag and at a limited rate."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, knots, side_by_side
from lgvi_warp.physics.terms.wrench import at_start, commands

# 1 / time constant of a channel without lag: faster than any step, and within float32. A limit of a rate that counts as none.
FAST, UNLIMITED = 1e20, 1e6


def motion(term: Any) -> dict[str, bool]:
    """How the channels of a driven actuator follow their commands, by the scene's own numbers."""
    lag, rate = term.time_constant, term.rate_limit
    return {
        "lag": lag is not None and bool(np.any(lag > 0.0)),
        "rate": rate is not None and bool(np.any(rate < UNLIMITED)),
    }


def refuse_unread(term: Any, numbers: Numbers) -> None:
    """Refuse members' lags and rate limits (n, channels) of a driven actuator where the scene has none."""
    faults, features = Faults(f"{term.key}."), motion(term)
    acting = {"lag": ("time_constant", lambda x: x > 0.0), "rate": ("rate_limit", lambda x: x < UNLIMITED)}
    for feature, (name, acts) in acting.items():
        values = numbers.get(name)
        if values is not None and not features[feature] and np.any(acts(values)):
            fault = "does not act: the scene has none"
            faults.add(
                name, values[np.any(acts(values), axis=-1)][0], fault, f"give {term.key}.{name} in the scene as well"
            )
    faults.raise_if_any()


def packed_following(
    term: Any, numbers: Numbers, blocks: np.ndarray, shared: np.ndarray | None = None, size: int = 0, work: int = 0
) -> Packed:
    """Pack an actuator whose device code is made by lgvi_kernels.laws.driven or .scheduled.

    numbers: (m, ...) by field: `limit`, where it has them `time_constant` and `rate_limit`, and if not driven the schedule.
    blocks: Other rows of each channel, (m, channels, rows). shared: Rows behind those of all channels, (m, rows).
    Returns: Rows of each channel: the blocks, limit, 1 / lag and limit of the rate; its schedule; the shared rows; and the
        memory of places, where they move: 0 of a driven actuator, else the command at the start.
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
        values |= term.driver.values_of(term.key) | {"alike": int(np.all(lag == lag[:, :1]))}
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
