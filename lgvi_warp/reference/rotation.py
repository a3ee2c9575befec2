"""Equation (24), Nordkvist & Sanyal 2010: F in SO(3) nearest I with F Jd - Jd F^T = hat(a), Jd = tr(J)/2 I - J.

Five solvers. `newton` is the paper's; `moser_veselov` the explicit solution it quotes; `riccati` that of its [19];
`cayley` and `quartic` go beyond it. J is any symmetric positive definite matrix: where a derivation wants it diagonal,
the axes are turned and turned back.
"""

from collections.abc import Callable

import numpy as np

# A Newton iteration that has not settled after this many steps will not.
MOST_ITERATIONS = 60
# A residual above this fraction of |a| is no solution.
RESIDUAL = 1e-9


class NoSolution(ValueError):
    """Equation (24) has no solution, or this solver does not find it."""


def hat(a):
    """The skew matrix with hat(a) x = a x x."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def vee(A):
    """The vector of a skew matrix."""
    return np.array([A[2, 1], A[0, 2], A[1, 0]])


def sinc(x):
    """sin(x) / x, 1 at 0."""
    return np.sinc(x / np.pi)


def exp(f):
    """Rodrigues' formula, section III-G: exp(hat(f)) = I + sin|f|/|f| hat(f) + (1 - cos|f|)/|f|^2 hat(f)^2."""
    angle = np.linalg.norm(f)
    return np.eye(3) + sinc(angle) * hat(f) + 0.5 * sinc(0.5 * angle) ** 2 * (hat(f) @ hat(f))


def cay(c):
    """The rotation with tan(angle / 2) = |c| about c: I + 2/(1 + c.c) (hat(c) + hat(c)^2)."""
    return np.eye(3) + 2.0 / (1.0 + c @ c) * (hat(c) + hat(c) @ hat(c))


def modified_inertia(J):
    """Jd = tr(J)/2 I - J, defined before equation (5)."""
    return 0.5 * np.trace(J) * np.eye(3) - J


def residual(F, a, J):
    """|F Jd - Jd F^T - hat(a)| / |a|, equation (24) as a number."""
    Jd = modified_inertia(J)
    return np.linalg.norm(vee(F @ Jd - Jd @ F.T) - a) / np.linalg.norm(a)


def in_principal_axes(solve):
    """A solver for diagonal J, given as its three numbers, made one for any symmetric J."""

    def solve_any(a, J, iterations=None):
        if np.array_equal(J, np.diag(np.diag(J))):
            return solve(a, np.diag(J), iterations)
        d, Q = np.linalg.eigh(J)
        return Q @ solve(Q.T @ a, d, iterations) @ Q.T

    solve_any.__doc__, solve_any.__name__ = solve.__doc__, solve.__name__
    return solve_any


def iterate(step, value, x, a, iterations):
    """Newton steps: so many, or until the residual no longer shrinks (near |J^-1 a| = 1 it never reaches round-off)."""
    if iterations is not None:
        for _ in range(iterations):
            x = step(x)
        return x
    size = np.linalg.norm(value(x))
    for _ in range(MOST_ITERATIONS):
        new = step(x)
        new_size = np.linalg.norm(value(new))
        if not new_size < size:
            break
        x, size = new, new_size
    if not size <= RESIDUAL * np.linalg.norm(a):
        raise NoSolution(f"equation (24): residual {size:.3g} for |a| = {np.linalg.norm(a):.3g}; shorten the step")
    return x


def newton(a, J, iterations=None):
    """Section III-G: Newton-Raphson on a = sin|f|/|f| J f + (1 - cos|f|)/|f|^2 f x J f, F = exp(hat(f)).

    iterations: that many steps from J^-1 a, or None for round-off. Raises NoSolution.
    """
    if not np.any(a):
        return np.eye(3)

    def value(f):
        n = np.linalg.norm(f)
        return sinc(n) * J @ f + 0.5 * sinc(0.5 * n) ** 2 * np.cross(f, J @ f) - a

    def step(f):
        return f - np.linalg.solve(newton_differential(f, J), value(f))

    return exp(iterate(step, value, np.linalg.solve(J, a), a, iterations))


def newton_differential(f, J):
    """The differential as printed in section III-G, with the series of its two quotients for small |f|."""
    n = np.linalg.norm(f)
    if n > 1e-2:
        first = np.cos(n) / n**2 - np.sin(n) / n**3
        second = np.sin(n) / n**3 - 2.0 * (1.0 - np.cos(n)) / n**4
    else:
        first = -1.0 / 3.0 + n**2 / 30.0 - n**4 / 840.0
        second = -1.0 / 12.0 + n**2 / 180.0 - n**4 / 6720.0
    Jf = J @ f
    return (
        sinc(n) * J
        + first * np.outer(Jf, f)
        + 0.5 * sinc(0.5 * n) ** 2 * (hat(f) @ J - hat(Jf))
        + second * np.outer(np.cross(f, Jf), f)
    )


def cayley(a, J, iterations=None):
    """Newton on G(c) = a + a x c + c (a.c) - 2 J c = 0, F = cay(c); dG = hat(a) + (a.c) I + c a^T - 2 J.

    iterations: that many steps from (2 J)^-1 a, or None for round-off. Raises NoSolution.
    """
    if not np.any(a):
        return np.eye(3)

    def value(c):
        return a + np.cross(a, c) + c * (a @ c) - 2.0 * J @ c

    def step(c):
        return c - np.linalg.solve(hat(a) + (a @ c) * np.eye(3) + np.outer(c, a) - 2.0 * J, value(c))

    return cay(iterate(step, value, np.linalg.solve(2.0 * J, a), a, iterations))


