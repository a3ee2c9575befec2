"""What is made of each member's whole path first, and then counted over members."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.errors import Faults
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimate import Estimate
from lgvi_warp.statistics.moments import Mean
from lgvi_warp.statistics.quantity import Quantity
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values


class _Path:
    """Of a block: the best so far of each member, and whether all its samples counted."""

    def __init__(self, statistic: _PathExtreme):
        self._statistic = statistic
        # One row, or one of each replicate.
        self._best: np.ndarray | None = None
        self._whole: np.ndarray | None = None
        self._place, self._single = (0, 0, 0, 1), False

    def take(self, values: Values, when: slice) -> None:
        """Look at these times."""
        rows = (-1, values.replicates)
        best = self._statistic.better.reduce(values.x.reshape(*rows, *values.x.shape[1:]), axis=0)
        self._best = best if self._best is None else self._statistic.better(self._best, best)
        if values.good is not None:
            whole = values.good.reshape(*rows, values.good.shape[1]).all(axis=0)
            self._whole = whole if self._whole is None else self._whole & whole
        self._place = (values.first, values.block, values.size, values.replicates)
        self._single = values.single

    def close(self) -> Part:
        """What each of the statistics keeps of the paths' bests."""
        assert self._best is not None
        good = None if self._whole is None or self._whole.all() else self._whole
        values = Values(self._best.astype(np.float32) if self._single else self._best, good, *self._place)
        found: Part = {}
        for i, one in enumerate(self._statistic.then_all):
            gathered = one.open(1, values.x.shape[2])
            gathered.take(values, slice(0, 1))
            found |= {f"{i}/{key}": array for key, array in gathered.close().items()}
        return found


@dataclass(frozen=True, eq=False)
class _PathExtreme(Statistic):
    """The largest (or smallest) of a quantity over all sample times of each member, then statistics of that.

    then: a statistic, or a list, without `of`: lw.Mean(), lw.Quantiles(levels=(0.5, 0.99)), lw.Exceedance(above=2.0).
    Members that failed are left out: the rest of their path is not known. The estimates are called after both: "mean
    path_maximum speed". The time of their one row is that of the end.
    """

    better: ClassVar[Any] = np.maximum

    then: Any = None

    def check(self, faults: Faults) -> None:
        """What comes after must be statistics that are not of something else."""
        from lgvi_warp import statistics

        given = [Mean()] if self.then is None else self.then if isinstance(self.then, list | tuple) else [self.then]
        found: list[Statistic] = []
        with faults.including():
            found = list(statistics.from_list(given, f"{self.type}.then", whole=False))
        for i, one in enumerate(found):
            if one.of is not None or isinstance(one, _PathExtreme):
                faults.add(f"then[{i}].of", one.of, "is given already", f"leave it out: it is of the {self.type}")
        object.__setattr__(self, "then", tuple(found))

    @property
    def then_all(self) -> tuple[Statistic, ...]:
        """The statistics of the paths, each knowing what it is of."""
        inner = self.quantity
        whole = Quantity(self.key, inner.function, inner.unit, inner.fields, self._labels)
        return tuple(replace(one, of=whole, confidence=one.confidence) for one in self.then)

    @property
    def _labels(self) -> tuple[str, ...]:
        return tuple(f"{self.type} {label}" for label in self.quantity.labels)

    def parts(self) -> tuple[Statistic, ...]:
        """Those of the paths."""
        return self.then_all

    def open(self, times: int, count: int) -> _Path:
        """What follows the members of a block."""
        return _Path(self)

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        """Each statistic's own."""
        found: Part = {}
        for i, one in enumerate(self.then_all):
            found |= {f"{i}/{key}": a for key, a in one.join(own(left, i), own(right, i), place).items()}
        return found

    def estimates(self, parts: Sequence[Part], time: np.ndarray) -> list[Estimate]:
        """Each statistic's, at the end."""
        found: list[Estimate] = []
        for i, one in enumerate(self.then_all):
            found += one.estimates([own(part, i) for part in parts], time[-1:])
        return found

    def of_replicate(self, part: Part, replicate: int, replicates: int) -> Part:
        """Each statistic's own."""
        found: Part = {}
        for i, one in enumerate(self.then_all):
            found |= {f"{i}/{key}": a for key, a in one.of_replicate(own(part, i), replicate, replicates).items()}
        return found

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        """Each statistic's, at the end."""
        found: list[Estimate] = []
        for i, one in enumerate(self.then_all):
            found += one.estimates_of_replicates([own(part, i) for part in parts], time[-1:], replicates)
        return found


def own(part: Part, i: int) -> Part:
    """The arrays of the i-th."""
    return {key.removeprefix(f"{i}/"): array for key, array in part.items() if key.startswith(f"{i}/")}


@dataclass(frozen=True, eq=False)
class PathMaximum(_PathExtreme):
    """The largest of a quantity over all sample times of each member, then statistics of that.

    then: a statistic, or a list, without `of`: lw.Mean(), lw.Quantiles(levels=(0.5, 0.99)), lw.Exceedance(above=2.0).
    Members that failed are left out: the rest of their path is not known. The estimates are called after both: "mean
    path_maximum speed". The time of their one row is that of the end.
    """

    type: ClassVar[str] = "path_maximum"


@dataclass(frozen=True, eq=False)
class PathMinimum(_PathExtreme):
    """The smallest of a quantity over all sample times of each member, then statistics of that: as PathMaximum."""

    type: ClassVar[str] = "path_minimum"
    better: ClassVar[Any] = np.minimum
