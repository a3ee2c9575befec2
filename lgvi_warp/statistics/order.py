"""Extremes and quantiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.statistics import intervals, sketch
from lgvi_warp.statistics.base import Statistic, together
from lgvi_warp.statistics.estimate import Estimate, along
from lgvi_warp.statistics.moments import component_dims, empty_as_nan, estimate
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values

# Numbers of sketches: some 50 bytes are needed for each.
SORTED_AT_ONCE = 2_000_000


@dataclass(frozen=True, eq=False)
class Extremes(Statistic):
    """Smallest and largest value, and whose they are: minimum, maximum, minimum_member, maximum_member (k, d).

    value is the maximum. No interval holds the extremes of what was not drawn; instead beyond (k,): with this confidence,
    at most this fraction of all members that could be drawn lies above the maximum, and as much below the minimum.
    """

    type: ClassVar[str] = "extremes"

    def rows(self, values: Values) -> Part:
        """Extremes of the block."""
        found: Part = {"count": values.count}
        for name, best, beyond in (("minimum", np.argmin, np.inf), ("maximum", np.argmax, -np.inf)):
            x = values.filled(beyond)
            at = best(x, axis=2)
            found[name] = np.take_along_axis(x, at[:, :, None], axis=2)[:, :, 0]
            found[f"{name}_member"] = np.where(values.count[:, None] > 0, values.members(at), -1)
        return found

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        """The more extreme; the first member's of equal ones."""
        both: Part = {"count": left["count"] + right["count"]}
        for name, better in (
            ("minimum", right["minimum"] < left["minimum"]),
            ("maximum", right["maximum"] > left["maximum"]),
        ):
            member = f"{name}_member"
            better |= (right[name] == left[name]) & (right[member] < left[member])
            for key in (name, f"{name}_member"):
                both[key] = np.where(better, right[key], left[key])
        return both

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """P(a fraction above the maximum > b) = (1 - b)^n."""
        count = part["count"]
        arrays = {name: empty_as_nan(part[name], count) for name in ("minimum", "maximum")}
        arrays |= {name: part[name] for name in ("minimum_member", "maximum_member")}
        dims = component_dims("value", *arrays) | {"beyond": ("time",)}
        beyond = np.where(count > 0, -np.expm1(np.log(1.0 - self.confidence) / np.maximum(count, 1)), 1.0)
        arrays = {"value": arrays["maximum"]} | arrays | {"beyond": beyond, "count": count}
        return estimate(self, "none: beyond bounds what lies outside", dims, arrays, time)

    def spread(self, whole: Estimate, each: Sequence[Estimate]) -> Estimate:
        """Extremes have no interval."""
        return whole


