# SPDX-License-Identifier: Apache-2.0
"""Metrics of a navigation filter: whether its errors and innovations have the size that its covariance predicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.common.errors import among, refusal
from lgvi_warp.statistics.metrics.actuator_metrics import all_of
from lgvi_warp.statistics.metrics.metric import Metric, State, Ticks, accumulated
from lgvi_warp.statistics.values.quantity import Quantity


@dataclass(frozen=True, eq=False)
class OfFilter(Metric):
    """Base class of metrics of an `lw.control.ErrorStateFilter`. Abstract."""

    def meant(self) -> Quantity:
        if not among(self.of, (self.default,)):
            raise refusal(f"{self.type}.of", self.of, f"is not the {self.default} of a filter", "leave it out")
        return _BELIEFS[self.type]


@dataclass(frozen=True, eq=False)
class NEES(OfFilter):
    """Mean over a member's ticks of e^T P^-1 e, the filter's normalised squared error; then statistics over members.

    e is the error and P the covariance of its 15 states. A consistent filter has the expected value 15. Errors at two
    ticks are not independent, so use `lw.metrics.consistency` for a test over members. The filter needs report=True.

    Args:
        of: "nees", the default.
        then: Statistic of these numbers over the members, or a list of statistics, without their argument `of`, such
            as lw.statistics.Quantiles(); by default lw.statistics.Mean().
    """

    type: ClassVar[str] = "nees"
    default: ClassVar[str | None] = "nees"

    def begin(self, x: np.ndarray) -> State:
        return {"sum": x[0].copy(), "count": np.ones(x.shape[1])}

    def follow(self, state: State, ticks: Ticks) -> State:
        size = ticks.x[:, 0]
        return {
            "sum": accumulated(state["sum"], ticks, size),
            "count": accumulated(state["count"], ticks, np.ones(size.shape)),
        }

    def finish(self, state: State) -> np.ndarray:
        return state["sum"] / state["count"]


@dataclass(frozen=True, eq=False)
class NIS(NEES):
    """Mean of innovation^2 / variance over all readings that a member's filter accepted; then statistics over members.

    Its expected value is 1 for a consistent filter. It is NaN if the filter accepted no reading. Unlike `NEES` it does not
    need the true state, so a vehicle at sea can compute it. The filter needs report=True.

    Args:
        of: "nis", the default.
        then: Statistic of these numbers over the members, or a list of statistics, without their argument `of`, such
            as lw.statistics.Quantiles(); by default lw.statistics.Mean().
    """

    type: ClassVar[str] = "nis"
    default: ClassVar[str | None] = "nis"

    def begin(self, x: np.ndarray) -> State:
        return {"sum": x[0].copy(), "count": x[1].copy()}

    def follow(self, state: State, ticks: Ticks) -> State:
        names = ("sum", "count")
        return {name: accumulated(state[name], ticks, ticks.x[:, i]) for i, name in enumerate(names)}


@dataclass(frozen=True, eq=False)
class Rejected(OfFilter):
    """Number of readings that the gate of a member's filter has rejected by the end; then statistics over members.

    Every number of a reading counts separately, such as a beam or a coordinate of a fix. The counts of all sensors are
    added; the signal "rejected" has the count of each sensor. The filter needs a gate and report=True.

    Args:
        of: "rejected", the default.
        then: Statistic of these numbers over the members, or a list of statistics, without their argument `of`, such
            as lw.statistics.Quantiles(); by default lw.statistics.Mean().

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.metrics.Rejected(then=[lw.statistics.Quantiles(levels=(0.5, 0.95))]).key
        'rejected'
    """

    type: ClassVar[str] = "rejected"
    default: ClassVar[str | None] = "rejected"

    def begin(self, x: np.ndarray) -> State:
        return {"last": x.sum(axis=0)}

    def follow(self, state: State, ticks: Ticks) -> State:
        # It never falls while a member is under way.
        counts = ticks.of_living(ticks.x.sum(axis=1), 0.0)
        return {"last": np.maximum(state["last"], counts.max(axis=0))}

    def finish(self, state: State) -> np.ndarray:
        return state["last"]


_BELIEFS = {"nees": all_of("nees"), "nis": all_of("nis", "nis_count"), "rejected": all_of("rejected")}
