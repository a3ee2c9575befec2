# SPDX-License-Identifier: Apache-2.0
"""The twin's solvers of equation (24), F Jd - Jd F^T = hat(a): against the equation, each other and their limits."""

import numpy as np
import pytest
import scipy.linalg

from lgvi_warp.reference import rotation
from tests.support.tools import TURN, slope

SOLVERS = rotation.SOLVERS
ITERATIVE = ("newton", "cayley", "quartic")
# Principal inertias: the paper's, a general one, a sphere, a plate (J1 + J2 = J3), a thin rod, and one that no rigid
# body has, but that added inertia can make (J1 + J2 < J3).
SHAPES = {
    "paper": (5.46, 5.29, 5.72), "general": (1.0, 2.0, 2.5), "sphere": (2.0, 2.0, 2.0), "plate": (1.0, 2.0, 3.0),
    "rod": (1e-6, 1.0, 1.0), "added": (1.0, 2.0, 3.5),
}  # fmt: skip
ROUND_OFF = 2.3e-16


def directions(seed, n):
    """Unit vectors (n, 3)."""
    w = np.random.default_rng(seed).normal(size=(n, 3))
    return w / np.linalg.norm(w, axis=1, keepdims=True)


def turns(seed, n):
    """Rotations (n, 3, 3)."""
    return [rotation.exp(3.0 * w) for w in directions(seed, n)]


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1e-8, 1e-3, 1.0, np.pi, 6.0])
def test_exp(size):
    # An error of exp of hat(f) is that of 15 operations on numbers below 1; the power series of scipy's expm likewise.
    for w in directions(0, 5):
        F = rotation.exp(size * w)
        assert np.abs(F - scipy.linalg.expm(rotation.hat(size * w))).max() < 1e-14
        assert np.abs(F.T @ F - np.eye(3)).max() < 20 * ROUND_OFF
        # First order in f to all its digits, however small f is.
        assert np.abs(rotation.vee(F - F.T) / 2 - rotation.sinc(size) * size * w).max() <= 4 * ROUND_OFF


def test_hat_vee_and_cross():
    a, x = directions(1, 2)
    np.testing.assert_array_equal(rotation.vee(rotation.hat(a)), a)
    np.testing.assert_allclose(rotation.hat(a) @ x, np.cross(a, x), atol=4 * ROUND_OFF)
    np.testing.assert_allclose(rotation.cross(a, x), np.cross(a, x), atol=4 * ROUND_OFF)


def test_identity_5():
    # Eq. (5): hat(J Om) = hat(Om) Jd + Jd hat(Om), which fixes Jd = tr(J)/2 I - J.
    J, Om = TURN @ np.diag([1.0, 2.0, 2.5]) @ TURN.T, np.array([0.3, -0.2, 0.9])
    Jd = rotation.modified_inertia(J)
    right = rotation.hat(Om) @ Jd + Jd @ rotation.hat(Om)
    np.testing.assert_allclose(rotation.hat(J @ Om), right, atol=20 * ROUND_OFF)


@pytest.mark.parametrize("size", [1e-4, 9e-3, 1.1e-2, 0.5, 1.5])
def test_printed_differential(size):
    # The differential of vee(F Jd - Jd F^T), F = exp(hat(f)): differences of order 2, eps^2 = 1e-10 and 1e-16 / eps.
    J, eps = TURN @ np.diag([1.0, 2.0, 2.5]) @ TURN.T, 1e-5
    Jd, f = rotation.modified_inertia(J), size * directions(2, 1)[0]

    def left(f):
        F = rotation.exp(f)
        return rotation.vee(F @ Jd - Jd @ F.T)

    columns = [(left(f + eps * e) - left(f - eps * e)) / (2 * eps) for e in np.eye(3)]
    assert np.abs(rotation.newton_differential(f, J) - np.array(columns).T).max() < 1e-9


