"""The parts of a controller of one vehicle, in the user's body axes and about his origin: what each does at a look."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.reference.rotation import Array


@dataclass(frozen=True)
class Measurement:
    """What is taken for the motion at a look: the truth, until a sensor changes it.

    position (3,) [m] inertial; R (3, 3) body to inertial; velocity over ground, water_velocity through water (3,) [m/s] and
    angular_velocity (3,) [rad/s], body axes; t, period, h [s]; step and look, numbers of the step that begins and of the look;
    member.
    """

    position: Array
    R: Array
    velocity: Array
    water_velocity: Array
    angular_velocity: Array
    t: float = 0.0
    period: float = 0.0
    h: float = 0.0
    step: int = 0
    look: int = 0
    member: int = 0


@dataclass(frozen=True)
class Reference:
    """The wanted motion: position [m], velocity [m/s], inertial; R; angular_velocity [rad/s] in the axes of R; speed [m/s]."""

    position: Array
    velocity: Array
    R: Array
    angular_velocity: Array
    speed: float


NO_WISH = Reference(np.zeros(3), np.zeros(3), np.eye(3), np.zeros(3), 0.0)


class Part:
    """A part that does nothing; each overrides its role. Its numbers have the names and units of the part in lgvi_warp.

    It remembers in attributes of its own, which `begin` sets.
    """

    def __init__(self, **numbers: Any) -> None:
        vars(self).update(numbers)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"{type(self).__name__} has no number {name!r}")

    def begin(self) -> None:
        """Forget everything, before the first look."""

    def measure(self, y: Measurement) -> Measurement:
        """The measurement as a sensor or an estimator changes it."""
        return y

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """The wanted motion as a guidance changes it."""
        return r

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """The demand w (6,) = (X, Y, Z, K, M, N) plus that of a law; unmet (6,): what the last look did not deliver."""
        return w

    def allocate(self, w: Array, actuators: dict[str, Any]) -> Array:
        """Sets `command` of an actuator; returns what is left of the demand."""
        return w


def heading_error(wanted: Array, measured: Array) -> float:
    """The heading of one attitude (3, 3) less that of another [rad], in [-pi, pi], from their forward axes."""
    s, c = wanted[:2, 0], measured[:2, 0]
    return float(np.arctan2(s[1] * c[0] - s[0] * c[1], s @ c))


def cannot(reached: Array) -> Array:
    """The projector (6, 6) onto the demands that actuators cannot make, without round-off.

    Args:
        reached: Projector (6, 6) onto those that they can.
    """
    others = np.eye(6) - reached
    return np.where(np.abs(others) < 1e-12, 0.0, others)


class Integral:
    """The integral of an error, which waits while the actuators deliver no more (conditional integration)."""

    def __init__(self) -> None:
        self.value, self.error = 0.0, 0.0

    def at_look(self, period: float, limit: float, unmet: float, conditional: bool) -> float:
        """I + T e within +-limit, unless more of the demand would go where some of it was not delivered.

        Args:
            period, limit: Time between looks T [s]; largest size of I.
            unmet, conditional: What was not delivered at the last look; whether it counts.
        """
        if not (conditional and unmet * self.error > 0.0):
            self.value = float(np.clip(self.value + period * self.error, -limit, limit))
        return self.value
