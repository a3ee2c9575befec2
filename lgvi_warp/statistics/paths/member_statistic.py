# SPDX-License-Identifier: Apache-2.0
"""Statistics of one number of each member, such as the maximum of its path or its end time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults
from lgvi_warp.statistics.base import Statistic, from_list
from lgvi_warp.statistics.estimates.estimate import Estimate
from lgvi_warp.statistics.estimates.tree import Part, arrays_under
from lgvi_warp.statistics.moments import Mean
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.statistics.values.values import Values


@dataclass(frozen=True, eq=False)
class MemberStatistic(Statistic):
    """One number for each component of each member, then statistics of this number. Abstract.

    Args:
        of: see the derived classes.
        then: statistic of these numbers over the members, or a list of statistics, each without its `of`:
            lw.statistics.Mean(), lw.statistics.Quantiles(levels=(0.5, 0.99)), lw.statistics.Exceedance(above=2.0).
    """

    then: Any = None

    def check(self, faults: Faults) -> None:
        super().check(faults)

        entries = self.then_default() if self.then is None else self.then
        items = items_of(entries)
        entries = [entries] if items is None else items
        statistics: list[Statistic] = []
        with faults.including():
            statistics = list(from_list(entries, f"{self.type}.then", unique_names=False))
        for i, statistic in enumerate(statistics):
            if statistic.of_numbers and statistic.of is not None:
                faults.add(f"then[{i}].of", statistic.of, "is given already", f"leave it out: it is of the {self.type}")
            else:
                statistic.check_one_number(faults, f"then[{i}].", f"a {self.type}")
        object.__setattr__(self, "then", tuple(statistics))
        if self.of is not None and not faults:
            with faults.including():  # report a missing limit now, not during the run
                self.parts()

    def then_default(self) -> Sequence[Statistic]:
        """Return the default of `then`."""
        return [Mean()]

    def then_of(self, time: np.ndarray) -> tuple[Statistic, ...]:
        """Return the statistics of `then`, each with this class's number as `of`, over the run's sample times (k,) [s]."""
        inner = self.quantity
        derived = Quantity(self.key, inner.function, self.unit, inner.fields, self._labels, self.needs_limit)
        return tuple(replace(statistic.over(time), of=derived, stopped=self.stopped) for statistic in self.then)

    @property
    def unit(self) -> str:
        """The unit of the number."""
        return self.quantity.unit

    @property
    def needs_limit(self) -> bool:
        """True if a condition on the number needs a limit."""
        return self.quantity.needs_limit

    @property
    def _labels(self) -> tuple[str, ...]:
        return tuple(f"{self.type} {label}" for label in self.quantity.labels)

    def parts(self) -> tuple[Statistic, ...]:
        return self.then_of(np.array([0.0, 1.0]))

    def gather(self, values: Values, time: np.ndarray) -> Part:
        """Return the part of a block, from its members' numbers at one time: the numbered parts of all of `then`."""
        return numbered(part_of(statistic, values, time) for statistic in self.then_of(time))

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        pairs = ((arrays_under(first, f"{i}/"), arrays_under(second, f"{i}/")) for i in range(len(self.then)))
        return numbered(statistic.join_any(*pair, place) for statistic, pair in zip(self.then, pairs, strict=True))

    def estimates(self, parts: Sequence[Part], time: np.ndarray) -> list[Estimate]:
        estimates: list[Estimate] = []
        for statistic, inner in self._inner(parts, time):
            estimates += statistic.estimates(inner, time[-1:])
        return estimates

    def of_replicate(self, part: Part, replicate: int, replicates: int) -> Part:
        each = enumerate(self.then)
        return numbered(
            statistic.of_replicate(arrays_under(part, f"{i}/"), replicate, replicates) for i, statistic in each
        )

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        estimates: list[Estimate] = []
        for statistic, inner in self._inner(parts, time):
            estimates += statistic.estimates_of_replicates(inner, time[-1:], replicates)
        return estimates

    def _inner(self, parts: Sequence[Part], time: np.ndarray) -> Iterator[tuple[Statistic, list[Part]]]:
        """Yield each statistic of `then` with its own parts."""
        for i, statistic in enumerate(self.then_of(time)):
            yield statistic, [arrays_under(part, f"{i}/") for part in parts]


def part_of(statistic: Statistic, values: Values, time: np.ndarray) -> Part:
    """The part of a statistic of numbers that are known only at the end of the run."""
    gatherer = statistic.open(time[-1:], values.x.shape[2])
    gatherer.take(values, slice(0, 1))
    return gatherer.close()


def numbered(parts: Iterable[Part]) -> Part:
    """Join the parts of several statistics to one: each name begins with the number of its statistic."""
    return {f"{i}/{key}": array for i, part in enumerate(parts) for key, array in part.items()}
