# SPDX-License-Identifier: Apache-2.0
"""Equation (24), Nordkvist & Sanyal 2010: F in SO(3) nearest I with F Jd - Jd F^T = hat(a), Jd = tr(J)/2 I - J.

There are five solvers. `newton` is the paper's, `moser_veselov` is the explicit solution that it quotes, and `riccati`
is the solution of its reference [19]; `cayley` and `quartic` are not in the paper. J is any symmetric positive definite
matrix. If a derivation needs a diagonal J, the axes are turned before and turned back afterwards.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Function = Callable[[Array], Array]
# (a, J) -> F; those of SOLVERS take a number of iterations as well.
Solver = Callable[[Array, Array], Array]

# A Newton iteration that has not settled after this many steps will not.
MOST_ITERATIONS = 60
# A residual above this fraction of |a| is no solution.
RESIDUAL = 1e-9
# Explicit solutions: a matrix of condition 1 / SINGULAR is singular; a root that is imaginary up to the square root of
# round-off, IMAGINARY, counts as such; F may miss SO(3) by LOST_DIGITS (Moser-Veselov near a sphere: 1e-5), not more.
SINGULAR = 1e-12
IMAGINARY = 1e-8
LOST_DIGITS = 1e-4


class NoSolution(ValueError):  # noqa: N818
    """Raised if equation (24) has no solution, or the solver does not find it."""


def hat(a: Array) -> Array:
    """The skew matrix (3, 3) with hat(a) x = a x x."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def vee(A: Array) -> Array:
    """The vector (3,) of a skew matrix."""
    return np.array([A[2, 1], A[0, 2], A[1, 0]])


def cross(x: Array, y: Array) -> Array:
    """x x y of two vectors (3,): numpy.cross takes ten times as long."""
    (x1, x2, x3), (y1, y2, y3) = x.tolist(), y.tolist()
    return np.array([x2 * y3 - x3 * y2, x3 * y1 - x1 * y3, x1 * y2 - x2 * y1])


def norm(x: Array) -> float:
    """Euclidean length |x| of a vector."""
    return math.sqrt(x @ x)


def sinc(x: float) -> float:
    """sin(x) / x, 1 at 0."""
    return math.sin(x) / x if x else 1.0


def exp(f: Array) -> Array:
    """Rodrigues' formula, section III-G: exp(hat(f)) = I + sin|f|/|f| hat(f) + (1 - cos|f|)/|f|^2 hat(f)^2.

    docs/theory/integrator.md, (4); docs/theory/rotation.md, (R1).

    The half angle in (1 - cos|f|)/|f|^2 = sinc(|f|/2)^2 / 2 keeps it exact near 0.
    """
    angle, H = norm(f), hat(f)
    return np.eye(3) + sinc(angle) * H + 0.5 * sinc(0.5 * angle) ** 2 * (H @ H)


def cay(c: Array) -> Array:
    """The rotation with tan(angle / 2) = |c| about c: I + 2/(1 + c.c) (hat(c) + hat(c)^2).

    docs/theory/rotation.md, (R4).
    """
    H = hat(c)
    return np.eye(3) + 2.0 / (1.0 + c @ c) * (H + H @ H)


def modified_inertia(J: Array) -> Array:
    """Jd = tr(J)/2 I - J, defined before equation (5). docs/theory/integrator.md, (I4)."""
    return 0.5 * np.trace(J) * np.eye(3) - J


def residual(F: Array, a: Array, J: Array) -> float:
    """|F Jd - Jd F^T - hat(a)| / |a|, the residual of equation (24); not divided if a = 0.

    docs/theory/rotation.md, (24).
    """
    Jd = modified_inertia(J)
    return norm(vee(F @ Jd - Jd @ F.T) - a) / (norm(a) or 1.0)


