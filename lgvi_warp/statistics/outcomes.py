# SPDX-License-Identifier: Apache-2.0
"""Statistics of how members end: the probability of an outcome by time, and statistics of the time at which it came."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.statistics import intervals
from lgvi_warp.statistics.base import Gatherer, Statistic
from lgvi_warp.statistics.counts import Curve, Histogram, by_replicates, check_levels
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.estimate import Estimate, along
from lgvi_warp.statistics.moments import Mean, estimate
from lgvi_warp.statistics.order import Quantiles
from lgvi_warp.statistics.quantity import Quantity
from lgvi_warp.statistics.then import Then
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values

# How a member ended: by the outcome asked for, otherwise, or not before the end of the run.
SO, OTHERWISE, NOT = 1.0, 2.0, 0.0

# Largest number of times, beside the sample times, at which curves of replicates are compared.
MOST_TIMES = 4096


def _nothing(samples: Any, members: Any) -> np.ndarray:
    raise TypeError("an outcome is not made of samples")


@dataclass(frozen=True, eq=False)
class OfEnds(Statistic):
    """A statistic of how members end. Abstract.

    Args:
        of: an outcome: the name of an event, a status, "stopped" or "failed".
    """

    of_numbers: ClassVar[bool] = False
    of_ends: ClassVar[bool] = True

    def meant(self) -> Quantity:
        """Return a quantity with the outcome's name; it needs no samples.

        Raises:
            SceneError: `of` is no name of an outcome.
        """
        if not isinstance(self.of, str) or not self.of:
            remedy = 'give "floor", the name of an event of the scene, "stopped" or "failed"'
            raise refusal(f"{self.type}.of", self.of, "is no outcome", remedy)
        return Quantity(self.of, _nothing, "s", (), (self.of,), needs_limit=True)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """The one outcome that the statistic is of."""
        return (self.quantity.name,)


class _Endings(Gatherer):
    """Gathers the times of a block's members that ended before the run did, by the outcome asked for or otherwise."""

    def take(self, values: Values, when: slice) -> None:
        """Take in the ends: x (replicates, 2, members), time [s] and kind of each end."""
        time, kind = values.x[:, 0], values.x[:, 1]
        replicate, member = np.nonzero(kind != NOT)
        self._part = {
            "members": np.full(len(time), time.shape[1], np.int64),
            "time": time[replicate, member],
            "so": kind[replicate, member] == SO,
            "replicate": replicate.astype(np.int32),
        }

    def close(self) -> Part:
        """Return the part that summarises the block."""
        return self._part


