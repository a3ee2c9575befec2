# SPDX-License-Identifier: Apache-2.0
"""The problems that peers solve, many members from 0 to t1: the vehicle of Nordkvist & Sanyal (2010), and driven ones.

R' = R hat(Om), b' = R nu, M nu' = M nu x Om + net z, J Om' = J Om x Om + M nu x nu - d x z with z = R^T e3 and d = B r.
The state of the peers without a rotation of their own is 13 numbers: b, a unit quaternion (scalar first, body to
inertial), nu, Om. `make_rates` writes its equations once, for any numbers: arrays, JAX's, heyoka's, numba's tuples; those
of driven, damped vehicles are in equations.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.peers import equations
from benchmarks.peers.body import Body, body_of
from benchmarks.peers.plot import DRIVEN
from lgvi_warp.measuring import speed
from lgvi_warp.physics import notation
from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.sampling.distributions.basic import Normal
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import Environment

SIZE = 13
GRAVITY = 9.8
# How the driven vehicles start.
VELOCITIES = {"remus_100": (1.54, 0.1, 0.05), "bluerov2_heavy": (0.5, 0.1, 0.05)}
ANGULAR_VELOCITY, POSITION = (0.02, 0.01, 0.03), (0.0, 0.0, 10.0)
# Steps a second by the order of a method. Rates stand between those that double: an error between two settings is the
# time of the finer one, or nearly so, and each peer's steps that just keep it are among them.
RATES = {
    4: (1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 64, 128, 256, 512),
    5: (1, 1.5, 2, 3, 4, 5, 6, 8, 12, 16, 24, 32, 64, 128, 256),
    8: (0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 32),
}
# Where |v| v is not smooth, and drag is stiff.
DRIVEN_RATES = {
    4: (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 256, 512),
    5: (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128, 256),
    8: (2, 3, 4, 6, 8, 12, 16, 24, 32, 64, 128, 256),
}


@dataclass(frozen=True, eq=False)
class Problem:
    """A body and its members' start.

    name: "vehicle", or "rigid" for the vehicle without added mass and without restoring moment, which engines for
    rigid bodies can do, or one of DRIVEN. ensemble: the same as lgvi_warp takes it.
    """

    name: str
    ensemble: Ensemble
    body: Body
    t1: float
    b: np.ndarray
    R: np.ndarray
    nu: np.ndarray
    Om: np.ndarray

    @property
    def members(self) -> int:
        """Number of members."""
        return len(self.b)

    @property
    def driven(self) -> bool:
        """Whether there are forces other than weight, buoyancy and restoring moment."""
        return self.name in DRIVEN

    @property
    def M(self) -> np.ndarray:
        """The diagonal of the mass (3,) [kg]."""
        return np.diag(self.body.mass_matrix)[:3]

    @property
    def J(self) -> np.ndarray:
        """The diagonal of the inertia (3,) [kg m2]."""
        return np.diag(self.body.mass_matrix)[3:]

    @property
    def net(self) -> float:
        """Weight - buoyancy [N]."""
        return self.body.net

    @property
    def d(self) -> np.ndarray:
        """Buoyancy times its lever (3,) [N m]."""
        return self.body.moment

    def rates(self, order: int) -> tuple[float, ...]:
        """Steps a second for a method of this order."""
        return (DRIVEN_RATES if self.driven else RATES)[order]

    def steps(self, rate: float) -> tuple[float, int]:
        """The step [s] and how many, of a rate [1/s] or a little beside it where steps end elsewhere than at t1."""
        count = max(1, round(self.t1 * rate))
        return self.t1 / count, count

    def state(self) -> np.ndarray:
        """The start as (members, 13)."""
        return np.concatenate([self.b, notation.quaternion_from_matrix(self.R), self.nu, self.Om], axis=1)

    def matrix_state(self) -> np.ndarray:
        """The start as (members, 18): b, the rows of R, nu, Om."""
        return np.concatenate([self.b, self.R.reshape(-1, 9), self.nu, self.Om], axis=1)

    def first(self, members: int) -> Problem:
        """The first so many members alone."""
        n = min(members, self.members)
        states = (self.b[:n], self.R[:n], self.nu[:n], self.Om[:n])
        ensemble = Ensemble.from_states(self.ensemble.scene, *states)
        return replace(self, ensemble=ensemble, **dict(zip(("b", "R", "nu", "Om"), states, strict=True)))


def make_problem(members: int, t1: float, name: str = "vehicle") -> Problem:
    """The paper's vehicle, its rigid body alone, or a driven one: members 10 % apart in rate."""
    if name in DRIVEN:
        fleet = Ensemble(driven_scene(name), members, 1, {"start.angular_velocity": Normal(relative=0.1)})
        start = fleet.select(0, members)
        states = (start.position, start.attitude, start.velocity, start.angular_velocity)
        return of_states(name, fleet.scene, t1, *states)
    fleet = speed.fleet(members)
    start, vehicle = fleet.select(0, members), fleet.scene.vehicle
    buoyancy = vehicle.buoyancy
    if name == "rigid":
        vehicle = Vehicle(
            vehicle.mass,
            inertia=np.diag(vehicle.inertia),
            added_mass=[0.0, 0.0, 0.0],
            buoyancy=buoyancy,
            center_of_buoyancy=[0.0, 0.0, 0.0],
        )
    states = (start.position, start.attitude, start.velocity, start.angular_velocity)
    scene = Scene(vehicle, Environment(gravity=GRAVITY), start=fleet.scene.start)
    return of_states(name, scene, t1, *states)


