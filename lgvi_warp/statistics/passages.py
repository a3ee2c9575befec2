# SPDX-License-Identifier: Apache-2.0
"""Times at which a condition first holds, and the curve of the probability of passing by each time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.statistics.base import Gatherer, together
from lgvi_warp.statistics.counts import Condition, Counted, by_replicates
from lgvi_warp.statistics.ends import STOPPED, Ends
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.estimates.estimate import Estimate, along
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.moments import estimate
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.statistics.weighted import Weighted, both_measures, is_weighted

# How intervals of probabilities by time are formed.
DIRICHLET = "Wilson with the variance of the Dirichlet product"

# Number of equal pieces of the time between two samples, in which passages are counted.
PIECES = 8
# Part of all that is taken for none.
NOBODY = 1e-12


class _Passages(Gatherer):
    """Finds, for each member of a block, the first sample at which the condition holds, or the last known sample."""

    def __init__(self, statistic: FirstPassage, time: np.ndarray, count: int):
        self._statistic, self._time, self._times = statistic, time, len(time)
        self._passed = np.full(count, len(time), np.int64)
        # Fraction of the time from the sample before to the sample that shows the passage.
        self._share = np.ones(count)
        self._stopped = np.full(count, len(time), np.int64)
        self._known = np.zeros(count, np.int64)
        self._before: np.ndarray | None = None
        self._replicates = 1
        self._weight: np.ndarray | None = None

    def take(self, values: Values, when: slice) -> None:
        k = when.stop - when.start
        self._replicates, self._weight = values.replicates, values.weight
        x = values.x.reshape(k, -1)
        holds = self._statistic.holds(values)[:, 0].reshape(k, -1)
        first = np.where(holds.any(axis=0), when.start + holds.argmax(axis=0), self._times)
        open_ = (self._passed == self._times) & (self._known == when.start)
        if values.good is None:
            self._known[open_] = when.stop
        else:
            # A member that is lost stays lost: its later samples are ignored.
            lost = ~values.good.reshape(k, -1)
            good = np.where(lost.any(axis=0), lost.argmax(axis=0), len(lost))
            self._known = np.where(open_, when.start + good, self._known)
            first = np.where(first < when.start + good, first, self._times)
        self._passed = np.where(open_, first, self._passed)
        self._place(x, when, np.flatnonzero(open_ & (first < self._times)))
        self._before = x[-1]

    def _place(self, x: np.ndarray, when: slice, now: np.ndarray) -> None:
        """Set the passage times of these members between the previous sample and this one, by linear interpolation."""
        above, below = self._statistic.limits(1)
        if self._before is None or (above is None and below is None):
            return
        at = self._passed[now] - when.start
        before = np.where(at > 0, x[at - 1, now], self._before[now])
        # A band is entered over its nearer end.
        limit = below if above is None else above if below is None else np.where(before <= above, above, below)
        limit = np.asarray(limit).ravel()
        self._share[now] = (limit - before) / (x[at, now] - before)

    def end(self, ends: Ends, replicates: int) -> None:
        """Correct passages of members that stopped between the two samples; members that stopped otherwise never pass."""
        end = ends.time.reshape(-1, replicates).T.ravel()
        stopped = ends.are(STOPPED).reshape(-1, replicates).T.ravel()
        never = stopped & (self._passed == self._times) & (self._known == self._times)
        self._stopped[never] = np.searchsorted(self._time, end[never])
        now = np.flatnonzero((self._passed > 0) & (self._passed < self._times) & stopped)
        before, at = self._time[self._passed[now] - 1], self._time[self._passed[now]]
        self._share[now] *= np.clip((end[now] - before) / (at - before), 0.0, 1.0)

    def close(self) -> Part:
        if self._weight is None:
            return self._part(None)
        counted = {"count": np.array([self._weight.sum()])}, {"count": np.array([np.sum(self._weight**2)])}
        own, squares = (sums | self._part(self._weight**power) for power, sums in enumerate(counted, 1))
        return both_measures(own, squares, np.array([np.count_nonzero(self._weight)]))

    def _part(self, weights: np.ndarray | None) -> Part:
        """Numbers of members that pass, are lost and stop at each time, or the sums of their weights."""
        R, length = self._replicates, self._times + 1
        row = np.repeat(np.arange(R), len(self._passed) // R) * length
        piece = np.clip(np.floor(self._share * PIECES), 0, PIECES - 1).astype(np.int64)
        passed = np.bincount((row + self._passed) * PIECES + piece, weights, R * length * PIECES)
        stopped = self._stopped < self._times
        open_ = (self._passed == self._times) & ~stopped
        lost, over = (np.bincount((row + at)[which], _of(weights, which), R * length).reshape(R, length)
                      for at, which in ((self._known, open_), (self._stopped, stopped)))  # fmt: skip
        return {"passed": passed.reshape(R, length, PIECES), "lost": lost, "stopped": over}


def _of(weights: np.ndarray | None, which: np.ndarray) -> np.ndarray | None:
    return None if weights is None else weights[which]


@dataclass(frozen=True, eq=False)
class FirstPassage(Condition, Counted):
    """Time until a condition first holds, determined from the samples.

    The probability is Aalen & Johansen's estimate. A member that an event stops before the condition holds never
    passes. With stopped="left_out" this member is censored: its chance of passing later is assumed to equal the other
    members' chance. A member that fails before it passes counts until its last valid sample. The estimate is NaN if no
    member is valid at the first sample. If no member fails, the probability is the fraction of all members. The
    interval is Wilson's for an equivalent number of members: a simple fraction of so many members has the variance of a
    beta product (Fay, Brittain & Proschan 2013). This accounts for few members at risk. Once no member is at risk, the
    upper end of the interval assumes that all lost members pass.

    If the condition holds at a sample but not at the sample before, the member passes where the straight line between
    the two values crosses the limit. For a quantity that is true or false, the member passes at the sample. A condition
    that holds only between two samples is missed; an event of the scene checks every step.

    Arrays of the estimate, in addition to lower and upper, at k sample times:

    * value (k,): probability of passing by each time; survival is 1 - value.
    * passed (k,): number of members that pass in the interval from the previous sample time to each time.
    * lost (k,): number of members that fail in this interval without having passed.
    * stopped (k,): number of members that an event stops in this interval without having passed.
    * count (k,): number of members at risk of passing in this interval.
    * censored: number of members that ran to the end and did not pass.
    * passage_time (levels,) [s]: time by which each fraction in `levels` of the members has passed; infinite if never.
      passage_time_lower, passage_time_upper follow from the interval of value.

    Args:
        of: A quantity of one component, such as "depth" or "position[2]" (see lw.statistics.Quantity).
        above: the lower limit, in the quantity's unit.
        below: the upper limit; with both limits, the quantity must lie between them.
        levels: fractions of members between 0 and 1; by default (0.05, 0.5, 0.95).
    """

    type: ClassVar[str] = "first_passage"
    since: ClassVar[frozenset[str]] = frozenset({"stopped"})
    of_numbers: ClassVar[bool] = False

    levels: Any = (0.05, 0.5, 0.95)

    def check(self, faults: Faults) -> None:
        super().check(faults)
        check_levels(faults, self.levels)
        if self.of is not None and getattr(self, "_quantity", None) is not None and self.quantity.size != 1:
            faults.add("of", self.of, f"has {self.quantity.size} components", f"give one: {self.quantity.labels[0]!r}")

    def open(self, time: np.ndarray, count: int) -> _Passages:
        return _Passages(self, time, count)

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # The estimate of Aalen & Johansen (1978).
        curve = PassageCurve.of(part)
        return self._estimate(part, curve, curve.members, time)

    def read_any(self, part: Part, time: np.ndarray) -> Estimate:
        if not is_weighted(part):
            return self.read(part, time)
        # The curve of effective members; the number behind a probability is that of its own variance.
        weighted = Weighted.of(part)
        scale = float((weighted.effective / weighted.weight)[0])
        scaled = {key: array * scale for key, array in weighted.own.items()}
        curve = PassageCurve.of(scaled)
        share, squares = (_added(sums["passed"][0, :-1]) for sums in (weighted.own, weighted.squares))
        number = curve.members * design_effect(weighted, share, squares)
        estimate = self._estimate(scaled, curve, number, time)
        arrays = estimate.arrays | {"members": np.full(len(time), weighted.members[0])}
        interval, dims = f"{estimate.interval}, of weighted members", estimate.dims | {"members": ("time",)}
        return replace(estimate, arrays=arrays, dims=dims, interval=interval)

    def _estimate(self, part: Part, curve: PassageCurve, number: np.ndarray, time: np.ndarray) -> Estimate:
        """The estimate from the curve, and the number (k, pieces) of members for each probability."""
        lower, upper = curve.ends(*intervals.wilson(curve.value, number, self.confidence))
        passed, lost, stopped = part["passed"][0, :-1].sum(axis=1), part["lost"][0], part["stopped"][0, :-1]
        arrays = {"value": curve.value[:, -1], "lower": lower[:, -1], "upper": upper[:, -1]}
        arrays |= {"survival": 1.0 - curve.value[:, -1], "passed": passed, "lost": lost[:-1], "stopped": stopped}
        arrays |= {"count": curve.risk}
        dims = along(arrays, "time")
        arrays |= {"censored": lost[-1]}
        dims["censored"] = ()
        levels = {"level": np.asarray(self.levels, dtype=np.float64)}
        text = DIRICHLET
        arrays |= (times := self._times(curve.value, lower, upper, time))
        return estimate(self, text, dims | along(times, "level"), arrays, time, levels, "1", labels=())

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        # Probabilities with intervals from the spread of the replicates' curves.
        each = self.each_replicate(parts, replicates)
        overall = self.whole(together(each))
        curve = PassageCurve.of(overall)
        curves = np.stack([PassageCurve.of(self.whole(replicate_parts)).value for replicate_parts in each])
        ends = curve.ends(*intervals.probability_of_replicates(curve.value, curves, curve.members, self.confidence))
        arrays = {"lower": ends[0][:, -1], "upper": ends[1][:, -1]} | self._times(curve.value, *ends, time)
        return [self.read(overall, time).with_interval(by_replicates(replicates), arrays)]

    def _times(self, value: np.ndarray, lower: np.ndarray, upper: np.ndarray, time: np.ndarray) -> Part:
        """Times at which the curves (k, pieces) reach each level."""
        curves = {"passage_time": value, "passage_time_lower": upper, "passage_time_upper": lower}
        reached = partial(self._reached, time=time)
        return {name: np.array([reached(curve, level) for level in self.levels]) for name, curve in curves.items()}

    def _reached(self, curve: np.ndarray, level: float, time: np.ndarray) -> float:
        """Time [s] at which a rising curve reaches a level: linear within a piece; without limits a sample time."""
        if np.isnan(curve).all():
            return np.nan
        reached = np.flatnonzero(curve.ravel() >= level)
        if not len(reached):
            return np.inf
        i, piece = divmod(int(reached[0]), PIECES)
        if i == 0 or (self.above is None and self.below is None):
            return float(time[i])
        low, high = curve.ravel()[reached[0] - 1], curve[i, piece]
        return float(time[i - 1] + (time[i] - time[i - 1]) * (piece + (level - low) / (high - low)) / PIECES)


def check_levels(faults: Faults, levels: Any) -> None:
    """Add a fault unless levels are fractions between 0 and 1."""
    numbers = faults.finite("levels", levels)
    if numbers is not None and (numbers.ndim != 1 or np.any(numbers <= 0.0) or np.any(numbers >= 1.0)):
        faults.add("levels", levels, "are not numbers between 0 and 1", "give (0.05, 0.5, 0.95)")


def design_effect(weighted: Weighted, share: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Equivalent number of members of a weighted fraction (...), divided by the effective number of all members.

    share, squares: sums of the weights, and of their squares, of the members that the fraction counts.
    """
    fraction = (share / weighted.weight[0]).ravel()[None]
    number = weighted.number_of(fraction, squares.ravel()[None]) / np.maximum(weighted.effective[0], 1e-300)
    return np.asarray(number.reshape(share.shape))


