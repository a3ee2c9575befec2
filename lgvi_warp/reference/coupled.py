# SPDX-License-Identifier: Apache-2.0
"""The step for a full 6x6 inertia, of one vehicle, in the symbols of docs/explain/coupled_inertia.md.

I6 = [[M, C], [C^T, J]] at the user's origin O in the user's axes; E = M^-1 C, Js = J - C^T M^-1 C, and H = p.M^-1 p / 2 +
(pi - E^T p).Js^-1 (pi - E^T p) / 2 + U. The turns need a diagonal, ascending Js, and an E that is upper triangular (scheme
X, no solve) or symmetric (scheme W, one 3-dimensional solve). Axes Q and another origin achieve this.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.reference.rotation import Array, NoSolution, cay, cross, hat, modified_inertia, norm, vee

# wrench(b, R) -> force (3,) [N] and torque (3,) [N m] about the user's origin, in the user's axes.
Wrench = Callable[[Array, Array], tuple[Array, Array]]
# kick(b, R, p, pi, h) -> b, R, p, pi: at the user's origin, in his axes.
Kick = Callable[[Array, Array, Array, Array, float], tuple[Array, Array, Array, Array]]
# (letter, coefficient) of each sub-map, the first applied first.
Program = Sequence[tuple[str, float]]

# I6 counts as symmetric if entries ij and ji differ by this fraction of sqrt(I_ii I_jj).
ASYMMETRY = 1e-12
# C counts as removable if C M is skew to this fraction of |C| |M|.
SKEW = 1e-12
# W: Newton stops below SETTLED |a|, or where the residual stagnates; above RESIDUAL |a| there it has failed.
SETTLED = 1e-14
RESIDUAL = 1e-12
MOST_ITERATIONS = 60


@dataclass(frozen=True)
class CoupledState:
    """b (3,) [m], R (3, 3) body to inertial, p (3,) [N s], pi (3,) [N m s]: at the origin o_1, in the axes Q."""

    b: Array
    R: Array
    p: Array
    pi: Array


@dataclass(frozen=True)
class Direction:
    """Drag along w = twist.(nu, Om), user's origin and axes, twist (6,): force -(linear + quadratic |w|) w along it.

    With a unit vector as twist[:3]: linear [N s/m], quadratic [N s^2/m^2].
    """

    twist: Array
    linear: float = 0.0
    quadratic: float = 0.0


@dataclass(frozen=True)
class Reduced:
    """The inertia in the axes Q at the origin o_1: the common part of ReducedX and ReducedW.

    Q (3, 3), rotation to the user's axes; M (3, 3) [kg]; A = M^-1 [1/kg]; Js (3,) ascending [kg m2]; E (3, 3) [m];
    o (n, 3), the origins o_1, .. o_n in the user's axes [m].
    """

    Q: Array
    M: Array
    A: Array
    Js: Array
    E: Array
    o: Array

    def velocity(self, p: Array, pi: Array) -> tuple[Array, Array]:
        """nu = A p - E Om, Om = Js^-1 (pi - E^T p), at o_1 in the axes Q. docs/theory/coupled.md, (X2)."""
        Om = (pi - self.E.T @ p) / self.Js
        return self.A @ p - self.E @ Om, Om

    def to_reduced(self, b: Array, R: Array, nu: Array, Om: Array) -> CoupledState:
        """The state for the user's b (3,) [m], R (3, 3), nu (3,) [m/s], Om (3,) [rad/s]."""
        Om_1, nu_1 = self.Q.T @ Om, self.Q.T @ (nu + cross(Om, self.o[0]))
        p = self.M @ (nu_1 + self.E @ Om_1)
        return CoupledState(b + R @ self.o[0], R @ self.Q, p, self.Js * Om_1 + self.E.T @ p)

    def momenta_about_user(self, x: CoupledState, i: int) -> tuple[Array, Array, Array, Array]:
        """b, R, p, pi at the user's origin, in the user's axes, from a state at o_i."""
        R, p = x.R @ self.Q.T, self.Q @ x.p
        return x.b - R @ self.o[i - 1], R, p, self.Q @ x.pi + cross(self.o[i - 1], p)

    def momenta_about(self, i: int, b: Array, R: Array, p: Array, pi: Array) -> CoupledState:
        """Inverse of `momenta_about_user`: the state at o_i.

        b, R: Position (3,) [m] of the user's origin; attitude (3, 3) of the user's axes.
        p, pi: Momentum (3,) [N s], the user's axes; angular momentum (3,) [N m s] about the user's origin.
        """
        o = self.o[i - 1]
        return CoupledState(b + R @ o, R @ self.Q, self.Q.T @ p, self.Q.T @ (pi - cross(o, p)))

    def from_reduced(self, x: CoupledState) -> tuple[Array, Array, Array, Array]:
        """b, R, nu, Om at the user's origin, in the user's axes."""
        nu, Om = self.velocity(x.p, x.pi)
        R, Om = x.R @ self.Q.T, self.Q @ Om
        return x.b - R @ self.o[0], R, self.Q @ nu - cross(Om, self.o[0]), Om


