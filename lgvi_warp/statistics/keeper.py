"""Statistics as what a run keeps: gathered block by block, joined in the order of the blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.blocks import Block, Fields, blocks
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimate import Estimate, Estimates
from lgvi_warp.statistics.tree import Part, Tree
from lgvi_warp.statistics.values import Values, dealt

if TYPE_CHECKING:
    from lgvi_warp.ensemble import Members
    from lgvi_warp.packets import Outcome
    from lgvi_warp.plan import Plan


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
        return _BlockStatistics(self._statistics, members, place, self.time, self._replicates)

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
        if self._replicates > 1:
            return statistic.estimates_of_replicates(parts, self.time, self._replicates)
        return statistic.estimates(parts, self.time)

    def result(self) -> Estimates:
        """All of them, by name."""
        return Estimates(self.estimates())

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
        members: Members,
        place: tuple[int, int, int],
        time: np.ndarray,
        replicates: int,
    ):
        self._statistics, self._members, self._place = statistics, members, place
        self._replicates = replicates
        self._open = [one.open(time, members.count) for one in statistics]

    def take(self, when: slice, samples: Fields) -> None:
        """Hand each statistic the values of its quantity; statistics of the same quantity share them."""
        made: dict[Any, Values] = {}
        for statistic, gathers in zip(self._statistics, self._open, strict=True):
            quantity = statistic.quantity
            key = (quantity.name, quantity.function, statistic.stopped)
            if key not in made:
                x = quantity(samples, self._members)
                good = samples.good(statistic.stopped == "held")
                alone = self._replicates == 1
                made[key] = Values(x, good, *self._place) if alone else dealt(x, good, *self._place, self._replicates)
            gathers.take(made[key], when)

    def close(self, outcome: Outcome) -> list[Part]:
        """Of each statistic, named arrays."""
        return [one.close() for one in self._open]
