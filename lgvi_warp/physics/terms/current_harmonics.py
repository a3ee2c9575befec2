# SPDX-License-Identifier: Apache-2.0
"""A uniform current that is a sum of harmonics in time, such as a tidal current."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number, rows_of, side_by_side


@dataclass(frozen=True, eq=False, kw_only=True)
class Harmonics(Term):
    """Base class of sums of harmonics in time, each with an amplitude, a period and a phase. Abstract.

    Args:
        amplitudes: Amplitudes of the k harmonics.
        periods: Periods, (k,) [s], above 0.
        phases: Phases at t = 0, (k,) [rad]; 0 by default.
    """

    strengths: ClassVar[tuple[str, ...]] = ("amplitudes",)
    timed: ClassVar[bool] = True

    amplitudes: Any = number(("k",), "1")
    periods: Any = number(("k",), "s", above=0.0)
    phases: Any = number(("k",), "rad", None)

    def __post_init__(self) -> None:
        if self.phases is None:
            object.__setattr__(self, "phases", np.zeros(rows_of(self.amplitudes)))
        super().__post_init__()


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentHarmonics(Harmonics):
    """A uniform current that is a sum of harmonics, u(t) = sum of amplitude cos(2 pi t / period + phase).

    Args:
        amplitudes: Amplitudes, (k, 3) [m/s], in inertial axes.
        periods: Periods, (k,) [s], above 0.
        phases: Phases at t = 0, (k,) [rad]; 0 by default.

    Raises:
        SceneError: If a period is not above 0, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "current_harmonics"

    amplitudes: Any = number(("k", 3), "m/s")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Device rows of each harmonic: amplitude, angular frequency [rad/s], phase.
        columns = [numbers["amplitudes"], 2.0 * np.pi / numbers["periods"][..., None], numbers["phases"][..., None]]
        rows = side_by_side(*columns)
        return Packed({"count": rows.shape[1]}, rows.reshape(len(rows), -1))

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        # Velocity (k, n, 3) [m/s] at each time, the same at all positions.
        total = np.zeros(position.shape)
        for j in range(numbers["periods"].shape[1]):
            angle = 2.0 * np.pi / numbers["periods"][:, j] * time[:, None] + numbers["phases"][:, j]
            total = total + np.cos(angle)[..., None] * numbers["amplitudes"][:, j]
        return total
