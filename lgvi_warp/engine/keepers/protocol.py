# SPDX-License-Identifier: Apache-2.0
"""The protocols of keepers: the methods that a run calls to save data of its members."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from lgvi_warp.engine.block import Block
from lgvi_warp.statistics.values.samples import Fields

if TYPE_CHECKING:
    from lgvi_warp.engine.outcome import MemberStatus
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.sampling.members import Members


class BlockKeeper(Protocol):
    """Keeper of one block's data, in the thread or process that runs the block."""

    def take(self, when: slice, samples: Fields) -> None:
        """Receive samples of the block (times, members, ...) by field; each time is passed once, in order."""

    # One that has `take_ticks(when, samples)` as well receives with that the samples at all ticks, before those to keep. One
    # that has `take_packets(packets)` looks at the packets after the last step; what it wants of them it copies.

    def close(self, outcome: MemberStatus) -> Any:
        """Return the block's result, small and picklable."""


class Keeper(Protocol):
    """Keeper of a run's data: all samples, statistics or files."""

    def open(self, plan: Plan, block: Block, members: Members) -> BlockKeeper:
        """Prepare for a block, before its first step, in the thread or process that runs it."""

    def merge(self, block: Block, part: Any) -> None:
        """Merge the result of a block; called in block order, in the thread that started the run."""


@runtime_checkable
class PartKeeper(Keeper, Protocol):
    """A keeper whose block results a store can save, so that a resumed run has the results of finished blocks."""

    @property
    def name(self) -> str:
        """Name of its results in the store, unique among the keepers of a run."""

    def to_arrays(self, part: Any) -> tuple[dict[str, np.ndarray], Any]:
        """Split a block's result for a store into arrays by name and content for JSON."""

    def from_arrays(self, arrays: dict[str, np.ndarray], content: Any) -> Any:
        """Restore a block's result, with the same bits."""


class BlockStore(Keeper, Protocol):
    """A keeper that writes blocks to disk, where they outlive the run, and that knows the stored blocks."""

    def parts(self, block: Block, keepers: Sequence[Keeper]) -> tuple[Any, ...] | None:
        """Closing value of each keeper for a block; None if the store does not have the block."""

    def finish(self, block: Block, arrays: Any, keepers: Sequence[Keeper], parts: Sequence[Any]) -> None:
        """Make a block durable."""

    def understood(self, block: Block) -> AbstractContextManager[None]:
        """Context in which a stored block's results are used: errors are reported as faults of the store."""
