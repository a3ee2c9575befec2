# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 under the depth and heading autopilots of another simulator, written afresh from its equations.

The simulator: T. I. Fossen, Python Vehicle Simulator (github.com/cybergalactic/PythonVehicleSimulator), remus100.py as of May
2025, with control.py, guidance.py and gnc.py; the equations: Fossen 2021, Handbook of Marine Craft Hydrodynamics and Motion
Control. Axes: x ahead, y to starboard, z down; the origin is the centre of buoyancy. Euler angles roll, pitch, yaw.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray

GRAVITY, DENSITY = 9.81, 1026.0
LENGTH, DIAMETER = 1.6, 0.19
CENTER = np.array([0.0, 0.0, 0.02])  # of gravity
SAMPLE = 0.02  # s: its step, and the time between two ticks of its autopilots


def hat(a: Array) -> Array:
    """The matrix of a x."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


# A neutral spheroid: mass, inertia about the centre of gravity, and Lamb's factors of added mass (Fossen 2021, 8.4.2).
_a, _b = 0.5 * LENGTH, 0.5 * DIAMETER
MASS = 4.0 / 3.0 * np.pi * DENSITY * _a * _b**2
WEIGHT = MASS * GRAVITY
_Ix, _Iy = 0.4 * MASS * _b**2, 0.2 * MASS * (_a**2 + _b**2)
_shift = np.block([[np.eye(3), -hat(CENTER)], [np.zeros((3, 3)), np.eye(3)]])
RIGID = _shift.T @ np.diag([MASS, MASS, MASS, _Ix, _Iy, _Iy]) @ _shift
_e = np.sqrt(1.0 - (_b / _a) ** 2)
_log = np.log((1.0 + _e) / (1.0 - _e))
_alpha = 2.0 * (1.0 - _e**2) / _e**3 * (0.5 * _log - _e)
_beta = 1.0 / _e**2 - (1.0 - _e**2) / (2.0 * _e**3) * _log
_turning = _e**4 * (_beta - _alpha) / ((2.0 - _e**2) * (2.0 * _e**2 - (2.0 - _e**2) * (_beta - _alpha)))
_ahead, _across = _alpha / (2.0 - _alpha) * MASS, _beta / (2.0 - _beta) * MASS
ADDED = np.diag([_ahead, _across, _across, 0.3 * _Ix, _turning * _Iy, _turning * _Iy])
INERTIA = RIGID + ADDED

# Linear damping, as rates of decay: those of surge and sway fade with the speed as e^(-3 U).
_sizes, _stiff = np.diag(INERTIA), WEIGHT * CENTER[2]
LINEAR = _sizes / np.array([20.0, 20.0, 20.0, np.inf, np.inf, 1.0])
LINEAR[3:5] = 2.0 * np.array([0.3, 0.8]) * np.sqrt(_stiff * _sizes[3:5])
FADING = 3.0  # s/m

# Lift and drag of the hull as of a wing (Beard & McLain 2012): area, drag without lift, slope of lift, induced drag.
AREA = 0.7 * LENGTH * DIAMETER
DRAG = 0.42 * np.pi * _b**2 / AREA
_aspect = DIAMETER**2 / AREA
SLOPE = np.pi * _aspect / (1.0 + np.sqrt(1.0 + (0.5 * _aspect) ** 2))
INDUCED = SLOPE**2 / (np.pi * 0.7 * _aspect)

# Cross flow over 21 strips; the coefficient is Hoerner's where the beam is the draught, between two entries of his table.
STRIPS = np.linspace(-_a, _a, 21)
CROSS = 0.5 * DENSITY * DIAMETER * np.interp(0.5, [0.4933, 0.5585], [1.2108, 1.0836]) * LENGTH / 20.0

# Fins at the stern: rho / 2 A C of rudder and planes; propeller: thrust and torque, straight lines of the advance number.
FIN_PLACE, FIN_LIMIT, FIN_LAG = -_a, np.radians(15.0), 0.1
RUDDER, PLANES = 0.5 * DENSITY * 2.0 * 0.00665 * np.array([0.5, 0.7])
_prop, _most = 0.14, 0.6632
THRUST = 0.9 * DENSITY * _prop**4 * 0.4566
THRUST_LOSS = 0.9 * DENSITY * _prop**3 * (0.4566 - 0.1798) / _most * 0.944
TORQUE = 0.1 * DENSITY * _prop**5 * 0.0700
TORQUE_LOSS = 0.1 * DENSITY * _prop**4 * (0.0700 - 0.0312) / _most * 0.944
REVOLUTIONS, PROPELLER_LAG = 1525.0 / 60.0, 1.0


@dataclass(frozen=True)
class Choices:
    """Options of the loop; defaults are the simulator's.

    parts: steps in a period of the autopilots. method: "euler", its forward Euler, which turns and moves with the new
    velocities; or "rk4", with fins and propeller exactly after their commands. model: reference model of the heading, by
    "euler", as it does, or "exact" over a period. level: whether the current has no part along the body's z axis whatever the
    pitch, as it says; if not, the current is one vector of inertial axes.
    """

    parts: int = 1
    method: str = "euler"
    model: str = "euler"
    level: bool = True


def rotation(angles: Array) -> Array:
    """Body to inertial axes."""
    (a, b, c), (A, B, C) = np.sin(angles), np.cos(angles)
    return np.array([
        [C * B, C * b * a - c * A, C * b * A + c * a],
        [c * B, c * b * a + C * A, c * b * A - C * a],
        [-b, B * a, B * A],
    ])  # fmt: skip


def angle_rates(angles: Array, rates: Array) -> Array:
    """Rates of roll, pitch and yaw."""
    (a, b, _), (A, B, _) = np.sin(angles), np.cos(angles)
    p, q, r = rates
    return np.array([p + (q * a + r * A) * b / B, q * A - r * a, (q * a + r * A) / B])


def wrench(nu: Array, speed: float, rudder: float, planes: float, n: float) -> Array:
    """Damping, lift, fins and propeller: the force and moment of a twist nu through the water.

    speed: over ground [m/s], at which the propeller advances; rudder, planes [rad]; n: revolutions [1/s], ahead.
    """
    u, v, w, _, _, r = nu
    through = np.linalg.norm(nu[:3])
    fade = np.exp(-FADING * through)
    force = -LINEAR * np.array([fade, fade, 1.0, 1.0, 1.0, 1.0]) * nu
    angle = np.arctan2(w, u)
    pressure = 0.5 * DENSITY * AREA * through**2
    drag, lift = pressure * (DRAG + INDUCED * angle**2), pressure * SLOPE * angle
    force[0] += np.sin(angle) * lift - np.cos(angle) * drag
    force[2] -= np.cos(angle) * lift + np.sin(angle) * drag
    strips = np.abs(v + STRIPS * r) * (v + STRIPS * r)
    force[1] -= CROSS * np.sum(strips)
    force[5] -= CROSS * np.sum(STRIPS * strips)
    side, rise = -RUDDER * (u * u + v * v) * rudder, -PLANES * (u * u + w * w) * planes
    force += [side * rudder + rise * planes, side, rise, 0.0, -FIN_PLACE * rise, FIN_PLACE * side]
    force[0] += THRUST * n * n - THRUST_LOSS * n * speed
    force[3] += TORQUE * n * n - TORQUE_LOSS * n * speed
    return force


def coriolis(nu: Array) -> Array:
    """C(nu) nu: of the rigid body in full; of added mass without the moments of Munk, and without what they answer."""
    linear, angular = np.split(RIGID @ nu, 2)
    velocity, rate = np.split(nu, 2)
    a, turning = np.split(ADDED @ nu, 2)
    force = np.cross(rate, linear) + rate[0] * np.array([0.0, -a[2], a[1]])
    moment = np.cross(velocity, linear) + np.cross(rate, angular) + np.cross(rate, turning)
    moment[0] += velocity[1] * a[2] - velocity[2] * a[1]
    return np.concatenate([force, moment])


@dataclass(frozen=True)
class Sea:
    """A current of a speed [m/s] towards a direction [rad]."""

    speed: float = 0.0
    direction: float = 0.0

    @property
    def velocity(self) -> Array:
        """In inertial axes."""
        return self.speed * np.array([np.cos(self.direction), np.sin(self.direction), 0.0])

    def twist(self, angles: Array, level: bool) -> Array:
        """In body axes; as the simulator has it, those of the yaw alone."""
        turned = np.array([0.0, 0.0, angles[2]]) if level else angles
        return np.concatenate([rotation(turned).T @ self.velocity, np.zeros(3)])


def acceleration(angles: Array, nu: Array, actual: Array, sea: Sea, level: bool) -> Array:
    """The rate of the twist over ground. actual: rudder, planes, revolutions."""
    current = sea.twist(angles, level)
    relative = nu - current
    # The current as seen from a body that turns; from one that yaws, where it is taken to be level.
    turning = np.array([0.0, 0.0, nu[5]]) if level else nu[3:]
    apparent = np.concatenate([-np.cross(turning, current[:3]), np.zeros(3)])
    down = rotation(angles)[2]
    force = wrench(relative, np.linalg.norm(nu[:3]), *actual) - coriolis(relative)
    force[3:] += np.cross(CENTER, WEIGHT * down)
    return apparent + np.linalg.solve(INERTIA, force)


class Autopilots:
    """Depth by PI and pitch by PID; heading by integral sliding mode after a reference model (Fossen 2021, 16.479)."""

    def __init__(self, depth: float, heading: float, model: str) -> None:
        self.depth, self.heading, self.model = depth, heading, model
        self.filtered = self.depth_sum = self.pitch_sum = self.heading_sum = 0.0
        self.wanted = np.zeros(3)

    def look(self, position: Array, angles: Array, nu: Array) -> Array:
        """Commands of rudder and planes [rad]; then what is remembered goes on by a period."""
        keep = np.exp(-SAMPLE * 0.02)
        self.filtered = keep * self.filtered + (1.0 - keep) * self.depth
        deep = position[2] - self.filtered
        climb = angles[1] - 0.1 * (deep + self.depth_sum / 100.0)
        planes = 5.0 * shortest(climb) + 2.0 * nu[4] + 0.3 * self.pitch_sum + 5.0 * nu[2]
        self.depth_sum += SAMPLE * deep
        self.pitch_sum += SAMPLE * shortest(climb)
        error, rate, slow = shortest(angles[2] - self.wanted[0]), nu[5] - self.wanted[1], 0.1
        sigma = rate + 2.0 * slow * error + slow**2 * self.heading_sum
        wanted_rate = nu[5] - sigma
        change = self.wanted[2] - 2.0 * slow * rate - slow**2 * error
        rudder = (change + wanted_rate - 0.5 * sigma - 0.05 * np.clip(sigma / 0.1, -1.0, 1.0)) / 0.25
        self.heading_sum += SAMPLE * error
        self.wanted = self.led()
        return np.array([rudder, planes])

    def led(self) -> Array:
        """The wanted heading, its rate and acceleration a period later."""
        omega, gap = 0.1, np.array([self.wanted[0] - self.heading, *self.wanted[1:]])
        A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(omega**3), -3.0 * omega**2, -3.0 * omega]])
        if self.model == "exact":
            # A has the triple eigenvalue -omega.
            N = SAMPLE * (A + omega * np.eye(3))
            gap = np.exp(-omega * SAMPLE) * (np.eye(3) + N + 0.5 * N @ N) @ gap
        else:
            gap = gap + SAMPLE * A @ gap
        limit = np.radians(5.0)
        return np.array([self.heading + gap[0], np.clip(gap[1], -limit, limit), gap[2]])


def shortest(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def euler_step(state: list[Array], commands: Array, sea: Sea, level: bool, h: float) -> list[Array]:
    """The simulator's step: velocities and actuators first, then place and angles by the new velocities."""
    position, angles, nu, actual = state
    limit = np.array([FIN_LIMIT, FIN_LIMIT, REVOLUTIONS])
    actual = np.clip(actual, -limit, limit)
    nu = nu + h * acceleration(angles, nu, actual, sea, level)
    actual = actual + h * (commands - actual) / [FIN_LAG, FIN_LAG, PROPELLER_LAG]
    return [position + h * rotation(angles) @ nu[:3], angles + h * angle_rates(angles, nu[3:]), nu, actual]


