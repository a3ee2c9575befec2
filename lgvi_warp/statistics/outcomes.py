# SPDX-License-Identifier: Apache-2.0
"""Statistics of the members' ends: the probability of an outcome by time, and statistics of its time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.statistics.base import Gatherer, Statistic
from lgvi_warp.statistics.counts import Histogram, by_replicates
from lgvi_warp.statistics.ends import FAILED, Ends
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.estimates.estimate import Estimate, along
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.moments import Mean, estimate
from lgvi_warp.statistics.order import Quantiles
from lgvi_warp.statistics.passages import DIRICHLET, PassageCurve, check_levels, design_effect
from lgvi_warp.statistics.paths.member_statistic import MemberStatistic
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.statistics.weighted import Weighted

# How a member ended: not before the end of the run, by the outcome asked for, otherwise, or by a failure.
NOT, SO, OTHERWISE, LOST = 0.0, 1.0, 2.0, 3.0

# Largest number of times, beside the sample times, at which curves of replicates are compared.
MOST_TIMES = 4096


def _nothing(samples: Any, members: Any) -> np.ndarray:
    raise TypeError("an outcome is not made of samples")


@dataclass(frozen=True, eq=False)
class OfEnds(Statistic):
    """A statistic of the members' ends. Abstract.

    Args:
        of: an outcome: the name of an event, a status, "stopped" or "failed".
    """

    of_numbers: ClassVar[bool] = False
    of_ends: ClassVar[bool] = True

    def meant(self) -> Quantity:
        """Return a quantity with the outcome's name, which needs no samples; SceneError if `of` is not a name."""
        if not isinstance(self.of, str) or not self.of:
            remedy = 'give "floor", the name of an event of the scene, "stopped" or "failed"'
            raise refusal(f"{self.type}.of", self.of, "is not an outcome", remedy)
        return Quantity(self.of, _nothing, "s", (), (self.of,), needs_limit=True)

    @property
    def outcomes(self) -> tuple[str, ...]:
        return (self.quantity.name,)


class _AtEnd(Gatherer):
    """Gathers the ends of a block's members, which arrive all at once."""

    def __init__(self, part_of: Callable[[Values], Part]):
        self._part_of = part_of

    def take(self, values: Values, when: slice) -> None:
        self._part = self._part_of(values)

    def close(self) -> Part:
        return self._part


def _endings(values: Values) -> Part:
    """Members that ended before the run, from x (replicates, 2, members): time [s] and kind of each end."""
    time, kind = values.x[:, 0], values.x[:, 1]
    replicate, member = np.nonzero(kind != NOT)
    ends = {
        "members": np.full(len(time), time.shape[1], np.int64),
        "time": time[replicate, member],
        "kind": kind[replicate, member].astype(np.uint8),
        "replicate": replicate.astype(np.int32),
    }
    if values.weight is None:
        return ends
    sums = {"weight": np.sum(values.weight), "square": np.sum(values.weight**2)}
    sums |= {"members": np.count_nonzero(values.weight)}
    return ends | {"of_member": values.weight[member]} | {name: np.array([total]) for name, total in sums.items()}


