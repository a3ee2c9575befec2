# SPDX-License-Identifier: Apache-2.0
"""Equation (24) solved by an algebraic Riccati equation and the matrix sign function, for comparison with other solvers.

J. R. Cardoso & F. Silva Leite (2003), The Moser-Veselov equation, Linear Algebra and its Applications 360: F Jd = A + S
with A = hat(a)/2 and a symmetric S, S^2 + S A - A S = A^2 + Jd^2. `rotation.riccati` takes eigenvectors instead.
"""

import numpy as np

from lgvi_warp.reference.rotation import SINGULAR, Array, NoSolution, hat, modified_inertia, residual, rotation_or_raise

# Newton's iteration for the sign that has not settled after this many steps will not: an eigenvalue is imaginary.
MOST_ITERATIONS = 60


def hamiltonian(a: Array, J: Array) -> Array:
    """H (6, 6) with H (I; S) = (I; S) (A + S), similar to a Hamiltonian matrix: its eigenvalues are pairs +-lambda.

    docs/theory/rotation.md, (R15).
    """
    A, Jd = 0.5 * hat(a), modified_inertia(J)
    return np.block([[A, np.eye(3)], [A @ A + Jd @ Jd, A]])


def matrix_sign(H: Array) -> Array:
    """sign(H) (6, 6), by Z <- (Z / mu + mu Z^-1) / 2, mu = |det Z|^(1/6) (Roberts 1980; Byers 1987). Raises NoSolution."""
    Z, before = H, np.inf
    for _ in range(MOST_ITERATIONS):
        mu = abs(np.linalg.det(Z)) ** (1.0 / len(H))
        new = 0.5 * (Z / mu + mu * np.linalg.inv(Z))
        change, Z = float(np.abs(new - Z).max()), new
        if change <= 1e-14 * np.abs(Z).max() or (change >= before and change <= 1e-8 * np.abs(Z).max()):
            return Z
        before = change
    raise NoSolution("Riccati: an eigenvalue is imaginary; the step is too large")


def sign(a: Array, J: Array, iterations: int | None = None) -> Array:
    """F = (A + S) Jd^-1, where I + sign(H) spans the invariant subspace (I; S) of the eigenvalues with positive real part.

    docs/theory/rotation.md, (R15).

    a (3,), J (3, 3) [kg m2]. `iterations` is not used. Raises NoSolution if the step is too large or Jd is singular.
    """
    Jd = modified_inertia(J)
    if not np.linalg.cond(Jd) < 1.0 / SINGULAR:
        raise NoSolution("Riccati: Jd is singular (a plate)")
    P = np.eye(6) + matrix_sign(hamiltonian(a, J))
    S = P[3:] @ np.linalg.pinv(P[:3])
    return rotation_or_raise((0.5 * hat(a) + 0.5 * (S + S.T)) @ np.linalg.inv(Jd), "Riccati")


def quality(F: Array, a: Array, J: Array) -> tuple[float, float]:
    """Relative residual of equation (24), and the largest entry of |F^T F - I|."""
    return residual(F, a, J), float(np.abs(F.T @ F - np.eye(3)).max())
