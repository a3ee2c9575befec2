# SPDX-License-Identifier: Apache-2.0
"""An estimator of the attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import MeasuringPart
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class ComplementaryFilter(MeasuringPart):
    """Complementary filter of the attitude: measured rates at high frequency, a measured attitude at low frequency.

    R <- R exp(T (Omega_old + Omega) / 2), T the period; then R <- R exp((1 - exp(-T / time_constant)) e), e the rotation
    vector from R to the measured attitude. It starts at the first measured attitude, and is listed after the sensors that it
    uses. Mahony, Hamel & Pflimlin, IEEE Trans. Automatic Control 53 (2008); here without an estimate of the rates' bias.

    Args:
        time_constant: Time after which the measured attitude counts more than the rates [s].

    Raises:
        SceneError: If a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "complementary_filter"
    memory_rows: ClassVar[int] = 12

    time_constant: Any = number((), "s", least=0.0)
