# SPDX-License-Identifier: Apache-2.0
"""The integrators of Nordkvist & Sanyal (2010) as printed, one function for each equation.

phi, phi_adjoint, psi: conservative. Phi, Phi_adjoint: with the nonconservative phi and tau of (15), (16).

The state is b, R, nu, Om; `body` has M, J and the laws. F_k belongs to Phi, and G = F_{k+1}^T to its adjoint. The
printed text of the adjoint needs parentheses: F_{k+1} turns the whole bracket, not only its first term.
"""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.rotation import Array, NoSolution, Solver, cross, newton, norm
from lgvi_warp.reference.submaps import Body, State, acceleration_wrench, damping, load, look, remembered, water

# b (3,) [m], R (3, 3), nu (3,) [m/s], Om (3,) [rad/s].
Motion = tuple[Array, Array, Array, Array]


def equation_10(Om_k: Array, body: Body, h: float, solve: Solver = newton) -> Array:
    """Eq. (10): F_k with h hat(J Om_k) = F_k Jd - Jd F_k^T. docs/theory/integrator.md, (10)."""
    return solve(h * body.J @ Om_k, body.J)


def equation_11(R_k: Array, F_k: Array) -> Array:
    """Eq. (11): R_{k+1} = R_k F_k. docs/theory/integrator.md, (11)."""
    return R_k @ F_k


def equation_12(b_k: Array, R_k: Array, nu_k: Array, h: float) -> Array:
    """Eq. (12): b_{k+1} = h R_k nu_k + b_k, with the old R and the old nu. docs/theory/integrator.md, (12)."""
    return b_k + h * R_k @ nu_k


def equation_13(nu_k: Array, F_k: Array, b_k1: Array, R_k1: Array, body: Body, h: float) -> Array:
    """Eq. (13): M nu_{k+1} = F_k^T M nu_k + h U_{k+1}. Returns nu_{k+1}. docs/theory/integrator.md, (13)."""
    force, _ = body.wrench(b_k1, R_k1)
    return np.linalg.solve(body.M, F_k.T @ body.M @ nu_k + h * force)


def equation_14(Om_k: Array, F_k: Array, nu_k1: Array, b_k1: Array, R_k1: Array, body: Body, h: float) -> Array:
    """Eq. (14): J Om_{k+1} = F_k^T J Om_k + h M nu_{k+1} x nu_{k+1} + h M_{k+1}, with the new nu. Returns Om_{k+1}.

    docs/theory/integrator.md, (14).
    """
    _, torque = body.wrench(b_k1, R_k1)
    munk = cross(body.M @ nu_k1, nu_k1)
    return np.linalg.solve(body.J, F_k.T @ body.J @ Om_k + h * munk + h * torque)


def phi(b_k: Array, R_k: Array, nu_k: Array, Om_k: Array, body: Body, h: float, solve: Solver = newton) -> Motion:
    """Phi_h, eq. (10)-(14), in the order they are printed. Returns b, R, nu, Om at k + 1."""
    F_k = equation_10(Om_k, body, h, solve)
    R_k1 = equation_11(R_k, F_k)
    b_k1 = equation_12(b_k, R_k, nu_k, h)
    nu_k1 = equation_13(nu_k, F_k, b_k1, R_k1, body, h)
    Om_k1 = equation_14(Om_k, F_k, nu_k1, b_k1, R_k1, body, h)
    return b_k1, R_k1, nu_k1, Om_k1


def kicked_momentum(b_k: Array, R_k: Array, nu_k: Array, Om_k: Array, body: Body, h: float) -> Array:
    """The bracket of eq. (19) and (21): J Om_k + h M nu_k x nu_k + h M_k, with the old nu.

    docs/theory/integrator.md, (19).
    """
    _, torque = body.wrench(b_k, R_k)
    return body.J @ Om_k + h * cross(body.M @ nu_k, nu_k) + h * torque


