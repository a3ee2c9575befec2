# SPDX-License-Identifier: Apache-2.0
"""The numbers of a vehicle as the right-hand sides of the peers read them: matrices about the body's origin, no frames.

They follow the formulas of docs/guide/terms and share no code with the kernels, so that a peer which agrees is a check.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Fin:
    """A fin that stands: twists (6,) of its chord and normal, which measure the speed along them, and rho A/2 times the
    coefficients of lift, of drag, and of drag by the angle of attack."""

    chord: np.ndarray
    normal: np.ndarray
    lift: float
    drag: float
    drag_normal: float


@dataclass(frozen=True, eq=False)
class Thrusters:
    """Wrenches (n, 6) of a unit thrust, curves (n, p) ahead and astern from the first power up, limits and lags [s] (n,)."""

    wrenches: np.ndarray
    ahead: np.ndarray
    astern: np.ndarray
    limit: np.ndarray
    lag: np.ndarray
    command: np.ndarray

    def thrust(self, command: Any) -> Any:
        """The thrusts (..., n) [N] of commands that are held."""
        n = np.clip(command, -self.limit, self.limit)
        return power_series(self.ahead, np.maximum(n, 0.0)) - power_series(self.astern, np.maximum(-n, 0.0))


def power_series(curves: np.ndarray, w: Any) -> Any:
    """p1 w + p2 w^2 + ... of each column of w (..., n) by its row of curves (n, p)."""
    total = np.zeros_like(w)
    for coefficients in curves.T[::-1]:
        total = (total + coefficients) * w
    return total


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body in water; rows and columns: surge, sway, heave, roll, pitch, yaw.

    net: weight - buoyancy [N]. moment: B r_b - W r_g [N m]. linear, quadratic, lift: force_i = -sum_j (linear_ij +
    quadratic_ij |v_j| + u lift_ij) v_j. wrench: constant force and torque.
    """

    mass_matrix: np.ndarray
    net: float
    moment: np.ndarray
    linear: np.ndarray
    quadratic: np.ndarray
    lift: np.ndarray
    wrench: np.ndarray
    fins: tuple[Fin, ...] = ()
    thrusters: Thrusters | None = None

    def held(self) -> Body:
        """The same with the thrusts of the commands in its constant wrench."""
        if self.thrusters is None:
            return self
        thrust = self.thrusters.thrust(self.thrusters.command)
        return replace(self, wrench=self.wrench + thrust @ self.thrusters.wrenches, thrusters=None)


def body_of(scene: Scene) -> Body:
    """The body of a scene whose commands are held, in still water; raises TypeError for a term that it does not know."""
    vehicle, gravity = scene.vehicle, scene.environment.gravity
    if vehicle.full:
        mass_matrix = np.asarray(vehicle.rigid_body_mass_matrix + vehicle.added_mass_matrix)
        weight = vehicle.rigid_body_mass_matrix[0, 0] * gravity if vehicle.weight is None else vehicle.weight
        moment = vehicle.buoyancy * vehicle.center_of_buoyancy - weight * vehicle.center_of_gravity
    else:
        mass_matrix = np.zeros((6, 6))
        mass_matrix[:3, :3], mass_matrix[3:, 3:] = vehicle.mass_matrix, vehicle.inertia
        weight, moment = vehicle.mass * gravity, vehicle.buoyancy * vehicle.center_of_buoyancy
    none = np.zeros((6, 6))
    body = Body(mass_matrix, float(weight - vehicle.buoyancy), moment, none, none, none, np.zeros(6))
    for term in scene.terms:
        if term.type not in TERMS:
            raise TypeError(f"the peers know no term {term.type!r}; they know {', '.join(TERMS)}")
        body = TERMS[term.type](body, term, scene)
    return body


def _drag(body: Body, term: Any, scene: Scene) -> Body:
    return _drag_matrix(body, term, scene, np.diag)


def _drag_matrix(body: Body, term: Any, scene: Scene, matrix: Callable[[Any], Any] = np.asarray) -> Body:
    linear, quadratic = matrix(term.linear), matrix(term.quadratic)
    return replace(body, linear=body.linear + linear, quadratic=body.quadratic + quadratic)


def _body_lift(body: Body, term: Any, scene: Scene) -> Body:
    return replace(body, lift=body.lift + term.matrix)


def _wrench(body: Body, term: Any, scene: Scene) -> Body:
    return replace(body, wrench=body.wrench + np.concatenate([term.force, term.torque]))


def _control_fins(body: Body, term: Any, scene: Scene) -> Body:
    if not (term.holds and term.flow_angle and term.lift_angles is None):
        raise TypeError("the peers know fins that stand, with lift by the angle of the flow and no table")
    fins = []
    for i, angle in enumerate(np.clip(term.command, -term.limit, term.limit)):
        c = term.chord[i] / np.linalg.norm(term.chord[i])
        n = term.normal[i] - (term.normal[i] @ c) * c
        n = n / np.linalg.norm(n)
        c, n = np.cos(angle) * c + np.sin(angle) * n, np.cos(angle) * n - np.sin(angle) * c
        half = 0.5 * scene.environment.water_density * term.area[i]
        sizes = (float(half * x[i]) for x in (term.lift_slope, term.drag, term.drag_normal))
        fins.append(Fin(*(_twist(term.position[i], e) for e in (c, n)), *sizes))
    return replace(body, fins=(*body.fins, *fins))


def _thrusters(body: Body, term: Any, scene: Scene) -> Body:
    absent = all(getattr(term, name) is None for name in ("table_commands", "advance_loss", "torque_coefficient"))
    if body.thrusters or not (term.holds and absent) or np.any(term.dead_band):
        raise TypeError("the peers know one set of thrusters with held commands, polynomials and no dead band")
    wrenches = np.array([_twist(r, d / np.linalg.norm(d)) for r, d in zip(term.position, term.direction, strict=True)])
    ahead = np.outer(term.coefficient, term.polynomial)
    astern = np.outer(term.coefficient_astern, term.polynomial_astern)
    return replace(body, thrusters=Thrusters(wrenches, ahead, astern, term.limit, term.time_constant, term.command))


def _twist(point: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The wrench (6,) of a unit force at a point; it also measures the speed of that point along the force."""
    return np.concatenate([direction, np.cross(point, direction)])


TERMS = {
    "drag": _drag,
    "drag_matrix": _drag_matrix,
    "body_lift": _body_lift,
    "wrench": _wrench,
    "control_fins": _control_fins,
    "thrusters": _thrusters,
}
