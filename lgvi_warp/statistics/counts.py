# SPDX-License-Identifier: Apache-2.0
"""Statistics that count members: histograms, probabilities of a condition, and times of its first passage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.statistics.base import Gatherer, Statistic, together
from lgvi_warp.statistics.ends import STOPPED, Ends
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.estimates.estimate import Estimate, along
from lgvi_warp.statistics.estimates.naming import spelled
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.moments import component_dims, empty_as_nan, estimate
from lgvi_warp.statistics.values.values import Values


class Counted(Statistic):
    """A statistic whose part is whole numbers: these add up to the same in any order."""

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        return {key: first[key] + second[key] for key in first}

    def spread(self, pooled: Estimate, each: Sequence[Estimate]) -> Estimate:
        # Form Wilson's interval with the variance of the replicates' fractions.
        count = pooled.count.reshape(-1, *[1] * (pooled.value.ndim - 1))
        fractions = np.stack([replicate.value for replicate in each])
        lower, upper = intervals.probability_of_replicates(pooled.value, fractions, count, self.confidence)
        return pooled.with_interval(by_replicates(len(each)), {"lower": lower, "upper": upper})


def by_replicates(number: int) -> str:
    """Return the text that says how an interval of a probability was formed."""
    return f"Wilson with the variance and Student's t of {number} replicates"


@dataclass(frozen=True, eq=False)
class Histogram(Counted):
    """Fraction of members in each bin, with Wilson's interval for each bin.

    A bin contains its lower edge; the last bin contains its upper edge too. Give either `edges`, or `bins` and
    `limits`.

    Arrays of the estimate, beside lower, upper and count (k,):

    * value (k, d, bins): fraction of the members.
    * counts (k, d, bins): number of members.
    * below, above (k, d): number of members outside the edges.

    Args:
        of: a quantity; see `Statistic`, also for name, confidence, stopped and at.
        edges: rising edges of the bins, in the quantity's unit.
        bins: number of equal bins.
        limits: (low, high) of equal bins, in the quantity's unit; or "run", from the first to the last sample time, for
            statistics of times (see EndTime).
    """

    type: ClassVar[str] = "histogram"

    edges: Any = None
    bins: int | None = None
    limits: Any = None

    def check(self, faults: Faults) -> None:
        if self.edges is not None and self.bins is not None:
            faults.add("edges", self.edges, "and bins are both given", "keep one of them")
            return
        if (self.edges is None) == (self.bins is None or self.limits is None):
            faults.add("edges", self.edges, "is missing, and so is bins or limits", "give edges=(0, 10, 20)")
            return
        run = isinstance(self.limits, str) and self.limits == "run"
        if run and self.of is not None:
            faults.add(
                "limits", self.limits, "is for times alone, as in lw.statistics.EndTime", "give limits=(low, high)"
            )
            return
        if self.edges is None:
            limits, bins = np.array([0.0, 1.0]) if run else faults.finite("limits", self.limits, (2,)), self.bins
            if bins is None or not is_whole(bins, 1):
                faults.add("bins", bins, "is no whole number above 0", "give 50")
                return
            object.__setattr__(self, "bins", int(bins))
            edges = None if limits is None else np.linspace(limits[0], limits[1], int(bins) + 1)
        else:
            edges = faults.finite("edges", self.edges)
        if edges is not None and (edges.ndim != 1 or len(edges) < 2 or np.any(np.diff(edges) <= 0.0)):
            faults.add("edges", self.edges if self.edges is not None else self.limits, "do not rise", "sort them")
        object.__setattr__(self, "_edges", edges)

    def over(self, time: np.ndarray) -> Histogram:
        if not isinstance(self.limits, str):
            return self
        return replace(self, edges=np.linspace(time[0], time[-1], (self.bins or 0) + 1), bins=None, limits=None)

    def rows(self, values: Values) -> Part:
        edges: np.ndarray = self._edges  # type: ignore[attr-defined]
        k, d, _ = values.x.shape
        # 0: below; 1 to B: bins; B + 1: above. The last edge belongs to the last bin.
        at = np.searchsorted(edges, values.x, side="right")
        at = np.where(values.x == edges[-1], len(edges) - 1, at)
        stream = np.arange(k * d).reshape(k, d, 1) * (len(edges) + 1)
        bin_of = at + stream
        kept = bin_of.ravel() if values.good is None else bin_of[np.repeat(values.good[:, None], d, axis=1)]
        counts = np.bincount(kept, minlength=k * d * (len(edges) + 1)).reshape(k, d, len(edges) + 1)
        return {"count": values.count, "counts": counts}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        edges: np.ndarray = self._edges  # type: ignore[attr-defined]
        count, counts = part["count"], part["counts"]
        n = count[:, None, None]
        inside = counts[..., 1:-1]
        value = empty_as_nan(inside / np.maximum(n, 1), count)
        lower, upper = intervals.wilson(inside / np.maximum(n, 1), n, self.confidence)
        arrays = {"value": value, "lower": lower, "upper": upper, "counts": inside}
        dims = along(arrays, "time", "component", "bin")
        arrays |= {"below": counts[..., 0], "above": counts[..., -1]}
        dims |= {"below": ("time", "component"), "above": ("time", "component"), "count": ("time",), "edge": ("edge",)}
        bins = {"bin": 0.5 * (edges[1:] + edges[:-1]), "edge": edges}
        return estimate(self, "Wilson", dims, arrays | {"count": count}, time, bins, "1")


@dataclass(frozen=True, eq=False)
class Condition(Statistic):
    """A statistic with a condition: a quantity above a number, below one, or between two: above < x < below.

    Args:
        above: one number, or one for each component, in the quantity's unit; None (the default): no limit.
        below: the same for the upper limit. With neither, the condition holds where a function is not 0, so that a
            function may return true or false; a quantity by name needs a number.
    """

    above: Any = None
    below: Any = None

    def check(self, faults: Faults) -> None:
        super().check(faults)
        quantity = getattr(self, "_quantity", None)
        fits, limits = (1,) if quantity is None else (1, quantity.size), list[np.ndarray]()
        for name in ("above", "below"):
            if getattr(self, name) is not None:
                limit = faults.finite(name, getattr(self, name))
                if limit is not None and (limit.ndim > 1 or limit.size not in fits):
                    faults.add(name, getattr(self, name), "is no number", "give one number, or one for each component")
                elif limit is not None:
                    limits.append(limit)
        if len(limits) == 2 and not np.all(limits[0] < limits[1]):
            both = self.above, self.below
            faults.add("above and below", both, "have nothing between them", "give above < below, or one of them")
        if quantity is not None and self.above is None and self.below is None and quantity.needs_limit:
            unit = f" [{quantity.unit}]" if quantity.unit else ""
            remedy = f"give above=... or below=...{unit}, or a function that says true or false"
            faults.add("above", None, f"and below are missing: {quantity.name} is compared with nothing", remedy)

    @property
    def key(self) -> str:
        # The name in the result: "exceedance depth above 50", "exceedance depth above 1 below 2".
        return self.name or f"{self.type} {self.quantity.name}{self.limits_text}{self.at_text}"

    @property
    def limits_text(self) -> str:
        """The part of the name that says the limits: " above 50"."""
        bounds = ((word, getattr(self, word)) for word in ("above", "below"))
        return "".join(f" {word} {spelled(limit)}" for word, limit in bounds if limit is not None)

    def limits(self, d: int) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Return above and below as (d, 1) arrays, d the number of components; None where there is no limit."""
        bounds = (None if bound is None else np.asarray(bound, np.float64) for bound in (self.above, self.below))
        above, below = (None if bound is None else np.broadcast_to(bound.reshape(-1, 1), (d, 1)) for bound in bounds)
        return above, below

    def holds(self, values: Values) -> np.ndarray:
        """Return where the condition holds, (k, d, n); false where a member does not count."""
        above, below = self.limits(values.x.shape[1])
        if below is None:
            mask = values.x != 0.0 if above is None else values.x > above
        else:
            mask = values.x < below if above is None else (values.x > above) & (values.x < below)
        return mask if values.good is None else mask & values.good[:, None]


