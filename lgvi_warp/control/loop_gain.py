# SPDX-License-Identifier: Apache-2.0
"""A factor on the demand of some laws and an added demand, to measure margins. Users do not write this part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.control.base import ControlLaw, Numbers, Packed, PackingContext
from lgvi_warp.physics.terms.base import number
from lgvi_warp.physics.terms.control_wrench import COMPONENTS

BEGIN, END = "loop_begin", "loop_gain"
FACTOR, ADDED = f"{END}.factor", f"{END}.added"


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopBegin(ControlLaw):
    """Stores the demand before the laws of a loop act."""

    device: ClassVar[str] = "loop_gain:begin"
    shared_rows: ClassVar[int] = 6

    asks: Sequence[str] = ()

    @property
    def demands(self) -> tuple[str, ...]:  # type: ignore[override]
        # What the laws demand, whose gain is measured.
        return tuple(self.asks)

    def words(self) -> dict[str, Any]:
        # The rows that both share.
        return {"demand": self.bus.answer}


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopGain(LoopBegin):
    """Multiplies each component of the demand of the laws since `LoopBegin` by a factor, and adds a demand."""

    device: ClassVar[str] = "loop_gain:end"

    factor: Any = number((6,), "1", (1.0,) * 6)
    added: Any = number((6,), "N, N m", (0.0,) * 6)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        factor, added = numbers["factor"], numbers["added"]
        factors = {"of_force": factor[:, :3], "of_torque": factor[:, 3:]}
        return Packed(factors | {"force": added[:, :3], "torque": added[:, 3:]} | self.words())


def of_all(factor: np.ndarray) -> np.ndarray:
    """Factors (m, 6) on the components of a demand, from one factor on all of them (m,)."""
    return np.repeat(factor[:, None], len(COMPONENTS), axis=1)


def with_factor(laws: Sequence[ControlLaw], loop: str | None) -> list[ControlLaw]:
    """The laws of a controller, with a factor on the demand of the law with the key `loop`, or of all laws for None."""
    chosen = [law for law in laws if loop in (None, law.key)]
    asks = tuple(name for name in COMPONENTS if any(name in (law.demands or COMPONENTS) for law in chosen))
    first, last = laws.index(chosen[0]), laws.index(chosen[-1])
    begin, end = LoopBegin(asks=asks, name=BEGIN), LoopGain(asks=asks, name=END)
    return [*laws[:first], begin, *laws[first : last + 1], end, *laws[last + 1 :]]
