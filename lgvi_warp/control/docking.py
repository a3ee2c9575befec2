# SPDX-License-Identifier: Apache-2.0
"""Guidance into a dock along its centre line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import Guidance, Numbers, Packed, PackingContext
from lgvi_warp.physics.terms.base import number

# The largest half angle of a funnel [rad]: its tangent stays a number to calculate with.
WIDEST = 1.5


@dataclass(frozen=True, eq=False, kw_only=True)
class Docking(Guidance):
    """Approach a dock along its centre line at decreasing speed, and start again if the vehicle is outside the funnel.

    Let e be the vehicle's distance to starboard of the centre line, D the look-ahead and J the integral with
    dJ/dt = D e / (D^2 + (e + kappa J)^2). The wanted heading is the dock's heading minus atan((e + kappa J) / D). The wanted
    speed over ground falls linearly with the distance, from `speed` at the distance `slowing` to `contact_speed` at the
    dock. The funnel's radius is `mouth` at the dock and grows by tan(`funnel`) per metre of distance. A vehicle that is
    nearer to the dock than `judged` and outside the funnel starts again. It goes to the point at the distance `approach`
    before the dock and `offset` to starboard of the line, and from there along the line. A vehicle that reaches the dock's
    plane inside the mouth is docked. Its wanted speed is then 0, and its wanted position and heading are the dock's.

    Args:
        position: Middle of the dock's mouth, (3,) [m], inertial axes.
        heading: Heading at which a vehicle enters the dock [rad].
        speed: Speed of the approach [m/s], over ground.
        contact_speed: Speed at the dock [m/s], over ground, above 0.
        slowing: Distance from the dock at which the wanted speed begins to fall [m].
        look_ahead: Look-ahead distance D [m].
        mouth: Radius of the mouth [m].
        funnel: Half the opening angle of the funnel [rad], at most 1.5.
        approach: Distance from the dock at which the line begins [m].
        judged: Distance from the dock within which a vehicle must be in the funnel [m], at most `approach`.
        offset: Displacement of the starting point of a new approach to starboard of the line [m]; 0 by default. With an
            offset of twice the turning radius, the vehicle ends its turn on the line.
        kappa: Gain of the integral [m/s]; 0.1 by default.

    Raises:
        SceneError: If `judged` exceeds `approach`, `contact_speed` exceeds `speed`, or a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> dock = dict(position=[200.0, 0.0, 10.0], heading=0.0, mouth=1.0, funnel=0.1)
        >>> pace = dict(speed=1.5, contact_speed=0.8, slowing=60.0, look_ahead=10.0)
        >>> lw.control.Docking(**dock, **pace, approach=150.0, judged=80.0).gives[0]
        'depth'
    """

    type: ClassVar[str] = "docking"
    memory_rows: ClassVar[int] = 3

    position: Any = number((3,), "m")
    heading: Any = number((), "rad")
    speed: Any = number((), "m/s", above=0.0)
    contact_speed: Any = number((), "m/s", above=0.0)
    slowing: Any = number((), "m", above=0.0)
    look_ahead: Any = number((), "m", above=0.0)
    mouth: Any = number((), "m", above=0.0)
    funnel: Any = number((), "rad", least=0.0, most=WIDEST)
    approach: Any = number((), "m", above=0.0)
    judged: Any = number((), "m", least=0.0)
    offset: Any = number((), "m", 0.0)
    kappa: Any = number((), "m/s", 0.1, least=0.0)

    def check(self, faults: Faults) -> None:
        for small, great in (("judged", "approach"), ("contact_speed", "speed")):
            if getattr(self, small) > getattr(self, great):
                remedy = f"give at most {great} = {float(getattr(self, great)):g}"
                faults.add(small, float(getattr(self, small)), f"is above {great}", remedy)

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        bad["judged"] = bad["judged"] | (numbers["judged"] > numbers["approach"])
        bad["contact_speed"] = bad["contact_speed"] | (numbers["contact_speed"] > numbers["speed"])
        return bad

    @property
    def gives(self) -> tuple[str, ...]:
        return ("depth", "position", "velocity", "heading", "attitude", "angular_velocity", "speed")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Cosine and sine of the heading, the tangent of the funnel; memory of what it does, of J, and of changes.
        values = {name: value for name, value in numbers.items() if name not in ("heading", "funnel")}
        angles = {"c": np.cos(numbers["heading"]), "s": np.sin(numbers["heading"]), "slope": np.tan(numbers["funnel"])}
        return Packed(values | angles, memory=self.first_memory)