@dataclass(frozen=True, eq=False)
class Exceedance(Condition, Counted):
    """Probability that a condition holds at each sample time: value (k, d), with Wilson's interval.

    Args:
        of: a quantity; see `Statistic`, also for name, confidence, stopped and at.
        above: one number, or one for each component, in the quantity's unit.
        below: the same for the upper limit; with both, the quantity lies between them.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0})
        >>> fleet = lw.Ensemble(scene, members=64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=2.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=20.0, statistics=[lw.statistics.Exceedance("depth", above=1.0)])
        >>> print(f"{result.statistics['exceedance depth above 1'].value[-1, 0]:.2f}")
        0.25
    """

    type: ClassVar[str] = "exceedance"

    def rows(self, values: Values) -> Part:
        return {"count": values.count, "hits": self.holds(values).sum(axis=2)}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        count = part["count"]
        n = count[:, None]
        fraction = part["hits"] / np.maximum(n, 1)
        lower, upper = intervals.wilson(fraction, n, self.confidence)
        arrays = {"value": empty_as_nan(fraction, count), "lower": lower, "upper": upper, "count": count}
        return estimate(self, "Wilson", component_dims("value", "lower", "upper"), arrays, time, unit="1")


# How intervals of probabilities by time are formed.
DIRICHLET = "Wilson with the variance of the Dirichlet product"

