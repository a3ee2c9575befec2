# SPDX-License-Identifier: Apache-2.0
"""The environment of a scene, and the initial state of its members."""

from __future__ import annotations

import copy
import dataclasses
import datetime
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import explained
from lgvi_warp.common.declared import array, positive, read, real
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import PLACE_UNIT, TABLE

if TYPE_CHECKING:
    from lgvi_warp.common.places import LocalPlane

ATTITUDES = ("attitude", "rotation_vector", "quaternion_wxyz", "euler_deg")
VELOCITIES = ("velocity", "velocity_inertial")
PLACES = ("position", "geodetic")
# In the order of a scene file.
NAMES = (*PLACES, *ATTITUDES, *VELOCITIES, "angular_velocity")


@dataclass(frozen=True)
class Environment:
    """Gravity, density of the water, and the location and date of the scene on the Earth.

    Args:
        gravity: Acceleration of free fall [m/s2], >= 0; by default 9.80665 (standard gravity).
        water_density: Density of the water [kg/m3], > 0; by default 1025 (sea water).
        origin: Latitude and longitude (2,) [deg, WGS 84] of the origin of the inertial axes, where these point north, east
            and down. None, the default, if it is unknown. A longitude may be given from -180 to 180 or from 0 to 360.
        start: Date and time at t = 0, such as "2026-06-01T00:00:00Z", in UTC unless the text names a time zone. None, the
            default, if it is unknown.

    Attributes:
        start_time: Date and time at t = 0 in UTC; None if unknown.

    Methods:
        positions: Convert geodetic coordinates to positions.
        geodetic: Convert positions to geodetic coordinates.
        to_dict: The section [environment] of a scene file.

    Raises:
        SceneError: If a number is negative or not finite, or a latitude is beyond 90 degrees; the message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.Environment(water_density=1000.0).gravity
        9.80665
        >>> fjord = lw.Environment(origin=[63.44, 10.40], start="2026-06-01T06:00:00Z")
        >>> fjord.positions([63.45, 10.40, 20.0]).round(1)
        array([1114.7,    0. ,   20. ])
    """

    gravity: float = real(9.80665, unit="m/s2", least=0.0)
    water_density: float = positive(1025.0, unit="kg/m3")
    origin: Any = array(None, shape=(2,), unit="deg")
    start: Any = None

    def __post_init__(self) -> None:
        faults = Faults("environment.")
        origin = read(self, faults)["origin"]
        if origin is not None:
            from lgvi_warp.common.places import check_places

            check_places(faults, "origin", origin)
            # Plain numbers: environments are compared.
            object.__setattr__(self, "origin", tuple(origin.tolist()))
        if isinstance(self.start, datetime.date):
            object.__setattr__(self, "start", self.start.isoformat())
        if self.start is not None and _moment(self.start) is None:
            remedy = 'write it as "2026-06-01T00:00:00Z"'
            faults.add("start", self.start, "is not a date and time", remedy)
        faults.raise_if_any()

    @property
    def start_time(self) -> np.datetime64 | None:
        """Date and time at t = 0 in UTC, to the microsecond; None if unknown."""
        return None if self.start is None else _moment(self.start)

    @property
    def plane(self) -> LocalPlane | None:
        """The plane of the inertial axes on the Earth; None without an origin."""
        if self.origin is None:
            return None
        # Most scenes are nowhere: they load nothing of it.
        from lgvi_warp.common.places import LocalPlane

        return LocalPlane(*self.origin)

    def positions(self, geodetic: Any) -> np.ndarray:
        """Convert geodetic coordinates to positions in inertial axes.

        Args:
            geodetic: Latitude, longitude [deg] and depth [m] of points, (..., 3).

        Returns:
            Positions (..., 3) [m], inertial axes (north, east, down).

        Raises:
            SceneError: If there is no origin, or a latitude is beyond 90 degrees.
            ImportError: If pyproj is not installed.
        """
        remedy = "give latitude, longitude and depth of each"
        return positions_of(self, "geodetic", _in_threes("geodetic", geodetic, remedy))

    def geodetic(self, position: Any) -> np.ndarray:
        """Convert positions in inertial axes to geodetic coordinates.

        Args:
            position: Positions (..., 3) [m], inertial axes (north, east, down), such as `result.position`.

        Returns:
            Latitude, longitude from -180 to 180 [deg] and depth [m], (..., 3). They are NaN if a position is not finite
            or farther away than the opposite point of the Earth.

        Raises:
            SceneError: If there is no origin.
            ImportError: If pyproj is not installed.
        """
        plane = self.plane
        if plane is None:
            raise refusal("environment.origin", None, "is not known", NO_ORIGIN)
        return plane.places(_in_threes("position", position, "give north, east and down of each"))

    def to_dict(self) -> dict[str, Any]:
        """Return the section [environment] of a scene file.

        Returns:
            {name: value}: gravity [m/s2] and water_density [kg/m3], and origin [deg] and start if they are known.
        """
        content: dict[str, Any] = {"gravity": float(self.gravity), "water_density": float(self.water_density)}
        content |= {} if self.origin is None else {"origin": list(self.origin)}
        return content | ({} if self.start is None else {"start": self.start})