def driven_scene(name: str) -> Scene:
    """A shipped vehicle under way, with its terms and commands as shipped."""
    start = {"position": POSITION, "velocity": VELOCITIES[name], "angular_velocity": ANGULAR_VELOCITY}
    return Scene.named(name, start=start)


def of_states(name: str, scene: Scene, t1: float, *states: np.ndarray) -> Problem:
    """The problem of a scene and its members' b, R, nu, Om."""
    return Problem(name, Ensemble.from_states(scene, *states), body_of(scene), t1, *states)


def make_rates(
    problem: Problem, number: Callable[[float], Any] = float, absolute: Any = np.abs, root: Any = np.sqrt
) -> Callable[[Any], tuple[Any, ...]]:
    """The rates of 13 numbers as a function of them, its constants folded.

    number: The type of constants, where they are not float64 anyway. absolute, root: |x| and its root, for such numbers.
    """
    if problem.driven:
        return equations.python_rates(problem.body.held(), "quaternion", absolute, root)
    M1, M2, M3 = (number(x) for x in problem.M)
    J1, J2, J3 = (number(x) for x in problem.J)
    d1, d2, d3 = (number(x) for x in problem.d)
    net = number(problem.net)
    a12, a13, a21, a23, a31, a32 = M2 / M1, M3 / M1, M1 / M2, M3 / M2, M1 / M3, M2 / M3
    f1, f2, f3 = net / M1, net / M2, net / M3
    e1, e2, e3 = (J2 - J3) / J1, (J3 - J1) / J2, (J1 - J2) / J3
    m1, m2, m3 = (M2 - M3) / J1, (M3 - M1) / J2, (M1 - M2) / J3
    d12, d13, d21, d23, d31, d32 = d2 / J1, d3 / J1, d1 / J2, d3 / J2, d1 / J3, d2 / J3
    one, two, half = number(1.0), number(2.0), number(0.5)

    def rates(state: Any) -> tuple[Any, ...]:
        _, _, _, w, x, y, z, u1, u2, u3, o1, o2, o3 = state
        t1 = two * (y * u3 - z * u2)
        t2 = two * (z * u1 - x * u3)
        t3 = two * (x * u2 - y * u1)
        z1 = two * (x * z - w * y)
        z2 = two * (y * z + w * x)
        z3 = one - two * (x * x + y * y)
        return (
            u1 + w * t1 + y * t3 - z * t2,
            u2 + w * t2 + z * t1 - x * t3,
            u3 + w * t3 + x * t2 - y * t1,
            -half * (x * o1 + y * o2 + z * o3),
            half * (w * o1 + y * o3 - z * o2),
            half * (w * o2 + z * o1 - x * o3),
            half * (w * o3 + x * o2 - y * o1),
            a12 * u2 * o3 - a13 * u3 * o2 + f1 * z1,
            a23 * u3 * o1 - a21 * u1 * o3 + f2 * z2,
            a31 * u1 * o2 - a32 * u2 * o1 + f3 * z3,
            e1 * o2 * o3 + m1 * u2 * u3 + d13 * z2 - d12 * z3,
            e2 * o3 * o1 + m2 * u3 * u1 + d21 * z3 - d23 * z1,
            e3 * o1 * o2 + m3 * u1 * u2 + d32 * z1 - d31 * z2,
        )

    return rates