def equation_19(q: Array, body: Body, h: float, solve: Solver = newton) -> Array:
    """Eq. (19): F_{k+1} with F_{k+1}^T Jd - Jd F_{k+1} = h hat(q), q the kicked momentum.

    docs/theory/integrator.md, (19).
    """
    return solve(h * q, body.J).T


def equation_20(nu_k: Array, F_k1: Array, b_k: Array, R_k: Array, body: Body, h: float) -> Array:
    """Eq. (20): M nu_{k+1} = F_{k+1} (M nu_k + h U_k). Returns nu_{k+1}. docs/theory/integrator.md, (20)."""
    force, _ = body.wrench(b_k, R_k)
    return np.linalg.solve(body.M, F_k1 @ (body.M @ nu_k + h * force))


def equation_21(q: Array, F_k1: Array, body: Body) -> Array:
    """Eq. (21): J Om_{k+1} = F_{k+1} q, q the kicked momentum. Returns Om_{k+1}.

    docs/theory/integrator.md, (18), (21).
    """
    return np.linalg.solve(body.J, F_k1 @ q)


def equation_22(R_k: Array, F_k1: Array) -> Array:
    """Eq. (22): R_{k+1} = R_k F_{k+1}^T. docs/theory/integrator.md, (22)."""
    return R_k @ F_k1.T


def equation_23(b_k: Array, R_k1: Array, nu_k1: Array, h: float) -> Array:
    """Eq. (23): b_{k+1} = h R_{k+1} nu_{k+1} + b_k, with the new R and the new nu. docs/theory/integrator.md, (23)."""
    return b_k + h * R_k1 @ nu_k1


def phi_adjoint(
    b_k: Array, R_k: Array, nu_k: Array, Om_k: Array, body: Body, h: float, solve: Solver = newton
) -> Motion:
    """Phi*_h, eq. (19)-(23), in the order they are printed. Returns b, R, nu, Om at k + 1."""
    q = kicked_momentum(b_k, R_k, nu_k, Om_k, body, h)
    F_k1 = equation_19(q, body, h, solve)
    nu_k1 = equation_20(nu_k, F_k1, b_k, R_k, body, h)
    Om_k1 = equation_21(q, F_k1, body)
    R_k1 = equation_22(R_k, F_k1)
    b_k1 = equation_23(b_k, R_k1, nu_k1, h)
    return b_k1, R_k1, nu_k1, Om_k1


def psi(b_k: Array, R_k: Array, nu_k: Array, Om_k: Array, body: Body, h: float, solve: Solver = newton) -> Motion:
    """Psi_h = Phi*_{h/2} o Phi_{h/2}, section III-F: Phi first, each over half the step.

    docs/theory/integrator.md, (I9).
    """
    return phi_adjoint(*phi(b_k, R_k, nu_k, Om_k, body, 0.5 * h, solve), body, 0.5 * h, solve)


# phi_k, tau_k: force (3,) [N] and torque (3,) [N m] in body axes.
Wrench = tuple[Array, Array]


def forces(x: State, body: Body, h: float, nu: Array, Om: Array) -> Wrench:
    """phi(b, nu, R, Om) and tau(b, nu, R, Om): all laws that do not follow from a potential."""
    views = look(x, body, h)
    flow = water(views, body)
    force, torque = body.wrench(x.b, x.R, views, potential=False)
    pushed, turned = acceleration_wrench(x.R, body, flow)
    drag = damping(x, body, h, nu, Om, flow) @ np.concatenate([nu, Om]) - load(x, body, h, nu, Om)[1]
    return force + pushed - drag[:3], torque + turned - drag[3:]


def equation_15(old: Wrench, new: Wrench, alpha: float) -> Array:
    """Eq. (15): phi_k = alpha phi(b_k, nu_k, R_k, Om_k) + (1 - alpha) phi(b_{k+1}, nu_k, R_{k+1}, Om_k).

    docs/theory/integrator.md, (15).
    """
    return alpha * old[0] + (1.0 - alpha) * new[0]


