# SPDX-License-Identifier: Apache-2.0
"""Guidance along a circle about a point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import flag
from lgvi_warp.control.base import Guidance
from lgvi_warp.physics.terms.base import number


@dataclass(frozen=True, eq=False, kw_only=True)
class Loiter(Guidance):
    """Circle a point until the run ends (Beard & McLain 2012, 10.2).

    Let d be the horizontal distance from the centre. The wanted heading is the direction of the circle's tangent, turned
    towards the circle by atan((d - radius) / look_ahead). The wanted heading rate on the circle is speed / radius. For
    laws that control the pose (`PosePID`, `PoseSMC`), the wanted position is the nearest point of the circle, and the
    wanted velocity is `speed` along the tangent there. If the vehicle cannot turn so tightly, its circle is wider.

    Args:
        center: Centre of the circle, (3,) [m], inertial axes; its third number is the wanted depth.
        radius: Radius of the circle [m].
        speed: Wanted forward speed through the water [m/s].
        look_ahead: Look-ahead distance along the tangent [m]; a few vehicle lengths are usual.
        clockwise: Whether the vehicle circles clockwise as seen from above; by default True.

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
