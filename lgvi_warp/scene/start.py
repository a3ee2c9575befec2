"""To be said in one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics import notation

ATTITUDES = ("attitude", "rotation_vector", "quaternion_wxyz", "euler_deg")


VELOCITIES = ("velocity", "velocity_inertial")


SHAPES = {
    "position": (3,),
    "attitude": (3, 3),
    "rotation_vector": (3,),
    "quaternion_wxyz": (4,),
    "euler_deg": (3,),
    "velocity": (3,),
    "velocity_inertial": (3,),
    "angular_velocity": (3,),
}


UNITS = {"position": "m", "rotation_vector": "rad", "euler_deg": "deg", "velocity": "m/s", "velocity_inertial": "m/s",
         "angular_velocity": "rad/s"}  # fmt: skip


@dataclass(frozen=True)
class Environment:
    """gravity [m/s2] (may be 0), water_density [kg/m3]. Raises SceneError for what is negative or not finite."""

    gravity: float = 9.80665
    water_density: float = 1025.0

    def __post_init__(self) -> None:
        faults = Faults("environment.")
        faults.number("gravity", self.gravity, "m/s2", least=0.0)
        faults.positive("water_density", self.water_density, "kg/m3")
        faults.raise_if_any()

    def to_dict(self) -> dict[str, float]:
        """As in a scene file."""
        return {"gravity": float(self.gravity), "water_density": float(self.water_density)}


@dataclass(frozen=True, eq=False)
class Start:
    """The state at t = 0. What is left out is zero, or no rotation.

    position (3,) [m], inertial (north, east, down). Attitude, body to inertial, in one of four ways: attitude (3, 3),
    rotation_vector (3,) [rad], quaternion_wxyz (4,) (any length), euler_deg (roll, pitch, yaw) [deg]. Velocity in one
    of two: velocity (3,) [m/s, body axes] or velocity_inertial (3,) [m/s]. angular_velocity (3,) [rad/s, body axes].

    Raises SceneError naming every fault.
    """

    position: Any = None
    attitude: Any = None
    rotation_vector: Any = None
    quaternion_wxyz: Any = None
    euler_deg: Any = None
    velocity: Any = None
    velocity_inertial: Any = None
    angular_velocity: Any = None

    def __post_init__(self) -> None:
        faults = Faults("start.")
        for names in (ATTITUDES, VELOCITIES):
            given = [name for name in names if getattr(self, name) is not None]
            if len(given) > 1:
                faults.add(" and ".join(given), "...", "say the same thing twice", "keep one of them")
        for name, shape in SHAPES.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, faults.finite(name, value, shape, UNITS.get(name, "")))
        self._check_attitude(faults)
        faults.raise_if_any()

    def _check_attitude(self, faults: Faults) -> None:
        R, q = self.attitude, self.quaternion_wxyz
        if R is not None and not notation.rotations(R):
            faults.add(
                "attitude",
                R,
                "is not a rotation (R^T R = I, det R = 1, to 1e-9)",
                "give more digits, or quaternion_wxyz",
            )
        if q is not None and not np.any(q):
            faults.add("quaternion_wxyz", q, "is zero", "give a quaternion that is not")

    def given(self) -> dict[str, np.ndarray]:
        """What the user gave, and zeros for the rest: position, one attitude, one velocity, angular_velocity."""
        chosen = {name: getattr(self, name) for name in SHAPES if getattr(self, name) is not None}
        for names in (("position",), ATTITUDES[1:], VELOCITIES, ("angular_velocity",)):
            alternatives = ATTITUDES if names == ATTITUDES[1:] else names
            if not any(name in chosen for name in alternatives):
                chosen[names[0]] = np.zeros(SHAPES[names[0]])
        return chosen

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file: what was given."""
        return {name: getattr(self, name).tolist() for name in SHAPES if getattr(self, name) is not None}


def resolve_attitude(values: Mapping[str, np.ndarray]) -> np.ndarray:
    """R (n, 3, 3), body to inertial, from whichever way the attitude was given, each (n, ...)."""
    if "attitude" in values:
        return np.asarray(values["attitude"])
    if "quaternion_wxyz" in values:
        return notation.matrix_from_quaternion(values["quaternion_wxyz"])
    if "euler_deg" in values:
        return notation.matrix_from_euler_deg(values["euler_deg"])
    return notation.matrix_from_rotation_vector(values["rotation_vector"])
