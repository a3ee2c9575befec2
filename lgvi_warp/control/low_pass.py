# SPDX-License-Identifier: Apache-2.0
"""Low-pass filter of a measured quantity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.common.declared import word
from lgvi_warp.control.base import READINGS, MeasuringPart
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class LowPass(MeasuringPart):
    """First-order low-pass filter of one measured quantity, exact for readings that are held over a period.

    At each tick x <- x + (1 - exp(-T / time_constant)) (measured - x), where x is the output and T the period. x starts at
    the first reading. Differences of headings are reduced to half a turn. If x is an attitude, it turns by the fraction
    1 - exp(-T / time_constant) of the rotation to the measured attitude.

    Args:
        of: Quantity to filter, one of those that an `lw.control.Sensor` measures.
        time_constant: Time constant of the filter [s]; 0 for no filter.

    Raises:
        SceneError: If `of` is unknown, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "low_pass"

    of: str = word("", known=READINGS)
    time_constant: Any = number((), "s", least=0.0)

    def device_in(self, aligned: bool) -> Any:
        return f"low_pass:{self.of}"

    @property
    def estimates_position(self) -> bool:
        return self.of == "position"

    @property
    def memory_rows(self) -> int:  # type: ignore[override]
        return 9 if self.of == "attitude" else READINGS[self.of]
