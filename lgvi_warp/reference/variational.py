# SPDX-License-Identifier: Apache-2.0
"""The discrete Lagrange-d'Alembert principle behind Phi, equations (2)-(9) and (17) of Nordkvist & Sanyal (2010).

A path is a list of configurations (b, R) at t_0, t_1, ...; a variation is a list of (delta b, Sigma), delta R = R
hat(Sigma). docs/theory/integrator.md derives the integrator in these functions.
"""

from collections.abc import Sequence

import numpy as np

from lgvi_warp.reference.paper import Wrench
from lgvi_warp.reference.rotation import Array, cross, hat, modified_inertia, vee
from lgvi_warp.reference.submaps import Body

# b (3,) [m], R (3, 3); delta b (3,) [m], Sigma (3,).
Path = Sequence[tuple[Array, Array]]
Variation = Sequence[tuple[Array, Array]]


def equation_2(b: Array, nu: Array, R: Array, Om: Array, body: Body) -> float:
    """Eq. (2): L = M nu.nu / 2 + J Om.Om / 2 - U(b, R) [J]. docs/theory/integrator.md, (2)."""
    return float(0.5 * nu @ body.M @ nu + 0.5 * Om @ body.J @ Om) - body.potential(b, R)


def equation_3(path: Path, variation: Variation, wrenches: Sequence[Wrench], body: Body, h: float, eps: float) -> float:
    """Eq. (3): the variation of sum L_k, by differences of size eps, and sum W_k. docs/theory/integrator.md, (3)."""
    ends = (
        sum(discrete_lagrangian(*x, *y, body, h) for x, y in zip(moved, moved[1:], strict=False))
        for moved in (displaced(path, variation, eps), displaced(path, variation, -eps))
    )
    return (next(ends) - next(ends)) / (2.0 * eps) + work(path, variation, wrenches, h)


def displaced(path: Path, variation: Variation, eps: float) -> Path:
    """b + eps delta b and R cay(eps Sigma / 2): the varied path to first order."""
    half = (np.eye(3) + 0.5 * eps * hat(Sigma) for _, Sigma in variation)
    turns = (A @ np.linalg.inv(A.T) for A in half)
    return [(b + eps * db, R @ F) for (b, R), (db, _), F in zip(path, variation, turns, strict=True)]


def work(path: Path, variation: Variation, wrenches: Sequence[Wrench], h: float) -> float:
    """Sum of W_k = h tau_k.Sigma_k+1 + h phi_k.R_k+1^T delta b_k+1."""
    ends = zip(path[1:], variation[1:], wrenches, strict=True)
    return float(sum(h * tau @ Sigma + h * phi @ R.T @ db for (_, R), (db, Sigma), (phi, tau) in ends))


def equation_4(Om_k: Array, h: float) -> Array:
    """Eq. (4): F_k = I + h hat(Om_k) to first order. docs/theory/integrator.md, (4)."""
    return np.eye(3) + h * hat(Om_k)


def equation_5(Om: Array, J: Array) -> Array:
    """Eq. (5): hat(J Om) = hat(Om) Jd + Jd hat(Om), the right side. docs/theory/integrator.md, (5)."""
    Jd = modified_inertia(J)
    return hat(Om) @ Jd + Jd @ hat(Om)


def equation_6(Om: Array, J: Array) -> float:
    """Eq. (6): J Om.Om = <Jd hat(Om), hat(Om)>, the right side. docs/theory/integrator.md, (6)."""
    return float(np.trace((modified_inertia(J) @ hat(Om)).T @ hat(Om)))


def equation_7(F_k: Array, J: Array, h: float) -> Array:
    """Eq. (7): h hat(J Om_k) = F_k Jd - Jd F_k^T. Returns J Om_k. docs/theory/integrator.md, (7)."""
    Jd = modified_inertia(J)
    return vee(F_k @ Jd - Jd @ F_k.T) / h


def equation_8(b_k: Array, R_k: Array, b_k1: Array, h: float) -> Array:
    """Eq. (8): b_{k+1} = h R_k nu_k + b_k. Returns nu_k. docs/theory/integrator.md, (8)."""
    return R_k.T @ (b_k1 - b_k) / h


def discrete_lagrangian(b_k: Array, R_k: Array, b_k1: Array, R_k1: Array, body: Body, h: float) -> float:
    """L_k of section III-C [J s]: h M nu.nu / 2 + <Jd (F - I), F - I> / 2h, and U by trapezoids.

    docs/theory/integrator.md, (I5).
    """
    nu, A = equation_8(b_k, R_k, b_k1, h), R_k.T @ R_k1 - np.eye(3)
    kinetic = 0.5 * h * nu @ body.M @ nu + 0.5 / h * np.trace((modified_inertia(body.J) @ A).T @ A)
    return float(kinetic) - 0.5 * h * (body.potential(b_k, R_k) + body.potential(b_k1, R_k1))


def equation_9(path: Path, variation: Variation, wrenches: Sequence[Wrench], body: Body, h: float) -> float:
    """Eq. (9), the left side: the variations of F_k, nu_k and U_k, and the work of forces. docs/theory/integrator.md, (9)."""
    total, Jd = work(path, variation, wrenches, h), modified_inertia(body.J)
    steps = zip(zip(path, variation, strict=True), zip(path[1:], variation[1:], strict=True), strict=False)
    for ((b, R), (db, Sigma)), ((b_k1, R_k1), (db_k1, Sigma_k1)) in steps:
        F, nu = R.T @ R_k1, equation_8(b, R, b_k1, h)
        dF = -hat(Sigma) @ F + F @ hat(Sigma_k1)
        dnu = R.T @ (db_k1 - db) / h - cross(Sigma, nu)
        total += np.trace(dF.T @ Jd @ (F - np.eye(3))) / h + h * dnu @ body.M @ nu
        for place, turned, shift, turn in ((b, R, db, Sigma), (b_k1, R_k1, db_k1, Sigma_k1)):
            force, torque = body.wrench(place, turned, potential=True)
            total += 0.5 * h * (force @ turned.T @ shift + torque @ turn)
    return float(total)


def momenta_before(nu: Array, Om: Array, b: Array, R: Array, body: Body, h: float) -> tuple[Array, Array]:
    """p^-, pi^- (3,): the momenta at t_k from the step that begins at t_k. docs/theory/integrator.md, (I6)."""
    force, torque = body.wrench(b, R, potential=True)
    p = body.M @ nu
    return p - 0.5 * h * force, body.J @ Om - h * cross(p, nu) - 0.5 * h * torque


def momenta_after(
    nu: Array, Om: Array, F: Array, b_k1: Array, R_k1: Array, body: Body, h: float
) -> tuple[Array, Array]:
    """p^+, pi^+ (3,): the momenta at t_k+1 from the step that ends at t_k+1. docs/theory/integrator.md, (I6)."""
    force, torque = body.wrench(b_k1, R_k1, potential=True)
    return F.T @ body.M @ nu + 0.5 * h * force, F.T @ body.J @ Om + 0.5 * h * torque


def momentum_map(b: Array, R: Array, p: Array, pi: Array) -> tuple[Array, Array]:
    """R p [N s] and R pi + b x R p [N m s] of discrete momenta, inertial axes. docs/theory/integrator.md, (I7)."""
    return R @ p, R @ pi + cross(b, R @ p)


def equation_17(F_k1: Array, J: Array, h: float) -> Array:
    """Eq. (17): -h hat(J Om_{k+1}) = F_{k+1} Jd - Jd F_{k+1}^T. Returns J Om_{k+1}. docs/theory/integrator.md, (17)."""
    return equation_7(F_k1, J, -h)