@dataclass(frozen=True)
class ReducedX(Reduced):
    """Inertia for scheme X: E = U upper triangular, pitches k_i = U_ii [m]; a (3, 3): its rows are the lines a_i [m]."""

    a: Array

    @property
    def U(self) -> Array:
        """E in this gauge (3, 3) [m]."""
        return self.E


@dataclass(frozen=True)
class ReducedW(Reduced):
    """Inertia for scheme W: E = S symmetric; one origin."""

    @property
    def S(self) -> Array:
        """E in this gauge (3, 3) [m]."""
        return self.E


def blocks(I6: Array) -> tuple[Array, Array, Array]:
    """M, C, J of I6 = [[M, C], [C^T, J]], (6, 6). Raises ValueError unless symmetric positive definite.

    docs/theory/coupled.md, (X1).
    """
    size = np.sqrt(np.abs(np.diag(I6)))
    if not np.all(np.abs(I6 - I6.T) <= ASYMMETRY * np.outer(size, size)):
        raise ValueError("the inertia (6, 6) must be finite and symmetric")
    if not np.linalg.eigvalsh(I6)[0] > 0.0:
        raise ValueError("the inertia (6, 6) must be positive definite")
    return I6[:3, :3], I6[:3, 3:], I6[3:, 3:]


def shift(I6: Array, d: Array) -> Array:
    """I6 about the origin O + d, d (3,) [m]: C' = C + M d^, J' = J - d^ M d^ - d^ C + C^T d^.

    docs/theory/coupled.md, (X4).
    """
    M, C, J = blocks(I6)
    H = hat(d)
    C1 = C + M @ H
    return np.block([[M, C1], [C1.T, J - H @ M @ H - H @ C + C.T @ H]])


def turn(I6: Array, Q: Array) -> Array:
    """I6 in axes that are the columns of Q: X' = Q^T X Q for every block."""
    M, C, J = (Q.T @ X @ Q for X in blocks(I6))
    return np.block([[M, C], [C.T, J]])


def coupling(I6: Array) -> float:
    """k in 0..1: the largest singular value of M^-1/2 C J^-1/2, any square roots. docs/theory/coupled.md, (X6)."""
    M, C, J = blocks(I6)
    half = np.linalg.solve(np.linalg.cholesky(M), C)
    return float(np.linalg.svd(np.linalg.solve(np.linalg.cholesky(J), half.T))[1][0])


def removable(I6: Array) -> Array | None:
    """The shift d (3,) [m] of the origin that makes C zero: d = -vee(E), if C M is skew; else None.

    docs/theory/coupled.md, (X5).
    """
    M, C, _ = blocks(I6)
    CM = C @ M
    if not np.abs(CM + CM.T).max() <= SKEW * np.abs(C).max() * np.abs(M).max():
        return None
    return -vee(skew(np.linalg.solve(M, C)))


def skew(E: Array) -> Array:
    """The antisymmetric part (E - E^T)/2 of a matrix (3, 3)."""
    return 0.5 * (E - E.T)


def in_the_axes_of_Js(I6: Array) -> tuple[Array, Array, Array, Array]:
    """Q, M, Js (3,) and E in the axes in which Js is diagonal and ascending, still at the user's origin."""
    M, C, J = blocks(I6)
    E = np.linalg.solve(M, C)
    Js = J - C.T @ E
    d, Q = np.linalg.eigh(0.5 * (Js + Js.T))
    Q = Q * np.sign(np.linalg.det(Q))
    return Q, Q.T @ M @ Q, d, Q.T @ E @ Q


