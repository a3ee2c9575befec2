# SPDX-License-Identifier: Apache-2.0
"""The keeper of implausible speeds at the end, for runs that keep no samples in which these would show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.plan import Plan
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.oddities import Oddities
from lgvi_warp.scene.plausibility import at_the_end
from lgvi_warp.statistics.values.samples import Fields

MOMENTUM = slice(12, 15)


class Speeds:
    """Counts the members that are implausibly fast at the end, though not at the start."""

    def __init__(self) -> None:
        self.found = Oddities({})

    def __getstate__(self) -> dict[str, Any]:
        return {"found": Oddities({})}

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockSpeeds:
        """The keeper of a block."""
        return _BlockSpeeds(block.first, members)

    def merge(self, block: Block, part: Oddities) -> None:
        """Join the members of a block with those before."""
        self.found |= part


@dataclass
class _BlockSpeeds:
    first: int
    members: Members
    found: Oddities | None = None

    def take(self, when: slice, samples: Fields) -> None:
        """Ignore the samples."""

    def take_packets(self, packets: Any) -> None:
        """Bound the speeds from below: the momentum over the largest mass."""
        lanes = packets.state_lanes.view[:, MOMENTUM, : packets.plan.spec.width]
        momenta = lanes.transpose(0, 2, 1).reshape(-1, 3)[: self.members.count].astype(np.float64)
        with np.errstate(all="ignore"):
            speed = np.linalg.norm(momenta, axis=1) * packets.scale / np.linalg.eigvalsh(packets.frame.M)[:, -1]
        self.found = at_the_end(self.members.velocity, speed, self.first)

    def close(self, outcome: Any) -> Oddities:
        """Return the members that were found."""
        return self.found or Oddities({})