def make_matrix_rates(
    problem: Problem, absolute: Any = np.abs, root: Any = np.sqrt
) -> Callable[[Any], tuple[Any, ...]]:
    """The same of 18 numbers: b, the rows of R, nu, Om."""
    if problem.driven:
        return equations.python_rates(problem.body.held(), "xyz", absolute, root)
    M, J, d = ([float(x) for x in values] for values in (problem.M, problem.J, problem.d))
    net = float(problem.net)

    def cross(a: Any, b: Any) -> list[Any]:
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    def rates(state: Any) -> tuple[Any, ...]:
        R, u, o = [state[3:6], state[6:9], state[9:12]], state[12:15], state[15:18]
        z = R[2]
        found = [row[0] * u[0] + row[1] * u[1] + row[2] * u[2] for row in R]
        for row in R:
            found += cross(row, o)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            found.append((M[j] / M[i]) * (u[j] * o[k]) - (M[k] / M[i]) * (u[k] * o[j]) + (net / M[i]) * z[i])
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            turning = ((J[j] - J[k]) / J[i]) * (o[j] * o[k]) + ((M[j] - M[k]) / J[i]) * (u[j] * u[k])
            found.append(turning + (d[k] / J[i]) * z[j] - (d[j] / J[i]) * z[k])
        return tuple(found)

    return rates


# Position (members, 3) and attitude (members, 3, 3) at the end.
End = tuple[np.ndarray, np.ndarray]


def end_of(state: np.ndarray) -> End:
    """Position and attitude of states (members, 13)."""
    state = np.asarray(state, dtype=np.float64)
    return state[:, :3], notation.matrix_from_quaternion(state[:, 3:7])


def matrix_end_of(state: np.ndarray) -> End:
    """Position and attitude of states (members, 18)."""
    return state[:, :3], state[:, 3:12].reshape(-1, 3, 3)


@dataclass
class Run:
    """One setting of one peer, compiled: `call` advances all members from the start to t1, to be timed; `end` is then
    the last call's end. members: how many it has, where a slow peer takes fewer."""

    method: str
    setting: str
    members: int
    call: Callable[[], Any]
    end: Callable[[], End]
    dtype: str = "float64"


# A peer: all its settings for a problem and a number of threads.
Runs = Iterator[Run]


def error(end: End, reference: End) -> dict[str, float]:
    """Position [m] and attitude |R - R_ref|_F at the end, largest and rms over the members, and the larger of the two.

    The members are the first ones that both have.
    """
    n = min(len(end[0]), len(reference[0]))
    position = np.linalg.norm(end[0][:n] - reference[0][:n], axis=1)
    attitude = np.linalg.norm((end[1][:n] - reference[1][:n]).reshape(n, 9), axis=1)
    rms = [float(np.sqrt(np.mean(x * x))) for x in (position, attitude)]
    most = [float(x.max()) for x in (position, attitude)]
    return {
        "error_max": max(most) if np.isfinite(most).all() else float("inf"),
        "error_rms": max(rms),
        "position_max": most[0],
        "position_rms": rms[0],
        "attitude_max": most[1],
        "attitude_rms": rms[1],
    }
