# SPDX-License-Identifier: Apache-2.0
"""The keeper of statistics: gathers them block by block and joins the blocks in their order."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.estimates.estimate import Estimate, Estimates
from lgvi_warp.statistics.estimates.tree import Part, Tree
from lgvi_warp.statistics.paths.path import followed
from lgvi_warp.statistics.values.samples import Fields
from lgvi_warp.statistics.values.values import Values, dealt

if TYPE_CHECKING:
    from lgvi_warp.engine.outcome import MemberStatus
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.sampling.members import Members


class Gathered:
    """The statistics of a run so far: for each statistic a tree of parts. time: (k,) [s].

    With R replicates, member i belongs to replicate i mod R, and parts contain the numbers of each replicate separately.
    """

    # Name of its results in a store.
    name = "statistics"

    def __init__(self, time: np.ndarray, members: int, statistics: Sequence[Statistic], replicates: int = 1):
        self._asked, self.time, self.replicates = tuple(statistics), time, replicates
        self.statistics = tuple(map(followed, statistics))
        self._size = blocks(members)[0].count
        self.trees = [Tree(statistic.join_any) for statistic in self.statistics]

    def open(self, plan: Plan, block: Block, members: Members) -> _BlocksOfRun:
        """The keeper of the statistics of a block, or of several that run as one."""
        return _BlocksOfRun(self, plan, block, members)

    def place(self, block: Block) -> tuple[int, int, int]:
        """Return (first member of a block, number of the block, size of all blocks except the last)."""
        return block.first, block.first // self._size, self._size

    def merge(self, block: Block, part: list[Part]) -> None:
        """Add the parts of a block, or of several blocks in order, to the trees."""
        first = block.first // self._size
        numbers = range(first, first + len(blocks(block.count, self._size)))
        each = list(zip(itertools.product(numbers, range(len(self.trees))), part, strict=True))
        for (_, of), statistic_part in each:
            if (statistic := self.statistics[of]).since - statistic_part.keys():
                raise ValueError(f"{statistic.key!r} is of an earlier version, which took other events for censoring")
        # Squares of a failing member may overflow: the statistic reports it, so no warning from NumPy.
        with np.errstate(invalid="ignore", over="ignore"):
            for (number, of), statistic_part in each:
                self.trees[of].add(number, statistic_part)

    def estimates(self, chosen: Statistic | None = None) -> list[Estimate]:
        """Estimates from the blocks so far, of one statistic or (None, the default) of all."""
        estimates: list[Estimate] = []
        for requested, statistic, tree in zip(self._asked, self.statistics, self.trees, strict=True):
            if chosen is None or requested is chosen:
                with np.errstate(invalid="ignore", over="ignore"):
                    estimates += self.said(statistic, tree.parts())
        return estimates

    def said(self, statistic: Statistic, parts: Sequence[Part]) -> list[Estimate]:
        """Estimates of one statistic from given parts."""
        time = self.times_of(statistic)
        if self.replicates > 1:
            return statistic.estimates_of_replicates(parts, time, self.replicates)
        return statistic.estimates(parts, time)

    def times_of(self, statistic: Statistic) -> np.ndarray:
        """Times of a statistic's values [s]: all sample times (k,), or the end alone (1,)."""
        return self.time if statistic.at is None else self.time[-1:]

    def result(self) -> Estimates:
        """All estimates by name."""
        return Estimates(self.estimates())

    @property
    def apart(self) -> set[str]:
        """Names of estimates that omit members on purpose: those about the members' ends."""
        return {part.key for statistic in self.statistics if statistic.at_end for part in statistic.parts()}

    def __getstate__(self) -> dict[str, Any]:
        """State for another process that gathers blocks, without the data gathered here."""
        return {name: value for name, value in vars(self).items() if name != "trees"}

    @staticmethod
    def to_arrays(part: Sequence[Part]) -> tuple[dict[str, np.ndarray], Any]:
        """A block's parts as arrays for a file, by name, and the number of statistics."""
        arrays = {f"{i}/{name}": array for i, entry in enumerate(part) for name, array in entry.items()}
        return arrays, len(part)

    @staticmethod
    def from_arrays(arrays: Mapping[str, np.ndarray], content: Any) -> list[Part]:
        """Restore a block's parts; merging them gives the same bits."""
        prefixes = (f"{i}/" for i in range(content))
        return [{name.removeprefix(p): array for name, array in arrays.items() if name.startswith(p)} for p in prefixes]


