"""Cross-flow drag of a slender hull, by strips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number
from lgvi_warp.physics.terms.fins import side_by_side, twist

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
    device: ClassVar[str] = "cross_flow"

    stations: Any = number(("k",), "m", rising=True)
    diameters: Any = number(("k",), "m", least=0.0)
    drag_coefficient: Any = number(("k",), "1", least=0.0)

    def __post_init__(self) -> None:
        if np.ndim(np.asarray(self.drag_coefficient, dtype=object)) == 0:
            count = len(np.atleast_1d(np.asarray(self.stations, dtype=object)))
            object.__setattr__(self, "drag_coefficient", np.array([self.drag_coefficient] * count))
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        """Adds a fault where stations are fewer than two."""
        if len(self.stations) < 2:
            faults.add("stations", self.stations, "has one station", "give two or more, from stern to bow")

    def present(self, numbers: Numbers) -> bool:
        """Whether some member has a diameter and a drag coefficient above 0."""
        return bool(np.any(numbers["diameters"]) and np.any(numbers["drag_coefficient"]))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The two directions across the hull, and two strips per segment: station, and rho/2 Cd D times its length."""
        a, b = (twist(context.frame, np.zeros((1, 3)), direction) for direction in ACROSS)
        values: dict[str, Any] = {"a": a[:, :3], "a_arm": a[:, 3:], "b": b[:, :3], "b_arm": b[:, 3:]}
        stations, strength = numbers["stations"], numbers["drag_coefficient"] * numbers["diameters"]
        half_length = 0.5 * np.diff(stations)
        half_density = 0.5 * context.parameters["environment.water_density"][:, None]
        strips = []
        for place in GAUSS:
            x, c = (table[:, :-1] + place * np.diff(table) for table in (stations, strength))
            strips.append(side_by_side([x[..., None], (half_density * half_length * c)[..., None]]))
        rows = side_by_side(strips)
        return Packed(values | {"count": 2 * half_length.shape[1]}, rows.reshape(len(rows), -1))
