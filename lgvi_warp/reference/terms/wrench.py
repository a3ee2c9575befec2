# SPDX-License-Identifier: Apache-2.0
"""A wrench in body axes, constant or from a schedule."""

from collections.abc import Iterator

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


class Wrench(Law):
    """Attributes as in `lw.terms.Wrench`."""

    def wrench(self, view: View) -> tuple[Array, Array]:
        """The constant force [N] and torque [N m]."""
        return np.asarray(self.force), np.asarray(self.torque)


class WrenchSchedule(Law):
    """Attributes as in `lw.terms.WrenchSchedule`; steps: whether each value is held until the next time."""

    steps = False

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Force [N] and torque [N m] of the tables at view.t."""
        return at_time(view.t, self.times, self.force, self.steps), at_time(view.t, self.times, self.torque, self.steps)


def at_time(t: float, times: Array, values: Array, steps: bool) -> Array:
    """A table's row (3,) at t: linear between the times, or held from each time to the next; constant outside."""
    if steps:
        return np.asarray(np.asarray(values)[max(int(np.searchsorted(times, t, side="left")) - 1, 0)])
    return np.array([np.interp(t, times, column) for column in np.transpose(values)])


def pieces(t: float, h: float, times: Array, values: Array, limit: Array) -> Iterator[tuple[float, Array, Array]]:
    """Straight parts of a limited table (k, n) within the h before t, in order: (duration [s], first, last value)."""
    changes = np.diff(values, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = [(sign * limit - values[:-1]) / changes for sign in (-1.0, 1.0)]
    at = [times[:-1, None] + part * np.diff(times)[:, None] for part in np.clip(np.nan_to_num(crossings), 0.0, 1.0)]
    turns = np.unique(np.concatenate([times, *(array.ravel() for array in at)]))
    ends = [t - h, *(s for s in turns if t - h < s < t), t]
    rows = [np.clip(at_time(s, times, values, False), -limit, limit) for s in ends]
    yield from zip(np.diff(ends), rows[:-1], rows[1:], strict=True)
