# SPDX-License-Identifier: Apache-2.0
"""The keeper of the final states of a run's members, from which another run can continue."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.going_on import joined, known_settings, left_by
from lgvi_warp.engine.outcome import MemberStatus
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.plan import Plan
from lgvi_warp.sampling.members import Members
from lgvi_warp.statistics.values.samples import Fields

Rows = dict[str, np.ndarray]
# What a block leaves: rows by name, and what they depend on.
Part = tuple[Rows, dict[str, Any]]
# Name of its parts in a store.
FINAL = "final"


class Finals:
    """Keeps the final rows of every block's packets; in a store they are a part of each block.

    in_store: whether blocks write their parts into a store; then no part is held in memory.
    """

    name = FINAL

    def __init__(self, in_store: bool = False) -> None:
        self.parts: dict[int, Rows] = {}
        self._in_store = in_store

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"parts": {}}

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockFinal:
        """The keeper of a block."""
        return _BlockFinal(plan)

    def merge(self, block: Block, part: Part) -> None:
        """Keep the final rows of a block."""
        if not self._in_store:
            self.parts[block.first] = part[0]

    def rows(self, members: int) -> Rows:
        """Final rows of the first members, whose blocks have all ended."""
        return joined({first: part for first, part in self.parts.items() if first < members})

    def to_arrays(self, part: Part) -> Part:
        """Return a block's rows, which are arrays already."""
        return part

    def from_arrays(self, arrays: Rows, content: Any) -> Part:
        """Final rows of a block."""
        return arrays, content


@dataclass
class _BlockFinal:
    plan: Plan
    rows: Rows = field(default_factory=dict)

    def take(self, when: slice, samples: Fields) -> None:
        """Ignore the samples."""

    def take_packets(self, packets: Packets) -> None:
        """Copy the final rows of the packets."""
        self.rows = left_by(packets)

    def close(self, outcome: MemberStatus) -> Part:
        """Return the final rows."""
        return self.rows, known_settings(self.plan)
