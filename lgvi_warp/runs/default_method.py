# SPDX-License-Identifier: Apache-2.0
"""The method of a run for which no one names one, chosen by what acts in the scene and by the step.

Conservative motion keeps its symplectic method. A splitting moves steady motion, and Runge-Kutta methods keep it, so these
advance damped scenes, as long as the step is stable for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.engine.plan import Plan, damping_terms
from lgvi_warp.methods.limits import drag_limit, rotation_limit
from lgvi_warp.methods.method import Method
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.physics.terms.hydrostatics import net
from lgvi_warp.scene.ensemble import Ensemble

# The first members stand for all.
LOOKED_AT = 32
# Least speed of a vehicle under way [m/s], and the part of it that counts as speed along, and rate about, every axis.
UNDER_WAY = 1.0
ASIDE = 0.05
# A net weight drives along any axis, and turns about none.
FORCES = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
# Parts of a method's limits that a step may use, since rates grow. Oscillations need none: psi_s and psi_x cease to be
# stable at a shorter step than rk4, rk8 and rkw3 do (methods/stable_steps.csv).
SHARES = {"drag": 0.75, "rotation": 0.5}
# Largest h (l + 2 q |v|) / I that rkw3 is trusted with: of quadratic drag it knows that at the step's start.
MOST_IMPLICIT = 1000.0
# For damped scenes, the cheapest step first (`python -m benchmarks run damped`).
DAMPED = {
    "rk4": "since the scene is damped",
    "rk8": "since the scene is damped and the step long",
    "rkw3": "since the scene is damped, strongly for this step",
}
OTHERWISE = ("psi_x", "psi_s")


def planned(ensemble: Ensemble, h: float, plan_of: Callable[[Method], Plan]) -> Plan:
    """Plan a run with the first method that takes it.

    Args:
        ensemble: The members.
        h: Step [s].
        plan_of: Function from a method to the plan of the run.

    Returns:
        The plan; its method says why it was chosen.

    Raises:
        SceneError: If none takes it.
    """
    for method in choices(ensemble, h):
        try:
            return plan_of(method)
        except SceneError as error:
            fault = error
    raise fault


def choices(ensemble: Ensemble, h: float) -> Iterator[Method]:
    """List the methods for a run, the best first.

    Args:
        ensemble: The members.
        h: Step [s].

    Yields:
        A method, which the scene may refuse.
    """
    if not is_damped(ensemble):
        yield Method("psi_s", reason="since nothing damps the motion")
        yield Method("psi_x", reason="since nothing damps the motion, and psi_s does not take the scene")
        return
    numbers = h_rates(ensemble, h)
    for name, reason in DAMPED.items():
        if stable(Method(name), numbers):
            yield Method(name, reason=reason)
    for name in OTHERWISE:
        if name == OTHERWISE[-1] or stable(Method(name), numbers):
            yield Method(name, reason="since the scene is damped, and Runge-Kutta methods do not take it at this step")


def stable(method: Method, numbers: dict[str, float]) -> bool:
    """Tell whether a step is well within a method's limits.

    Args:
        method: The method.
        numbers: As of `h_rates`.

    Returns:
        False where a number is above its share of the limit.
    """
    drag = MOST_IMPLICIT if method.linearly_implicit else SHARES["drag"] * drag_limit(method.name)
    return numbers["drag"] <= drag and numbers["rotation"] <= SHARES["rotation"] * rotation_limit(method)


def is_damped(ensemble: Ensemble) -> bool:
    """Tell whether a term takes energy from some of the first members.

    Args:
        ensemble: The members.

    Returns:
        True where a dissipative term acts.
    """
    terms = [term for term in damping_terms(ensemble.scene.terms) if term.dissipative]
    if not terms:
        return False
    parameters = ensemble.parameters(0, min(LOOKED_AT, ensemble.members))
    return any(term.present(ensemble.own(term, parameters)) for term in terms)


@np.errstate(over="ignore", invalid="ignore")
def h_rates(ensemble: Ensemble, h: float) -> dict[str, float]:
    """Compute the step times the rates of the fastest of the first members under way.

    Args:
        ensemble: The members.
        h: Step [s].

    Returns:
        "drag" and "rotation" -> number [1]; drag as large as rkw3 takes where a term does not tell how it brakes.
    """
    members = ensemble.select(0, min(LOOKED_AT, ensemble.members))
    p, terms = members.parameters, damping_terms(ensemble.scene.terms)

    speeds = np.abs(np.concatenate([members.velocity, members.angular_velocity], axis=1))
    drag = MOST_IMPLICIT
    if all(type(term).braking is not Term.braking for term in terms):

        def matrices(at: np.ndarray) -> np.ndarray:
            total = np.zeros((1, 6, 6))
            for term in terms:
                total = total + term.braking(ensemble.own(term, p), at, p["environment.water_density"])
            return total

        linear, both = (np.einsum("nii->ni", matrices(np.full((1, 6), size))) for size in (0.0, 1.0))
        force = sum((term.drive() for term in ensemble.scene.terms), np.zeros(6)) + abs(net(p))[:, None] * FORCES
        speeds = np.maximum(speeds, terminal_speeds(force, linear, 0.5 * (both - linear)))
        speeds = np.maximum(speeds, ASIDE * np.maximum(np.linalg.norm(speeds[:, :3], axis=1, keepdims=True), UNDER_WAY))
        rates = np.linalg.solve(vehicle.inertia6(p), matrices(speeds))
        # Drag beyond float64 brakes faster than any step.
        drag = float(h * np.abs(np.linalg.eigvals(rates)).max()) if np.isfinite(rates).all() else np.inf
    return {"drag": drag, "rotation": float(h * np.linalg.norm(members.angular_velocity, axis=1).max())}


def terminal_speeds(force: np.ndarray, linear: np.ndarray, quadratic: np.ndarray) -> np.ndarray:
    """Speeds at which drag along an axis balances a force.

    Args:
        force: Sizes of force and torque, (n, 6) [N, N m].
        linear: Linear drag, (n, 6) [N s/m, N m s].
        quadratic: Quadratic drag, (n, 6) [N s2/m2, N m s2].

    Returns:
        Speeds (n, 6) [m/s, rad/s]; 0 where nothing brakes.
    """
    root = linear + np.sqrt(linear**2 + 4.0 * np.maximum(quadratic, 0.0) * force)
    return np.divide(2.0 * force, root, out=np.zeros(np.broadcast_shapes(force.shape, root.shape)), where=root > 0.0)