NO_ORIGIN = "give the origin of the axes: [environment] origin = [latitude, longitude]"


def positions_of(environment: Environment, key: str, places: np.ndarray) -> np.ndarray:
    """Positions (..., 3) [m] of geodetic points (..., 3) [deg, deg, m]; error messages name the scene's key."""
    from lgvi_warp.common.places import check_places

    faults = Faults()
    check_places(faults, key, places)
    plane = environment.plane
    if plane is None:
        faults.add(key, places, "is a place on the Earth, and environment.origin is not known", NO_ORIGIN)
    faults.raise_if_any()
    assert plane is not None
    return plane.positions(places)


def _in_threes(key: str, values: Any, remedy: str) -> np.ndarray:
    """Read real numbers (..., 3); they may be NaN."""
    faults = Faults()
    array_given = faults.real(key, values, remedy)
    if array_given is not None and array_given.shape[-1:] != (3,):
        faults.add(key, values, f"has shape {array_given.shape}", remedy)
    faults.raise_if_any()
    assert array_given is not None
    return array_given


def _moment(text: Any) -> np.datetime64 | None:
    """The date and time of a text, in UTC; None if the text has none."""
    try:
        moment = datetime.datetime.fromisoformat(text)
    except (TypeError, ValueError):
        return None
    if moment.tzinfo is not None:
        try:
            moment = moment.astimezone(datetime.UTC).replace(tzinfo=None)
        except OverflowError:
            return None
    return np.datetime64(moment, "us")


