# SPDX-License-Identifier: Apache-2.0
"""Complementary filter, an estimator of the attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.control.base import MeasuringPart
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class ComplementaryFilter(MeasuringPart):
    """Complementary filter: an attitude from measured rates (high frequencies) and measured attitude (low frequencies).

    At each tick, first R <- R exp(T (Omega_old + Omega) / 2): R is the estimate, T the period, Omega_old and Omega are the
    measured rates at the previous and at this tick. Then R <- R exp((1 - exp(-T / time_constant)) e), where e is the
    rotation vector from R to the measured attitude. The filter starts at the first measured attitude. List it after its
    sensors. Source (without its bias estimator): Mahony, Hamel & Pflimlin, IEEE Trans. Automatic Control 53 (2008).

    Args:
        time_constant: Time scale [s] beyond which the measured attitude counts more than the rates.

    Raises:
        SceneError: If a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "complementary_filter"
    memory_rows: ClassVar[int] = 12

    time_constant: Any = number((), "s", least=0.0)
