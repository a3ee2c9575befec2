# SPDX-License-Identifier: Apache-2.0
"""Guidance along waypoints by line of sight."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import array, flag, word
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.places import LocalPlane, check_places
from lgvi_warp.control.base import Guidance, Numbers, Packed, PackingContext
from lgvi_warp.physics.fields import PLACE_UNIT
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import number

# How the heading follows from the way off the leg, and what is done at the last point.
METHODS = ("los", "ilos", "alos")
AT_END = ("stop", "go_on", "loiter")
# Numbers of each point.
CIRCLES = ("loiter_turns", "loiter_time")
OF_POINTS = ("times", *CIRCLES)


@dataclass(frozen=True, eq=False, kw_only=True)
class Waypoints(Guidance):
    """Waypoints joined by straight legs; the heading follows by line of sight (Fossen 2021, 12.3-12.5).

    y: the vehicle's distance to starboard of the leg, D: look-ahead. The wanted heading is the leg's heading minus an angle:
    "los": atan(y / D);
    "ilos": atan((y + kappa J) / D), where dJ/dt = D y / (D^2 + (y + kappa J)^2) (Borhaug, Pavlov & Pettersen 2008);
    "alos": beta + atan(y / D), where beta is an estimate of the crab angle with d beta/dt = gamma D y / sqrt(D^2 + y^2)
    (Fossen & Aguiar 2024).

    Wanted depth and position are those of the point of the leg that is abeam of the vehicle. A leg is done when the vehicle
    is within the radius of the leg's end or abeam of the end.

    Args:
        points: Waypoints, (k, 3) [m], inertial axes: at least two; neighbours must differ in north or east.
        geodetic: Waypoints as latitude, longitude [deg, WGS 84] and depth [m], (k, 3), in place of `points`. The scene's
            environment must have an origin. Legs are straight in the plane of the inertial axes. Geodetic points
            cannot vary by member.
        speed: Wanted forward speed through the water [m/s]; with `times`, the largest wanted speed.
        look_ahead: Look-ahead distance D [m].
        radius: Radius of acceptance [m], horizontal.
        method: "los", "ilos" or "alos"; by default "los".
        kappa: Gain of "ilos" [m/s]; 0.1 by default.
        gamma: Gain of "alos" [rad/(m s)]; 0.002 by default.
        at_end: Behaviour at the last point. With "stop", the default, the wanted heading is that of the last leg, the wanted
            speed is 0, and the wanted position is the last point. With "go_on", the vehicle continues straight beyond
            the end of the last leg. With "loiter", it circles the last point.
        times: Arrival time at each point, (k,) [s], rising. Before the first time the wanted speed is 0. By default there are
            no times.
        loiter_radius: Radius of circles about points [m], required if there are circles.
        loiter_turns: Number of turns about each point, (k,), 0 at the first point; by default no turns.
        loiter_time: Least time on the circle about each point, (k,) [s], 0 at the first point; by default no time.
        clockwise: Whether the vehicle circles clockwise as seen from above; by default True.

    Raises:
        SceneError: If the points do not form a path, times do not rise, circles are given without their radius or the radius
            without circles, or a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> points = [[0.0, 0.0, 5.0], [100.0, 0.0, 5.0], [100.0, 100.0, 5.0]]
        >>> guidance = lw.control.Waypoints(points=points, speed=1.5, look_ahead=10.0, radius=5.0)
        >>> guidance.points.shape
        (3, 3)
    """

    type: ClassVar[str] = "waypoints"

    points: Any = number(("k", 3), "m", None, optional=True)
    speed: Any = number((), "m/s")
    look_ahead: Any = number((), "m", above=0.0)
    radius: Any = number((), "m", above=0.0)
    geodetic: Any = array(None, unit=PLACE_UNIT)
    method: str = word("los", known=METHODS)
    kappa: Any = number((), "m/s", 0.1, least=0.0)
    gamma: Any = number((), "rad/(m s)", 0.002, least=0.0)
    at_end: str = word("stop", known=AT_END)
    times: Any = number(("k",), "s", None, optional=True, rising=True)
    loiter_radius: Any = number((), "m", None, optional=True, above=0.0)
    loiter_turns: Any = number(("k",), "1", None, optional=True, least=0.0)
    loiter_time: Any = number(("k",), "s", None, optional=True, least=0.0)
    clockwise: bool = flag(True)

    def check(self, faults: Faults) -> None:
        chosen = [name for name in ("points", "geodetic") if getattr(self, name) is not None]
        if len(chosen) == 2:
            faults.add("points and geodetic", "...", "say the same thing twice", "keep one of them")
        elif not chosen:
            faults.add("points", None, "are missing", "give points [m], or geodetic [deg, deg, m]")
        elif chosen == ["points"]:
            _check_way(faults, "points", self.points)
        elif not faults:
            places = np.asarray(self.geodetic, dtype=np.float64)
            object.__setattr__(self, "geodetic", places)
            if places.ndim != 2 or places.shape[1] != 3:
                faults.add("geodetic", places, f"has shape {places.shape}", f"give k x 3 numbers [{PLACE_UNIT}]")
                return
            check_places(faults, "geodetic", places)
            _check_way(faults, "geodetic", places)
            for name in OF_POINTS:
                if (values := getattr(self, name)) is not None and len(values) != len(places):
                    faults.add(name, values, f"are {len(values)} numbers", f"give {len(places)}, one for each point")
        self._check_circles(faults)

    def _check_circles(self, faults: Faults) -> None:
        """Add faults if only circles or only their radius is given, or a circle is at the first or before an endless leg."""
        asked = {name: getattr(self, name) for name in CIRCLES if getattr(self, name) is not None}
        circling = bool(asked) or self.at_end == "loiter"
        if circling and self.loiter_radius is None:
            faults.add("loiter_radius", None, "is missing", "give the radius of the circles [m]")
        if self.loiter_radius is not None and not circling:
            remedy = 'give loiter_turns or loiter_time, or at_end = "loiter"'
            faults.add("loiter_radius", float(self.loiter_radius), "is given, and nothing is circled", remedy)
        for name, values in asked.items():
            if len(values) and values[0] > 0.0:
                problem = "is of the first point, where the way begins"
                faults.add(f"{name}[0]", float(values[0]), problem, "give 0; to circle first, begin with another point")
            if len(values) and values[-1] > 0.0 and self.at_end == "go_on":
                problem = "is of the last point, and at_end is to go on along its leg"
                remedy = 'give 0, or at_end = "stop" or "loiter"'
                faults.add(f"{name}[{len(values) - 1}]", float(values[-1]), problem, remedy)

    def located(self, plane: LocalPlane | None) -> Any:
        # With the points that the places are on the plane.
        if self.geodetic is None:
            return self
        if plane is None:
            problem = "are places on the Earth, and environment.origin is not known"
            remedy = "give the origin of the axes: [environment] origin = [latitude, longitude]"
            raise refusal(f"{self.key}.geodetic", self.geodetic, problem, remedy)
        part = copy.copy(self)
        points = plane.positions(self.geodetic)
        points.setflags(write=False)
        object.__setattr__(part, "points", points)
        return part

    def with_fields(self, fields: Mapping[str, Any]) -> Any:
        # Points and places say the same thing: each takes the place of the other.
        other = {"geodetic": None} if "points" in fields else {"points": None} if self.geodetic is not None else {}
        return super().with_fields(other | dict(fields))

    def to_dict(self) -> dict[str, Any]:
        # What was given: places, where points follow from them.
        content = super().to_dict()
        if self.geodetic is not None:
            content.pop("points", None)
        return content

    @property
    def gives(self) -> tuple[str, ...]:
        # All that a reference can have.
        return ("depth", "position", "velocity", "heading", "attitude", "angular_velocity", "speed")

    @property
    def circles(self) -> bool:
        """Whether the path has a circle about some point."""
        return self.loiter_radius is not None

    @property
    def ends(self) -> str:
        return "" if self.at_end == "go_on" else "mission_done"

    def device_in(self, aligned: bool) -> Any:
        has = {"timed": self.times is not None, "circles": self.circles, "ends": self.key in self.bus.done}
        return "waypoints:" + ",".join(("legs", *(name for name, present in has.items() if present)))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The points in the table, then times, turns and times of circles; memory of the leg, J or beta, and of a circle.
        points = numbers["points"]
        k = points.shape[1]
        values = {name: numbers[name] for name in ("speed", "look_ahead", "radius", "kappa", "gamma")}
        words = {"legs": k - 1, "method": METHODS.index(self.method), "stops": int(self.at_end != "go_on")}
        rows = [points.reshape(len(points), -1)]
        if self.times is not None:
            rows.append(numbers["times"])
        if self.circles:
            values |= {"circle": numbers["loiter_radius"], "sense": np.full(1, 1.0 if self.clockwise else -1.0)}
            words["circles"] = int(self.at_end == "loiter")
            rows += [numbers.get(name, np.zeros((1, k))) for name in CIRCLES]
        if self.key in self.bus.done:
            words["done"] = self.bus.done[self.key]
        table = np.concatenate(repeated(*rows), axis=1)
        return Packed(values | words, table, np.zeros((1, 6 if self.circles else 2)))


def _check_way(faults: Faults, name: str, points: np.ndarray) -> None:
    """Add a fault for points that form no path: a single point, or neighbours with the same north and east."""
    if len(points) < 2:
        faults.add(name, points, "are less than two", "give where the way begins and where it ends")
    for i in np.flatnonzero(np.all(np.diff(points[:, :2], axis=0) == 0.0, axis=1)):
        where, problem = f"{name}[{i + 1}]", "is at the same place of the map as the one before"
        faults.add(where, points[i + 1], problem, "leave it out: a leg needs a direction")
