# SPDX-License-Identifier: Apache-2.0
"""The sub-maps of which every method is a program (Ab, Ap, T, D, K), for one vehicle."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from lgvi_warp.reference.rotation import Array, Solver, cross, hat, newton
from lgvi_warp.reference.terms import STILL, Flow, Law, View
from lgvi_warp.reference.terms.drag import Drag

# Alexander (1977): the two-stage L-stable scheme of order 2.
GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


@dataclass(frozen=True)
class State:
    """b (3,) [m], R (3, 3) body to inertial, p (3,) [N s] and pi (3,) [N m s] relative to the water; t [s]; step.

    memory: memory of each of the body's laws, in their order. used: energy used since the start [J].
    """

    b: Array
    R: Array
    p: Array
    pi: Array
    t: float = 0.0
    step: int = 0
    memory: tuple[Array, ...] = ()
    used: float = 0.0


@dataclass(frozen=True)
class Body:
    """M (3, 3) [kg], J (3, 3) [kg m2], both symmetric, and the laws that act.

    excess [kg]: displaced mass minus dry mass; excess_lever (3,) [kg m]: the same with their lever arms. Accelerating
    water acts on them.
    mass [kg], and mass_lever (3,) [kg m], mass times the centre of mass, of the dry body. M and C minus these are the
    added mass. Water that varies in space acts differently on dry mass and added mass.
    C (3, 3) [kg m]: coupling of M and J, only for K; the other sub-maps of this file need C = 0.
    """

    M: Array
    J: Array
    terms: tuple[Law, ...] = ()
    excess: float = 0.0
    excess_lever: Array = field(default_factory=lambda: np.zeros(3))
    mass: float = 0.0
    mass_lever: Array = field(default_factory=lambda: np.zeros(3))
    member: int = 0
    C: Array = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def I6(self) -> Array:
        """The inertia (6, 6), with M and J as its blocks. docs/theory/coupled.md, (X1)."""
        return np.block([[self.M, self.C], [self.C.T, self.J]])

    def wrench(
        self, b: Array, R: Array, views: tuple[View, ...] = (), potential: bool | None = None
    ) -> tuple[Array, Array]:
        """Sum of the laws' wrenches; potential: True: only of laws that follow from a potential; False: of the others."""
        force, torque = np.zeros(3), np.zeros(3)
        views = views or tuple(View(R, b, np.zeros(3), np.zeros(3)) for _ in self.terms)
        for term, view in zip(self.terms, views, strict=True):
            if potential is None or term.potential_force == potential:
                f, m = term.wrench(view)
                force, torque = force + f, torque + m
        return force, torque

    def potential(self, b: Array, R: Array) -> float:
        """U(b, R), the sum of the laws [J]."""
        return sum(term.potential(View(R, b, np.zeros(3), np.zeros(3))) for term in self.terms)


def start(body: Body, b: Array, R: Array, p: Array, pi: Array) -> State:
    """The state at t = 0, with the initial memory of the laws."""
    return State(b, R, p, pi, memory=tuple(term.start() for term in body.terms))


def vertical(R: Array) -> Array:
    """z = R^T e3, the downward vertical in body axes: the third row of R."""
    return R[2]


def velocity(body: Body, p: Array) -> Array:
    """Velocity nu (3,) [m/s] of the momentum p: nu = M^-1 p."""
    return np.linalg.solve(body.M, p)


def look(x: State, body: Body, h: float) -> tuple[View, ...]:
    """View of the state for each law: attitude, position, velocities, time and its memory."""
    nu, Om = np.split(np.linalg.solve(body.I6, np.concatenate([x.p, x.pi])), 2)
    memory = x.memory or (np.zeros(0),) * len(body.terms)
    return tuple(View(x.R, x.b, nu, Om, x.t, h, x.step, body.member, remembered) for remembered in memory)