def in_principal_axes(solve: Callable[[Array, Array, int | None], Array]) -> Callable[..., Array]:
    """Make a solver for any symmetric J (3, 3) from a solver for diagonal J, given as its three numbers."""

    def solve_any(a: Array, J: Array, iterations: int | None = None) -> Array:
        if J[0, 1] == J[0, 2] == J[1, 2] == 0.0:
            return solve(a, np.diag(J), iterations)
        d, Q = np.linalg.eigh(J)
        # hat(Q a) = Q hat(a) Q^T for a rotation; eigh also returns reflections, under which hat(a) changes its sign.
        Q = Q * np.sign(np.linalg.det(Q))
        return Q @ solve(Q.T @ a, d, iterations) @ Q.T

    solve_any.__doc__, solve_any.__name__ = solve.__doc__, solve.__name__
    return solve_any


def iterate(value: Function, differential: Function, x: Array, a: Array, iterations: int | None) -> Array:
    """Newton steps on value(x) = 0: this many, or (None) until the residual, divided by |a|, no longer falls.

    A test against round-off alone would never end, since the residual stagnates above round-off near |J^-1 a| = 1. Raises
    NoSolution if it stays large, and LinAlgError (a ValueError) if the differential is singular in a fixed number of steps.
    """
    if iterations is not None:
        for _ in range(iterations):
            x = x - np.linalg.solve(differential(x), value(x))
        return x
    v = value(x)
    for _ in range(MOST_ITERATIONS):
        try:
            new = x - np.linalg.solve(differential(x), v)
        except np.linalg.LinAlgError:
            break
        new_v = value(new)
        if not new_v @ new_v < v @ v:
            break
        x, v = new, new_v
    if not norm(v) <= RESIDUAL * norm(a):
        raise NoSolution(f"equation (24): residual {norm(v):.3g} for |a| = {norm(a):.3g}. Shorten the step")
    return x


def newton(a: Array, J: Array, iterations: int | None = None) -> Array:
    """Section III-G: Newton-Raphson on a = sin|f|/|f| J f + (1 - cos|f|)/|f|^2 f x J f, F = exp(hat(f)).

    docs/theory/rotation.md, (24), (R2).

    iterations: that many steps from J^-1 a, or None for round-off. Raises NoSolution.
    """
    if not np.any(a):
        return np.eye(3)

    def value(f: Array) -> Array:
        n, Jf = norm(f), J @ f
        return sinc(n) * Jf + 0.5 * sinc(0.5 * n) ** 2 * cross(f, Jf) - a

    def differential(f: Array) -> Array:
        return newton_differential(f, J)

    return exp(iterate(value, differential, np.linalg.solve(J, a), a, iterations))


def newton_differential(f: Array, J: Array) -> Array:
    """The differential printed in section III-G, with series of its two quotients for small |f|.

    docs/theory/rotation.md, (R3).
    """
    n = norm(f)
    if n > 1e-2:
        first = math.cos(n) / n**2 - math.sin(n) / n**3
        second = math.sin(n) / n**3 - 2.0 * (1.0 - math.cos(n)) / n**4
    else:
        first = -1.0 / 3.0 + n**2 / 30.0 - n**4 / 840.0
        second = -1.0 / 12.0 + n**2 / 180.0 - n**4 / 6720.0
    Jf = J @ f
    return (
        sinc(n) * J
        + first * np.outer(Jf, f)
        + 0.5 * sinc(0.5 * n) ** 2 * (hat(f) @ J - hat(Jf))
        + second * np.outer(cross(f, Jf), f)
    )


def cayley_value(c: Array, a: Array, J: Array) -> Array:
    """G(c) = a + a x c + c (a.c) - 2 J c, equation (24) for F = cay(c). docs/theory/rotation.md, (R5)."""
    return a + cross(a, c) + c * (a @ c) - 2.0 * J @ c