class PassageCurve:
    """Probability of passing, by Aalen & Johansen (1978), at the end of each piece of the intervals between samples.

    A member that ends otherwise no longer passes; without such members, this is Kaplan & Meier's curve (1958). A lost
    member is known up to the sample before, and is not at risk in any later piece.

    passed: (k, pieces), number of members that pass in each piece.
    others: (k, pieces), number of members that end otherwise in each piece.
    lost: (k,), number of members that are lost before each time.

    Attributes:
        value: (k, pieces), estimated probability of passing; the fraction of all members as long as none is lost.
        risk: (k,), number of members at risk of passing at each sample time.
        left: (k, pieces), number of members still at risk at the end of each piece.
        members: (k, pieces), number of independent members that would give the same variance.
    """

    @classmethod
    def of(cls, part: Part) -> PassageCurve:
        """Return the curve of first passages."""
        passed = part["passed"][0, :-1]
        others = np.zeros_like(passed)
        # They stop within the time before a sample: the last of its pieces counts them.
        others[:, -1] = part["stopped"][0, :-1]
        return cls(passed, others, part["lost"][0, :-1], part["passed"][0].sum())

    def __init__(self, passed: np.ndarray, others: np.ndarray, lost: np.ndarray, total: float):
        now, so_far = (np.cumsum(counts, axis=1) for counts in (passed, passed + others))
        risk = total - np.cumsum(lost) - _before(so_far[:, -1])
        # Of weights rounding leaves a little, which is nobody.
        self.risk = np.where(risk > NOBODY * total, risk, 0)
        n = self.risk[:, None]
        self.left = n - so_far
        some = np.where(n > 0, n, 1)
        stay = 1.0 - so_far / some
        under_way = np.concatenate([[1.0], np.cumprod(stay[:, -1])[:-1]])[:, None]
        # As long as none is lost, the sum is the fraction of all members, but for round-off.
        none_lost = np.cumsum(lost)[:, None] == 0
        fraction, value = _added(passed) / (total or 1), _added(under_way * passed / some)
        self.value = np.where(self.risk[0] > 0, np.where(none_lost, fraction, value), np.nan)
        self.members = np.where(none_lost, float(total), self._members(n, now, so_far))
        self._otherwise = np.maximum(1.0 - under_way * stay - self.value, 0.0)

    @staticmethod
    def _members(n: np.ndarray, now: np.ndarray, so_far: np.ndarray) -> np.ndarray:
        """Number of members whose fraction has the variance of a sum of Dirichlet variables, one for each time.

        If x of n members pass and o end otherwise, the shares of those that pass, end otherwise and stay are
        Dirichlet(x, o, n - x - o + 1); of those that finally stay, a share Beta(1/2, staying + 1/2) passes. If none
        ends otherwise, this lies between the two beta products of Fay, Brittain & Proschan (2013, Biostatistics 14), as
        Jeffreys' interval lies between Clopper & Pearson's limits. If none is lost, it is Jeffreys' Beta(m + 1/2, n - m
        + 1/2), and the result is the number of all members. With few members at risk, Greenwood's variance would be far
        too small.

        n: (k, 1), members at risk at each time.
        now: (k, pieces), members that passed since the time before.
        so_far: (k, pieces), members that passed or ended otherwise since the time before.
        """
        # Means, variances and covariance of S, the probability to be under way, and of F, to have passed.
        size = n + 1.0
        q, p = now / size, (size - so_far) / size
        var_q, cov, var_p = (c / (size + 1.0) for c in (q * (1.0 - q), -q * p, p * (1.0 - p)))
        spread = np.log1p(var_p / (p * p))
        S = np.concatenate([[1.0], np.cumprod(p[:, -1])[:-1]])[:, None]
        var_S = S * S * np.expm1(_before(spread[:, -1]))[:, None]
        S2 = var_S + S * S
        cov_step = S2 * cov + var_S * q * p
        cov_FS = S * _before((cov_step / (S * p))[:, -1])[:, None]
        var_step = 2.0 * cov_FS * q + S2 * var_q + var_S * q * q
        # At the end of each piece.
        F, var_F = (_before(step[:, -1])[:, None] + step for step in (S * q, var_step))
        cov_FS, S2 = cov_FS * p + cov_step, S2 * (p * p + var_p)
        S, var_S = S * p, var_S * p * p + (var_S + S * S) * var_p
        # The last step, of those that stay.
        staying = n - so_far
        r = 0.5 / (staying + 1.0)
        var_F = var_F + 2.0 * cov_FS * r + S2 * r * (1.0 - r) / (staying + 2.0) + var_S * r * r
        F = F + S * r
        # For a Beta(a, b) mean (1 - mean) / variance is a + b + 1, which is the number of members plus two.
        return np.asarray(np.maximum(F * (1.0 - F) / var_F - 2.0, 0.0))

    def ends(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return an interval (k, pieces) that contains the value, widened if nothing is known.

        After the last member at risk, all lost members may pass at once; without any member the interval is 0 to 1.
        """
        nobody = not self.risk[0]
        most = np.minimum(1.0, 1.0 - self._otherwise + (upper - self.value))
        upper = np.where(nobody, 1.0, np.where(self.left <= 0, most, upper))
        return np.fmin(np.where(nobody, 0.0, lower), self.value), np.fmax(upper, self.value)


def _added(steps: np.ndarray) -> np.ndarray:
    """Sum of all steps (k, pieces) up to the end of each piece."""
    return np.asarray(_before(steps.sum(axis=1))[:, None] + np.cumsum(steps, axis=1))


def _before(steps: np.ndarray) -> np.ndarray:
    """Sum of the steps (k,) before each time."""
    return np.concatenate([np.zeros(1, steps.dtype), np.cumsum(steps)[:-1]])