def equation_16(old: Wrench, new: Wrench, beta: float) -> Array:
    """Eq. (16): tau_k = beta tau(b_k, nu_k, R_k, Om_k) + (1 - beta) tau(b_{k+1}, nu_k, R_{k+1}, Om_k).

    docs/theory/integrator.md, (16).
    """
    return beta * old[1] + (1.0 - beta) * new[1]


def velocities(x: State, body: Body) -> tuple[Array, Array]:
    """nu and Om of a state."""
    return np.linalg.solve(body.M, x.p), np.linalg.solve(body.J, x.pi)


def drift(x: State, body: Body, h: float) -> Array:
    """h u: displacement of the vehicle by the water."""
    return h * water(look(x, body, h), body).velocity


def Phi(x: State, body: Body, h: float, solve: Solver = newton, alpha: float = 0.5, beta: float = 0.5) -> State:
    """Phi_h with (15), (16): (10)-(14) in their order. The memory of laws is advanced first."""
    x = at_time(remembered_over(at_time(x, x.t + 0.5 * h), body, h), x.t)
    nu, Om = velocities(x, body)
    old = forces(x, body, h, nu, Om)
    F = equation_10(Om, body, h, solve)
    x = replace(x, R=equation_11(x.R, F), b=equation_12(x.b, x.R, nu, h) + drift(x, body, h), t=x.t + h)
    new = forces(x, body, h, nu, Om)
    f, m = body.wrench(x.b, x.R, look(x, body, h), potential=True)
    p = F.T @ x.p + h * (f + equation_15(old, new, alpha))
    pi = F.T @ x.pi + h * (cross(p, np.linalg.solve(body.M, p)) + m + equation_16(old, new, beta))
    return replace(x, p=p, pi=pi)


def Phi_adjoint(x: State, body: Body, h: float, solve: Solver = newton, alpha: float = 0.5, beta: float = 0.5) -> State:
    """Phi*_h: (19)-(23) with phi*_k, tau*_k, which are (15), (16) with k and k + 1 interchanged; by iteration.

    docs/theory/integrator.md, (I8).

    Raises NoSolution if the iteration does not converge.
    """
    nu, Om = velocities(x, body)
    f, m = body.wrench(x.b, x.R, look(x, body, h), potential=True)
    star: Wrench = forces(x, body, h, nu, Om)
    moved = drift(x, body, h)
    for _ in range(200):
        q = x.pi + h * (cross(x.p, nu) + m + star[1])
        F = equation_19(q, body, h, solve)
        p, pi = F @ (x.p + h * (f + star[0])), F @ q
        R = equation_22(x.R, F)
        b = equation_23(x.b, R, np.linalg.solve(body.M, p), h) + moved
        y = replace(x, b=b, R=R, p=p, pi=pi, t=x.t + h)
        nu_k1, Om_k1 = velocities(y, body)
        ends = forces(y, body, h, nu_k1, Om_k1), forces(x, body, h, nu_k1, Om_k1)
        new = equation_15(*ends, alpha), equation_16(*ends, beta)
        change = h * norm(np.concatenate([new[0] - star[0], new[1] - star[1]]))
        change = change + norm(drift(y, body, h) - moved)
        star, moved = new, drift(y, body, h)
        if change <= 1e-15 * (norm(p) + norm(pi) + h * norm(np.concatenate(new))):
            return at_time(remembered_over(at_time(y, y.t - 0.5 * h), body, h), y.t)
    raise NoSolution(f"Phi*: the forces change by {change:.3g} N s from one iteration to the next. Shorten the step")


def at_time(x: State, t: float) -> State:
    """The state at another time."""
    return replace(x, t=t)


def remembered_over(x: State, body: Body, h: float) -> State:
    """Memory of laws after all of h; x.t is the middle of this time."""
    return remembered(remembered(x, body, h, second=False), body, h, second=True)


FORCED = {"Phi": Phi, "Phi*": Phi_adjoint}