def reduce_x(I6: Array) -> ReducedX:
    """Section 3, set-up: d = (-E32, E31, -E21) makes U = E + d^ upper triangular; o_i = Q (d + a_i).

    docs/theory/coupled.md, (X7), (X8).
    """
    Q, M, Js, E = in_the_axes_of_Js(I6)
    d = np.array([-E[2, 1], E[2, 0], -E[1, 0]])
    U = np.triu(E + hat(d))
    a = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, U[0, 1]], [U[1, 2], -U[0, 2], U[0, 1]]])
    return ReducedX(Q=Q, M=M, A=np.linalg.inv(M), Js=Js, E=U, o=(d + a) @ Q.T, a=a)


def reduce_w(I6: Array) -> ReducedW:
    """Section 2 (a): the shift d = -vee(E) makes S = E + d^ symmetric."""
    Q, M, Js, E = in_the_axes_of_Js(I6)
    d = -vee(skew(E))
    return ReducedW(Q=Q, M=M, A=np.linalg.inv(M), Js=Js, E=0.5 * (E + E.T), o=(Q @ d)[None])


def slide(x: CoupledState, n: Array) -> CoupledState:
    """b += R n, pi += p x n, n (3,) [m] in the body's axes: moves the body, or the origin within the body.

    docs/theory/coupled.md, (X9).
    """
    return replace(x, b=x.b + x.R @ n, pi=x.pi + cross(x.p, n))


def shears(V: Array, j: int, k: int, t: float) -> Array:
    """The rows of V (n, 3) turned by F = cay(t e_i), V F: x += t z, z -= s x, x += t z on columns j, k (cyclic).

    docs/theory/coupled.md, (X10).
    """
    V, s = V.copy(), 2.0 * t / (1.0 + t * t)
    V[:, j] += t * V[:, k]
    V[:, k] -= s * V[:, j]
    V[:, j] += t * V[:, k]
    return V


def T(x: CoupledState, body: Reduced, h: float) -> CoupledState:
    """The exact flow of p.A p / 2: n = h A p, b += R n, pi += p x n. The same at every origin."""
    return slide(x, h * body.A @ x.p)


def R_i(x: CoupledState, body: ReducedX, i: int, h: float) -> CoupledState:
    """The screw of (pi_i - k_i p_i)^2 / (2 Js_i) at o_i, i = 1, 2, 3: slide by sl e_i, turn by cay(t e_i).

    docs/theory/coupled.md, (X9).

    y^3/3 makes t1 = tan(y) to order 4. Symplectic, since the angle 2 atan(t1) + 2 atan(t2) and the slide are the
    derivatives of one function of (p_i, pi_i). The result is infinite if t1 t2 = 1: a turn by pi in one step.
    """
    i, j, k = i - 1, i % 3, (i + 1) % 3
    g, pitch = 0.5 * h / body.Js[i], body.E[i, i]
    y, t2 = g * x.pi[i], -g * pitch * x.p[i]
    t1 = y + y**3 / 3.0
    sl = 2.0 * g * pitch * (pitch * x.p[i] - x.pi[i] / (1.0 + t2 * t2))
    x = slide(x, sl * np.eye(3)[i])
    V = shears(np.vstack([x.R, x.p, x.pi]), j, k, (t1 + t2) / (1.0 - t1 * t2))
    return replace(x, R=V[:3], p=V[3], pi=V[4])


def hop(x: CoupledState, body: ReducedX, i: int, j: int) -> CoupledState:
    """The same state at o_j instead of o_i (1, 2, 3): b += R d, pi -= d x p, d = a_j - a_i.

    docs/theory/coupled.md, (X8), (X11).
    """
    return slide(x, body.a[j - 1] - body.a[i - 1])


def K(x: CoupledState, body: Reduced, h: float, wrench: Wrench, i: int = 1) -> CoupledState:
    """The potential's kick at o_i: p += h f', pi += h m' with f' = Q^T f, m' = Q^T (m - o_i x f)."""
    R = x.R @ body.Q.T
    f, m = wrench(x.b - R @ body.o[i - 1], R)
    return replace(x, p=x.p + h * body.Q.T @ f, pi=x.pi + h * body.Q.T @ (m - cross(body.o[i - 1], f)))