class BlockStatistics:
    """Gathers the statistics of one block from its samples, in order, and from the ends of its members.

    members: the block's members, for functions of (samples, members).
    weight: weights of the members (n,); None: equal weights.
    ticks: (m,) [s], times of a controller's ticks, passed to `take_ticks`; None if samples are used as ticks.
    """

    def __init__(
        self,
        run: Gathered,
        block: Block,
        members: Members,
        ticks: np.ndarray | None,
        weight: np.ndarray | None,
    ):
        self._statistics, self._members, self._place = run.statistics, members, run.place(block)
        self._replicates, self._times = run.replicates, len(run.time)
        self._weight = weight
        # For statistics of members' ends: the quantity at the last sample.
        self._last: dict[Statistic, np.ndarray] = {}
        self._takes_ticks = ticks is not None
        of_ticks = run.time if ticks is None else ticks
        times = (of_ticks if statistic.ticks else run.times_of(statistic) for statistic in run.statistics)
        self._open = [statistic.open(time, block.count) for statistic, time in zip(run.statistics, times, strict=True)]

    def take(self, when: slice, samples: Fields) -> None:
        """Pass the values of its quantity to each statistic; statistics of the same quantity share them."""
        self._pass(when, samples, ticks=not self._takes_ticks)

    def take_ticks(self, when: slice, samples: Fields) -> None:
        """Pass the values at all ticks to the statistics that need them."""
        self._pass(when, samples, ticks=True, others=False)

    def _pass(self, when: slice, samples: Fields, ticks: bool, others: bool = True) -> None:
        values: dict[Any, Values] = {}
        for statistic, gathers in zip(self._statistics, self._open, strict=True):
            if not (ticks if statistic.ticks else others):
                continue
            if statistic.at_end:
                if when.stop == self._times and not statistic.of_ends:
                    self._last[statistic] = statistic.quantity(samples.last(), self._members)
                continue
            quantity = statistic.quantity
            key = (quantity.name, quantity.function, statistic.stopped)
            if key not in values:
                x = quantity(samples, self._members)
                values[key] = self._values(x, samples.good(statistic.stopped == "held"))
            gathers.take(values[key], when)

    def _values(self, x: np.ndarray, good: np.ndarray | None) -> Values:
        """The values of all members, or of each replicate's members."""
        if self._replicates == 1:
            return Values(x, good, *self._place, weight=self._weight)
        return dealt(x, good, *self._place, self._replicates)

    def ended(self, ends: Ends) -> list[Part]:
        """Return arrays by name, for each statistic."""
        for statistic, gathers in zip(self._statistics, self._open, strict=True):
            if statistic.at_end:
                gathers.take(self._values(*statistic.at_ends(ends, self._last.get(statistic))), slice(0, 1))
            gathers.end(ends, self._replicates)
        return [gathers.close() for gathers in self._open]


class _BlocksOfRun:
    """Statistics of blocks that are advanced together, gathered for each block separately."""

    def __init__(self, run: Gathered, plan: Plan, block: Block, members: Members):
        self._plan, ticks = plan, plan.launches.gathered
        self._each = list[tuple[slice, BlockStatistics]]()
        for one in blocks(block.count, run.place(block)[2]):
            some = slice(one.first, one.stop)
            own = members if one.count == block.count else members.at(some)
            place = Block(block.first + one.first, block.first + one.stop)
            gathers = BlockStatistics(run, place, own, None if ticks is None else ticks.times, own.weight)
            self._each.append((some, gathers))

    def take(self, when: slice, samples: Fields) -> None:
        """Pass the samples on."""
        for some, gathers in self._each:
            gathers.take(when, samples.of_members(some))

    def take_ticks(self, when: slice, samples: Fields) -> None:
        """Pass the samples at ticks on."""
        for some, gathers in self._each:
            gathers.take_ticks(when, samples.of_members(some))

    def close(self, outcome: MemberStatus) -> list[Part]:
        """Return arrays by name, for each block and statistic."""
        return [part for some, gathers in self._each for part in gathers.ended(outcome.at(some).ends(self._plan))]
