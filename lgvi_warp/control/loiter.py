# SPDX-License-Identifier: Apache-2.0
"""Guidance round a circle about a place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import flag
from lgvi_warp.control.base import Guidance
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class Loiter(Guidance):
    """Circle a point for as long as the run lasts (Beard & McLain 2012, 10.2).

    With d the distance from the centre on the map, the wanted heading is that of the circle's tangent, turned towards the
    circle by atan((d - radius) / look_ahead); the wanted heading rate on the circle is speed / radius. For laws of the
    pose, the wanted position and velocity are those of the point of the circle abeam. A vehicle that cannot turn so tightly
    circles outside.

    Args:
        center: The place, (3,) [m], inertial axes; its third number is the depth.
        radius: Radius of the circle [m].
        speed: Wanted speed ahead through the water [m/s].
        look_ahead: Look-ahead distance along the tangent [m]; some lengths of the vehicle.
        clockwise: Whether clockwise as seen from above; by default True.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.Loiter(center=[0.0, 0.0, 5.0], radius=30.0, speed=1.5, look_ahead=10.0).clockwise
        True
    """

    type: ClassVar[str] = "loiter"

    center: Any = number((3,), "m")
    radius: Any = number((), "m", above=0.0)
    speed: Any = number((), "m/s")
    look_ahead: Any = number((), "m", above=0.0)
    clockwise: bool = flag(True)

    @property
    def gives(self) -> tuple[str, ...]:
        return ("depth", "position", "velocity", "heading", "attitude", "angular_velocity", "speed")

    def words(self) -> dict[str, Any]:
        return {"sense": np.full(1, 1.0 if self.clockwise else -1.0)}