@pytest.mark.parametrize("x", [1e-3, 0.1, 0.5, 0.9, 0.99, 0.9999])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("solver", "shape"),
    [(solver, shape) for solver in ITERATIVE for shape in SHAPES]
    + [(solver, shape) for solver in ("moser_veselov", "riccati") for shape in ("paper", "general")],
)
def test_residual_and_orthogonality(solver, shape, turned, x):
    # x = |J^-1 a|. F's round-off is multiplied by |Jd| / |a|, and explicit solutions multiply it by 1 / x once more
    # (kernels of nearly equal roots). The quartic holds J^4: on the rod it loses 1 / condition = 1e6.
    for w, Q in zip(directions(3, 6), turns(4, 6), strict=True):
        J = Q @ np.diag(SHAPES[shape]) @ Q.T if turned else np.diag(SHAPES[shape])
        a = (Q if turned else np.eye(3)) @ (x * np.array(SHAPES[shape]) * w)
        F = SOLVERS[solver](a, 0.5 * (J + J.T))
        lost = {"moser_veselov": 1.0 / x, "quartic": 1e6 if shape == "rod" else 1.0}.get(solver, 1.0)
        error = rotation.residual(F, a, J) * np.linalg.norm(a) / np.linalg.norm(J)
        assert error < 40 * ROUND_OFF * lost
        assert np.abs(F.T @ F - np.eye(3)).max() < (20 if solver in ITERATIVE else 100 / x) * ROUND_OFF
        assert np.linalg.det(F) > 0.0


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("x", [0.1, 0.5, 0.9])
def test_same_root(solver, x):
    # One equation, one F near I: the root's condition is 1 / sqrt(1 - x^2) = 2.3 at most here.
    for name in ("paper", "general"):
        J = np.diag(SHAPES[name])
        for w in directions(5, 10):
            a = x * J @ w
            assert np.abs(SOLVERS[solver](a, J) - SOLVERS["cayley"](a, J)).max() < 2e-13


@pytest.mark.parametrize("solver", SOLVERS)
def test_turned_axes(solver):
    # F(Q a, Q J Q^T) = Q F(a, J) Q^T. Eigenvectors come as reflections too, under which a would change its sign.
    J = np.diag(SHAPES["general"])
    for w, Q in zip(directions(6, 20), turns(7, 20), strict=True):
        full = Q @ J @ Q.T
        F = SOLVERS[solver](Q @ (0.4 * J @ w), 0.5 * (full + full.T))
        assert np.abs(F - Q @ SOLVERS[solver](0.4 * J @ w, J) @ Q.T).max() < 1e-13


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_turn_at_rest(solver):
    np.testing.assert_allclose(SOLVERS[solver](np.zeros(3), np.diag(SHAPES["paper"])), np.eye(3), atol=10 * ROUND_OFF)
    assert rotation.residual(np.eye(3), np.zeros(3), np.eye(3)) == 0.0


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_principal_axis(solver, axis):
    # Exactly F = exp(asin(x) e_i) for a = x J_i e_i, up to x = 1; the angle's error is 1 / sqrt(1 - x^2) round-offs.
    J, e = np.array(SHAPES["general"]), np.eye(3)[axis]
    for x in (0.4, 0.99, 0.9999, 0.99999999):
        F = SOLVERS[solver](x * J * e, np.diag(J))
        assert np.abs(F - rotation.exp(np.arcsin(x) * e)).max() < 100 * ROUND_OFF / np.sqrt(1 - x)
    for x in (1.00001, 1.0001, 1.05, 2.0, 10.0):
        with pytest.raises(rotation.NoSolution):
            SOLVERS[solver](x * J * e, np.diag(J))