@dataclass(frozen=True, eq=False)
class Outcome(OfEnds):
    """Probability that a member has ended by an outcome by each time, of those that nothing else stopped before.

    The probability is Kaplan & Meier's estimate: a member that ends otherwise counts until then (it is censored). If no
    member ends otherwise, it is the fraction of all members. Interval: Wilson's with the number of members whose
    fraction has the variance of a beta product (see FirstPassage). Times are those of the events, not of samples.

    Arrays of the estimate, beside lower and upper:

    * value (k,): the probability; survival is 1 - value.
    * fraction (k,): members that have ended by the outcome, as a fraction of all members, including those that ended
      otherwise; fraction_lower, fraction_upper: Wilson's interval.
    * ended, otherwise (k,): number of members that have ended by the outcome, and otherwise, by each time.
    * count (k,): number of members at risk at each time.
    * end_time (levels,) [s]: time by which that fraction has ended, infinite if it never has; end_time_lower,
      end_time_upper from the interval of value.

    Args:
        of: "floor", "surface", the name of any event of the scene, "stopped" (by any event), a failure, or "failed" (by
            any). See `Statistic` for name and confidence.
        levels: fractions of members between 0 and 1; by default (0.05, 0.5, 0.95).
    """

    type: ClassVar[str] = "outcome"

    levels: Any = (0.05, 0.5, 0.95)

    def check(self, faults: Faults) -> None:
        """Note levels that are no fractions between 0 and 1."""
        check_levels(faults, self.levels)

    def open(self, time: np.ndarray, count: int) -> _Endings:
        """Return the object that takes in the ends of a block's members."""
        return _Endings()

    def at_ends(self, ends: Ends, last: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """Return time [s] and kind of each end."""
        over = ends.status != 0
        kind = np.where(ends.are(self.quantity.name), SO, np.where(over, OTHERWISE, NOT))
        return np.stack([ends.time, kind])[None], None

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        # Join the ends of both sets of members, one after the other.
        ends = {name: np.concatenate([left[name], right[name]]) for name in ("time", "so", "replicate")}
        return {"members": left["members"] + right["members"]} | ends

    def of_replicate(self, part: Part, replicate: int, replicates: int) -> Part:
        # The ends of the members of one replicate.
        chosen = part["replicate"] == replicate
        ends = {name: part[name][chosen] for name in ("time", "so", "replicate")}
        return {"members": part["members"][replicate : replicate + 1]} | ends

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """Return the estimate of Kaplan & Meier (1958), from the times of all ends."""
        at = np.union1d(time, part["time"][part["so"]])
        curve = _curve(part, at)
        return self._estimate(part, at, curve, intervals.wilson(curve.value, curve.members, self.confidence), time)

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        # Probabilities with intervals from the spread of the replicates' curves.
        overall = self.whole(parts)
        ends = np.unique(overall["time"][overall["so"]])
        at = np.union1d(time, ends[:: 1 + len(ends) // MOST_TIMES])
        curve = _curve(overall, at)
        curves = np.stack([_curve(self.of_replicate(overall, r, replicates), at).value for r in range(replicates)])
        ends_of = intervals.probability_of_replicates(curve.value, curves, curve.members, self.confidence)
        result = self._estimate(overall, at, curve, ends_of, time)
        return [result.with_interval(by_replicates(replicates), {})]

    def _estimate(
        self, part: Part, at: np.ndarray, curve: Curve, ends: tuple[np.ndarray, np.ndarray], time: np.ndarray
    ) -> Estimate:
        """The estimate from the curve at the times `at` (m,) [s], which contain the sample times."""
        lower, upper = (end[:, 0] for end in curve.ends(*ends))
        rows = np.searchsorted(at, time)
        members = int(part["members"].sum())
        kinds = part["so"], ~part["so"]
        ended, otherwise = (np.searchsorted(np.sort(part["time"][kind]), time, "right") for kind in kinds)
        fraction = ended / max(members, 1)
        # If no member ended otherwise before, the product equals this fraction except for round-off.
        value = np.where(otherwise == 0, fraction, curve.value[rows, 0]) if members else curve.value[rows, 0]
        low, high = intervals.wilson(fraction, np.full(len(time), members), self.confidence)
        arrays = {"value": value, "lower": np.fmin(lower[rows], value), "upper": np.fmax(upper[rows], value)}
        arrays |= {"survival": 1.0 - value, "fraction": fraction, "fraction_lower": low, "fraction_upper": high}
        arrays |= {"ended": ended, "otherwise": otherwise, "count": members - ended - otherwise}
        dims = along(arrays, "time")
        levels = np.asarray(self.levels, dtype=np.float64)
        curves = {"end_time": curve.value[:, 0], "end_time_lower": upper, "end_time_upper": lower}
        arrays |= (times := {name: _reached(values, levels, at) for name, values in curves.items()})
        text = "Wilson with the variance of the beta product"
        return estimate(self, text, dims | along(times, "level"), arrays, time, {"level": levels}, "1", labels=())


def _curve(part: Part, at: np.ndarray) -> Curve:
    """Kaplan & Meier's curve at rising times `at` [s]; an end between two of them counts at the second one."""
    so = np.searchsorted(at, part["time"][part["so"]])
    passed = np.bincount(so, minlength=len(at))[: len(at), None]
    # A member that ends otherwise at one of the times is at risk at that time, and at no later one.
    late = np.searchsorted(at, part["time"][~part["so"]], "right")
    lost = np.bincount(late, minlength=len(at))[: len(at)]
    return Curve(passed, lost, int(part["members"].sum()))


def _reached(curve: np.ndarray, levels: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Times [s] at which a rising curve reaches each level."""
    if np.isnan(curve).all():
        return np.full(len(levels), np.nan)
    places = np.searchsorted(np.maximum.accumulate(curve), levels)
    return np.append(at, np.inf)[places]


class _EndTimes(Gatherer):
    """Gathers the times of a block's members that ended by the outcome."""

    def __init__(self, statistic: EndTime, time: np.ndarray):
        self._statistic, self._time = statistic, time

    def take(self, values: Values, when: slice) -> None:
        """Take in the times of the ends."""
        self._part = self._statistic.gather(values, self._time)

    def close(self) -> Part:
        """Return the part that summarises the block."""
        return self._part


@dataclass(frozen=True, eq=False)
class EndTime(OfEnds, Then):
    """Statistics of the time [s] at which members ended by an outcome, over the members that did.

    Members that end otherwise, or not before the run does, are left out; Outcome takes them into account.

    Args:
        of: "floor", "surface", the name of any event of the scene, "stopped" (by any event), a failure, or "failed" (by
            any). See `Statistic` for name and confidence.
        then: a statistic, or a list, without `of`; by default the mean, quantiles and a histogram of 20 bins over the
            run: "mean end_time floor", "quantiles end_time floor", "histogram end_time floor".
    """

    type: ClassVar[str] = "end_time"

    def then_default(self) -> Sequence[Statistic]:
        """Return a mean, quantiles, and a histogram over the run."""
        return [Mean(), Quantiles(), Histogram(bins=20, limits="run")]

    def open(self, time: np.ndarray, count: int) -> _EndTimes:
        """Return the object that takes in the ends of a block's members."""
        return _EndTimes(self, time)

    def at_ends(self, ends: Ends, last: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the time [s] of each end."""
        return ends.time[None, None], ends.are(self.quantity.name)[None]
