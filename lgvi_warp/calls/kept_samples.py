# SPDX-License-Identifier: Apache-2.0
"""The samples of a result, read block by block in the order of a run: from memory, or from the chunks of a store."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError, refusal
from lgvi_warp.common.status import ROUNDING
from lgvi_warp.control.signals import SAVED
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.keepers.observation import replicates_of
from lgvi_warp.physics.terms.events import Event
from lgvi_warp.physics.terms.events import from_list as events_of
from lgvi_warp.results.drawn import DrawnParameters
from lgvi_warp.results.result import Result
from lgvi_warp.scene.scene import Scene
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.values.samples import Fields
from lgvi_warp.store.open import Arrays

# Memory of the samples that are read at once [bytes].
READ_AT_ONCE = 128_000_000
# Memory of a field of one member at one time, at most: a matrix.
FIELD_BYTES = 72


class KeptFields(Fields):
    """Samples of a block that were kept. For a missing field, the error says how to keep it."""

    def __missing__(self, name: str) -> Any:
        raise not_kept("statistics", name, tuple(self))


def not_kept(key: str, field: str, kept: tuple[str, ...]) -> SceneError:
    """Make the error for a field whose samples are needed but were not kept."""
    if not kept:
        remedy = 'run with keep="all", or gather it on the way: solve(..., statistics=[...])'
        return refusal(key, field, "is needed of every member, and no samples of all were kept", remedy)
    names = ", ".join(map(repr, (*kept, field)))
    remedy = f"keep it: save=lw.SaveAt(fields=({names})), or gather it on the way: solve(..., statistics=[...])"
    return refusal(key, field, "is needed, and its samples were not kept", remedy)


class KnownMembers:
    """Stored facts about a block's members, without their ensemble: their numbers, and their start from the first sample."""

    def __init__(self, result: Result, at: slice, start: KeptFields | None):
        self.parameters, self.starts = (_of_members(numbers, at) for numbers in (result.parameters, result.starts))
        self.count, self._start = at.stop - at.start, start

    def __getattr__(self, name: str) -> Any:
        if name not in SAVED or self.__dict__.get("_start") is None:
            raise AttributeError(f"members of a result have parameters, count and the start's fields, and no {name!r}")
        return self._start[name][0].astype(np.float64, copy=False)  # type: ignore[index]


def _of_members(numbers: Mapping[str, np.ndarray], at: slice) -> dict[str, np.ndarray]:
    """Select the numbers of some members. A number that all members share is returned unchanged."""
    if isinstance(numbers, Arrays):
        return dict(numbers.part(at))
    return {name: values[at] if len(values) > 1 else values for name, values in numbers.items()}