def solvability(a, J):
    """max_w sum_i a_i^2 w^2 / ((w^2 + Jd_j^2)(w^2 + Jd_k^2)): a solution exists up to 1 (mathematics, section 3)."""
    Jd2 = (J.sum() / 2 - J) ** 2
    W = np.logspace(-4, 4, 4001)[:, None] * Jd2.max()
    return (W[:, 0] * ((W + Jd2) @ a**2) / (W + Jd2).prod(axis=1)).max()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("shape", ["paper", "general"])
def test_solvable_exactly_where_a_solution_exists(solver, shape):
    # A grid of 500 points a decade finds the maximum to 1e-5: leave 1e-3 about 1 alone.
    J = np.array(SHAPES[shape])
    seen = set()
    for w, x in zip(directions(8, 60), np.linspace(0.7, 1.4, 60), strict=True):
        a, solvable = x * J * w, True
        bound = solvability(a, J)
        if abs(bound - 1.0) < 1e-3:
            continue
        try:
            SOLVERS[solver](a, np.diag(J))
        except rotation.NoSolution:
            solvable = False
        assert solvable == (bound < 1.0)
        # Sufficient, and not necessary off the axes: |J^-1 a| < 1.
        assert solvable or x >= 1.0
        seen.add(solvable)
    assert seen == {True, False}


@pytest.mark.parametrize("solver", ITERATIVE)
@pytest.mark.parametrize("shape", ["paper", "sphere", "plate"])
def test_far_beyond_the_bound(solver, shape):
    J = np.array(SHAPES[shape])
    for w in directions(9, 5):
        for x in (2.0, 30.0, 1e6):
            with pytest.raises(ValueError, match="24"):
                SOLVERS[solver](x * J * w, np.diag(J))


@pytest.mark.parametrize(("k", "order", "angles"), [(0, 4, (0.02, 0.04, 0.08)), (1, 8, (0.1, 0.14, 0.2)),
                                                    (2, 16, (0.3, 0.35, 0.4))])  # fmt: skip
def test_error_of_a_fixed_number_of_iterations(k, order, angles):
    # s0 = q0 / q1 is wrong by x^2 of itself, a Newton step makes x^2 e^2 of an error e, and c depends on s by x^2 s:
    # residual x^4, x^8, x^16 for x = h |Om|. The next term, x^2 larger, bends the slope by up to .5.
    J = np.array(SHAPES["paper"])
    for w in directions(10, 4):
        residuals = [
            rotation.residual(SOLVERS["quartic"](x * J * w, np.diag(J), k), x * J * w, np.diag(J)) for x in angles
        ]
        assert slope(np.array(angles), residuals) == pytest.approx(order, abs=0.5)


# Iterations to relative 1e-7 and to round-off. Mathematics, section 3, says 1/2 for the exponential map at .01.
COUNTS = [(0.01, (0, 1), (1, 2)), (0.1, (1, 2), (1, 2)), (0.3, (2, 3), (2, 3)), (0.9, (4, 5), (4, 5))]


@pytest.mark.parametrize(("x", "quartic", "others"), COUNTS)
def test_iterations_needed(x, quartic, others):
    J = np.array(SHAPES["paper"])
    for solver, (few, all_digits) in (("quartic", quartic), ("cayley", others), ("newton", others)):
        for w in directions(11, 4):
            a = x * J * w
            assert rotation.residual(SOLVERS[solver](a, np.diag(J), few), a, np.diag(J)) < 6e-7
            # A residual below 1e-15 is round-off of F, here 4e-16 |Jd| / |a|.
            rounded = 20 * ROUND_OFF * max(1.0, 0.1 / x) if x < 0.9 else 1e-12
            assert rotation.residual(SOLVERS[solver](a, np.diag(J), all_digits), a, np.diag(J)) < rounded