@dataclass(frozen=True, eq=False)
class Outcome(OfEnds):
    """Probability that a member has ended with an outcome, by each time.

    The probability is Aalen & Johansen's estimate (1978) of the cumulative incidence: a member that another event
    stopped can no longer have this outcome. A member that fails is censored at its failure, unless the outcome is a
    failure. If no member fails, the estimate is the fraction of all members. The probabilities of all events and of
    "ok" (the end of the run) sum to 1. The interval is Wilson's for an equivalent number of members: a simple fraction
    of so many members has the variance of a Dirichlet product. Without failures, this is the number of all members.
    Times of events are exact, not rounded to sample times.

    Arrays of the estimate, in addition to lower and upper, at k sample times:

    * value (k,): the probability; survival is 1 - value.
    * alone (k,): Kaplan & Meier's estimate (1958) of the probability if no other event stopped members. Members that
      other events stop are censored, as if they had continued like the others. No run can confirm this assumption, and
      it rarely holds (a vehicle that surfaces does not sink). Interval: alone_lower, alone_upper.
    * fraction (k,): members that have ended with the outcome, as a fraction of all members, including failed members;
      fraction_lower, fraction_upper: Wilson's interval.
    * ended, otherwise, failed (k,): numbers of members that have ended by each time. `ended`: with the outcome;
      `otherwise`: in any other way; `failed`: those of `otherwise` that failed.
    * count (k,): number of members at risk at each time.
    * end_time (levels,) [s]: time by which each fraction in `levels` of the members has the outcome; infinite if never.
      end_time_lower, end_time_upper follow from the interval of value.

    Args:
        of: "floor", "surface" or the name of any event of the scene; "stopped", for all events; a failure; or "failed",
            for all failures.
        name: Key of the estimate in the result; by default the type and the outcome, such as "outcome floor".
        levels: fractions of members between 0 and 1; by default (0.05, 0.5, 0.95).

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, events=[lw.events.Floor(depth=1.0)])
        >>> fleet = lw.Ensemble(scene, members=64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=2.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=20.0, statistics=[lw.statistics.Outcome("floor")])
        >>> print(f"{result.statistics['outcome floor'].value[-1]:.2f}")
        0.27
    """

    type: ClassVar[str] = "outcome"
    since: ClassVar[frozenset[str]] = frozenset({"kind"})

    levels: Any = (0.05, 0.5, 0.95)

    def check(self, faults: Faults) -> None:
        check_levels(faults, self.levels)

    def open(self, time: np.ndarray, count: int) -> _AtEnd:
        return _AtEnd(_endings)

    def at_ends(self, ends: Ends, last: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        kind = np.select([ends.are(self.quantity.name), ends.are(FAILED), ends.status != 0], [SO, LOST, OTHERWISE], NOT)
        return np.stack([ends.time, kind])[None], None

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        # Join the ends of both sets of members, one after the other.
        listed = first.keys() & {"time", "kind", "replicate", "of_member"}
        ends = {name: np.concatenate([first[name], second[name]]) for name in first if name in listed}
        return ends | {name: first[name] + second[name] for name in first if name not in listed}

    def of_replicate(self, part: Part, replicate: int, replicates: int) -> Part:
        # The ends of the members of one replicate.
        chosen = part["replicate"] == replicate
        ends = {name: part[name][chosen] for name in ("time", "kind", "replicate")}
        return {"members": part["members"][replicate : replicate + 1]} | ends

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # The estimate of Aalen & Johansen (1978), from the times of all ends.
        at = np.union1d(time, _steps_of(part))
        curves, effect = _curves(part, at), np.ones(1)
        if "weight" in part:
            weighted, so = _weighted(part), part["kind"] == SO
            share, squares = (
                np.cumsum(_counted(at, part["time"][so], "left", part["of_member"][so] ** power)) for power in (1, 2)
            )
            effect = design_effect(weighted, share, squares)[:, None]
        ends = [intervals.wilson(curve.value, curve.members * effect, self.confidence) for curve in curves]
        return self._estimate(part, at, curves, ends, time)

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        # Probabilities with intervals from the spread of the replicates' curves.
        overall = self.whole(parts)
        steps = np.unique(_steps_of(overall))
        at = np.union1d(time, steps[:: 1 + len(steps) // MOST_TIMES])
        curves = _curves(overall, at)
        each = [_curves(self.of_replicate(overall, r, replicates), at) for r in range(replicates)]
        values = [np.stack([replicate_curves[i].value for replicate_curves in each]) for i in range(len(curves))]
        ends = [
            intervals.probability_of_replicates(curve.value, of_each, curve.members, self.confidence)
            for curve, of_each in zip(curves, values, strict=True)
        ]
        result = self._estimate(overall, at, curves, ends, time)
        return [result.with_interval(by_replicates(replicates), {})]

    def _estimate(
        self, part: Part, at: np.ndarray, curves: Sequence[PassageCurve], ends: Sequence[Pair], time: np.ndarray
    ) -> Estimate:
        """The estimate from the curves at the times `at` (m,) [s], which contain the sample times."""
        rows, members = np.searchsorted(at, time), _total(part)
        arrays: Part = {}
        for name, curve, interval in zip(("value", "alone"), curves, ends, strict=True):
            names = (name, *(f"{name}_{end}".removeprefix("value_") for end in ("lower", "upper")))
            numbers = (curve.value, *curve.ends(*interval))
            arrays |= {key: values[:, 0] for key, values in zip(names, numbers, strict=True)}
        levels = np.asarray(self.levels, dtype=np.float64)
        reached = {"end_time": arrays["value"], "end_time_lower": arrays["upper"], "end_time_upper": arrays["lower"]}
        times = {name: _reached(values, levels, at) for name, values in reached.items()}
        arrays = {name: values[rows] for name, values in arrays.items()}
        ended, others, failed = (self._by(part, kind, time) for kind in (SO, OTHERWISE, LOST))
        fraction, number = ended / (members or 1), np.full(len(time), members)
        if "weight" in part:
            squares = self._by(part, SO, time, 2)
            number = _weighted(part).number_of(fraction[None], squares[None])[0]
        low, high = intervals.wilson(fraction, number, self.confidence)
        arrays |= {"survival": 1.0 - arrays["value"]}
        arrays |= {"fraction": fraction, "fraction_lower": low, "fraction_upper": high}
        arrays |= {"ended": ended, "otherwise": others + failed, "failed": failed}
        arrays |= {"count": members - ended - others - failed}
        how = DIRICHLET
        if "weight" in part:
            arrays, how = arrays | {"members": np.full(len(time), part["members"].sum())}, f"{how}, of weighted members"
        dims = along(arrays, "time")
        dims |= along(times, "level")
        return estimate(self, how, dims, arrays | times, time, {"level": levels}, "1", labels=())

    @staticmethod
    def _by(part: Part, kind: float, time: np.ndarray, power: int = 1) -> np.ndarray:
        """Number of members with an outcome by each time; for weighted members, effective numbers, or sums of squares."""
        so = part["kind"] == kind
        order = np.argsort(part["time"][so], kind="stable")
        by = np.searchsorted(part["time"][so][order], time, "right")
        if "weight" not in part:
            return by
        total = np.append(0.0, np.cumsum(part["of_member"][so][order] ** power))[by]
        return total * _scale(part) if power == 1 else total


Pair = tuple[np.ndarray, np.ndarray]


def _weighted(part: Part) -> Weighted:
    """The sums of the weights of all members, from a part of weighted members."""
    return Weighted({"count": part["weight"]}, {"count": part["square"]}, part["members"])


def _scale(part: Part) -> float:
    """Factor from weights to effective members; 1 for members without weights."""
    return float((part["weight"] / part["square"])[0]) if "weight" in part else 1.0


def _total(part: Part) -> Any:
    """Number of members, or the effective number of weighted members."""
    return float(_weighted(part).effective[0]) if "weight" in part else int(part["members"].sum())


def _steps_of(part: Part) -> np.ndarray:
    """Times [s] at which the curves step. Other ends are included only if members fail, since then their order matters."""
    lost = bool((part["kind"] == LOST).any())
    return np.asarray(part["time"][part["kind"] != LOST if lost else part["kind"] == SO])


def _curves(part: Part, at: np.ndarray) -> tuple[PassageCurve, PassageCurve]:
    """Aalen & Johansen's curve at rising times `at` [s], and Kaplan & Meier's, in which other events also censor."""
    weights = part["of_member"] * _scale(part) if "weight" in part else None

    def counted(which: np.ndarray, side: Literal["left", "right"]) -> np.ndarray:
        return _counted(at, part["time"][which], side, None if weights is None else weights[which])

    so, others = (counted(part["kind"] == kind, "left")[:, None] for kind in (SO, OTHERWISE))
    # A member that is censored at one of the times is at risk at that time, and at no later one.
    lost, not_so = (counted(which, "right") for which in (part["kind"] == LOST, part["kind"] != SO))
    members = _total(part)
    return PassageCurve(so, others, lost, members), PassageCurve(so, np.zeros_like(so), not_so, members)


def _counted(
    at: np.ndarray, times: np.ndarray, side: Literal["left", "right"], weights: np.ndarray | None = None
) -> np.ndarray:
    """Number of the times [s] assigned to each of `at`, or the sum of their weights; later times are left out."""
    return np.bincount(np.searchsorted(at, times, side), weights, len(at))[: len(at)]


def _reached(curve: np.ndarray, levels: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Times [s] at which a rising curve reaches each level."""
    if np.isnan(curve).all():
        return np.full(len(levels), np.nan)
    places = np.searchsorted(np.maximum.accumulate(curve), levels)
    return np.append(at, np.inf)[places]


@dataclass(frozen=True, eq=False)
class EndTime(OfEnds, MemberStatistic):
    """Statistics of the time [s] at which members ended with an outcome, over the members with this outcome.

    All other members are left out; lw.statistics.Outcome takes them into account.

    Args:
        of: "floor", "surface" or the name of any event of the scene; "stopped", for all events; a failure; or "failed",
            for all failures.
        name: Key of the estimate in the result; by default the type and the outcome, such as "end_time floor".
        then: statistic of these times over the members, or a list of statistics, each without its `of`; by default the
            mean, quantiles and a histogram of 20 bins over the run: "mean end_time floor", "quantiles end_time floor",
            "histogram end_time floor".
    """

    type: ClassVar[str] = "end_time"

    def then_default(self) -> Sequence[Statistic]:
        return [Mean(), Quantiles(), Histogram(bins=20, limits="run")]

    def open(self, time: np.ndarray, count: int) -> _AtEnd:
        return _AtEnd(partial(self.gather, time=time))

    def at_ends(self, ends: Ends, last: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        return ends.time[None, None], ends.are(self.quantity.name)[None]
