# SPDX-License-Identifier: Apache-2.0
"""Sizes of statistics on disk and in memory, measured on the parts of one block at a few sample times."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.going_on import known_settings, left_by
from lgvi_warp.engine.keepers.statistics import Gathered
from lgvi_warp.engine.work import at_start, samples_of
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.order import SORTED_AT_ONCE
from lgvi_warp.store.block_files import packed

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan

# Sample times of the two small measurements. Two are enough: an array has a row for each time, or none.
FEW, MORE = 2, 4


@dataclass(frozen=True)
class Sizes:
    """Sizes of a run's statistics [bytes].

    file: Parts of one block in a file.
    part: Parts of one block in memory.
    joined: Parts of all blocks after they are joined, at their largest.
    estimates: Estimates that are computed from the joined parts.
    taking: Additional memory of a block while it gathers statistics.
    reading: Additional memory while estimates are computed.
    """

    file: int = 0
    part: int = 0
    joined: int = 0
    estimates: int = 0
    taking: int = 0
    reading: int = 0


def sizes(plan: Plan, statistics: Sequence[Statistic]) -> Sizes:
    """Measure the sizes of statistics in a run."""
    times, runs = len(plan.grid.times), blocks(plan.ensemble.members)
    if not statistics:
        return Sizes()
    few, more = (_of_times(plan, statistics, min(count, times)) for count in (FEW, MORE))

    def at(name: str, count: int) -> int:
        slope = (getattr(more, name) - getattr(few, name)) / (min(MORE, times) - FEW) if times > FEW else 0.0
        return round(getattr(few, name) + slope * (count - FEW))

    values = {name: at(name, times) for name in ("file", "part", "joined", "estimates")}
    # Samples come one launch at a time; sketches are read at_once times together, which bounds the memory.
    due = (
        s1 - s0 for s0, s1 in (plan.launches.samples_due(*segment) for segment in plan.launches.segments(runs[0].count))
    )
    launch = max(plan.launches.ticks_held(runs[0].count), *due)
    at_once = max(1, SORTED_AT_ONCE * times * 8 // max(values["joined"], 1))
    return Sizes(**values, taking=at("taking", launch), reading=at("reading", min(times, at_once)))


def with_ends(of_statistics: Sizes, plan: Plan, stored: bool, kept: bool) -> Sizes:
    """Add the sizes of the members' final states, if the run keeps them."""
    if not kept:
        return of_statistics
    each, block = _file_of_ends(plan), blocks(plan.ensemble.members)[0]
    if stored:
        return replace(of_statistics, file=of_statistics.file + each)
    return replace(of_statistics, estimates=of_statistics.estimates + each * plan.ensemble.members // block.count)


def _file_of_ends(plan: Plan) -> int:
    """Size of one block's final states in a file [bytes]."""
    from lgvi_warp.engine.keepers.final import Finals
    from lgvi_warp.engine.packets import Packets

    block, *_ = blocks(plan.ensemble.members)
    packets = Packets(plan, plan.ensemble.select(block.first, block.stop))
    # The looks at the start, whose energies are kept.
    packets.launch(plan.grid.first, plan.grid.first)
    return len(packed([Finals()], [(left_by(packets), known_settings(plan))]))


def _of_times(plan: Plan, statistics: Sequence[Statistic], count: int) -> Sizes:
    """Measure the sizes for this many sample times, with members that do not move."""
    from lgvi_warp.engine.packets import Packets

    block, *others = blocks(plan.ensemble.members)
    when, time = slice(0, count), plan.grid.times[:count]
    members = plan.ensemble.select(block.first, block.stop)
    packets = Packets(plan, members)
    start = {name: np.repeat(values, count, axis=0) for name, values in at_start(plan, members, packets).items()}
    keeper = Gathered(time, plan.ensemble.members, statistics, plan.ensemble.replicates)
    gathers = keeper.open(plan, block, members)

    def take() -> None:
        samples = samples_of(plan, plan.grid, when, start, packets.ended)
        for take in (gathers.take_ticks, gathers.take) if plan.launches.gathered else (gathers.take,):
            take(when, samples)

    _, taking = _peak(take)
    part = gathers.close(packets.outcome())
    file = len(packed([keeper], [part]))
    joined, reading, estimates = 0, 0, 0
    with np.errstate(all="ignore"):
        for statistic, block_part in zip(keeper.statistics, part, strict=True):
            tree = _fullest(statistic, block_part, 1 + len(others))
            read, more = _peak(lambda: keeper.said(statistic, tree))  # noqa: B023
            joined, reading = joined + sum(map(_bytes, tree)), max(reading, more)
            estimates += sum(_bytes(estimate.arrays) for estimate in read)
    return Sizes(file, sum(map(_bytes, part)), joined, estimates, taking, reading)


def _fullest(statistic: Statistic, part: Part, count: int) -> list[Part]:
    """The largest number of parts in the joining tree of `count` blocks: one part of each level, the largest first."""
    tree = [part]
    for level in range(1, count.bit_length()):
        tree.append(statistic.join(tree[-1], tree[-1], (level, 0)))
    return tree[::-1]


def _bytes(arrays: Any) -> int:
    return sum(array.nbytes for array in arrays.values())


def _peak(action: Callable[[], Any]) -> tuple[Any, int]:
    """Run an action and return (its result, its peak memory [bytes])."""
    mine = not tracemalloc.is_tracing()
    if mine:
        tracemalloc.start()
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    try:
        return action(), tracemalloc.get_traced_memory()[1] - before
    finally:
        if mine:
            tracemalloc.stop()
