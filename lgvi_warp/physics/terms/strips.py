# SPDX-License-Identifier: Apache-2.0
"""Common parts of terms that divide a slender hull into strips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, PackingContext, Term, number, rows_of
from lgvi_warp.physics.terms.fins import twist

# The two Gauss points of a segment from 0 to 1.
GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
ACROSS = (np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))


@dataclass(frozen=True, eq=False, kw_only=True)
class StripTerm(Term):
    """Base class of a hull along the body's x axis, linear between stations, with cross-flow drag at each strip.

    A subclass declares `drag_coefficient`.

    Args:
        stations: Positions along the body's x axis, (k,) [m], rising; two or more, from stern to bow.
        diameters: Breadth D of the hull across the flow, (k,) [m].
    """

    braking_grows_with: ClassVar[tuple[str, ...]] = ("drag_coefficient", "diameters")

    stations: Any = number(("k",), "m", rising=True)
    diameters: Any = number(("k",), "m", least=0.0)

    def __post_init__(self) -> None:
        self.repeat(rows_of(self.stations), "drag_coefficient")
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        if len(self.stations) < 2:
            faults.add("stations", self.stations, "has one station", "give two or more, from stern to bow")

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        # The derivative across the hull, strip by strip, at the whole speed and all rates together.
        strength = numbers["drag_coefficient"] * numbers["diameters"]
        stations, breadth = (0.5 * (table[:, 1:] + table[:, :-1]) for table in (numbers["stations"], strength))
        size = water_density[:, None] * breadth * np.diff(numbers["stations"])
        motion, turning = (np.linalg.norm(speeds[:, half], axis=1)[:, None] for half in (slice(0, 3), slice(3, 6)))
        size = size * (motion + turning * np.abs(stations))
        arms = stations[..., None] * np.array([1.0, 0.0, 0.0])
        total = np.zeros((len(size), 6, 6))
        for across in ACROSS:
            rows = np.concatenate([np.broadcast_to(across, arms.shape), np.cross(arms, across)], axis=-1)
            total = total + np.einsum("nk,nki,nkj->nij", size, np.broadcast_to(rows, (*size.shape, 6)), rows)
        return total


def across(context: PackingContext) -> dict[str, np.ndarray]:
    """The two directions across the hull, and the moments of unit forces along them about the method's origin."""
    a, b = (twist(context.frame, np.zeros((1, 3)), direction) for direction in ACROSS)
    return {"a": a[:, :3], "a_arm": a[:, 3:], "b": b[:, :3], "b_arm": b[:, 3:]}