def Ab(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """Eq. (12) and (23), Nordkvist & Sanyal 2010: b <- b + h R nu. docs/theory/splitting.md, (S3)."""
    return replace(x, b=x.b + h * x.R @ velocity(body, x.p), t=x.t + h)


def Ap(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """The Munk moment of eq. (14) and (19): pi <- pi + h p x nu. docs/theory/splitting.md, (S3)."""
    return replace(x, pi=x.pi + h * cross(x.p, velocity(body, x.p)))


def T(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """Ab and Ap together: the exact flow of the kinetic energy p.M^-1 p / 2. docs/theory/splitting.md, (S2)."""
    return Ap(Ab(x, body, h), body, h)


def D(x: State, body: Body, h: float, solve: Solver = newton) -> State:
    """Eq. (10), (11): F = S(h pi), R <- R F; of (13), (14): p <- F^T p, pi <- F^T pi. Adjoint: (19)-(22).

    docs/theory/splitting.md, (S4).
    """
    F = solve(h * x.pi, body.J)
    return replace(x, R=x.R @ F, p=F.T @ x.p, pi=F.T @ x.pi)


def water(views: tuple[View, ...], body: Body) -> Flow:
    """The sum of all currents. docs/theory/water.md, (W4)."""
    return sum((term.flow(view) for term, view in zip(body.terms, views, strict=True)), STILL)


def acceleration_wrench(R: Array, body: Body, flow: Flow) -> tuple[Array, Array]:
    """(rho V - m) R^T Du/Dt at the centres of buoyancy and gravity: the force of accelerating water.

    docs/theory/water.md, (W2).
    """
    a = R.T @ (flow.rate + flow.gradient @ flow.velocity)
    return body.excess * a, cross(body.excess_lever, a)


def remembered(x: State, body: Body, h: float, second: bool, late: float = 0.0) -> State:
    """Memory of the laws half a kick later; late: see K."""
    views = look(replace(x, t=x.t + late * h), body, h)
    memory = tuple(term.evolve(view, second) for term, view in zip(body.terms, views, strict=True))
    return recorded(x, body, views, memory)


def recorded(x: State, body: Body, views: tuple[View, ...], memory: tuple[Array, ...]) -> State:
    """The same state with the present memory of the laws, and with the energy that they used meanwhile."""
    spent = sum(term.spent(view, rows) for term, view, rows in zip(body.terms, views, memory, strict=True))
    return replace(x, memory=memory, used=x.used + spent)


def power(x: State, body: Body, h: float, velocities: Array | None = None) -> float:
    """Power [W] of all laws at a state; velocities: (nu; Om) (6,), if they are not I6^-1 times the momenta."""
    views = look(x, body, h)
    if velocities is not None:
        views = tuple(replace(view, nu=velocities[:3], Om=velocities[3:]) for view in views)
    return sum(term.power(view) for term, view in zip(body.terms, views, strict=True))


def load(x: State, body: Body, h: float, nu: Array, Om: Array) -> tuple[Array, Array]:
    """D (6, 6) and w (6,) of the laws with access to the water: their force and torque are w - D (nu; Om)."""
    views = look(x, body, h)

    def water_at(point: Array) -> Flow:
        return water(tuple(replace(view, b=view.b + view.R @ point) for view in views), body)

    D, w = np.zeros((6, 6)), np.zeros(6)
    for term, view in zip(body.terms, views, strict=True):
        more, push = term.load(replace(view, nu=nu, Om=Om), water_at)
        D, w = D + more, w + push
    return D, w


def damping(x: State, body: Body, h: float, nu: Array, Om: Array, flow: Flow) -> Array:
    """D (6, 6) at nu, Om: the sum of the damping laws, and the effect of water that varies in space.

    docs/theory/water.md, (W3).

    With X = R^T G R: force -m X nu - X^T (A11 nu + A12 Om), torque -m r_g x X nu (Lamb 1932, art. 137; Galper & Miloh
    1994).
    """
    views = tuple(replace(view, nu=nu, Om=Om) for view in look(x, body, h))
    total = sum((term.damping(view) for term, view in zip(body.terms, views, strict=True)), np.zeros((6, 6)))
    X = x.R.T @ flow.gradient @ x.R
    rigid = np.hstack([body.mass * np.eye(3), -hat(body.mass_lever)])
    total[:3] += X.T @ (body.I6[:3] - rigid)
    total[:, :3] += rigid.T @ X
    return np.asarray(total + load(x, body, h, nu, Om)[0])


def V(x: State, body: Body, h: float, flow: Flow) -> State:
    """Velocity-dependent laws, w - D(nu) nu, by a linearly implicit step of order 2, D and w at the predicted middle.

    docs/theory/splitting.md, (S14).
    """
    I6, P = body.I6, np.concatenate([x.p, x.pi])
    nu, Om = np.split(np.linalg.solve(I6, P), 2)
    w = load(x, body, h, nu, Om)[1]
    nu, Om = np.split(np.linalg.solve(I6 + 0.5 * h * damping(x, body, h, nu, Om, flow), P + 0.5 * h * w), 2)
    Dm, w = damping(x, body, h, nu, Om, flow), load(x, body, h, nu, Om)[1]
    factor = I6 + GAMMA * h * Dm
    P = P + (1.0 - GAMMA) * h * (w - Dm @ np.linalg.solve(factor, P + GAMMA * h * w))
    P = P + GAMMA * h * (w - Dm @ np.linalg.solve(factor, P + GAMMA * h * w))
    return replace(x, p=P[:3], pi=P[3:])


def E(x: State, body: Body, h: float, flow: Flow) -> State:
    """Drag by its exact flow; if the inertia is not diagonal, by the exact flows of one axis after the other.

    docs/theory/splitting.md, (S13).
    """
    (drag,) = (term for term in body.terms if isinstance(term, Drag))
    P = np.concatenate([x.p, x.pi])
    if np.array_equal(body.I6, np.diag(np.diag(body.I6))):
        P = drag.exact(P, np.diag(body.I6), h)
    else:
        inverse = np.linalg.inv(body.I6)
        P = body.I6 @ drag.by_directions(inverse @ P, inverse, h)
    return replace(x, p=P[:3], pi=P[3:])


def dissipated(x: State, body: Body, h: float, flow: Flow) -> State:
    """E if drag is the only velocity-dependent law, V otherwise."""
    damped = [term for term in body.terms if type(term).damping is not Law.damping or type(term).load is not Law.load]
    alone = len(damped) == 1 and isinstance(damped[0], Drag) and not np.any(flow.gradient)
    if alone:
        return E(x, body, h, flow)
    return V(x, body, h, flow) if damped or np.any(flow.gradient) else x


def kicked(x: State, h: float, wrench: tuple[Array, Array]) -> State:
    """p <- p + h f, pi <- pi + h m, of a wrench (f, m) [N, N m]. docs/theory/splitting.md, (S5)."""
    return replace(x, p=x.p + h * wrench[0], pi=x.pi + h * wrench[1])


def K(x: State, body: Body, h: float, solve: Solver = newton, late: float = 0.0) -> State:
    """The potential's part of eq. (13), (14), (19), (20), p <- p + h f(b, R), pi <- pi + h mU(b, R), and the other laws.

    docs/theory/splitting.md, (S5), (S15).

    Half of the memory's step and of the water's drift, half the kick, drag, and the other halves: order 2. late: time
    from the kick to the middle of the interval over which memory is advanced, in lengths of the kick.
    """
    x = remembered(x, body, h, second=False, late=late)
    b = x.b
    x = replace(x, b=b + 0.5 * h * water(look(x, body, h), body).velocity)
    views = look(x, body, h)
    flow = water(views, body)
    force, torque = body.wrench(x.b, x.R, views)
    pushed, turned = acceleration_wrench(x.R, body, flow)
    wrench = (force + pushed, torque + turned)
    before = x
    x = kicked(x, 0.5 * h, wrench)
    x = dissipated(x, body, h, flow)
    x = kicked(x, 0.5 * h, wrench)
    middle = replace(x, p=0.5 * (before.p + x.p), pi=0.5 * (before.pi + x.pi))
    x = replace(x, used=x.used + h * power(middle, body, h))
    # Laws remember where the kick was, half way with the water.
    return replace(remembered(x, body, h, second=True, late=late), b=b + h * flow.velocity)


SUBMAPS = {"Ab": Ab, "Ap": Ap, "T": T, "D": D, "K": K}
