# SPDX-License-Identifier: Apache-2.0
"""The numbers of all members, if statistics are not enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimates.estimate import Estimate
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.moments import estimate
from lgvi_warp.statistics.values.values import Values


@dataclass(frozen=True, eq=False)
class MemberValues(Statistic):
    """The numbers of all members, in the order of the members. They take 8 bytes per member, component and row.

    Use this statistic mostly in `then` of a statistic that has only one row: lw.metrics.Overshoot("depth",
    then=[lw.statistics.Mean(), lw.statistics.MemberValues()]). For a metric, the values include failed members. For
    other statistics, the value of a member that is left out is NaN. There is no interval.

    Arrays of the estimate, for k rows (sample times), d components and n members:

    * value (k, d, n): the numbers.
    * count (k,): number of members that have numbers, including infinite numbers.

    Args:
        of: A quantity, such as "depth" or "position[2]", a function of (samples, members), or a list of these
            (see lw.statistics.Quantity).
        name: Key of the estimate in the result; by default the type and the quantity, as in "mean position".
        stopped: After an event stopped a member, "held" (default) counts the member with its last state; "left_out"
            omits the member.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0})
        >>> fleet = lw.Ensemble(scene, members=64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=2.0)})
        >>> deepest = lw.statistics.PathMaximum("depth", then=lw.statistics.MemberValues())
        >>> result = lw.solve(fleet, h=0.1, t1=20.0, statistics=[deepest])
        >>> result.statistics["each path_maximum depth"].value.shape
        (1, 1, 64)
    """

    type: ClassVar[str] = "each"

    def rows(self, values: Values) -> Part:
        return self.rows_of(values.filled(np.nan), values.replicates)

    def weighted_rows(self, values: Values) -> Part:
        # Numbers are the same, whatever their members weigh.
        return self.rows(values)

    def rows_of(self, x: np.ndarray, replicates: int) -> Part:
        """Return the numbers of a block, (k, d, n), in the order of its members.

        Args:
            x: (k R, d, n / R), with one row for each time and replicate.
            replicates: number R of replicates.
        """
        R = replicates
        k, d, n = len(x) // R, x.shape[1], x.shape[2] * R
        return {"x": np.ascontiguousarray(np.moveaxis(x.reshape(k, R, d, n // R), 1, 3).reshape(k, d, n))}

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        # The numbers of both sets of members, one after the other.
        return {"x": np.concatenate([first["x"], second["x"]], axis=2)}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        x = part["x"]
        arrays = {"value": x, "count": (~np.isnan(x)).all(axis=1).sum(axis=1)}
        dims = {"value": ("time", "component", "member"), "count": ("time",)}
        return estimate(self, "none", dims, arrays, time, {"member": np.arange(x.shape[2])})

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        # Numbers are in the order of the members already.
        return self.estimates(parts, time)
