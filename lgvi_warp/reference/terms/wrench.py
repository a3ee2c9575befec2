"""A wrench in body axes, held or by a schedule."""

from dataclasses import dataclass

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


@dataclass(frozen=True)
class Wrench(Law):
    """force (3,) [N], torque (3,) [N m]."""

    force: Array
    torque: Array

    def wrench(self, view: View) -> tuple[Array, Array]:
        """The constant force [N] and torque [N m]."""
        return np.asarray(self.force), np.asarray(self.torque)


@dataclass(frozen=True)
class WrenchSchedule(Law):
    """times (k,) [s], rising; force (k, 3) [N]; torque (k, 3) [N m]; steps: held from each time to the next."""

    times: Array
    force: Array
    torque: Array
    steps: bool = False

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Force [N] and torque [N m] of the tables at view.t."""
        return at_time(view.t, self.times, self.force, self.steps), at_time(view.t, self.times, self.torque, self.steps)


def at_time(t: float, times: Array, values: Array, steps: bool) -> Array:
    """A table's row at t: linear between the times, or held from each to the next; constant outside.

    Args:
        t: Time [s].
        times: Times [s], rising.
        values: Values (k, 3) at the times.
        steps: Whether each value holds until the next time.
    """
    if steps:
        return np.asarray(np.asarray(values)[max(int(np.searchsorted(times, t, side="left")) - 1, 0)])
    return np.array([np.interp(t, times, column) for column in np.transpose(values)])