def quartic_coefficients(a, J):
    """(q0, q1, q2, d1) of q(s) = s^4 - d1 s^3 + q2 s^2 - q1 s + q0, whose smallest root is s = a.c. J: (3,)."""
    D = 2.0 * J
    A = a @ a
    d1, d3 = D.sum(), D.prod()
    d2 = d3 * (1.0 / D).sum()
    e = a**2 @ (d3 / D)
    return e + A**2, d3 + d1 * A, d2 + 2.0 * A, d1


def quartic_parameter(a, J, s):
    """c = n / det for the diagonal J (3,) and the root s; for any s, G(c) = (a.c - s) c: the residual for free."""
    b = 2.0 * J - s
    n = (np.array([b[1] * b[2], b[2] * b[0], b[0] * b[1]]) + a @ a) * a + np.cross(b * a, a)
    return n / (b.prod() + a**2 @ b)


@in_principal_axes
def quartic(a, J, iterations=None):
    """The scalar reduction: s = a.c is the smallest root of a quartic, then c is rational in s and F = cay(c).

    iterations: Newton steps from the root q0 / q1 of q's linear part, or None for round-off. From there every step
    stays on the near side of the root, q being convex up to it. Raises NoSolution.
    """
    q0, q1, q2, d1 = quartic_coefficients(a, J)

    def value(s):
        return (((s - d1) * s + q2) * s - q1) * s + q0

    s = q0 / q1
    for _ in range(MOST_ITERATIONS if iterations is None else iterations):
        s -= value(s) / (((4.0 * s - 3.0 * d1) * s + 2.0 * q2) * s - q1)
    F = cay(quartic_parameter(a, J, s))
    if iterations is None and np.any(a) and not residual(F, a, np.diag(J)) <= RESIDUAL:
        raise NoSolution(f"equation (24): the quartic has no small root for |a| = {np.linalg.norm(a):.3g}")
    return F


@in_principal_axes
def moser_veselov(a, J, iterations=None):
    """Section III-G, after Moser & Veselov: P(lambda) = det(I - lambda hat(a) - lambda^2 Jd^2), a cubic in lambda^2.

    v_i spans the kernel of I - lambda_i hat(a) - lambda_i^2 Jd^2, and F = (Jd psi Lambda psi^-1)^T (every J of the
    printed text is Jd). Explicit: iterations means nothing here. Raises NoSolution where roots coincide (near a sphere,
    a = 0), where none has a positive real part, and where the answer is no rotation.
    """
    Jd = np.diag(modified_inertia(np.diag(J)))
    w = Jd**2
    # det(I - beta diag(w) - lambda hat(a)) = prod(1 - beta w_i) + beta sum a_i^2 (1 - beta w_i), beta = lambda^2
    e1, e2, e3 = w.sum(), w[0] * w[1] + w[1] * w[2] + w[2] * w[0], w.prod()
    betas = np.roots([-e3, e2 - a**2 @ w, -e1 + a @ a, 1.0]).astype(complex)
    lambdas = np.sqrt(betas)
    lambdas = np.where(lambdas.real < 0.0, -lambdas, lambdas)
    if np.any(lambdas.real <= 1e-12 * np.abs(lambdas)):
        raise NoSolution("Moser-Veselov: a root is real and negative; the step is too large")
    psi = np.empty((3, 3), complex)
    for i, root in enumerate(lambdas):
        psi[:, i] = np.linalg.svd(np.eye(3) - root * hat(a) - root**2 * np.diag(w))[2][-1].conj()
    if np.linalg.cond(psi) > 1e12:
        raise NoSolution("Moser-Veselov: roots coincide (J near a sphere, or a near 0)")
    F = (np.diag(Jd) @ psi @ np.diag(lambdas) @ np.linalg.inv(psi)).T.real
    if not np.linalg.det(F) > 0.0 or np.abs(F.T @ F - np.eye(3)).max() > 1e-3:
        raise NoSolution("Moser-Veselov: the explicit solution is not a rotation")
    return F


def riccati(a, J, iterations=None):
    """F = (A + S) Jd^-1 with A = hat(a)/2 and S^2 + S A - A S = A^2 + Jd^2, S symmetric (Cardoso & Leite 2003).

    S comes from the stable invariant subspace of the Riccati equation's Hamiltonian matrix. Explicit: iterations means
    nothing here. Raises NoSolution where the subspace is not 3-dimensional or F is no rotation (Jd singular: plates).
    """
    A, Jd = 0.5 * hat(a), modified_inertia(J)
    if np.linalg.cond(Jd) > 1e12:
        raise NoSolution("Riccati: Jd is singular (a plate)")
    # S^2 + S A + A^T S - (A^2 + Jd^2) = 0
    H = np.block([[A, np.eye(3)], [A @ A + Jd @ Jd, A]])
    values, vectors = np.linalg.eig(H)
    chosen = vectors[:, np.argsort(values.real)[3:]]
    if np.linalg.cond(chosen[:3]) > 1e12:
        raise NoSolution("Riccati: no solution is selected by the eigenvalues; the step is too large")
    S = (chosen[3:] @ np.linalg.inv(chosen[:3])).real
    F = (A + 0.5 * (S + S.T)) @ np.linalg.inv(Jd)
    if not np.linalg.det(F) > 0.0 or np.abs(F.T @ F - np.eye(3)).max() > 1e-3:
        raise NoSolution("Riccati: the solution is not a rotation; the step is too large")
    return F


SOLVERS: dict[str, Callable] = {
    "newton": newton,
    "cayley": cayley,
    "quartic": quartic,
    "moser_veselov": moser_veselov,
    "riccati": riccati,
}