def exact_actuators(actual: Array, commands: Array, length: float) -> Array:
    """Rudder, planes and revolutions a while later, under held commands: each stops at its limit."""
    limit = np.array([FIN_LIMIT, FIN_LIMIT, REVOLUTIONS])
    decay = np.exp(-length / np.array([FIN_LAG, FIN_LAG, PROPELLER_LAG]))
    return np.asarray(np.clip(commands + decay * (actual - commands), -limit, limit))


def rk4_step(state: list[Array], commands: Array, sea: Sea, level: bool, h: float) -> list[Array]:
    """The classical step of order 4, with actuators exact at its stages."""
    y, actual = state[:3], state[3]

    def rates(c: float, k: Any) -> Any:
        _, angles, nu = y if k is None else [a + c * h * b for a, b in zip(y, k, strict=True)]
        moved = exact_actuators(actual, commands, c * h)
        turned = rotation(angles) @ nu[:3], angle_rates(angles, nu[3:])
        return *turned, acceleration(angles, nu, moved, sea, level)

    k1 = rates(0.0, None)
    k2 = rates(0.5, k1)
    k3 = rates(0.5, k2)
    k4 = rates(1.0, k3)
    ends = [a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(y, k1, k2, k3, k4, strict=True)]
    return [*ends, exact_actuators(actual, commands, h)]


def simulate(depth: float, heading: float, time: float, sea: Sea, choices: Choices) -> tuple[Array, Array]:
    """The loop from rest.

    Args:
        depth, heading: what is wanted [m], [rad].
        time, sea, choices: how long [s], in which current, how.

    Returns:
        Positions (k, 3) [m] and angles (k, 3) [rad] at the ticks and at the end.
    """
    pilots = Autopilots(depth, heading, choices.model)
    step = {"euler": euler_step, "rk4": rk4_step}[choices.method]
    state, ticks = [np.zeros(3), np.zeros(3), np.zeros(6), np.zeros(3)], []
    for _ in range(round(time / SAMPLE)):
        ticks.append(state[:2])
        commands = np.array([*pilots.look(*state[:3]), REVOLUTIONS])
        for _ in range(choices.parts):
            state = step(state, commands, sea, choices.level, SAMPLE / choices.parts)
    ticks.append(state[:2])
    return np.array([x[0] for x in ticks]), np.array([x[1] for x in ticks])
