"""Statistics of one number of each member, whatever that number is of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.statistics.base import Statistic, from_list
from lgvi_warp.statistics.estimate import Estimate
from lgvi_warp.statistics.moments import Mean
from lgvi_warp.statistics.quantity import Quantity
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values


@dataclass(frozen=True, eq=False)
class Then(Statistic):
    """One number for each component of each member, then statistics of that. Abstract.

    then: a statistic, or a list, without `of`: lw.Mean(), lw.Quantiles(levels=(0.5, 0.99)), lw.Exceedance(above=2.0).
    """

    then: Any = None

    def check(self, faults: Faults) -> None:
        """What comes after must be statistics over members, and not of something else."""
        super().check(faults)

        given = self.then_default() if self.then is None else self.then
        given = given if isinstance(given, list | tuple) else [given]
        found: list[Statistic] = []
        with faults.including():
            found = list(from_list(given, f"{self.type}.then", whole=False))
        for i, one in enumerate(found):
            if not one.of_numbers:
                what = f"is of samples in time, and a {self.type} is one number of each member"
                faults.add(f"then[{i}].type", one.type, what, "ask for its mean, quantiles, or an exceedance")
            elif one.of is not None:
                faults.add(f"then[{i}].of", one.of, "is given already", f"leave it out: it is of the {self.type}")
            elif one.at is not None:
                faults.add(f"then[{i}].at", one.at, f"says when, and a {self.type} has no time", "leave it out")
        object.__setattr__(self, "then", tuple(found))
        if self.of is not None and not faults:
            with faults.including():  # a limit that is missing is told now, and not by the run
                self.parts()

    def then_default(self) -> Sequence[Statistic]:
        """What comes after where nothing is said."""
        return [Mean()]

    def then_of(self, time: np.ndarray) -> tuple[Statistic, ...]:
        """The statistics, each knowing what it is of; time: (k,) [s], of all samples."""
        inner = self.quantity
        whole = Quantity(self.key, inner.function, self.unit, inner.fields, self._labels, self.needs_limit)
        return tuple(replace(one.over(time), of=whole, stopped=self.stopped) for one in self.then)

    @property
    def unit(self) -> str:
        """Of the number."""
        return self.quantity.unit

    @property
    def needs_limit(self) -> bool:
        """Whether a condition on the number wants a limit."""
        return self.quantity.needs_limit

    @property
    def _labels(self) -> tuple[str, ...]:
        return tuple(f"{self.type} {label}" for label in self.quantity.labels)

    def parts(self) -> tuple[Statistic, ...]:
        """Those that come after."""
        return self.then_of(np.array([0.0, 1.0]))

    def gather(self, values: Values, time: np.ndarray) -> Part:
        """The part of a block; values: the members' numbers, of one time."""
        found: Part = {}
        for i, one in enumerate(self.then_of(time)):
            gathers = one.open(time[-1:], values.x.shape[2])
            gathers.take(values, slice(0, 1))
            found |= {f"{i}/{key}": array for key, array in gathers.close().items()}
        return found

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        """Each statistic's own."""
        found: Part = {}
        for i, one in enumerate(self.then):
            found |= {f"{i}/{key}": a for key, a in one.join(own(left, i), own(right, i), place).items()}
        return found

    def estimates(self, parts: Sequence[Part], time: np.ndarray) -> list[Estimate]:
        """Each statistic's, at the end."""
        found: list[Estimate] = []
        for i, one in enumerate(self.then_of(time)):
            found += one.estimates([own(part, i) for part in parts], time[-1:])
        return found

    def of_replicate(self, part: Part, replicate: int, replicates: int) -> Part:
        """Each statistic's own."""
        found: Part = {}
        for i, one in enumerate(self.then):
            found |= {f"{i}/{key}": a for key, a in one.of_replicate(own(part, i), replicate, replicates).items()}
        return found

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        """Each statistic's, at the end."""
        found: list[Estimate] = []
        for i, one in enumerate(self.then_of(time)):
            found += one.estimates_of_replicates([own(part, i) for part in parts], time[-1:], replicates)
        return found


def own(part: Part, i: int) -> Part:
    """The arrays of the i-th."""
    return {key.removeprefix(f"{i}/"): array for key, array in part.items() if key.startswith(f"{i}/")}