def w_matrix(D: Array, c: Array, al: Array, sg: Array) -> Array:
    """diag(D - s) - k^ with k = al - 2 sg, s = al.c; D: twice the moments Js (3,); sg: S's modified inertia times P (3,).

    docs/theory/coupled.md, (X15).
    """
    return np.diag(D - al @ c) - hat(al - 2.0 * sg)


def w_turning(c: Array, S: Array) -> float:
    """r = 2 c.S c / (1 + c.c) [m]. docs/theory/coupled.md, (X15)."""
    return float(2.0 * c @ S @ c / (1.0 + c @ c))


def w_guess(a: Array, P: Array, Js: Array, S: Array, sg: Array) -> Array:
    """The initial guess of section 2 (a): r of c = a / D, then the root s0 of the quartic's linear part (see below).

    docs/theory/coupled.md, (X16).
    """
    D = 2.0 * Js
    D_jk, D_sum = np.array([D[1] * D[2], D[2] * D[0], D[0] * D[1]]), D.sum() - D
    al = a + w_turning(a / D, S) * P
    k = al - 2.0 * sg
    s0 = (al**2 @ D_jk + (k @ al) ** 2) / (D.prod() + k**2 @ D + al**2 @ D_sum)
    b = D - s0
    b_jk = np.array([b[1] * b[2], b[2] * b[0], b[0] * b[1]])
    return (b_jk * al + (k @ al) * k + cross(b * k, al)) / (b.prod() + k**2 @ b)


def w_parameter(a: Array, P: Array, Js: Array, S: Array, newtons: int | None) -> Array:
    """c with [diag(D - s) - k^] c = al: F = cay(c) of W. Raises NoSolution (a ValueError).

    docs/theory/coupled.md, (X15).

    a = h pi - S P and P = h p, (3,); Js (3,) [kg m2]; S (3, 3) [m], the gauge.
    """
    D, sg = 2.0 * Js, modified_inertia(S) @ P

    def value(c: Array) -> Array:
        al = a + w_turning(c, S) * P
        return al - w_matrix(D, c, al, sg) @ c

    def newton(c: Array) -> Array:
        r = w_turning(c, S)
        al, w = a + r * P, P + cross(P, c) + (P @ c) * c
        g = 2.0 / (1.0 + c @ c) * (2.0 * S @ c - r * c)
        return c + np.linalg.solve(w_matrix(D, c, al, sg) - np.outer(c, al) - np.outer(w, g), value(c))

    c = w_guess(a, P, Js, S, sg)
    if newtons is not None:
        for _ in range(newtons):
            c = newton(c)
        return c
    return settled(value, newton, c, norm(a))


def settled(value: Callable[[Array], Array], newton: Callable[[Array], Array], c: Array, scale: float) -> Array:
    """Newton steps from c until |value| is below SETTLED scale or stagnates; NoSolution if it stays above RESIDUAL."""
    rho = norm(value(c))
    for _ in range(MOST_ITERATIONS):
        if rho <= SETTLED * scale:
            break
        new = newton(c)
        new_rho = norm(value(new))
        if not new_rho < rho:
            break
        c, rho = new, new_rho
    if not rho <= RESIDUAL * scale:
        raise NoSolution(f"coupled Moser-Veselov: residual {rho:.3g} for |a| = {scale:.3g}. Shorten the step")
    return c


def W(x: CoupledState, body: ReducedW, h: float, newtons: int | None = None) -> CoupledState:
    """Section 2 (a), for (pi - S p).Js^-1 (pi - S p) / 2: F of the coupled Moser-Veselov equation, then the motion.

    docs/theory/coupled.md, (X13), (X14).

    Y = -vee(F Sd - Sd F^T); b += R Y, pi -= Y x p; R <- R F, p <- F^T p, pi <- F^T pi. newtons: number of Newton steps
    from the guess, or None for round-off. Raises NoSolution (a ValueError).
    """
    P = h * x.p
    F, Sd = cay(w_parameter(h * x.pi - body.S @ P, P, body.Js, body.S, newtons)), modified_inertia(body.S)
    x = slide(x, -vee(F @ Sd - Sd @ F.T))
    return CoupledState(b=x.b, R=x.R @ F, p=F.T @ x.p, pi=F.T @ x.pi)


