# SPDX-License-Identifier: Apache-2.0
"""The heights of members above the mean surface, in scenes without a term or event for it.

Depths are checked on the host, in samples, at the end of a run and, in waves, between launches.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.common.status import Warnings
from lgvi_warp.engine.states import into
from lgvi_warp.physics.terms.base import Numbers, own
from lgvi_warp.physics.terms.surface_level import level_of, rise_at_start
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.scene.plausibility import LIMITS, ends_at_the_surface, floats, wave_periods

# Looks in a period of the highest wave, and fewest steps between two of them.
LOOKS, FEWEST = 8.0, 8


def time_between_looks(scene: SceneLike) -> float | None:
    """Time [s] between two checks of the depth in waves; None without waves, or if the scene has a surface."""
    periods = wave_periods(scene)
    if not periods or ends_at_the_surface(scene) or floats(scene):
        return None
    return min(periods) / LOOKS


class Heights:
    """Greatest height of each member above the surface so far [m], and the number of steps when it was first too high."""

    def __init__(self, scene: SceneLike, depth: np.ndarray, parameters: Numbers):
        self._open = not (ends_at_the_surface(scene) or floats(scene))
        level = level_of(scene.terms)
        highest = level.highest(own(level, parameters)) if level else 0.0
        self._limit = LIMITS["height"].value + np.zeros(len(depth)) + highest
        # Of a start above the surface a message of its own tells.
        self._above = depth + rise_at_start(scene.terms, parameters) < 0.0
        self._height, self._step = np.full(len(depth), -np.inf), np.zeros(len(depth), np.int64)

    def look(self, depth: np.ndarray, steps: np.ndarray) -> None:
        """Check depths (k, m) [m] after these steps (k,); most often one comparison of the smallest depth is enough."""
        if not self._open or depth.size == 0 or depth.min() >= -self._limit.min():
            return
        high = (depth < -self._limit) & ~self._above
        first = high.any(axis=0) & (self._height <= self._limit)
        self._step = np.where(first, steps[high.argmax(axis=0)], self._step)
        self._height = np.fmax(self._height, np.where(self._above, -np.inf, -np.fmin.reduce(depth, axis=0)))

    def added(self, bits: np.ndarray, step: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Add the warning of members that rose too high; arrays (m,) each, as in `Warnings`."""
        high = self._height > self._limit
        if not high.any():
            return bits, step, value
        most = high & (bits < Warnings.ABOVE_SURFACE)
        warned = bits | np.uint16(Warnings.ABOVE_SURFACE) * high
        return warned, np.where(most, self._step, step), np.where(most, self._height, value)

    def left(self) -> np.ndarray:
        """Rows (m, 3) for an exact continuation of the run; empty if no member was above the surface."""
        rows = np.stack([np.maximum(self._height, 0.0), self._step, self._above], axis=1)
        return rows if rows.any() else rows[:0]

    def take(self, rows: np.ndarray | None) -> None:
        """Continue with the rows of another run; None: no rows."""
        count = len(self._above)
        height, step, above = np.zeros((3, count)) if rows is None else rows.T
        self._height, self._step, self._above = height, step.astype(np.int64), above != 0.0


def of_states(packets: Any) -> np.ndarray:
    """Depths (1, m) [m] of the user's origin, from the states between two launches."""
    lanes, frame = packets.state_lanes.view[:, 6:12, : packets.plan.spec.width], packets.frame
    rows = lanes.transpose(0, 2, 1).reshape(-1, 6)[: packets.members.count]
    depth = rows[:, 5]
    if frame.shifted:
        depth = depth - np.einsum(
            "nj,nj->n", rows[:, :3], np.broadcast_to(into(frame.Q, frame.origin), rows[:, :3].shape)
        )
    return np.asarray(depth[None])
