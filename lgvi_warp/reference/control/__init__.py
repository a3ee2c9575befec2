# SPDX-License-Identifier: Apache-2.0
"""The parts of a controller of one vehicle, in the user's body axes and about the user's origin."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.reference.rotation import Array


@dataclass(frozen=True)
class Measurement:
    """Motion as measured at a tick: equal to the truth unless a sensor changes it.

    position (3,) [m] inertial; R (3, 3) body to inertial; velocity over ground, water_velocity through water (3,) [m/s]
    and angular_velocity (3,) [rad/s], body axes; t, period, h [s]; step and tick: index of the next step, and of the
    tick; member.
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
    tick: int = 0
    member: int = 0


@dataclass(frozen=True)
class Reference:
    """The reference motion: position [m] and velocity [m/s], inertial; R; speed [m/s].

    angular_velocity [rad/s] and angular_acceleration [rad/s^2] in the axes of R.
    """

    position: Array
    velocity: Array
    R: Array
    angular_velocity: Array
    speed: float
    angular_acceleration: Array = field(default_factory=lambda: np.zeros(3))


NO_WISH = Reference(np.zeros(3), np.zeros(3), np.eye(3), np.zeros(3), 0.0)


class Part:
    """Base class of parts, which does nothing. A subclass overrides its role; its numbers are as in lgvi_warp.

    Its memory is in attributes, which `begin` sets.
    """

    def __init__(self, **numbers: Any) -> None:
        vars(self).update(numbers)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"{type(self).__name__} has no number {name!r}")

    # How many ticks it looks ahead.
    ahead = 0

    def begin(self) -> None:
        """Reset the memory, before the first tick."""

    def measure(self, y: Measurement) -> Measurement:
        """Change the measurement, as a sensor or an estimator."""
        return y

    def guide(self, r: Reference, y: Measurement) -> Reference:
        """Change the reference motion, as a guidance."""
        return r

    def control(self, w: Array, r: Reference, y: Measurement, unmet: Array) -> Array:
        """Add the demand of this law to w (6,) [N, N m] of earlier laws; unmet (6,): undelivered part of the last one."""
        return w

    def allocate(self, w: Array, actuators: dict[str, Any]) -> Array:
        """Set `command` of an actuator; return the remaining demand."""
        return w


def upright(heading: float) -> Array:
    """Attitude (3, 3) with a heading [rad], without roll and pitch."""
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def heading_error(wanted: Array, measured: Array) -> float:
    """Heading of one attitude (3, 3) minus that of another [rad], in [-pi, pi], from their forward axes."""
    s, c = wanted[:2, 0], measured[:2, 0]
    return float(np.arctan2(s[1] * c[0] - s[0] * c[1], s @ c))


def attitude_error(wanted: Array, measured: Array) -> Array:
    """e_R = vee(R_d^T R - R^T R_d) / 2 (3,), in the axes of the measured attitude R; R_d: reference attitude."""
    skew = wanted.T @ measured - measured.T @ wanted
    return 0.5 * np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def pose_errors(r: Reference, y: Measurement) -> tuple[Array, Array, Array, Array]:
    """e_b = b_d - b, inertial axes; e_R; R^T v_d - nu and R^T R_d Omega_d - Omega, body axes."""
    rate = y.R.T @ r.R @ r.angular_velocity - y.angular_velocity
    return r.position - y.position, attitude_error(r.R, y.R), y.R.T @ r.velocity - y.velocity, rate


def unhindered(error: Array, unmet: Array, conditional: bool) -> Array:
    """An error (3,) without the entries that would increase a demand that is not delivered already (`unmet`, (3,))."""
    return np.where(conditional & (unmet * error > 0.0), 0.0, error)


class PoseIntegrals:
    """Integrals I of e_b, inertial axes, and I_R of e_R, body axes, for a law of the pose; they stop in body axes."""

    def __init__(self) -> None:
        zero: Array = np.zeros(3)
        self.I, self.I_R, self.e, self.e_R = zero, zero, zero, zero

    def at_tick(self, law: Any, y: Measurement, unmet: Array, e: Array, e_R: Array) -> tuple[Array, Array]:
        """I and I_R at this tick, from the errors of the last tick; the errors of this tick are stored.

        law: integral_limit (2,) and anti_windup.
        y, unmet, e, e_R: measurement; undelivered part of the last demand (6,); errors of this tick.
        """
        conditional = law.anti_windup == "conditional"
        error = y.R @ unhindered(y.R.T @ self.e, unmet[:3], conditional)
        error_R = unhindered(self.e_R, -unmet[3:], conditional)
        limit, limit_R = law.integral_limit
        self.I = np.clip(self.I + y.period * error, -limit, limit)
        self.I_R = np.clip(self.I_R + y.period * error_R, -limit_R, limit_R)
        self.e, self.e_R = e, e_R
        return self.I, self.I_R


def balance(law: Any, y: Measurement) -> Array:
    """The wrench (6,) that balances weight and buoyancy of the nominal vehicle, if the law's feedforward is "restoring".

    law: feedforward; weight and buoyancy [N], center_of_mass and center_of_buoyancy (3,) [m] of the nominal vehicle.
    """
    if law.feedforward != "restoring":
        return np.zeros(6)
    down = y.R[2]
    moment = np.cross(law.center_of_mass, law.weight * down) - np.cross(law.center_of_buoyancy, law.buoyancy * down)
    return -np.concatenate([(law.weight - law.buoyancy) * down, moment])


def cannot(reached: Array) -> Array:
    """Projector (6, 6) onto demands beyond the actuators, from the projector onto the others, without round-off."""
    others = np.eye(6) - reached
    return np.where(np.abs(others) < 1e-12, 0.0, others)


class Integral:
    """Integral of an error that stops while the actuators deliver no more (conditional integration)."""

    def __init__(self) -> None:
        self.value, self.error = 0.0, 0.0

    def at_tick(self, period: float, limit: float, unmet: float, conditional: bool) -> float:
        """I + T e within +-limit, unless this increases a demand that was not delivered.

        docs/theory/control_loop.md, (C8).

        period, limit: time T between ticks [s]; largest |I|.
        """
        if not (conditional and unmet * self.error > 0.0):
            self.value = float(np.clip(self.value + period * self.error, -limit, limit))
        return self.value
