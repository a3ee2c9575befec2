# SPDX-License-Identifier: Apache-2.0
"""The delay from a controller's tick to its actuators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common import registry
from lgvi_warp.control.base import Part
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number

# Periods that a delay may last: the commands of each are kept.
MOST_PERIODS = 1000


@dataclass(frozen=True, eq=False, kw_only=True)
class Delay(Part):
    """The delay of a controller, as a part that `Controller` creates from its period and delay. Its key is "controller".

    period: Time between two ticks [s].
    delay: Time from a tick until its commands take effect [s].
    """

    device: ClassVar[str] = "delay"
    kinds: ClassVar[registry.Kinds] = registry.Kinds("", {})

    period: float = 1.0
    delay: Any = number((), "s", 0.0, least=0.0)

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, members whose delay is longer than so many commands are kept.
        outside = super().unphysical(numbers)
        return {"delay": outside["delay"] | (numbers["delay"] > MOST_PERIODS * self.period)}

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # As many sets of commands, the latest first, as some member needs.
        # A delay that varies is that of the nearest whole step.
        # docs/theory/control_loop.md, (C3).
        bus, every = self.bus, round(self.period / context.h)
        steps = np.rint(numbers["delay"] / context.h)
        periods = steps // every
        sets = int(periods.max()) + 2
        acting, count = bus.acting, bus.channels
        rows = {"fresh": 0, "acting": acting, "before": acting + count, "begin": acting + 2 * count}
        values = {"periods": periods, "steps": steps - every * periods, "sets": sets, "count": count, **rows}
        return Packed(values, memory=np.zeros((1, sets * count)))