class KeptSamples:
    """A result divided into blocks, with the samples, members and ends of each block.

    Attributes:
        total: number of members of the whole run, from which the blocks are computed.
        weights: weights of the members (n,); None for equal weights.
        replicates: number of independent replicates of the design; 1 if the members are not those of a whole design.
        events: the events of the scene.
        ticks: (m,), indices of the samples at the ticks of the controller; None without a controller.
    """

    def __init__(self, result: Result, weights: np.ndarray | None = None):
        self.result, self.weights = result, result.weights if weights is None else weights
        ensemble = result.provenance.get("ensemble", {})
        planned = len(ensemble["indices"]) if "indices" in ensemble else int(ensemble.get("members") or result.members)
        of_design = result.members in (planned, result.provenance.get("members"))
        self.total = planned if of_design else result.members
        self.replicates = replicates_of(ensemble) if of_design and weights is None else 1
        self.events: tuple[Event, ...] = events_of(result.provenance["scene"].get("events", ()))

    def blocks(self) -> Iterator[Block]:
        """The blocks of these members, in order."""
        for block in blocks(self.total):
            if block.first < self.result.members:
                yield Block(block.first, min(block.stop, self.result.members))

    def weights_of(self, block: Block) -> np.ndarray | None:
        """Weights of a block's members; None for equal weights."""
        return None if self.weights is None else np.asarray(self.weights[block.first : block.stop])

    @functools.cached_property
    def scene(self) -> Any:
        """The scene, with its controller."""
        known = self.result.parameters
        if isinstance(known, DrawnParameters):
            return known.ensemble.scene
        return Scene.from_dict(self.result.provenance["scene"])

    @property
    def period(self) -> float | None:
        """Time between two ticks of the controller [s]; None without one."""
        table = self.result.provenance["scene"].get("controller")
        return None if table is None else float(table["period"])

    def tick_rows(self, key: str) -> np.ndarray | None:
        """Indices of the samples at the controller's ticks; None without a controller. Refuses samples that lack a tick."""
        if self.period is None:
            return None
        h = self.result.provenance["step"]
        made = np.rint(self.result.time / h).astype(np.int64)
        ticks = np.arange(0, made[-1] + 1, max(1, round(self.period / h)))
        rows = np.minimum(np.searchsorted(made, ticks), len(made) - 1)
        if not np.array_equal(made[rows], ticks):
            remedy = f"keep them: save=lw.SaveAt(every={self.period:g}, fields=...), or gather it on the way"
            raise refusal(
                key, "...", f"is of every tick of the controller, and samples lack some of {len(ticks):,}", remedy
            )
        return rows

    def ends(self, block: Block) -> Ends:
        """Outcomes and end times of a block's members."""
        at, result = slice(block.first, block.stop), self.result
        status = np.asarray(result.status[at])
        event = np.zeros(len(status), np.uint8) if result.event is None else np.asarray(result.event[at])
        if result.event is None:
            for i, each in enumerate(self.events):
                event[status == each.status] = i + 1
        return Ends(status, event, result.end_time[at], tuple(each.key for each in self.events))

    def members(self, block: Block, names: tuple[str, ...]) -> Any:
        """View of a block's members for functions of (samples, members)."""
        known = self.result.parameters
        if isinstance(known, DrawnParameters):
            return known.select(block.first, block.stop)
        start = next(self.pieces(block, names, np.zeros(1, np.int64)))[1] if names else None
        return KnownMembers(self.result, slice(block.first, block.stop), start)

    def of_block(self, block: Block, names: tuple[str, ...]) -> Result:
        """Make a result in memory from the members of a block and some of their samples."""
        result, at = self.result, slice(block.first, block.stop)
        rows = np.arange(len(result.time))
        parameters, starts = (numbers.part(at) if isinstance(numbers, Arrays) else numbers
                              for numbers in (result.parameters, result.starts))  # fmt: skip
        bare = replace(result, samples={}, parameters={}, starts={}, store=None)
        few = bare.part(np.arange(block.first, block.stop))
        samples = {name: self._read(name, rows, at) for name in names}
        return replace(few, samples=samples, parameters=parameters, starts=starts)

    def pieces(
        self, block: Block, names: tuple[str, ...], rows: np.ndarray, controller: Any = None
    ) -> Iterator[tuple[slice, KeptFields]]:
        """Yield the samples of a block at the times of `rows`, a few times at once, as (their slice of `rows`, samples)."""
        result, at = self.result, slice(block.first, block.stop)
        status = np.asarray(result.status[at])
        at_once = max(1, READ_AT_ONCE // (FIELD_BYTES * max(len(names), 1) * block.count))
        # A member's own samples are those up to its end, at which an event may have stopped it.
        last = np.searchsorted(result.time, result.end_time[at] * (1.0 + ROUNDING), side="right") - 1
        # The start comes by itself, as in a run.
        for first, stop in itertools.pairwise([0, *range(1, len(rows), at_once), len(rows)]):
            chosen = rows[first:stop]
            fields = {name: self._read(name, chosen, at) for name in names}
            others = (result.time[chosen], chosen, result.terms, lambda: (status, last), controller, self.events)
            yield slice(first, stop), KeptFields(fields, *others)

    def _read(self, name: str, rows: np.ndarray, at: slice) -> np.ndarray:
        follow = len(rows) == rows[-1] - rows[0] + 1
        when = slice(int(rows[0]), int(rows[-1]) + 1) if follow else rows
        if isinstance(self.result.samples, Arrays):
            return self.result.samples.rows(name, when, at)
        return self.result.samples[name][when, at]