def cayley(a: Array, J: Array, iterations: int | None = None) -> Array:
    """Newton on G(c) = a + a x c + c (a.c) - 2 J c = 0, F = cay(c); dG = hat(a) + (a.c) I + c a^T - 2 J.

    docs/theory/rotation.md, (R6).

    iterations: that many steps from (2 J)^-1 a, or None for round-off. Raises NoSolution.
    """
    if not np.any(a):
        return np.eye(3)

    def value(c: Array) -> Array:
        return cayley_value(c, a, J)

    def differential(c: Array) -> Array:
        return hat(a) + (a @ c) * np.eye(3) + np.outer(c, a) - 2.0 * J

    return cay(iterate(value, differential, np.linalg.solve(2.0 * J, a), a, iterations))


def quartic_coefficients(a: Array, J: Array) -> tuple[float, float, float, float]:
    """(q0, q1, q2, d1) of q(s) = s^4 - d1 s^3 + q2 s^2 - q1 s + q0, whose smallest root is s = a.c. J: (3,).

    docs/theory/rotation.md, (R8).
    """
    D1, D2, D3 = (2.0 * J).tolist()
    a1, a2, a3 = (a * a).tolist()
    A = a1 + a2 + a3
    d1, d2, d3 = D1 + D2 + D3, D1 * D2 + D2 * D3 + D3 * D1, D1 * D2 * D3
    e = a1 * D2 * D3 + a2 * D1 * D3 + a3 * D1 * D2
    return e + A**2, d3 + d1 * A, d2 + 2.0 * A, d1


def quartic_root(a: Array, J: Array, iterations: int | None) -> float:
    """The smallest root by Newton steps from q0 / q1, the root of q's linear part; None: until the steps no longer rise.

    docs/theory/rotation.md, (R9).

    q is convex and falls up to this root, so Newton steps from below stay below it, until round-off.
    """
    q0, q1, q2, d1 = quartic_coefficients(a, J)
    s = q0 / q1
    for _ in range(MOST_ITERATIONS if iterations is None else iterations):
        value = (((s - d1) * s + q2) * s - q1) * s + q0
        new = s - value / (((4.0 * s - 3.0 * d1) * s + 2.0 * q2) * s - q1)
        if iterations is None and not new > s:
            break
        s = new
    return s


def quartic_parameter(a: Array, J: Array, s: float) -> Array:
    """c = n / det for the diagonal J (3,) and the root s. For any s, G(c) = (a.c - s) c: the residual at no cost.

    docs/theory/rotation.md, (R7).
    """
    b = 2.0 * J - s
    b1, b2, b3 = b.tolist()
    n = (np.array([b2 * b3, b3 * b1, b1 * b2]) + a @ a) * a + cross(b * a, a)
    return n / (b1 * b2 * b3 + (a * a) @ b)


@in_principal_axes
def quartic(a: Array, J: Array, iterations: int | None = None) -> Array:
    """The scalar reduction: s = a.c is the smallest root of a quartic, then c is rational in s and F = cay(c).

    docs/theory/rotation.md, (24), (R11).

    iterations: Newton steps on the quartic, or None for round-off. F is a rotation for any s. Raises NoSolution.
    """
    s = quartic_root(a, J, iterations)
    c = quartic_parameter(a, J, s)
    if iterations is None and not norm(cayley_value(c, a, np.diag(J))) <= RESIDUAL * norm(a):
        raise NoSolution(f"equation (24): the quartic has no small root for |a| = {norm(a):.3g}. Shorten the step")
    return cay(c)


def rotation_or_raise(F: Array, name: str) -> Array:
    """Return F if it is a rotation up to the digits that an explicit solution may lose. Raises NoSolution."""
    if not np.linalg.det(F) > 0.0 or not np.abs(F.T @ F - np.eye(3)).max() < LOST_DIGITS:
        raise NoSolution(f"{name}: the explicit solution is not a rotation")
    return F


