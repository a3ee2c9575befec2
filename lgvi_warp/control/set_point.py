# SPDX-License-Identifier: Apache-2.0
"""Guidance by a set-point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import Guidance
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number


@dataclass(frozen=True, eq=False, kw_only=True)
class SetPoint(Guidance):
    """Constant set-point of position, heading and speed. An omitted quantity is left to the guidance before this part.

    Args:
        position: Wanted position, (3,) [m], inertial axes.
        depth: Wanted depth [m], without a position in north and east; give either `depth` or `position`.
        heading: Wanted heading [rad], from north to east; the wanted roll and pitch are 0. With a position, the heading is
            0 by default.
        speed: Wanted forward speed through the water [m/s].

    Raises:
        SceneError: If no quantity is given, both `position` and `depth` are given, or a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.SetPoint(depth=10.0, heading=0.5).gives
        ('depth', 'heading', 'attitude', 'angular_velocity')
    """

    type: ClassVar[str] = "set_point"
    foreseeable: ClassVar[bool] = True

    position: Any = number((3,), "m", None, optional=True)
    depth: Any = number((), "m", None, optional=True)
    heading: Any = number((), "rad", None, optional=True)
    speed: Any = number((), "m/s", None, optional=True)

    def check(self, faults: Faults) -> None:
        if not self.parameters():
            faults.add("", "", "sets nothing", "give position, depth, heading or speed")
        if self.position is not None and self.depth is not None:
            faults.add("depth", self.depth, "is given beside position", "keep one of them: position[2] is the depth")

    @property
    def gives(self) -> tuple[str, ...]:
        position = ("position", "depth", "velocity") if self.position is not None else ()
        depth = ("depth",) if self.depth is not None else ()
        upright = self.heading is not None or self.position is not None
        heading = ("heading", "attitude", "angular_velocity") if upright else ()
        return (*position, *depth, *heading, *(("speed",) if self.speed is not None else ()))

    @property
    def wanted(self) -> tuple[str, ...]:
        # A position alone brings a heading that no one asked for.
        return tuple(wish for wish in self.gives if wish != "heading" or self.heading is not None)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # All numbers, and which of them are wanted; what is not stays as guidance before it wants it.
        position = numbers.get("position", np.zeros((1, 3)))
        zero = np.zeros(1)
        depth = numbers.get("depth", position[:, 2])
        values = {"heading": numbers.get("heading", zero), "speed": numbers.get("speed", zero)}
        wishes = {"place": "position", "level": "depth", "turn": "heading", "pace": "speed"}
        wanted = {name: int(wish in self.gives) for name, wish in wishes.items()}
        return Packed({"position": position, "depth": depth, **values, **wanted})
