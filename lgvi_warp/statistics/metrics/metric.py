# SPDX-License-Identifier: Apache-2.0
"""The base of metrics: one number of each member, gathered tick by tick.

A tick is a sample at a controller's period. With ticks at t_0 = 0, t_1, ... a member counts from the first tick to the
last tick at which it was still under way. So the number of a member that stops or fails covers its time under way.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, among, refusal
from lgvi_warp.common.status import failed
from lgvi_warp.statistics.base import Gatherer, Statistic
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.paths.member_statistic import MemberStatistic, numbered, part_of
from lgvi_warp.statistics.paths.member_values import MemberValues
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.statistics.values.values import Values

State = dict[str, np.ndarray]
Place = tuple[int, int, int, int, np.ndarray | None]


@dataclass(frozen=True, eq=False)
class Ticks:
    """Successive ticks: times t (k,) [s], times dt (k,) [s] since the last tick, and d numbers of n members, x (k, d, n).

    start: (d, n), the numbers at the tick before the first.
    alive: (k, n), True for members still under way; None if all were.
    """

    t: np.ndarray
    dt: np.ndarray
    start: np.ndarray
    x: np.ndarray
    alive: np.ndarray | None

    @functools.cached_property
    def before(self) -> np.ndarray:
        """Numbers at the tick before each, (k, d, n)."""
        return np.concatenate([self.start[None], self.x[:-1]])

    def rows(self, *arrays: np.ndarray) -> Iterator[tuple[Any, ...]]:
        """Yield for each tick its time, its row of each array (k, ...), and the mask of members under way."""
        everyone: Any = [True] * len(self.t) if self.alive is None else self.alive
        yield from zip(self.t, *arrays, everyone, strict=True)

    def of_living(self, values: np.ndarray, otherwise: float) -> np.ndarray:
        """Return values (k, n), with `otherwise` for members that were no longer under way."""
        return values if self.alive is None else np.where(self.alive, values, otherwise)


class _Follow(Gatherer):
    """Follows a block's members from tick to tick."""

    def __init__(self, metric: Metric, time: np.ndarray):
        self._metric, self._time = metric, time
        self._state: State = {}
        self._last: np.ndarray | None = None
        self._place: Place = (0, 0, 0, 1, None)

    def take(self, values: Values, when: slice) -> None:
        R = values.replicates
        k, d, n = len(values.x) // R, *values.x.shape[1:]
        # Members of the replicates one after the other.
        x = values.x if R == 1 else np.swapaxes(values.x.reshape(k, R, d, n), 1, 2).reshape(k, d, R * n)
        alive = None if values.good is None else values.good.reshape(k, R * n)
        t, first = self._time[when], 0
        if self._last is None:
            begun = np.ones(R * n, bool) if alive is None else alive[0]
            self._state = {"begun": begun, "until": np.full(R * n, t[0]), "end": self._time[-1]}
            self._state |= self._metric.begin(x[0])
            self._last, first = x[0], 1
        if k > first:
            step = np.diff(self._time[max(when.start - 1, 0) : when.stop])
            ticks = Ticks(t[first:], step, self._last, x[first:], None if alive is None else alive[first:])
            self._state |= self._metric.follow(self._state, ticks)
            self._state["until"] = np.maximum(self._state["until"], ticks.of_living(ticks.t[:, None], 0.0).max(axis=0))
        self._last = x[-1].copy()
        self._place = (values.first, values.block, values.size, R, values.weight)

    def end(self, ends: Ends, replicates: int) -> None:

        def in_order(values: np.ndarray) -> np.ndarray:
            return values.reshape(-1, replicates).T.ravel()

        self._state["ended"] = in_order(np.where(ends.status != 0, ends.time, np.inf))
        self._state["failed"] = in_order(failed(ends.status))
        if self._metric.outcomes:
            self._state["ended_so"] = in_order(ends.are(self._metric.outcomes[0]))

    def close(self) -> Part:
        state = self._state
        with np.errstate(invalid="ignore", divide="ignore"):
            x = np.where(state["begun"], self._metric.finish(state), np.nan)
        R = self._place[3]
        return self._metric.gathered(x.reshape(R, 1, -1), state["failed"].reshape(R, -1), self._place, self._time)