# Number of equal pieces of the time between two samples, in which passages are counted.
PIECES = 8


class _Passages(Gatherer):
    """Follows a block, its members by replicate: the first sample that shows the condition, or the last known."""

    def __init__(self, statistic: FirstPassage, time: np.ndarray, count: int):
        self._statistic, self._time, self._times = statistic, time, len(time)
        self._passed = np.full(count, len(time), np.int64)
        # Fraction of the time from the sample before to the sample that shows the passage.
        self._share = np.ones(count)
        self._stopped = np.full(count, len(time), np.int64)
        self._known = np.zeros(count, np.int64)
        self._before: np.ndarray | None = None
        self._replicates = 1

    def take(self, values: Values, when: slice) -> None:
        k = when.stop - when.start
        self._replicates = values.replicates
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
        """Set when, between the previous sample and this one, these members passed: linear between the two."""
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
        """Correct passages of stopped members, whose last state came before the second sample; the others never pass."""
        end = ends.time.reshape(-1, replicates).T.ravel()
        stopped = ends.are(STOPPED).reshape(-1, replicates).T.ravel()
        never = stopped & (self._passed == self._times) & (self._known == self._times)
        self._stopped[never] = np.searchsorted(self._time, end[never])
        now = np.flatnonzero((self._passed > 0) & (self._passed < self._times) & stopped)
        before, at = self._time[self._passed[now] - 1], self._time[self._passed[now]]
        self._share[now] *= np.clip((end[now] - before) / (at - before), 0.0, 1.0)

    def close(self) -> Part:
        R, length = self._replicates, self._times + 1
        row = np.repeat(np.arange(R), len(self._passed) // R) * length
        piece = np.clip(np.floor(self._share * PIECES), 0, PIECES - 1).astype(np.int64)
        passed = np.bincount((row + self._passed) * PIECES + piece, minlength=R * length * PIECES)
        stopped = self._stopped < self._times
        open_ = (self._passed == self._times) & ~stopped
        lost, over = (np.bincount((row + at)[which], minlength=R * length).reshape(R, length)
                      for at, which in ((self._known, open_), (self._stopped, stopped)))  # fmt: skip
        return {"passed": passed.reshape(R, length, PIECES), "lost": lost, "stopped": over}


@dataclass(frozen=True, eq=False)
class FirstPassage(Condition, Counted):
    """Time until a condition first holds, as the samples show it.

    The probability is Aalen & Johansen's estimate. A member that an event stopped in a state in which the condition does
    not hold never passes; with stopped="left_out" it is taken for lost, as if it would have passed like the others. A
    member that fails before it passes counts until its last good sample; NaN where no member is known at any time. If
    none fails, the probability is the fraction of all members. Interval: Wilson's with the number of members whose
    fraction has the variance of a beta product (Fay, Brittain & Proschan 2013), which accounts for few members at risk;
    its upper end reaches up to what is not known where none is.

    A member passes between the sample before and the sample that shows it, where the line between the two crosses the
    limit; a quantity without a limit, which is true or false, passes at the sample that shows it. A passage that comes
    and goes between two samples is not seen (an event of the scene looks at every step).

    Arrays of the estimate, beside lower and upper:

    * value (k,): probability to have passed by each time; survival is 1 - value.
    * passed (k,): number of members that pass at each time.
    * lost (k,): number of members that failed before each time without having passed.
    * stopped (k,): number of members that an event stopped at each time, or since the one before, without having passed.
    * count (k,): number of members at risk of passing at each time.
    * censored: number of members that were under way to the end and did not pass.
    * passage_time (levels,) [s]: time by which that fraction has passed, infinite if it never has; passage_time_lower,
      passage_time_upper from the interval of value.

    Args:
        of: a quantity of one component; see `Statistic`, also for name, confidence and stopped.
        above: the lower limit, in the quantity's unit.
        below: the upper limit; with both, the quantity lies between them.
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
        lower, upper = curve.ends(*intervals.wilson(curve.value, curve.members, self.confidence))
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
    """Note a fault if levels are no fractions between 0 and 1."""
    numbers = faults.finite("levels", levels)
    if numbers is not None and (numbers.ndim != 1 or np.any(numbers <= 0.0) or np.any(numbers >= 1.0)):
        faults.add("levels", levels, "are no numbers between 0 and 1", "give (0.05, 0.5, 0.95)")


class PassageCurve:
    """Probability to have passed, by Aalen & Johansen (1978), at the end of each piece of the times before the samples.

    A member that ends otherwise passes no more; if none does, this is Kaplan & Meier's curve (1958). A member that is lost
    is known up to the sample before, and is at risk in no later piece.

    passed: (k, pieces), number of members that pass in each piece.
    others: (k, pieces), number of members that end otherwise in each piece.
    lost: (k,), number of members that are lost before each time.

    Attributes:
        value: (k, pieces), estimated probability to have passed; the fraction of all members as long as none is lost.
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
        return cls(passed, others, part["lost"][0, :-1], int(part["passed"][0].sum()))

    def __init__(self, passed: np.ndarray, others: np.ndarray, lost: np.ndarray, total: int):
        now, so_far = (np.cumsum(counts, axis=1) for counts in (passed, passed + others))
        self.risk = total - np.cumsum(lost) - _before(so_far[:, -1])
        n = self.risk[:, None]
        self.left = n - so_far
        stay = 1.0 - so_far / np.maximum(n, 1)
        under_way = np.concatenate([[1.0], np.cumprod(stay[:, -1])[:-1]])[:, None]
        # As long as none is lost, the sum is the fraction of all members, but for round-off.
        none_lost = np.cumsum(lost)[:, None] == 0
        fraction, value = _added(passed) / max(total, 1), _added(under_way * passed / np.maximum(n, 1))
        self.value = np.where(self.risk[0] > 0, np.where(none_lost, fraction, value), np.nan)
        self.members = np.where(none_lost, float(total), self._members(n, now, so_far))
        self._otherwise = np.maximum(1.0 - under_way * stay - self.value, 0.0)

    @staticmethod
    def _members(n: np.ndarray, now: np.ndarray, so_far: np.ndarray) -> np.ndarray:
        """Number of members whose fraction has the variance of a sum over Dirichlet variables, one for each time.

        Where x of n members pass and o end otherwise, the shares of those that pass, end otherwise and stay are
        Dirichlet(x, o, n - x - o + 1), and of the last ones Beta(1/2, staying + 1/2) pass. If none ends otherwise, this is
        between the two beta products of Fay, Brittain & Proschan (2013, Biostatistics 14), as Jeffreys' interval is between
        Clopper & Pearson's limits; if none is lost, it is Jeffreys' Beta(m + 1/2, n - m + 1/2), and the number is that of
        all members. Where few are at risk the variance of Greenwood's kind is far too small.

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
        """Return an interval (k, pieces) that contains the value, widened where nothing is known.

        After the last member at risk all that were lost may pass at once; without any member the interval is 0 to 1.
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
