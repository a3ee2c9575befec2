"""Statistics as what a run keeps: gathered block by block, joined in the order of the blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimate import Estimate, Estimates
from lgvi_warp.statistics.samples import Fields
from lgvi_warp.statistics.tree import Part, Tree
from lgvi_warp.statistics.values import Values, dealt

if TYPE_CHECKING:
    from lgvi_warp.engine.outcome import Outcome
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.sampling.members import Members


class Gathered:
    """The statistics of a run of n members, so far: a tree of parts for each; time: (k,) [s], of its samples.

    replicates: R where members are of so many independent ones, member i of the i-th mod R. Parts then hold each
    replicate's numbers by themselves, R times as many.
    """

    # What a store calls its parts.
    name = "statistics"

    def __init__(self, time: np.ndarray, members: int, statistics: Sequence[Statistic], replicates: int = 1):
        self._statistics, self.time, self._replicates = tuple(statistics), time, replicates
        self._size = blocks(members)[0].count
        self._trees = [Tree(one.join) for one in self._statistics]

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockStatistics:
        """What gathers those of one block."""
        place = (block.first, block.first // self._size, self._size)
        return _BlockStatistics(self._statistics, plan, members, place, self.time, self._replicates)

    def merge(self, block: Block, part: list[Part]) -> None:
        """Take in a block's part: of each statistic, named arrays."""
        # A member that is about to fail may be too large to be squared: the statistic then says so, and NumPy need not.
        with np.errstate(invalid="ignore", over="ignore"):
            for tree, one in zip(self._trees, part, strict=True):
                tree.add(block.first // self._size, one)

    def estimates(self, chosen: Statistic | None = None) -> list[Estimate]:
        """What all say of the blocks so far, or one of them."""
        found: list[Estimate] = []
        for statistic, tree in zip(self._statistics, self._trees, strict=True):
            if chosen is None or statistic is chosen:
                with np.errstate(invalid="ignore", over="ignore"):
                    found += self.said(statistic, tree.parts())
        return found

    def said(self, statistic: Statistic, parts: Sequence[Part]) -> list[Estimate]:
        """What one statistic says of the parts of a tree."""
        time = self.time if statistic.at is None else self.time[-1:]
        if self._replicates > 1:
            return statistic.estimates_of_replicates(parts, time, self._replicates)
        return statistic.estimates(parts, time)

    def result(self) -> Estimates:
        """All of them, by name."""
        return Estimates(self.estimates())

    @property
    def apart(self) -> set[str]:
        """Names of estimates that are not of all members on purpose: those of their ends."""
        return {part.key for one in self._statistics if one.at_end for part in one.parts()}

    def __getstate__(self) -> dict[str, Any]:
        """What another process needs to gather blocks: not what was gathered here."""
        return {name: value for name, value in vars(self).items() if name != "_trees"}

    @staticmethod
    def to_arrays(part: Sequence[Part]) -> tuple[dict[str, np.ndarray], Any]:
        """A block's part as named arrays, for a file, and the number of statistics."""
        return {f"{i}/{name}": array for i, one in enumerate(part) for name, array in one.items()}, len(part)

    @staticmethod
    def from_arrays(arrays: Mapping[str, np.ndarray], content: Any) -> list[Part]:
        """What `to_arrays` gave: merged later, it gives the same bits."""
        prefixes = [f"{i}/" for i in range(content)]
        return [{n.removeprefix(one): a for n, a in arrays.items() if n.startswith(one)} for one in prefixes]


class _BlockStatistics:
    def __init__(
        self,
        statistics: Sequence[Statistic],
        plan: Plan,
        members: Members,
        place: tuple[int, int, int],
        time: np.ndarray,
        replicates: int,
    ):
        self._statistics, self._members, self._place = statistics, members, place
        self._plan, self._replicates, self._times = plan, replicates, len(time)
        # Of those that are of members' ends: the quantity at the last sample.
        self._last: dict[Statistic, np.ndarray] = {}
        self._open = [one.open(time if one.at is None else time[-1:], members.count) for one in statistics]

    def take(self, when: slice, samples: Fields) -> None:
        """Hand each statistic the values of its quantity; statistics of the same quantity share them."""
        made: dict[Any, Values] = {}
        for statistic, gathers in zip(self._statistics, self._open, strict=True):
            if statistic.at_end:
                if when.stop == self._times and not statistic.of_ends:
                    self._last[statistic] = statistic.quantity(samples.last(), self._members)
                continue
            quantity = statistic.quantity
            key = (quantity.name, quantity.function, statistic.stopped)
            if key not in made:
                x = quantity(samples, self._members)
                made[key] = self._values(x, samples.good(statistic.stopped == "held"))
            gathers.take(made[key], when)

    def _values(self, x: np.ndarray, good: np.ndarray | None) -> Values:
        """Values of all members, or of each replicate's."""
        if self._replicates == 1:
            return Values(x, good, *self._place)
        return dealt(x, good, *self._place, self._replicates)

    def close(self, outcome: Outcome) -> list[Part]:
        """Of each statistic, named arrays."""
        ends = outcome.ends(self._plan)
        for statistic, gathers in zip(self._statistics, self._open, strict=True):
            if statistic.at_end:
                gathers.take(self._values(*statistic.at_ends(ends, self._last.get(statistic))), slice(0, 1))
            gathers.end(ends, self._replicates)
        return [one.close() for one in self._open]
