"""To be said in one sentence."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from lgvi_warp.engine.block import Block
from lgvi_warp.statistics.samples import Fields

if TYPE_CHECKING:
    from lgvi_warp.engine.outcome import Outcome
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.sampling.members import Members


class BlockKeeper(Protocol):
    """What is kept of one block, where that block runs."""

    def take(self, when: slice, samples: Fields) -> None:
        """Samples `when` (of all times) by field, (times, members of the block, ...): each time once, in order."""

    def close(self, outcome: Outcome) -> Any:
        """What the run is to have of this block: small, and picklable."""


class Keeper(Protocol):
    """What a run keeps of its members: all samples, statistics, files."""

    def open(self, plan: Plan, block: Block, members: Members) -> BlockKeeper:
        """Before a block's first step, in the thread or process that runs it."""

    def merge(self, block: Block, part: Any) -> None:
        """What a block's keeper closed with; in the order of the blocks, in the thread that asked for the run."""


@runtime_checkable
class PartKeeper(Keeper, Protocol):
    """A keeper whose parts a store can hold, so that a run that goes on later has those of its finished blocks."""

    @property
    def name(self) -> str:
        """What its parts are called by: unlike those of any other keeper of the run."""

    def to_arrays(self, part: Any) -> tuple[dict[str, np.ndarray], Any]:
        """A part as arrays by name, and what JSON holds."""

    def from_arrays(self, arrays: dict[str, np.ndarray], content: Any) -> Any:
        """The part again, with the same bits."""


class BlockStore(Keeper, Protocol):
    """A keeper that writes blocks to where they outlive the run, and knows those that are there."""

    def parts(self, block: Block, keepers: Sequence[Keeper]) -> tuple[Any, ...] | None:
        """What the keepers closed with where the block is there; None where it is not."""

    def finish(self, block: Block, own: Any, keepers: Sequence[Keeper], parts: Sequence[Any]) -> None:
        """Make a block durable; own: what the store closed with, parts: what the keepers did."""

    def understood(self, block: Block) -> AbstractContextManager[None]:
        """While the parts of a block that was there are used: what is wrong with them is told as theirs."""