def moser_veselov_roots(a: Array, w: Array) -> Array:
    """The roots lambda_i with positive real part of det(I - lambda hat(a) - lambda^2 diag(w)), w = Jd^2 (3,); complex.

    docs/theory/rotation.md, (R13).

    With beta = lambda^2 the determinant is prod(1 - beta w_i) + beta sum a_i^2 (1 - beta w_i). Raises NoSolution.
    """
    e1, e2, e3 = w.sum(), w[0] * w[1] + w[1] * w[2] + w[2] * w[0], w.prod()
    if e3 <= SINGULAR**2 * w.max() ** 3:
        raise NoSolution("Moser-Veselov: Jd is singular (a plate)")
    lambdas = np.sqrt(np.roots([-e3, e2 - a**2 @ w, -e1 + a @ a, 1.0]).astype(complex))
    if np.any(lambdas.real <= IMAGINARY * np.abs(lambdas)):
        raise NoSolution("Moser-Veselov: a root is real and negative; the step is too large")
    return lambdas


@in_principal_axes
def moser_veselov(a: Array, J: Array, iterations: int | None = None) -> Array:
    """Section III-G, after Moser & Veselov: P(lambda) = det(I - lambda hat(a) - lambda^2 Jd^2), a cubic in lambda^2.

    docs/theory/rotation.md, (R14).

    v_i spans the kernel of I - lambda_i hat(a) - lambda_i^2 Jd^2, and F = (Jd psi Lambda psi^-1)^T (every J of the
    printed text is Jd). The solution is explicit; `iterations` is not used. Raises NoSolution if roots coincide (near a
    sphere, a = 0), none has a positive real part, Jd is singular, or the answer is no rotation.
    """
    Jd = np.diag(modified_inertia(np.diag(J)))
    lambdas = moser_veselov_roots(a, Jd**2)
    # The kernel of a matrix known to round-off only: its last right singular vector.
    P = [np.eye(3) - root * hat(a) - root**2 * np.diag(Jd**2) for root in lambdas]
    psi = np.linalg.svd(np.array(P))[2][:, -1].conj().T
    if not np.linalg.cond(psi) < 1.0 / SINGULAR:
        raise NoSolution("Moser-Veselov: roots coincide (J near a sphere, or a near 0)")
    F = (np.diag(Jd) @ psi @ np.diag(lambdas) @ np.linalg.inv(psi)).T.real
    return rotation_or_raise(F, "Moser-Veselov")


def riccati(a: Array, J: Array, iterations: int | None = None) -> Array:
    """F = (A + S) Jd^-1 with A = hat(a)/2 and S^2 + S A - A S = A^2 + Jd^2, S symmetric (Cardoso & Leite 2003).

    docs/theory/rotation.md, (R15).

    The columns of (I, S) span an invariant subspace of H, on which H acts as A + S = F Jd: the one of the three
    eigenvalues with positive real part. The solution is explicit; `iterations` is not used. Raises NoSolution if this
    subspace gives no S, F is no rotation, or Jd is singular (plates).
    """
    A, Jd = 0.5 * hat(a), modified_inertia(J)
    if not np.linalg.cond(Jd) < 1.0 / SINGULAR:
        raise NoSolution("Riccati: Jd is singular (a plate)")
    H = np.block([[A, np.eye(3)], [A @ A + Jd @ Jd, A]])
    values, vectors = np.linalg.eig(H)
    chosen = vectors[:, values.real > IMAGINARY * np.abs(values).max()]
    if chosen.shape[1] != 3 or not np.linalg.cond(chosen[:3]) < 1.0 / SINGULAR:
        raise NoSolution("Riccati: the eigenvalues select no solution; the step is too large")
    S = (chosen[3:] @ np.linalg.inv(chosen[:3])).real
    return rotation_or_raise((A + 0.5 * (S + S.T)) @ np.linalg.inv(Jd), "Riccati")


SOLVERS: dict[str, Callable[..., Array]] = {
    "newton": newton,
    "cayley": cayley,
    "quartic": quartic,
    "moser_veselov": moser_veselov,
    "riccati": riccati,
}
