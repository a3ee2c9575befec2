# SPDX-License-Identifier: Apache-2.0
"""Approximate error of a method at a step, estimated from the rates at which the motion of a scene changes.

The motion is linearised about the members' start, with the damping at the speed that their drive produces. For each
mode y' = z y / h an explicit method multiplies by R(z) instead of exp(z). The error of a mode that decays ends with the
mode; errors of other modes accumulate. `python -m benchmarks run damped` compares the estimates with measured errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.engine.plan import damping_terms
from lgvi_warp.methods.limits import stability_polynomial
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.tableaux import RK4
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.hydrostatics import moment, net
from lgvi_warp.physics.notation import hat
from lgvi_warp.physics.terms.base import Term, word_of
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.ensemble import Ensemble

# The first members stand for all.
LOOKED_AT = 32
# Least speed of a vehicle under way [m/s], and the part of it that counts as speed along, and rate about, every axis.
UNDER_WAY = 1.0
ASIDE = 0.05
# A net weight drives along any axis, and turns about none.
FORCES = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
# A transient of rate r shifts what follows by this much over r.
SHIFT = 3.0
# Error of an implicit stage in a stiff transient, over its amplitude.
STIFF = 4.0
# Amplitude of a mode that grows by less than this a step does not count as unstable.
LEAST_GROWTH = 1e-3
# Error of psi_s and psi_x over (h times the fastest rate)^2, without damping; a splitting moves steady motion by more.
SPLITTING = {"conservative": 0.01, "damped": 0.03}


@dataclass(frozen=True)
class Rates:
    """Rates of change of the first members' motion.

    modes: rates of the modes of each member (n, 10), complex [1/s]; infinite where damping is beyond float64.
    drag: fastest rate of damping alone [1/s]; None if the damping of a term is unknown.
    rotation: largest angular rate at the start [rad/s].
    """

    modes: np.ndarray
    drag: float | None
    rotation: float


@np.errstate(over="ignore", invalid="ignore")
def rates(ensemble: Ensemble) -> Rates:
    """Find the rates of the first members that are under way."""
    members = ensemble.select(0, min(LOOKED_AT, ensemble.members))
    p, terms = members.parameters, damping_terms(ensemble.scene.terms)
    known = all(type(term).braking is not Term.braking for term in terms)
    inertia = vehicle.inertia6(p)
    damping = braking(ensemble, terms, members) if known else np.zeros((1, 6, 6))
    drag: float | None = None
    if known:
        alone = np.linalg.solve(inertia, damping)
        # Drag beyond float64 brakes faster than any step.
        drag = float(np.abs(np.linalg.eigvals(alone)).max()) if np.isfinite(alone).all() else math.inf
    rotation = float(np.linalg.norm(members.angular_velocity, axis=1).max())
    return Rates(modes(inertia, damping, members), drag, rotation)


def braking(ensemble: Ensemble, terms: list[Any], members: Members) -> np.ndarray:
    """Damping of the members at their initial speed or at the speed that their drive produces, whichever is larger.

    Returns: Matrices (n, 6, 6) [N s/m, N s, N m s].
    """
    p = members.parameters

    def matrices(at: np.ndarray) -> np.ndarray:
        total = np.zeros((1, 6, 6))
        for term in terms:
            total = total + term.braking(ensemble.own(term, p), at, p["environment.water_density"])
        return total

    speeds = np.abs(np.concatenate([members.velocity, members.angular_velocity], axis=1))
    linear, both = (np.einsum("nii->ni", matrices(np.full((1, 6), size))) for size in (0.0, 1.0))
    force = abs(net(p))[:, None] * FORCES
    for term in ensemble.scene.terms:
        force = force + drive(term, ensemble.own(term, p))
    speeds = np.maximum(speeds, terminal_speeds(force, linear, 0.5 * (both - linear)))
    aside = ASIDE * np.maximum(np.linalg.norm(speeds[:, :3], axis=1, keepdims=True), UNDER_WAY)
    return matrices(np.maximum(speeds, aside))


def drive(term: Any, numbers: dict[str, np.ndarray]) -> np.ndarray:
    """Force and torque with which a term drives each member, from the member's own numbers.

    numbers: Numbers of the term by field, of shape (1, ...) or (n, ...).
    Returns: Magnitudes (1 or n, 6) [N, N m].
    """
    varied = {name: values for name, values in numbers.items() if len(values) > 1}
    if type(term).drive is Term.drive or not varied:
        return np.asarray(term.drive())[None]
    fields = {word_of(item): item.name for item in term.number_fields()}
    # A command that varies replaces the schedule.
    held = {"times": None, "command_schedule": None} if "command" in varied else {}
    sizes = [
        replace(term, **held, **{fields[name]: values[i] for name, values in varied.items()}).drive()
        for i in range(len(next(iter(varied.values()))))
    ]
    return np.array(sizes)


def terminal_speeds(force: np.ndarray, linear: np.ndarray, quadratic: np.ndarray) -> np.ndarray:
    """Speeds at which drag along an axis balances a force.

    force: Magnitudes of force and torque, (n, 6) [N, N m].
    linear: Linear drag, (n, 6) [N s/m, N m s].
    quadratic: Quadratic drag, (n, 6) [N s2/m2, N m s2].
    Returns: Speeds (n, 6) [m/s, rad/s]; 0 without drag.
    """
    root = linear + np.sqrt(linear**2 + 4.0 * np.maximum(quadratic, 0.0) * force)
    return np.divide(2.0 * force, root, out=np.zeros(np.broadcast_shapes(force.shape, root.shape)), where=root > 0.0)


def modes(inertia: np.ndarray, damping: np.ndarray, members: Members) -> np.ndarray:
    """Rates of the motion linearised about the start: velocity, angular rate, and attitude with the restoring moment.

    inertia: Mass matrices about the user's origin (1 or n, 6, 6) [kg, kg m, kg m2].
    damping: Damping (1 or n, 6, 6) [N s/m, N s, N m s].
    Returns: Rates (n, 10), complex [1/s]: of the nine modes, and of the initial rotation itself.
    """
    v, w = members.velocity, members.angular_velocity
    n = len(v)
    momentum = np.einsum("nij,nj->ni", np.broadcast_to(inertia, (n, 6, 6)), np.concatenate([v, w], axis=1))
    # d(P x Om) and d(L x Om + P x v), L the angular and P the linear momentum.
    change = np.zeros((n, 6, 6))
    change[:, :3] = -hat(w) @ inertia[:, :3]
    change[:, 3:] = -hat(w) @ inertia[:, 3:] - hat(v) @ inertia[:, :3]
    change[:, :3, 3:] += hat(momentum[:, :3])
    change[:, 3:, :3] += hat(momentum[:, :3])
    change[:, 3:, 3:] += hat(momentum[:, 3:])
    stiffness = np.zeros((n, 6, 3))
    stiffness[:, 3, 0] = stiffness[:, 4, 1] = np.linalg.norm(moment(members.parameters), axis=1)
    system = np.zeros((n, 9, 9))
    system[:, :6, :6] = np.linalg.solve(inertia, change - damping)
    system[:, :6, 6:] = -np.linalg.solve(inertia, stiffness)
    system[:, 6:, 3:6] = np.eye(3)
    system[:, 6:, 6:] = -hat(w)
    if not np.isfinite(system).all():
        return np.full((n, 10), -np.inf + 0.0j)
    turning = 1j * np.linalg.norm(w, axis=1)[:, None]
    return np.concatenate([np.linalg.eigvals(system), turning], axis=1)


@np.errstate(all="ignore")
def path_error(method: Method, rates: Rates, h: float, t1: float) -> float:
    """Estimate the error of a method over a path.

    h: Step [s].
    t1: End [s].
    Returns: Approximate largest error in position divided by the length of the path [1]; infinite if the step is unstable.
    """
    if not np.isfinite(rates.modes).all():
        return math.inf
    z = h * rates.modes
    if method.tableau is None:
        return SPLITTING["damped" if rates.drag != 0.0 else "conservative"] * float(np.abs(z).max() ** 2)
    # What grows is bounded by the rest of the motion, which turns it over at the same rate.
    z = np.where(z.real > 0.0, 1j * np.abs(z), z)
    explicit = 1j * z.imag if method.linearly_implicit else z
    factor = stability_polynomial(RK4 if method.linearly_implicit else method.tableau, explicit)
    wrong, size = np.abs(factor - np.exp(explicit)), np.abs(factor)
    if method.linearly_implicit:
        # Damping by an implicit stage: of order 3, and of its first step alone where it is stiff.
        x = -z.real
        wrong += STIFF * np.minimum(x, 1.0) * (x / (1.0 + x)) ** 4
        size *= np.exp(-x)
    steps = max(t1 / h, 1.0)
    unstable = size > 1.0 + LEAST_GROWTH + SHIFT / steps
    kept = np.maximum(np.minimum(size, 1.0), np.exp(z.real))
    added = np.minimum(steps, 1.0 / np.maximum(1.0 - kept, 1.0 / steps))
    share = np.minimum(1.0, SHIFT / np.maximum(-rates.modes.real * t1, 1e-300))
    return math.inf if unstable.any() else float((wrong * added * share).max())