def drag(x: CoupledState, body: Reduced, h: float, z: Direction) -> CoupledState:
    """The exact flow of drag in one direction: w+ = w e^-y / (1 + h L q |w| (1 - e^-y)/y), y = h L l, L = z.I^-1 z.

    docs/theory/coupled.md, (X18).
    """
    v, w = z.twist[:3], z.twist[3:]
    v, w = body.Q.T @ v, body.Q.T @ (w - cross(body.o[0], v))
    g_v, g_w = body.velocity(v, w)
    L = float(v @ g_v + w @ g_w)
    nu, Om = body.velocity(x.p, x.pi)
    speed, y = float(v @ nu + w @ Om), h * L * z.linear
    growth = -math.expm1(-y) / y if y else 1.0
    slowed = speed * math.exp(-y) / (1.0 + h * L * z.quadratic * abs(speed) * growth)
    impulse = (speed - slowed) / L
    return replace(x, p=x.p - impulse * v, pi=x.pi - impulse * w)


def E(x: CoupledState, body: Reduced, h: float, directions: Sequence[Direction]) -> CoupledState:
    """Drag along the directions, one after another, each exactly: the half before the step."""
    for z in directions:
        x = drag(x, body, h, z)
    return x


def E_adjoint(x: CoupledState, body: Reduced, h: float, directions: Sequence[Direction]) -> CoupledState:
    """E with the directions in reversed order: the half after the step."""
    return E(x, body, h, directions[::-1])


def mirrored(half: Program) -> Program:
    """The half, K, and the reversed half: a symmetric program."""
    return (*half, ("K", 1.0), *reversed(half))


# T, K and the turns R1, R2, R3 or W. K acts where the middle stands: at o_3 in X6, o_2 in X8, o_1 in X10.
PROGRAMS: dict[str, Program] = {
    "x6": mirrored((("T", 0.5), ("R1", 0.5), ("R2", 0.5), ("R3", 0.5))),
    "x8": mirrored((("T", 0.5), ("R1", 0.5), ("R2", 0.25), ("R3", 0.5), ("R2", 0.25))),
    "x10": mirrored((("T", 0.5), ("R1", 0.25), ("R2", 0.25), ("R3", 0.5), ("R2", 0.25), ("R1", 0.25))),
    "psi_w": mirrored((("T", 0.5), ("W", 0.5))),
    "psi_1_w": (("K", 0.5), ("T", 0.5), ("W", 1.0), ("T", 0.5), ("K", 0.5)),
}


def reduce(I6: Array, program: str) -> ReducedX | ReducedW:
    """The reduction for the program of this name."""
    return reduce_w(I6) if program.endswith("w") else reduce_x(I6)


def step(
    x: CoupledState,
    body: ReducedX | ReducedW,
    h: float,
    program: Program,
    wrench: Wrench,
    newtons: int | None = None,
    kick: Kick | None = None,
) -> CoupledState:
    """One step of h from o_1 to o_1. A hop to o_i precedes a turn R_i; kick: replaces K, in the user's frame.

    docs/theory/coupled.md, (X12), (X17).
    """
    at = 1
    for letter, coefficient in program:
        if letter == "T":
            x = T(x, body, coefficient * h)
        elif letter == "K" and kick is not None:
            x = body.momenta_about(at, *kick(*body.momenta_about_user(x, at), coefficient * h))
        elif letter == "K":
            x = K(x, body, coefficient * h, wrench, at)
        elif isinstance(body, ReducedW):
            x = W(x, body, coefficient * h, newtons)
        else:
            i = int(letter[1])
            x, at = R_i(hop(x, body, at, i), body, i, coefficient * h), i
    return hop(x, body, at, 1) if isinstance(body, ReducedX) else x


def energy(
    b: Array, R: Array, nu: Array, Om: Array, I6: Array, potential: Callable[[Array, Array], float] | None = None
) -> float:
    """(nu, Om).I6 (nu, Om)/2 + U(b, R) [J], user's origin and axes; potential: U, None for none.

    docs/theory/coupled.md, (X3).
    """
    xi = np.concatenate([nu, Om])
    return float(0.5 * xi @ I6 @ xi) + (potential(b, R) if potential else 0.0)