@dataclass(frozen=True, eq=False)
class Metric(MemberStatistic):
    """One number of each member, computed over all ticks of a controller, and statistics of it over members. Abstract.

    A metric uses the samples at every tick, even if the run does not save them; without a controller, it uses the
    sample times. The number of a member that stops or fails covers its time until then, up to its last tick. Statistics
    leave out members that failed or whose number is not finite; lw.statistics.MemberValues() includes all members.

    Args:
        of: the tracked quantity; see the derived classes.
        then: Statistic of the metric over the members, or a list of statistics, each without its `of`:
            lw.statistics.Mean(), the default, lw.statistics.Quantiles(), ...
        measured: True uses the measured value of the sensors instead of the true value; by default False.
        stopped: not used by metrics; omit it.
    """

    of_numbers: ClassVar[bool] = False
    ticks: ClassVar[bool] = True
    # The unit of the number, with {0} for that of what it is of.
    form: ClassVar[str] = "{0}"

    stopped: str = "left_out"
    measured: bool = False

    def check(self, faults: Faults) -> None:
        super().check(faults)
        if not among(self.stopped, ("left_out",)):
            faults.add("stopped", self.stopped, "has no meaning for a metric", "leave it out")

    def begin(self, x: np.ndarray) -> State:
        """Return the state after the first tick, from its numbers (d, n)."""
        return {}

    def follow(self, state: State, ticks: Ticks) -> State:
        """Return the entries of the state that change with the next ticks."""
        return {}

    def finish(self, state: State) -> np.ndarray:
        """Return the members' numbers (n,) from the state after the last tick.

        The state also has "until" (n,) [s], each member's last tick under way; "ended" (n,) [s], the time at which it
        stopped or failed, else infinite; "failed" (n,); "end" [s], the end of the run; and "ended_so" (n,), True if it
        ended by the metric's outcome, if any.
        """
        raise TypeError(f"{type(self).__name__} is abstract")

    def gathered(self, x: np.ndarray, lost: np.ndarray, place: Place, time: np.ndarray) -> Part:
        """Return the part of a block: the parts of all statistics of `then`, for numbers (replicates, 1, members).

        place: first member, block, its size, number of replicates, and weights of the members.
        """
        surviving = Values(x, ~lost, *place)
        return numbered(
            statistic.rows_of(x, place[3])
            if isinstance(statistic, MemberValues)
            else part_of(statistic, surviving, time)
            for statistic in self.then_of(time)
        )

    def then_of(self, time: np.ndarray) -> tuple[Statistic, ...]:
        return tuple(replace(statistic, stopped="held") for statistic in super().then_of(time))

    @property
    def unit(self) -> str:
        unit = self.quantity.unit
        return self.form.format(unit) if unit != "1" else self.form.format("").strip() or "1"

    @property
    def key(self) -> str:
        # The name of the number: "overshoot depth", or "effort" where what it is of needs no word.
        return self.name or (self.type if self.of == self.default else f"{self.type} {self.quantity.name}")

    @property
    def _labels(self) -> tuple[str, ...]:
        return (self.key,)

    def open(self, time: np.ndarray, count: int) -> _Follow:
        return _Follow(self, time)


@dataclass(frozen=True, eq=False)
class OfOne(Metric):
    """A metric of a single quantity, its default. Abstract."""

    # The quantity, and its name in a refusal.
    meaning: ClassVar[Quantity]
    called: ClassVar[str]

    def meant(self) -> Quantity:
        if not among(self.of, (self.default,)):
            raise refusal(f"{self.type}.of", self.of, f"is not {self.called}", "leave it out")
        return self.meaning


@dataclass(frozen=True, eq=False)
class Total(Metric):
    """A metric that sums numbers over ticks. Abstract."""

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        """Return the addend of each tick, (k, n)."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def begin(self, x: np.ndarray) -> State:
        return {"sum": np.zeros(x.shape[1])}

    def follow(self, state: State, ticks: Ticks) -> State:
        return {"sum": accumulated(state["sum"], ticks, self.added(state, ticks))}

    def finish(self, state: State) -> np.ndarray:
        return state["sum"]


@dataclass(frozen=True, eq=False)
class Largest(Metric):
    """A metric that is the maximum of a number over ticks. Abstract."""

    def size(self, state: State, x: np.ndarray) -> np.ndarray:
        """Return the number (..., n) at ticks, from their numbers x (..., d, n)."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def begin(self, x: np.ndarray) -> State:
        state = super().begin(x)
        return state | {"most": self.size(state, x)}

    def follow(self, state: State, ticks: Ticks) -> State:
        sizes = ticks.of_living(self.size(state, ticks.x), -np.inf)
        return {"most": np.maximum(state["most"], sizes.max(axis=0))}

    def finish(self, state: State) -> np.ndarray:
        return state["most"]


def accumulated(total: np.ndarray, ticks: Ticks, parts: np.ndarray) -> np.ndarray:
    """Return a sum (n,) with parts (k, n) added tick by tick: its bits do not depend on the number of ticks at once."""
    total = total.copy()
    for addend in ticks.of_living(parts, 0.0):
        total += addend
    return total
