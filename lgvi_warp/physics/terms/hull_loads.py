# SPDX-License-Identifier: Apache-2.0
"""Loads on a slender hull due to water motion that varies along it, by strips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number, side_by_side
from lgvi_warp.physics.terms.strips import GAUSS, StripTerm, across


@dataclass(frozen=True, eq=False, kw_only=True)
class HullLoads(StripTerm):
    """Loads on a slender hull in water that moves differently along it, as in waves (Lighthill 1960; Newman 1977, 7.4).

    The loads are computed by strips. The vehicle's added mass and the water velocity at its origin give the loads in water
    with a uniform motion along the hull. For each strip, this term adds the loads due to the difference of the local water
    motion: by the pressure of the undisturbed water, and by the momentum of the water that the strip sets in motion. The
    term also adds cross-flow drag with the local flow, which includes the drag of `CrossFlow`; do not use both.

    Args:
        stations: Positions along the body's x axis, (k,) [m], rising; two or more, from stern to bow.
        diameters: Breadth D of the hull across the flow, (k,) [m], linear between stations.
        added_mass: Added mass across the hull per length, (k,) [kg/m], linear between stations; by default the added mass
            of a slender round hull, rho pi D^2 / 4, where rho is the density of the water.
        drag_coefficient: Drag coefficient Cd, (k,), or one number for all stations; 0 by default.

    Raises:
        SceneError: If stations do not rise or are fewer than two, or a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> hull = lw.terms.HullLoads(stations=[-0.8, 0.0, 0.8], diameters=[0.0, 0.2, 0.0])
        >>> hull.drag_coefficient.tolist()
        [0.0, 0.0, 0.0]
    """

    type: ClassVar[str] = "hull_loads"
    dissipative: ClassVar[bool] = False

    added_mass: Any = number(("k",), "kg/m", None, least=0.0, optional=True)
    drag_coefficient: Any = number(("k",), "1", 0.0, least=0.0)

    def present(self, numbers: Numbers) -> bool:
        # Whether some member has a hull.
        return bool(np.any(numbers["diameters"]) or np.any(numbers.get("added_mass", 0.0)))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        frame = context.frame
        values: dict[str, Any] = across(context)
        values |= {"axis": frame.vector(np.array([[1.0, 0.0, 0.0]])), "origin": frame.point(np.zeros((1, 3)))}
        density = context.parameters["environment.water_density"][:, None]
        x, D, Cd = (numbers[name] for name in ("stations", "diameters", "drag_coefficient"))
        half = 0.5 * np.diff(x)
        slope = np.diff(D) / np.diff(x)
        strips = []
        for place in GAUSS:
            at, breadth, c = (table[:, :-1] + place * np.diff(table) for table in (x, D, Cd * D))
            area = 0.25 * np.pi * breadth**2
            added = density * area
            if "added_mass" in numbers:
                added = numbers["added_mass"][:, :-1] + place * np.diff(numbers["added_mass"])
            # Integral of z^2 over a round section is S^2 / (4 pi): its slope, for the moment of the pressure along the axis.
            tilting = density * area * 0.25 * breadth * slope
            rows = (at, half * 0.5 * density * c, half * density * area, half * tilting, half * added)
            strips.append(side_by_side(*(row[..., None] for row in rows)))
        table = side_by_side(*strips)
        return Packed(values | {"count": 2 * half.shape[1]}, table.reshape(len(table), -1))
