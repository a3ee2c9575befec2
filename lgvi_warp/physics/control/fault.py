"""Faults of actuators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.control.base import NEVER, Sending
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Fault(Sending):
    """A fault of one channel of an actuator: from a time on, command <- gain * command + offset.

    gain = 0 is dead, or stuck at the offset; 0.5 is weak. It begins at the first look at or after its time.

    Args:
        of: Key of the term.
        channel: Number of the channel, from 0.
        time: When it begins [s]; inf for never.
        gain: Factor of the command; 0 by default.
        offset: Added to the command [unit of the command]; 0 by default.
        known: Whether the allocation knows it, and leaves the channel out from then on; False by default.

    Raises:
        SceneError: Where `known` is neither true nor false, and as `Term`.
    """

    type: ClassVar[str] = "fault"

    of: str = ""
    channel: int = 0
    time: Any = number((), "s", 0.0, infinite=True)
    gain: Any = number((), "1", 0.0)
    offset: Any = number((), "unit", 0.0)
    known: bool = False

    def check(self, faults: Faults) -> None:
        """Adds a fault where `known` is neither true nor false."""
        if not isinstance(self.known, bool):
            faults.add("known", self.known, "is neither true nor false", "give one of them")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The numbers, and the rows of the command."""
        assert self.bus is not None
        fresh = self.bus.commands[self.of][0] + self.channel
        rows = {"fresh": fresh, "acting": 0, "before": 0, "delayed": int(self.bus.delayed)}
        if self.bus.delayed:
            rows |= {"acting": self.bus.acting + fresh, "before": self.bus.acting + self.bus.channels + fresh}
        return Packed({**numbers, "time": np.minimum(numbers["time"], NEVER), **rows})
