# SPDX-License-Identifier: Apache-2.0
"""Statistics that count members: histograms, and probabilities of a condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import is_whole, whole_remedy
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.estimates.estimate import Estimate, along
from lgvi_warp.statistics.estimates.naming import spelled
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.moments import component_dims, empty_as_nan, estimate
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.statistics.weighted import Weighted


class Counted(Statistic):
    """A statistic whose part is whole numbers, which add up exactly in any order."""

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        return {key: first[key] + second[key] for key in first}

    def spread(self, pooled: Estimate, each: Sequence[Estimate]) -> Estimate:
        # Form Wilson's interval with the variance of the replicates' fractions.
        count = pooled.count.reshape(-1, *[1] * (pooled.value.ndim - 1))
        fractions = np.stack([replicate.value for replicate in each])
        lower, upper = intervals.probability_of_replicates(pooled.value, fractions, count, self.confidence)
        return pooled.with_interval(by_replicates(len(each)), {"lower": lower, "upper": upper})


def by_replicates(number: int) -> str:
    """Return the text on the kind of a probability's interval."""
    return f"Wilson with the variance and Student's t of {number} replicates"


@dataclass(frozen=True, eq=False)
class Histogram(Counted):
    """Fraction of members in each bin, with Wilson's interval for each bin.

    A bin contains its lower edge; the last bin also contains its upper edge. Give either `edges`, or `bins` and
    `limits`.

    Arrays of the estimate, in addition to lower, upper and count (k,), for k sample times and d components:

    * value (k, d, bins): fraction of the members in each bin.
    * counts (k, d, bins): number of members in each bin.
    * below, above (k, d): number of members below the first and above the last edge.

    Args:
        edges: rising edges of the bins, in the quantity's unit.
        bins: number of bins of equal width.
        limits: (low, high), first and last edge of bins of equal width, in the quantity's unit; or "run", for the first
            and the last sample time; only statistics of times accept "run" (see EndTime).
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
                faults.add("bins", bins, "is not a whole number above 0", whole_remedy(bins, "give 50"))
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
        chosen = None if values.good is None else np.repeat(values.good[:, None], d, axis=1)
        counts = values.counted(bin_of, chosen, k * d * (len(edges) + 1)).reshape(k, d, len(edges) + 1)
        return {"count": values.count, "counts": counts}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        count, counts = part["count"], part["counts"]
        n = count[:, None, None]
        inside = counts[..., 1:-1]
        value = empty_as_nan(inside / np.maximum(n, 1), count)
        lower, upper = intervals.wilson(inside / np.maximum(n, 1), n, self.confidence)
        return self._estimate({"value": value, "lower": lower, "upper": upper}, counts, count, time)

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        # Wilson's interval with the number of members of each bin's variance; counts are of effective members.
        share = weighted.own["counts"] / weighted.weight[:, None, None]
        inside = share[..., 1:-1]
        number = weighted.number_of(inside, weighted.squares["counts"][..., 1:-1])
        lower, upper = intervals.wilson(inside, number, self.confidence)
        arrays = {"value": empty_as_nan(inside, weighted.members), "lower": lower, "upper": upper}
        return self._estimate(arrays, share * weighted.effective[:, None, None], weighted.effective, time)

    def _estimate(
        self, arrays: dict[str, np.ndarray], counts: np.ndarray, count: np.ndarray, time: np.ndarray
    ) -> Estimate:
        """The estimate from the fractions with their interval, and the counts (k, d, bins + 2) in and outside the bins."""
        edges: np.ndarray = self._edges  # type: ignore[attr-defined]
        arrays |= {"counts": counts[..., 1:-1]}
        dims = along(arrays, "time", "component", "bin")
        arrays |= {"below": counts[..., 0], "above": counts[..., -1]}
        dims |= {"below": ("time", "component"), "above": ("time", "component"), "count": ("time",), "edge": ("edge",)}
        bins = {"bin": 0.5 * (edges[1:] + edges[:-1]), "edge": edges}
        return estimate(self, "Wilson", dims, arrays | {"count": count}, time, bins, "1")


@dataclass(frozen=True, eq=False)
class Condition(Statistic):
    """A statistic with a condition: a quantity above a number, below a number, or between two: above < x < below.

    Args:
        above: lower limit, one number or one for each component, in the quantity's unit; None (the default): no limit.
        below: upper limit, in the same form. A named quantity needs a limit. A function without limits meets the
            condition where it does not return 0 or false.
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
                    faults.add(
                        name, getattr(self, name), "is not a number", "give one number, or one for each component"
                    )
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
        """The part of the name with the limits: " above 50"."""
        bounds = ((word, getattr(self, word)) for word in ("above", "below"))
        return "".join(f" {word} {spelled(limit)}" for word, limit in bounds if limit is not None)

    def limits(self, d: int) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Return above and below as arrays (d, 1) for d components; None without a limit."""
        bounds = (None if bound is None else np.asarray(bound, np.float64) for bound in (self.above, self.below))
        above, below = (None if bound is None else np.broadcast_to(bound.reshape(-1, 1), (d, 1)) for bound in bounds)
        return above, below

    def holds(self, values: Values) -> np.ndarray:
        """Return the mask (k, d, n) of the condition; false if a member does not count."""
        above, below = self.limits(values.x.shape[1])
        if below is None:
            mask = values.x != 0.0 if above is None else values.x > above
        else:
            mask = values.x < below if above is None else (values.x > above) & (values.x < below)
        return mask if values.good is None else mask & values.good[:, None]


@dataclass(frozen=True, eq=False)
class Exceedance(Condition, Counted):
    """Probability that a condition holds: value (k, d) at k sample times for d components, with Wilson's interval.

    Args:
        above: lower limit, one number or one for each component, in the quantity's unit.
        below: upper limit, in the same form. With both limits, the quantity must lie between them.

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
        return {"count": values.count, "hits": values.summed(self.holds(values))}

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # docs/theory/estimators.md, (E5).
        count = part["count"]
        n = count[:, None]
        fraction = part["hits"] / np.maximum(n, 1)
        lower, upper = intervals.wilson(fraction, n, self.confidence)
        arrays = {"value": empty_as_nan(fraction, count), "lower": lower, "upper": upper, "count": count}
        return self._estimate(arrays, time)

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        # Wilson's interval with the number of members of the fraction's variance.
        fraction = weighted.own["hits"] / weighted.weight[:, None]
        lower, upper = intervals.wilson(
            fraction, weighted.number_of(fraction, weighted.squares["hits"]), self.confidence
        )
        arrays = {"value": empty_as_nan(fraction, weighted.members), "lower": lower, "upper": upper}
        return self._estimate(arrays | {"count": weighted.effective}, time)

    def _estimate(self, arrays: dict[str, np.ndarray], time: np.ndarray) -> Estimate:
        return estimate(self, "Wilson", component_dims("value", "lower", "upper"), arrays, time, unit="1")
