"""The sub-maps that every method is a program of (Ab, Ap, T, D, K), on one vehicle."""

from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.reference.rotation import newton


@dataclass(frozen=True)
class State:
    """b (3,) [m], R (3, 3) body to inertial, p = M nu (3,) [N s], pi = J Om (3,) [N m s]."""

    b: np.ndarray
    R: np.ndarray
    p: np.ndarray
    pi: np.ndarray


@dataclass(frozen=True)
class Body:
    """M (3, 3) [kg], J (3, 3) [kg m2], both symmetric, and the laws that act."""

    M: np.ndarray
    J: np.ndarray
    terms: tuple = ()

    def wrench(self, b, R):
        """Sum of the laws: force f(b, R) = -R^T dU/db and torque mU(b, R), body axes."""
        total = np.zeros(3), np.zeros(3)
        for term in self.terms:
            force, torque = term.wrench(R.T @ np.array([0.0, 0.0, 1.0]), b)
            total = total[0] + force, total[1] + torque
        return total


def velocity(body, p):
    """nu = M^-1 p."""
    return np.linalg.solve(body.M, p)


def Ab(x, body, h, solve=newton):
    """Eq. (12) and (23), Nordkvist & Sanyal 2010: b <- b + h R nu."""
    return replace(x, b=x.b + h * x.R @ velocity(body, x.p))


def Ap(x, body, h, solve=newton):
    """The Munk moment of eq. (14) and (19): pi <- pi + h p x nu."""
    return replace(x, pi=x.pi + h * np.cross(x.p, velocity(body, x.p)))


def T(x, body, h, solve=newton):
    """Ab and Ap together: the exact flow of the kinetic energy p.M^-1 p / 2."""
    return Ap(Ab(x, body, h), body, h)


def D(x, body, h, solve=newton):
    """Eq. (10), (11): F = S(h pi), R <- R F; of (13), (14): p <- F^T p, pi <- F^T pi. Adjoint: (19)-(22)."""
    F = solve(h * x.pi, body.J)
    return State(b=x.b, R=x.R @ F, p=F.T @ x.p, pi=F.T @ x.pi)


def K(x, body, h, solve=newton):
    """The potential's part of eq. (13), (14), (19), (20): p <- p + h f(b, R), pi <- pi + h mU(b, R)."""
    force, torque = body.wrench(x.b, x.R)
    return replace(x, p=x.p + h * force, pi=x.pi + h * torque)


SUBMAPS = {"Ab": Ab, "Ap": Ap, "T": T, "D": D, "K": K}
