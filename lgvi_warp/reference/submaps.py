"""The sub-maps that every method is a program of (Ab, Ap, T, D, K), on one vehicle."""

from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.reference.rotation import Array, Solver, cross, newton
from lgvi_warp.reference.terms import Law


@dataclass(frozen=True)
class State:
    """b (3,) [m], R (3, 3) body to inertial, p = M nu (3,) [N s], pi = J Om (3,) [N m s]."""

    b: Array
    R: Array
    p: Array
    pi: Array


@dataclass(frozen=True)
class Body:
    """M (3, 3) [kg], J (3, 3) [kg m2], both symmetric, and the laws that act."""

    M: Array
    J: Array
    terms: tuple[Law, ...] = ()

    def wrench(self, b: Array, R: Array) -> tuple[Array, Array]:
        """Sum of the laws: force f(b, R) = -R^T dU/db and torque mU(b, R), body axes."""
        force, torque = np.zeros(3), np.zeros(3)
        for term in self.terms:
            f, m = term.wrench(vertical(R), b)
            force, torque = force + f, torque + m
        return force, torque

    def potential(self, b: Array, R: Array) -> float:
        """U(b, R), the sum of the laws [J]."""
        return sum(term.potential(vertical(R), b) for term in self.terms)


def vertical(R: Array) -> Array:
    """z = R^T e3, the downward vertical in body axes: the third row of R."""
    return R[2]


def velocity(body: Body, p: Array) -> Array:
    """nu = M^-1 p."""
    return np.linalg.solve(body.M, p)


def Ab(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """Eq. (12) and (23), Nordkvist & Sanyal 2010: b <- b + h R nu."""
    return replace(x, b=x.b + h * x.R @ velocity(body, x.p))


def Ap(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """The Munk moment of eq. (14) and (19): pi <- pi + h p x nu."""
    return replace(x, pi=x.pi + h * cross(x.p, velocity(body, x.p)))


def T(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """Ab and Ap together: the exact flow of the kinetic energy p.M^-1 p / 2."""
    return Ap(Ab(x, body, h), body, h)


def D(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """Eq. (10), (11): F = S(h pi), R <- R F; of (13), (14): p <- F^T p, pi <- F^T pi. Adjoint: (19)-(22)."""
    F = solve(h * x.pi, body.J)
    return State(b=x.b, R=x.R @ F, p=F.T @ x.p, pi=F.T @ x.pi)


def K(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """The potential's part of eq. (13), (14), (19), (20): p <- p + h f(b, R), pi <- pi + h mU(b, R)."""
    force, torque = body.wrench(x.b, x.R)
    return replace(x, p=x.p + h * force, pi=x.pi + h * torque)


SUBMAPS = {"Ab": Ab, "Ap": Ap, "T": T, "D": D, "K": K}
