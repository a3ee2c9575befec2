# SPDX-License-Identifier: Apache-2.0
"""Cross-flow drag of a slender hull, by strips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number, side_by_side
from lgvi_warp.physics.terms.strips import GAUSS, StripTerm, across


@dataclass(frozen=True, eq=False, kw_only=True)
class CrossFlow(StripTerm):
    """Cross-flow drag of a slender hull, by strips: force per length -rho/2 Cd D |w| w (Hoerner 1965; Fossen 2021, chapter 8).

    rho is the density of the water, and w the velocity of the strip across the hull, relative to the water. Between stations
    the product Cd D is linear.

    Args:
        stations: Positions along the body's x axis, (k,) [m], rising; two or more.
        diameters: Breadth D of the hull across the flow, (k,) [m].
        drag_coefficient: Drag coefficient Cd, (k,), or one number for all stations.

    Raises:
        SceneError: If stations do not rise or are fewer than two, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "cross_flow"

    drag_coefficient: Any = number(("k",), "1", least=0.0)

    def present(self, numbers: Numbers) -> bool:
        # Whether some member has a diameter and a drag coefficient above 0.
        return bool(np.any(numbers["diameters"]) and np.any(numbers["drag_coefficient"]))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Two strips per segment: station, and rho/2 Cd D times its length.
        stations, strength = numbers["stations"], numbers["drag_coefficient"] * numbers["diameters"]
        half_length = 0.5 * np.diff(stations)
        half_density = 0.5 * context.parameters["environment.water_density"][:, None]
        strips = []
        for place in GAUSS:
            x, c = (table[:, :-1] + place * np.diff(table) for table in (stations, strength))
            strips.append(side_by_side(x[..., None], (half_density * half_length * c)[..., None]))
        rows = side_by_side(*strips)
        return Packed(across(context) | {"count": 2 * half_length.shape[1]}, rows.reshape(len(rows), -1))
