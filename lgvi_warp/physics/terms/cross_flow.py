# SPDX-License-Identifier: Apache-2.0
"""Cross-flow drag of a slender hull, by strips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number, rows_of, side_by_side
from lgvi_warp.physics.terms.fins import twist

# The two Gauss points of a segment from 0 to 1.
GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
ACROSS = (np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))


@dataclass(frozen=True, eq=False, kw_only=True)
class CrossFlow(Term):
    """Cross-flow drag of a slender hull, by strips: force per length -rho/2 Cd D |w| w (Hoerner 1965; Fossen 2021, chapter 8).

    w is the flow across the hull at the strip. Between stations the product Cd D is linear.

    Args:
        stations: Places along the body's x axis, (k,) [m], rising; two or more.
        diameters: Breadth D of the hull across the flow, (k,) [m].
        drag_coefficient: Drag coefficient Cd, (k,), or one number for all stations.

    Raises:
        SceneError: Where stations do not rise or are fewer than two, and as `Term`.
    """

    type: ClassVar[str] = "cross_flow"
    braking_grows_with: ClassVar[tuple[str, ...]] = ("drag_coefficient", "diameters")

    stations: Any = number(("k",), "m", rising=True)
    diameters: Any = number(("k",), "m", least=0.0)
    drag_coefficient: Any = number(("k",), "1", least=0.0)

    def __post_init__(self) -> None:
        self.repeat(rows_of(self.stations), "drag_coefficient")
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        if len(self.stations) < 2:
            faults.add("stations", self.stations, "has one station", "give two or more, from stern to bow")

    def present(self, numbers: Numbers) -> bool:
        # Whether some member has a diameter and a drag coefficient above 0.
        return bool(np.any(numbers["diameters"]) and np.any(numbers["drag_coefficient"]))

    def braking(self, numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
        return strip_braking(numbers, speeds, water_density)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The two directions across the hull, and two strips per segment: station, and rho/2 Cd D times its length.
        a, b = (twist(context.frame, np.zeros((1, 3)), direction) for direction in ACROSS)
        values: dict[str, Any] = {"a": a[:, :3], "a_arm": a[:, 3:], "b": b[:, :3], "b_arm": b[:, 3:]}
        stations, strength = numbers["stations"], numbers["drag_coefficient"] * numbers["diameters"]
        half_length = 0.5 * np.diff(stations)
        half_density = 0.5 * context.parameters["environment.water_density"][:, None]
        strips = []
        for place in GAUSS:
            x, c = (table[:, :-1] + place * np.diff(table) for table in (stations, strength))
            strips.append(side_by_side(x[..., None], (half_density * half_length * c)[..., None]))
        rows = side_by_side(*strips)
        return Packed(values | {"count": 2 * half_length.shape[1]}, rows.reshape(len(rows), -1))


def strip_braking(numbers: Numbers, speeds: np.ndarray, water_density: np.ndarray) -> np.ndarray:
    """How strongly cross-flow drag brakes, as `Term.braking`."""
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
