# SPDX-License-Identifier: Apache-2.0
"""Extremes and quantiles: order statistics of the members."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.statistics.base import Statistic, together
from lgvi_warp.statistics.estimates import intervals, sketch, weighted_sketch
from lgvi_warp.statistics.estimates.estimate import Estimate, along
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.moments import component_dims, empty_as_nan, estimate
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.statistics.weighted import Weighted, both_measures, is_weighted

# Values of sketches that are sorted together; each takes some 50 bytes.
SORTED_AT_ONCE = 2_000_000


# Of a value: the ends of its interval, as ranks.
EndsOf = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Extremes(Statistic):
    """Smallest and largest value over members, and the members that have them.

    Extremes have no confidence interval; `beyond` bounds the fraction of the distribution outside the extremes.

    Arrays of the estimate, in addition to count (k,), for k sample times and d components:

    * minimum, maximum (k, d): the smallest and largest value; `value` equals maximum.
    * minimum_member, maximum_member (k, d): indices of the members with these values; -1 if no member counts.
    * beyond (k,): with the statistic's confidence, at most this fraction of the distribution lies above the maximum,
      and at most this fraction below the minimum.
    """

    type: ClassVar[str] = "extremes"

    def rows(self, values: Values) -> Part:
        part: Part = {"count": values.count}
        for name, best, beyond in (("minimum", np.argmin, np.inf), ("maximum", np.argmax, -np.inf)):
            x = values.filled(beyond)
            at = best(x, axis=2)
            part[name] = np.take_along_axis(x, at[:, :, None], axis=2)[:, :, 0]
            part[f"{name}_member"] = np.where(values.count[:, None] > 0, values.members(at), -1)
        return part

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        # Keep the more extreme value; of equal ones, that of the first member.
        both: Part = {"count": first["count"] + second["count"]}
        for name, beats in (("minimum", np.less), ("maximum", np.greater)):
            member = f"{name}_member"
            better = beats(second[name], first[name])
            better |= (second[name] == first[name]) & (second[member] < first[member])
            for key in (name, member):
                both[key] = np.where(better, second[key], first[key])
        return both

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # The extremes; `beyond` = b follows from P(a fraction above the maximum > b) = (1 - b)^n.
        # docs/theory/estimators.md, (E7).
        count = part["count"]
        arrays = {name: empty_as_nan(part[name], count) for name in ("minimum", "maximum")}
        arrays |= {name: part[name] for name in ("minimum_member", "maximum_member")}
        dims = component_dims("value", *arrays) | {"beyond": ("time",)}
        beyond = np.where(count > 0, -np.expm1(np.log(1.0 - self.confidence) / np.maximum(count, 1)), 1.0)
        arrays = {"value": arrays["maximum"]} | arrays | {"beyond": beyond, "count": count}
        return estimate(self, "none: beyond bounds what lies outside", dims, arrays, time)

    def weighted_rows(self, values: Values) -> Part:
        # The members themselves; the sums of weights bound what lies outside.
        squares = {"count": values.under(2).count}
        return both_measures(self.rows(values) | {"count": values.under(1).count}, squares, values.count)

    def weighted_join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        a, b = Weighted.of(first), Weighted.of(second)
        squares = {"count": a.squares["count"] + b.squares["count"]}
        return both_measures(self.join(a.own, b.own, place), squares, a.members + b.members)

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        return self.read(weighted.own | {"count": weighted.effective}, time)

    def spread(self, pooled: Estimate, each: Sequence[Estimate]) -> Estimate:
        # The estimate as it is: extremes have no interval.
        return pooled


@dataclass(frozen=True, eq=False)
class Quantiles(Statistic):
    """Quantiles over members: exact for up to `size` members, beyond that from a sketch with a proven error bound.

    The interval follows from the ranks of the sorted values (binomial, for any distribution), and is widened by the
    sketch's standard error. It is infinite if too few members lie beyond the level. Each replicate has its own sketch.

    Arrays of the estimate, in addition to lower, upper and count (k,), for k sample times and d components:

    * value (k, levels, d): the quantiles.
    * rank_error (k,): proven bound on the error of the rank, as a fraction of the members. Typical errors are several
      times smaller.

    Args:
        levels: fractions between 0 and 1; by default (0.05, 0.25, 0.5, 0.75, 0.95).
        size: number of values that each level of the sketch keeps, a power of two from 64; by default 2048. With a size
            below 256, quantiles are approximate even for few members.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, statistics=[lw.statistics.Quantiles("depth", levels=[0.1, 0.9])])
        >>> result.statistics["quantiles depth"].value.shape
        (2, 2, 1)
    """

    type: ClassVar[str] = "quantiles"
    shared: ClassVar[frozenset[str]] = frozenset({"weights", "error", "variance", "shift"})

    levels: Any = (0.05, 0.25, 0.5, 0.75, 0.95)
    size: int = 2048

    def check(self, faults: Faults) -> None:
        levels = faults.finite("levels", self.levels)
        if levels is not None:
            if levels.ndim > 1 or levels.size == 0 or np.any(levels <= 0.0) or np.any(levels >= 1.0):
                faults.add("levels", self.levels, "are not numbers between 0 and 1", "give (0.05, 0.5, 0.95)")
            object.__setattr__(self, "levels", tuple(np.unique(levels).tolist()))
        n = self.size
        if not is_whole(n, 64) or int(n) & (int(n) - 1):
            faults.add("size", n, "is not a power of two from 64", "give 2048")
        else:
            object.__setattr__(self, "size", int(n))

    def rows(self, values: Values) -> Part:
        # The sketch of the block: its values sorted, and thinned to `size` values where there are more.
        x = values.filled(np.inf)
        # Sorting is most of the work, and takes half as long in float32.
        x = x.astype(np.float32) if values.single else x
        return {"count": values.count} | sketch.sketch_of(x, values.size, self.size, values.block)

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        return {"count": first["count"] + second["count"]} | sketch.join(first, second, self.size, place)

    def weighted_rows(self, values: Values) -> Part:
        # Values in order, each with its weight and its square, thinned where there are more than `size`.
        kept = weighted_sketch.sketch_of(values.filled(np.inf), values.under(1).weights, self.size)
        return both_measures({"count": values.under(1).count} | kept, {"count": values.under(2).count}, values.count)

    def weighted_join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        return self._weighted_whole([first, second], self.size)

    def _weighted_whole(self, parts: Sequence[Part], size: int | None) -> Part:
        """Join the parts of weighted members, thinned to `size` values; None keeps all values."""
        each = [Weighted.of(part) for part in parts]
        kept = weighted_sketch.together([part.own for part in each], size)
        own, squares, members = (
            np.sum(sums, axis=0)
            for sums in (
                [part.own["count"] for part in each],
                [part.squares["count"] for part in each],
                [part.members for part in each],
            )
        )
        return both_measures({"count": own} | kept, {"count": squares}, members)

    def estimates(self, parts: Sequence[Part], time: np.ndarray) -> list[Estimate]:
        # The quantiles of all members, a few sample times at once to bound memory.
        return self._in_pieces(parts, time, 1, lambda some, when: self.read_any(self.whole(some), when))

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        # Quantiles with intervals between sorted values, at ranks that the replicates' spread gives.
        def read(some: Sequence[Part], when: np.ndarray) -> Estimate:
            return self._read_replicates(self.each_replicate(some, replicates), when)

        return self._in_pieces(parts, time, replicates, read)

    def _in_pieces(
        self, parts: Sequence[Part], time: np.ndarray, replicates: int, read: Callable[..., Estimate]
    ) -> list[Estimate]:
        """Read a few sample times at once: sorting all at once would need more memory than the sketches."""
        numbers = sum(part["values"][0].size for part in parts) * replicates
        rows = max(1, SORTED_AT_ONCE // numbers)
        pieces = []
        for first in range(0, len(time), rows):
            at = slice(first * replicates, (first + rows) * replicates)
            some = [part | {key: part[key][at] for key in part.keys() - self.shared} for part in parts]
            pieces.append(read(some, time[first : first + rows]))
        arrays = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0].arrays}
        return [replace(pieces[0], arrays=arrays, coordinates=pieces[0].coordinates | {"time": time})]

    def whole(self, parts: Sequence[Part]) -> Part:
        if is_weighted(parts[0]):
            return self._weighted_whole(parts, None)
        return {"count": np.sum([part["count"] for part in parts], axis=0)} | sketch.together(parts)

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        # Quantiles, linear between sorted values as np.quantile, with intervals by ranks.
        # docs/theory/estimators.md, (E8).
        n, level = part["count"][:, None], np.array(self.levels)[None, :]
        low, high = intervals.ranks(n, level, self.confidence)
        # The variance of the sketch's error adds to that of the ranks.
        binomial = n * level * (1.0 - level)
        more = intervals.normal(self.confidence) * (np.sqrt(binomial + part["variance"][0]) - np.sqrt(binomial))
        ends = ((low - more)[:, :, None], (high + more)[:, :, None])
        return self._read(part, time, lambda value: ends, "order statistics: binomial ranks")

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        # The interval lies between the quantiles at the ends of that of the fraction below the value (Woodruff 1952).
        count, level = weighted.effective, np.array(self.levels)
        values, at, squares = weighted_sketch.sorted_values(weighted.own, weighted.weight)
        value = weighted_sketch.at_fraction(values, at, level[:, None])
        below = weighted_sketch.squares_below(values, squares, value)
        fractions = np.broadcast_to(level[:, None], value.shape)
        number = weighted.number_of(fractions, below)
        low, high = intervals.wilson(fractions, number, self.confidence)
        lower = np.where(number * low < 1.0, -np.inf, weighted_sketch.at_fraction(values, at, low))
        upper = np.where(number * (1.0 - high) < 1.0, np.inf, weighted_sketch.at_fraction(values, at, high))
        some = weighted.members
        arrays = {"value": empty_as_nan(value, some), "lower": empty_as_nan(lower, some)}
        arrays |= {"upper": empty_as_nan(upper, some)}
        dims = along(arrays, "time", "level", "component") | {"count": ("time",), "rank_error": ("time",)}
        arrays |= {"rank_error": weighted.own["rank_error"] / weighted.weight, "count": count}
        return estimate(self, "Woodruff: fractions below the value", dims, arrays, time, {"level": level})

    def _read_replicates(self, each: Sequence[Sequence[Part]], time: np.ndarray) -> Estimate:
        """Quantiles with ranks from the spread of the replicates' fractions below the joint quantile (Woodruff 1952)."""
        overall = self.whole(together(each))
        n, level = overall["count"][:, None, None], np.array(self.levels)[None, :, None]

        def ends(value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            below = np.stack([sketch.fraction(parts, value) for parts in each])
            least = float(np.sqrt(1.0 + overall["variance"][0]))
            low, high = intervals.probability_of_replicates(level, below, n, self.confidence, least)
            return n * low, n * high + 1.0

        return self._read(overall, time, ends, f"order statistics: ranks by Student's t of {len(each)} replicates")

    def _read(self, part: Part, time: np.ndarray, ends: EndsOf, interval: str) -> Estimate:
        """Return the quantiles, with the interval between two ranks.

        ends: function from the value (k, levels, d) to the ranks, counted from 1, of the interval's ends.
        """
        count = part["count"]
        level = np.array(self.levels)[None, :]
        n = count[:, None, None]
        values, middles = sketch.sorted_values(part)
        finite = np.isfinite(values)

        def at(rank: np.ndarray) -> np.ndarray:
            shape = len(values), len(level[0]), values.shape[1]
            return sketch.at_rank(values, middles, finite, np.broadcast_to(rank, shape))

        value = empty_as_nan(at((n - 1) * level[:, :, None]), count)
        low, high = ends(value)
        lower = np.where(low < 1.0, -np.inf, at(np.maximum(low - 1.0, 0.0)))
        upper = np.where(high > n, np.inf, at(np.maximum(np.minimum(high, n) - 1.0, 0.0)))
        error = part["error"][0] / np.maximum(count, 1)
        arrays = {"value": value, "lower": empty_as_nan(lower, count), "upper": empty_as_nan(upper, count)}
        dims = along(arrays, "time", "level", "component") | {"count": ("time",), "rank_error": ("time",)}
        arrays |= {"rank_error": error, "count": count}
        return estimate(self, interval, dims, arrays, time, {"level": level[0]})