@explained
@dataclass(frozen=True, eq=False)
class Start:
    """The state at t = 0.

    Values that are not given are zero; without an attitude, the body's axes are the inertial axes. Give at most one of
    `position` and `geodetic`, at most one of the four forms of the attitude, and at most one of the two velocities.

    Args:
        position: Position of the body origin (3,) [m], inertial axes (north, east, down).
        attitude: Rotation matrix (3, 3), body to inertial.
        rotation_vector: Axis times angle (3,) [rad], body to inertial.
        quaternion_wxyz: Quaternion (4,), scalar first, body to inertial, of any length but 0.
        euler_deg: Roll, pitch, yaw (3,) [deg], in Fossen's zyx convention.
        velocity: Velocity of the body origin (3,) [m/s], body axes.
        velocity_inertial: Velocity of the body origin (3,) [m/s], inertial axes.
        angular_velocity: Angular velocity (3,) [rad/s], body axes.
        geodetic: Latitude, longitude [deg, WGS 84] and depth [m] of the body origin (3,), instead of position; the scene's
            environment must have an origin.

    Raises:
        SceneError: If a value is invalid; the message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> start = lw.Start(position=[0.0, 0.0, 5.0], euler_deg=[0.0, 0.0, 90.0], velocity=[1.5, 0.0, 0.0])
        >>> lw.Scene.named("remus_100", start=start).start.velocity
        array([1.5, 0. , 0. ])
    """

    position: Any = array(None, shape=(3,), unit="m")
    attitude: Any = array(None, shape=(3, 3), unit="1")
    rotation_vector: Any = array(None, shape=(3,), unit="rad")
    quaternion_wxyz: Any = array(None, shape=(4,), unit="1")
    euler_deg: Any = array(None, shape=(3,), unit="deg")
    velocity: Any = array(None, shape=(3,), unit="m/s")
    velocity_inertial: Any = array(None, shape=(3,), unit="m/s")
    angular_velocity: Any = array(None, shape=(3,), unit="rad/s")
    geodetic: Any = array(None, shape=(3,), unit=PLACE_UNIT)
    # Position of `geodetic`, which the scene tells.
    converted: ClassVar[Any] = None

    def __post_init__(self) -> None:
        faults = Faults("start.")
        for names in (PLACES, ATTITUDES, VELOCITIES):
            chosen = [name for name in names if getattr(self, name) is not None]
            if len(chosen) > 1:
                faults.add(" and ".join(chosen), "...", "say the same thing twice", "keep one of them")
        for name, value in read(self, faults).items():
            object.__setattr__(self, name, value)
        R, q = self.attitude, self.quaternion_wxyz
        if R is not None and not notation.rotations(R):
            fault = "is not a rotation (R^T R = I, det R = 1, to 1e-9)"
            faults.add("attitude", R, fault, "give more digits, or quaternion_wxyz")
        if q is not None and not np.any(q):
            faults.add("quaternion_wxyz", q, "is zero", "give a quaternion that is not")
        faults.raise_if_any()

    def given(self) -> dict[str, np.ndarray]:
        """Return the start as the user gave it, completed with zeros.

        Returns:
            Values by name: position (3,) [m], attitude in one form, one velocity (3,) [m/s], angular_velocity (3,) [rad/s].
        """
        chosen = {name: getattr(self, name) for name in NAMES if getattr(self, name) is not None}
        if (place := chosen.pop("geodetic", None)) is not None:
            if self.converted is None:
                raise refusal("start.geodetic", place, "needs a scene", "give the start to a scene with an origin")
            chosen = {"position": self.converted} | chosen
        alternatives = {"rotation_vector": ATTITUDES, "velocity": VELOCITIES}
        for name in ("position", "rotation_vector", "velocity", "angular_velocity"):
            if chosen.keys().isdisjoint(alternatives.get(name, (name,))):
                chosen[name] = np.zeros(TABLE[name].shape)
        return chosen

    def with_fields(self, fields: Mapping[str, Any]) -> Start:
        """Return the start with other values; a new value replaces equivalent ones, such as an attitude in another form.

        Args:
            fields: Values by name.

        Returns:
            A new start.
        """
        faults = Faults()
        faults.keys("start", fields, [item.name for item in dataclasses.fields(self) if item.init])
        faults.raise_if_any()
        alike = {name for names in (PLACES, ATTITUDES, VELOCITIES) if fields.keys() & set(names) for name in names}
        return replace(self, **(dict.fromkeys(alike) | dict(fields)))

    def located(self, environment: Environment) -> Start:
        """Convert the geodetic coordinates, if given, to a position.

        Args:
            environment: The environment of the scene.

        Returns:
            The start with its position: a copy, or this object if it has no geodetic coordinates.

        Raises:
            SceneError: If the environment has no origin, or a latitude is beyond 90 degrees.
        """
        if self.geodetic is None:
            return self
        start = copy.copy(self)
        object.__setattr__(start, "converted", positions_of(environment, "start.geodetic", self.geodetic))
        return start

    def to_dict(self) -> dict[str, Any]:
        """Return the section [start] of a scene file.

        Returns:
            The values that the user gave, by name, as lists.
        """
        return {name: getattr(self, name).tolist() for name in NAMES if getattr(self, name) is not None}


def resolve_attitude(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """R (n, 3, 3), body to inertial, from start values {name: (n, ...)} with an attitude in any form."""
    if "attitude" in values:
        return np.asarray(values["attitude"])
    if "quaternion_wxyz" in values:
        return notation.matrix_from_quaternion(values["quaternion_wxyz"])
    if "euler_deg" in values:
        return notation.matrix_from_euler_deg(values["euler_deg"])
    return notation.matrix_from_rotation_vector(values["rotation_vector"])
