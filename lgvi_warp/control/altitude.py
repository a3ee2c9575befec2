# SPDX-License-Identifier: Apache-2.0
"""Guidance at an altitude above the sea floor."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults
from lgvi_warp.control.altimeter import Altimeter, unit
from lgvi_warp.control.base import Guidance
from lgvi_warp.control.over_floor import chosen, packed_over, with_floor
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number, own

SOURCES = ("altimeter", "chart")


@dataclass(frozen=True, eq=False, kw_only=True)
class Altitude(Guidance):
    """Guidance along the sea floor: the wanted depth, for depth laws, is the floor's depth minus the wanted altitude.

    With an altimeter, the floor's depth is the depth of the point that the beam hits. It is computed from the measured
    depth, the measured attitude and the reading. With a beam that points ahead, the vehicle climbs before a slope. Without
    an echo the vehicle goes deeper until the beam has an echo. With `source="chart"`, the floor's depth is read at two
    points: the measured position, and the point `look_ahead` ahead of it. The smaller of the two depths is used.

    Args:
        altitude: Wanted altitude [m], above 0.
        source: "altimeter", the default, or "chart".
        altimeter: Name of the altimeter; "", the default, stands for the only altimeter of the controller.
        floor: Name of the floor that serves as chart; "", the default, stands for the only floor of the scene.
        look_ahead: Distance ahead, along the heading, at which the chart is read in addition [m]; 0 by default.
        shallowest: Least value of the wanted depth [m]; 0 by default.
        deepest: Largest value of the wanted depth [m]; 12,000 by default.

    Raises:
        SceneError: If `shallowest` exceeds `deepest`, `look_ahead` is given with an altimeter, or a number is
            invalid (see `Term`). A scene refuses this part if its altimeter or floor is missing.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.Altitude(altitude=5.0, source="chart", look_ahead=10.0).gives
        ('depth',)
    """

    type: ClassVar[str] = "altitude"
    # The altimeter or the floor; set for a part of a scene.
    sounder: ClassVar[Any] = None
    ground: ClassVar[Any] = None

    altitude: Any = number((), "m", above=0.0)
    source: str = word("altimeter", known=SOURCES)
    altimeter: str = ""
    floor: str = ""
    look_ahead: Any = number((), "m", 0.0, least=0.0)
    shallowest: Any = number((), "m", 0.0)
    deepest: Any = number((), "m", 12_000.0)

    def check(self, faults: Faults) -> None:
        if self.shallowest > self.deepest:
            remedy = f"give at most deepest = {float(self.deepest):g}"
            faults.add("shallowest", float(self.shallowest), "is below deepest", remedy)
        if self.source == "altimeter" and self.look_ahead > 0.0:
            remedy = 'give source = "chart", or let the beam look ahead: direction = [1, 0, 1] of the altimeter'
            faults.add("look_ahead", float(self.look_ahead), "is given beside an altimeter", remedy)

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        return bad | {"shallowest": bad["shallowest"] | (numbers["shallowest"] > numbers["deepest"])}

    @property
    def gives(self) -> tuple[str, ...]:
        return ("depth",)

    def in_scene(self, faults: Faults, events: Sequence[Term], sensors: Sequence[Any]) -> Any:
        if self.source == "chart":
            return with_floor(self, faults, events)
        able = [sensor for sensor in sensors if isinstance(sensor, Altimeter)]
        remedy = 'give [[controller.sensors]] type = "altimeter", or source = "chart"'
        part = copy.copy(self)
        where = f"{self.key}.altimeter"
        object.__setattr__(part, "sounder", chosen(faults, where, self.altimeter, able, "altimeter", remedy))
        return part

    def device_in(self, aligned: bool) -> Any:
        return f"altitude:{self.source}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        values = {name: numbers[name] for name in ("altitude", "shallowest", "deepest")}
        if self.source == "chart":
            return packed_over(self.ground, context, values | {"look_ahead": numbers["look_ahead"]})
        beam = own(self.sounder, context.parameters)
        row = {"row": self.bus.ranges[self.sounder.key]}
        return Packed(values | {"beam": unit(beam["direction"]), "point": beam["point"]} | row)
