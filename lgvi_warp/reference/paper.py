"""The integrators of Nordkvist & Sanyal (2010) as printed, for conservative scenes, one function for each equation.

State b, R, nu, Om; `body` holds M, J and the laws. F_k belongs to Phi, and G = F_{k+1}^T to its adjoint, where the
printed text needs parentheses: the whole bracket is turned by F_{k+1}, not its first term only.
"""

import numpy as np

from lgvi_warp.reference.rotation import Array, Solver, cross, newton
from lgvi_warp.reference.submaps import Body

# b (3,) [m], R (3, 3), nu (3,) [m/s], Om (3,) [rad/s].
Motion = tuple[Array, Array, Array, Array]


def equation_10(Om_k: Array, body: Body, h: float, solve: Solver = newton) -> Array:
    """Eq. (10): F_k with h hat(J Om_k) = F_k Jd - Jd F_k^T."""
    return solve(h * body.J @ Om_k, body.J)


def equation_11(R_k: Array, F_k: Array) -> Array:
    """Eq. (11): R_{k+1} = R_k F_k."""
    return R_k @ F_k


def equation_12(b_k: Array, R_k: Array, nu_k: Array, h: float) -> Array:
    """Eq. (12): b_{k+1} = h R_k nu_k + b_k, with the old R and the old nu."""
    return b_k + h * R_k @ nu_k


def equation_13(nu_k: Array, F_k: Array, b_k1: Array, R_k1: Array, body: Body, h: float) -> Array:
    """Eq. (13): M nu_{k+1} = F_k^T M nu_k + h U_{k+1}. Returns nu_{k+1}."""
    force, _ = body.wrench(b_k1, R_k1)
    return np.linalg.solve(body.M, F_k.T @ body.M @ nu_k + h * force)


def equation_14(Om_k: Array, F_k: Array, nu_k1: Array, b_k1: Array, R_k1: Array, body: Body, h: float) -> Array:
    """Eq. (14): J Om_{k+1} = F_k^T J Om_k + h M nu_{k+1} x nu_{k+1} + h M_{k+1}, with the new nu. Returns Om_{k+1}."""
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
    """The bracket of eq. (19) and (21): J Om_k + h M nu_k x nu_k + h M_k, with the old nu."""
    _, torque = body.wrench(b_k, R_k)
    return body.J @ Om_k + h * cross(body.M @ nu_k, nu_k) + h * torque


def equation_19(q: Array, body: Body, h: float, solve: Solver = newton) -> Array:
    """Eq. (19): F_{k+1} with F_{k+1}^T Jd - Jd F_{k+1} = h hat(q), q the kicked momentum."""
    return solve(h * q, body.J).T


def equation_20(nu_k: Array, F_k1: Array, b_k: Array, R_k: Array, body: Body, h: float) -> Array:
    """Eq. (20): M nu_{k+1} = F_{k+1} (M nu_k + h U_k). Returns nu_{k+1}."""
    force, _ = body.wrench(b_k, R_k)
    return np.linalg.solve(body.M, F_k1 @ (body.M @ nu_k + h * force))


def equation_21(q: Array, F_k1: Array, body: Body) -> Array:
    """Eq. (21): J Om_{k+1} = F_{k+1} q. Returns Om_{k+1}."""
    return np.linalg.solve(body.J, F_k1 @ q)


def equation_22(R_k: Array, F_k1: Array) -> Array:
    """Eq. (22): R_{k+1} = R_k F_{k+1}^T."""
    return R_k @ F_k1.T


def equation_23(b_k: Array, R_k1: Array, nu_k1: Array, h: float) -> Array:
    """Eq. (23): b_{k+1} = h R_{k+1} nu_{k+1} + b_k, with the new R and the new nu."""
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
    """Psi_h = Phi*_{h/2} o Phi_{h/2}, section III-F: Phi first, each over half the step."""
    return phi_adjoint(*phi(b_k, R_k, nu_k, Om_k, body, 0.5 * h, solve), body, 0.5 * h, solve)
