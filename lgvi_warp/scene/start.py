# SPDX-License-Identifier: Apache-2.0
"""The environment of a scene and the state that its members start from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.declared import array, positive, read, real
from lgvi_warp.common.errors import Faults
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import TABLE

ATTITUDES = ("attitude", "rotation_vector", "quaternion_wxyz", "euler_deg")
VELOCITIES = ("velocity", "velocity_inertial")
# In the order of a scene file.
NAMES = ("position", *ATTITUDES, *VELOCITIES, "angular_velocity")


@dataclass(frozen=True)
class Environment:
    """Gravity and density of the water around the vehicle.

    Args:
        gravity: Acceleration of free fall [m/s2], >= 0; by default 9.80665 (standard gravity).
        water_density: Density of the water [kg/m3], > 0; by default 1025 (sea water).

    Raises:
        SceneError: If a number is negative or not finite; the message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.Environment(water_density=1000.0)
        Environment(gravity=9.80665, water_density=1000.0)
    """

    gravity: float = real(9.80665, unit="m/s2", least=0.0)
    water_density: float = positive(1025.0, unit="kg/m3")

    def __post_init__(self) -> None:
        faults = Faults("environment.")
        read(self, faults)
        faults.raise_if_any()

    def to_dict(self) -> dict[str, float]:
        """Return the section [environment] of a scene file.

        Returns:
            gravity [m/s2] and water_density [kg/m3], by name.
        """
        return {"gravity": float(self.gravity), "water_density": float(self.water_density)}


@dataclass(frozen=True, eq=False)
class Start:
    """The state at t = 0.

    Whatever is None (default) is zero, or no rotation. At most one of the four attitudes and one of the two velocities
    may be given.

    Args:
        position: Position of the body origin (3,) [m], inertial axes (north, east, down).
        attitude: Rotation matrix (3, 3), body to inertial.
        rotation_vector: Axis times angle (3,) [rad], body to inertial.
        quaternion_wxyz: Quaternion (4,), scalar first, body to inertial, of any length but 0.
        euler_deg: Roll, pitch, yaw (3,) [deg].
        velocity: Velocity of the body origin (3,) [m/s], body axes.
        velocity_inertial: Velocity of the body origin (3,) [m/s], inertial axes.
        angular_velocity: Angular velocity (3,) [rad/s], body axes.

    Raises:
        SceneError: If anything is wrong; the message lists every fault.

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

    def __post_init__(self) -> None:
        faults = Faults("start.")
        for names in (ATTITUDES, VELOCITIES):
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
            Values by name: position (3,) [m], one attitude, one velocity (3,) [m/s] and angular_velocity (3,) [rad/s].
        """
        chosen = {name: getattr(self, name) for name in NAMES if getattr(self, name) is not None}
        alternatives = {"rotation_vector": ATTITUDES, "velocity": VELOCITIES}
        for name in ("position", "rotation_vector", "velocity", "angular_velocity"):
            if chosen.keys().isdisjoint(alternatives.get(name, (name,))):
                chosen[name] = np.zeros(TABLE[name].shape)
        return chosen

    def with_fields(self, fields: Mapping[str, Any]) -> Start:
        """Return the start with other values, which take the place of those that say the same thing.

        Args:
            fields: Values by name.

        Returns:
            A new start.
        """
        alike = {name for names in (ATTITUDES, VELOCITIES) if fields.keys() & set(names) for name in names}
        return replace(self, **(dict.fromkeys(alike) | dict(fields)))

    def to_dict(self) -> dict[str, Any]:
        """Return the section [start] of a scene file.

        Returns:
            The values that the user gave, by name, as lists.
        """
        return {name: getattr(self, name).tolist() for name in NAMES if getattr(self, name) is not None}


def resolve_attitude(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """R (n, 3, 3), body to inertial, from start values (n, ...) by name, of which one is an attitude in any form."""
    if "attitude" in values:
        return np.asarray(values["attitude"])
    if "quaternion_wxyz" in values:
        return notation.matrix_from_quaternion(values["quaternion_wxyz"])
    if "euler_deg" in values:
        return notation.matrix_from_euler_deg(values["euler_deg"])
    return notation.matrix_from_rotation_vector(values["rotation_vector"])