def test_residual_for_free():
    # For the c made from any s: G(c) = a + a x c + c (a.c) - 2 J c = (a.c - s) c, and, since
    # (1 + c.c) (I + hat(c))^-1 = I + c c^T - hat(c), equation (24) misses a by -(I + hat(c)) G / (1 + c.c).
    J = np.array(SHAPES["general"])
    for w in directions(12, 10):
        a = 0.6 * J * w
        for s in (0.0, 0.1, 0.3):
            c = rotation.quartic_parameter(a, J, s)
            G = rotation.cayley_value(c, a, np.diag(J))
            np.testing.assert_allclose(G, (a @ c - s) * c, atol=1e-14)
            F, Jd = rotation.cay(c), rotation.modified_inertia(np.diag(J))
            missed = rotation.vee(F @ Jd - Jd @ F.T) - a
            np.testing.assert_allclose(missed, -(G + np.cross(c, G)) / (1.0 + c @ c), atol=1e-14)


def test_quartic_and_its_coefficients():
    # s = a.c is the smallest of the roots of the quartic of section 3, for the c of Newton's method on G.
    J = np.array(SHAPES["general"])
    for w in directions(13, 10):
        a = 0.8 * J * w
        q0, q1, q2, d1 = rotation.quartic_coefficients(a, J)
        roots = np.roots([1.0, -d1, q2, -q1, q0])
        smallest = min(roots[np.abs(roots.imag) < 1e-9].real)
        assert rotation.quartic_root(a, J, None) == pytest.approx(smallest, rel=1e-12)
        F = SOLVERS["cayley"](a, np.diag(J))
        # c = vee(F - F^T) / (1 + tr F)
        assert a @ rotation.vee(F - F.T) / (1.0 + np.trace(F)) == pytest.approx(smallest, rel=1e-12)


@pytest.mark.parametrize("solver", ["moser_veselov", "riccati"])
@pytest.mark.parametrize("shape", ["plate", "added"])
def test_explicit_solutions_need_positive_jd(solver, shape):
    # Plates have a singular Jd, J1 + J2 < J3 an indefinite one: Moser-Veselov then gives det F = -1.
    with pytest.raises(rotation.NoSolution):
        SOLVERS[solver](0.1 * np.array(SHAPES[shape]) * directions(14, 1)[0], np.diag(SHAPES[shape]))


def orthogonality(solver, shape, x):
    """Worst |F^T F - I| over directions; a refusal counts as 1."""
    J, worst = np.array(SHAPES[shape]), 0.0
    for w in directions(15, 10):
        try:
            F = SOLVERS[solver](x * J * w, np.diag(J))
        except rotation.NoSolution:
            return 1.0
        worst = max(worst, np.abs(F.T @ F - np.eye(3)).max())
    return worst


def test_known_losses_of_the_explicit_solutions():
    # Moser-Veselov's roots coincide for a sphere as a -> 0; Riccati divides by Jd, nearly singular for a thin rod.
    assert orthogonality("moser_veselov", "sphere", 1e-4) > 1e-10
    assert orthogonality("riccati", "rod", 0.1) > 1e-10
    for solver in ITERATIVE:
        assert max(orthogonality(solver, "sphere", 1e-4), orthogonality(solver, "rod", 0.1)) < 20 * ROUND_OFF
    with pytest.raises(rotation.NoSolution):
        SOLVERS["moser_veselov"](np.zeros(3), np.diag(SHAPES["sphere"]))


def test_moser_veselov_at_a_double_root():
    # About e1 two roots beta solve w2 w3 beta^2 - (w2 + w3 - a1^2) beta + 1 = 0, w = Jd^2; here w2 = .5625, w3 = .0625,
    # and a1 = .5 makes them equal: the root of round-off is left. The other solvers notice nothing.
    J, a = np.diag(SHAPES["general"]), np.array([0.5, 0.0, 0.0])
    exact = rotation.exp(np.arcsin(a))
    assert 1e-12 < np.abs(SOLVERS["moser_veselov"](a, J) - exact).max() < 1e-6
    for solver in ITERATIVE:
        assert np.abs(SOLVERS[solver](a, J) - exact).max() < 20 * ROUND_OFF