@dataclass(frozen=True, eq=False)
class Quantiles(Statistic):
    """Quantiles over members: value (k, levels, d). Exact up to `size` members; then from a sketch with a proven bound.

    levels: between 0 and 1. size: numbers that each level of the sketch keeps, a power of two; below 256 no block is
    exact, however few its members. rank_error (k,): proven bound on the rank's error as a fraction of the members; what is
    to be expected is several times smaller.
    Interval: from the ranks of sorted values (binomial, no assumption on the distribution), widened by the sketch's
    standard error; infinite where too few members lie beyond the level. Each replicate has a sketch of its own.
    """

    type: ClassVar[str] = "quantiles"
    shared: ClassVar[frozenset[str]] = frozenset({"weights", "error", "variance", "shift"})

    levels: Any = (0.05, 0.25, 0.5, 0.75, 0.95)
    size: int = 2048

    def check(self, faults: Faults) -> None:
        """Levels lie between 0 and 1."""
        levels = faults.finite("levels", self.levels)
        if levels is not None:
            if levels.ndim > 1 or levels.size == 0 or np.any(levels <= 0.0) or np.any(levels >= 1.0):
                faults.add("levels", self.levels, "are no numbers between 0 and 1", "give (0.05, 0.5, 0.95)")
            object.__setattr__(self, "levels", tuple(np.unique(levels).tolist()))
        n = self.size
        if isinstance(n, bool) or not isinstance(n, Integral) or n < 64 or int(n) & (int(n) - 1):
            faults.add("size", n, "is no power of two from 64", "give 2048")
        else:
            object.__setattr__(self, "size", int(n))

    def rows(self, values: Values) -> Part:
        """The block's values, sorted; every other one, and so on, down to `size`."""
        x = values.filled(np.inf)
        # Sorting is most of the work, and half as much of numbers half as long.
        x = x.astype(np.float32) if values.single else x
        return {"count": values.count} | sketch.of(x, values.size, self.size, values.block)

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        """One sketch of two."""
        return {"count": left["count"] + right["count"]} | sketch.join(left, right, self.size, place)

    def estimates(self, parts: Sequence[Part], time: np.ndarray) -> list[Estimate]:
        """Of all members."""
        return self._in_pieces(parts, time, 1, lambda some, when: self.read(self.whole(some), when))

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        """Intervals between the sorted values of all members, by ranks that the replicates' spread gives."""

        def read(some: Sequence[Part], when: np.ndarray) -> Estimate:
            return self._read_replicates(self.each_replicate(some, replicates), when)

        return self._in_pieces(parts, time, replicates, read)

    def _in_pieces(
        self, parts: Sequence[Part], time: np.ndarray, replicates: int, read: Callable[..., Estimate]
    ) -> list[Estimate]:
        """Some times after others: sorting all at once would take more memory than the sketches do."""
        numbers = sum(part["values"][0].size for part in parts) * replicates
        rows = max(1, SORTED_AT_ONCE // numbers)
        found = []
        for first in range(0, len(time), rows):
            at = slice(first * replicates, (first + rows) * replicates)
            some = [part | {key: part[key][at] for key in part.keys() - self.shared} for part in parts]
            found.append(read(some, time[first : first + rows]))
        arrays = {name: np.concatenate([one[name] for one in found]) for name in found[0].arrays}
        return [replace(found[0], arrays=arrays, coordinates=found[0].coordinates | {"time": time})]

    def whole(self, parts: Sequence[Part]) -> Part:
        """All that is kept, side by side."""
        return {"count": np.sum([part["count"] for part in parts], axis=0)} | sketch.together(parts)

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """Linear between sorted values, as np.quantile; its interval by ranks."""
        n, level = part["count"][:, None], np.array(self.levels)[None, :]
        low, high = intervals.ranks(n, level, self.confidence)
        # The sketch's own error adds to the ranks' variance.
        own = n * level * (1.0 - level)
        more = intervals.normal(self.confidence) * (np.sqrt(own + part["variance"][0]) - np.sqrt(own))
        ends = ((low - more)[:, :, None], (high + more)[:, :, None])
        return self._read(part, time, lambda value: ends, "order statistics: binomial ranks")

    def _read_replicates(self, each: Sequence[Sequence[Part]], time: np.ndarray) -> Estimate:
        """Ranks from the spread of the replicates' fractions of members up to the quantile of all (Woodruff 1952).

        The fractions hold the errors of their sketches.
        """
        whole = self.whole(together(each))
        n, level = whole["count"][:, None, None], np.array(self.levels)[None, :, None]

        def ends(value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            below = np.stack([sketch.fraction(parts, value) for parts in each])
            least = float(np.sqrt(1.0 + whole["variance"][0]))
            low, high = intervals.probability_of_replicates(level, below, n, self.confidence, least)
            return n * low, n * high + 1.0

        return self._read(whole, time, ends, f"order statistics: ranks by Student's t of {len(each)} replicates")

    def _read(
        self,
        part: Part,
        time: np.ndarray,
        ends: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
        interval: str,
    ) -> Estimate:
        """ends: value (k, levels, d) to the ranks, counted from 1, of its interval's ends."""
        count = part["count"]
        level = np.array(self.levels)[None, :]
        n = count[:, None, None]
        values, middles = sketch.sorted_values(part)
        finite = np.isfinite(values)

        def at(rank: np.ndarray) -> np.ndarray:
            return sketch.at_rank(
                values, middles, finite, np.broadcast_to(rank, (len(values), len(level[0]), values.shape[1]))
            )

        value = empty_as_nan(at((n - 1) * level[:, :, None]), count)
        low, high = ends(value)
        lower = np.where(low < 1.0, -np.inf, at(np.maximum(low - 1.0, 0.0)))
        upper = np.where(high > n, np.inf, at(np.maximum(np.minimum(high, n) - 1.0, 0.0)))
        error = part["error"][0] / np.maximum(count, 1)
        arrays = {"value": value, "lower": empty_as_nan(lower, count), "upper": empty_as_nan(upper, count)}
        dims = along(arrays, "time", "level", "component") | {"count": ("time",), "rank_error": ("time",)}
        arrays |= {"rank_error": error, "count": count}
        return estimate(self, interval, dims, arrays, time, {"level": level[0]})
