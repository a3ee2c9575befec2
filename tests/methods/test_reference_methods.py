# SPDX-License-Identifier: Apache-2.0
"""The twins of the explicit, collocation, Lie group and two-part splitting methods: orders, invariants, agreement."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import scipy.linalg

from lgvi_warp.methods import tableaux
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.reference import advance, collocation, energy, explicit, munthe_kaas, near_integrable, riccati, rotation
from lgvi_warp.reference.submaps import Body, State, T, start
from lgvi_warp.reference.terms.current import CurrentProfile
from lgvi_warp.reference.terms.current_harmonics import CurrentHarmonics
from lgvi_warp.reference.terms.drag import Drag
from lgvi_warp.reference.terms.gauss_markov_current import GaussMarkovCurrent
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from lgvi_warp.reference.terms.wrench import Wrench
from tests.support.tools import TURN, difference, expected, from_state, slope
from tests.support.two_form import change, coordinates, moved, two_form

M = TURN @ np.diag([1.0, 2.0, 3.0]) @ TURN.T
J = np.diag([1.0, 2.0, 2.5])
CONSERVATIVE = (Weight(net=-0.7), Restoring(moment=np.array([0.1, -0.2, -0.5])))
WATER = (
    CurrentProfile(depths=np.array([-100.0, 100.0]), velocities=np.array([[1.0, 0.5, 0.0], [-1.0, 0.8, 0.2]])),
    CurrentHarmonics(amplitudes=np.array([[0.2, -0.1, 0.05]]), periods=np.array([3.0]), phases=np.array([0.4])),
)
DISSIPATIVE = (
    Drag(linear=np.array([0.3, 0.2, 0.4, 0.1, 0.2, 0.3]), quadratic=np.zeros(6)),
    Wrench(force=np.array([0.5, -0.3, 0.2]), torque=np.array([0.1, 0.2, -0.1])),
)
EXPLICIT = {
    "rk4": tableaux.RK4, "rk5": tableaux.DOPRI5, "rk5_ck": tableaux.CASH_KARP, "rk8": tableaux.DOP853,
}  # fmt: skip


def body_of(*terms, excess=0.0):
    return Body(0.5 * (M + M.T), J, terms, excess, np.array([0.02, -0.1, 0.05]), 0.6, np.array([0.01, 0.05, -0.02]))


def begin(body, speed=1.0):
    """A state of no symmetry."""
    p, pi = np.array([0.5, -1.2, 0.9]), np.array([0.8, 0.6, -1.1])
    return start(body, np.array([1.0, -2.0, 3.0]), TURN.T, speed * p, speed * pi)


def errors(x, body, truth):
    return np.array([np.linalg.norm(u - v) for u, v in zip(from_state(body, x), truth, strict=True)])


# Order conditions of Runge-Kutta methods: b.phi = 1 / gamma for each rooted tree (Hairer, Norsett & Wanner, II.2).


def trees(order):
    """The rooted trees with so many vertices, each the sorted tuple of its branches."""
    if order == 1:
        return [()]
    found = set()
    for k in range(1, order):
        for branch in trees(k):
            for rest in trees(order - k):
                found.add(tuple(sorted((*rest, branch))))
    return sorted(found)


def density(tree):
    """(vertices, gamma)."""
    branches = [density(branch) for branch in tree]
    size = 1 + sum(n for n, _ in branches)
    return size, size * math.prod(g for _, g in branches)


def weight(tree, a):
    """phi (stages,): the product over the branches of a phi(branch)."""
    return math.prod((a @ weight(branch, a) for branch in tree), start=np.ones(len(a)))


def square(tableau):
    a = np.zeros((len(tableau.b),) * 2)
    for i, row in enumerate(tableau.a):
        a[i, : len(row)] = row
    return a


def order_of(a, b):
    """The largest order whose conditions hold to round-off."""
    order = 0
    while order < 9:
        if any(abs(b @ weight(t, a) - 1.0 / density(t)[1]) > 1e-14 for t in trees(order + 1)):
            return order
        order += 1
    return order


def test_trees_are_all_there():
    assert [len(trees(n)) for n in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]


@pytest.mark.parametrize("name", EXPLICIT)
def test_order_conditions(name):
    tableau = EXPLICIT[name]
    a, b = square(tableau), np.array(tableau.b)
    np.testing.assert_allclose(a.sum(axis=1), tableau.c, atol=1e-15, rtol=4e-15)
    assert order_of(a, b) == tableau.order


def test_embedded_methods():
    # b - e is a method of order 4 (Dormand-Prince, with f at the end as a seventh stage), 5 and 3 (DOP853).
    a, b = square(tableaux.DOPRI5), np.array(tableaux.DOPRI5.b)
    longer = np.block([[a, np.zeros((6, 1))], [b[None], np.zeros((1, 1))]])
    assert order_of(longer, np.append(b, 0.0) - np.array(tableaux.DOPRI5.errors[0])) == 4
    a, b = square(tableaux.DOP853), np.array(tableaux.DOP853.b)
    assert [order_of(a, b - np.array(e)) for e in tableaux.DOP853.errors] == [5, 3]


def exactly(numbers):
    """The fractions that these numbers are, of six digits at most; none other is as near."""
    found = [Fraction(number).limit_denominator(10**6) for number in numbers]
    assert [float(fraction) for fraction in found] == list(numbers)
    return found


def test_the_coefficients_of_cash_and_karp_are_exact():
    """Each as a fraction: row sums, every condition up to order 5 and, of b - e, up to 4, with no remainder at all."""
    tableau = tableaux.CASH_KARP
    a = [exactly(row) for row in tableau.a]
    b, c, e = (exactly(row) for row in (tableau.b, tableau.c, tableau.errors[0]))

    def elementary(tree):
        branches = [elementary(branch) for branch in tree]
        inner = [[sum(a_ij * phi_j for a_ij, phi_j in zip(row, phi)) for row in a] for phi in branches]
        return [math.prod((column[i] for column in inner), start=Fraction(1)) for i in range(len(a))]

    def met(weights, order):
        """Whether all the conditions of this order hold."""
        left = [sum(w * phi for w, phi in zip(weights, elementary(tree), strict=True)) for tree in trees(order)]
        return left == [Fraction(1, density(tree)[1]) for tree in trees(order)]

    assert [sum(row) for row in a] == c
    assert [met(b, order) for order in range(1, 7)] == [True] * 5 + [False]
    embedded = [w - error for w, error in zip(b, e, strict=True)]
    assert [met(embedded, order) for order in range(1, 6)] == [True] * 4 + [False]


@pytest.mark.parametrize("s", range(1, 7))
def test_gauss_coefficients(s):
    # B(2s), C(s), symmetry, and b_i a_ij + b_j a_ji = b_i b_j: quadratic invariants are kept.
    g = collocation.gauss(s)
    np.testing.assert_allclose([g.b @ g.c**k for k in range(2 * s)], 1.0 / np.arange(1, 2 * s + 1), rtol=1e-14)
    for k in range(1, s + 1):
        np.testing.assert_allclose(g.a @ g.c ** (k - 1), g.c**k / k, atol=2e-16)
    np.testing.assert_allclose(g.a + g.a[::-1, ::-1], np.tile(g.b, (s, 1)), atol=2e-16)
    np.testing.assert_allclose(g.b[:, None] * g.a + (g.b[:, None] * g.a).T, np.outer(g.b, g.b), atol=1e-16)
    # Stages of a polynomial of degree s - 1 are extrapolated exactly.
    np.testing.assert_allclose(g.ahead @ g.c ** (s - 1), (1.0 + g.c) ** (s - 1), rtol=1e-10)


@pytest.mark.ci
@pytest.mark.slow_for("2-*", "4-*")
@pytest.mark.parametrize(
    ("s", "steps"), [(2, (0.1, 0.05)), (3, (0.25, 0.125)), (4, (0.5, 0.25)), (5, (1.0, 0.5)), (6, (1.0, 0.5))]
)
def test_order_of_gauss(s, steps, body, start, example):
    truth = expected(example["truth"]["5"])
    measured = [errors(collocation.advance(start, body, h, round(5 / h), s)[0], body, truth)[1] for h in steps]
    assert slope(np.array(steps), measured) == pytest.approx(2 * s, abs=0.1 * 2 * s)


def test_gauss_reaches_the_truth(body, start, example):
    x, _ = collocation.advance(start, body, 0.125, 40, 6)
    assert errors(x, body, expected(example["truth"]["5"])).max() < 1e-13


@pytest.mark.ci
def test_gauss_keeps_quadratic_invariants():
    # R^T R = I, and without forces |p|^2, p.pi and R p, which are quadratic in y: round-off of 100 steps.
    body = body_of()
    x, states = begin(body), []
    for _ in range(10):
        states.append(x)
        x, _ = collocation.advance(x, body, 0.2, 10, 3)
    assert max(np.abs(x.R.T @ x.R - np.eye(3)).max() for x in states) < 1e-14
    assert change([x.p @ x.p for x in states]) < 1e-14
    assert change([x.p @ x.pi for x in states]) < 1e-14
    assert change([energy.linear_momentum(x) for x in states]) < 1e-14
    # The energy is quadratic as well; L = R pi + b x R p is not, and moves with the error of the method.
    assert change([energy.energy(x, body) for x in states]) < 1e-14
    assert 1e-9 < change([energy.angular_momentum(x) for x in states]) < 1e-1


@pytest.mark.ci
def test_methods_agree_with_all_laws():
    # Independent methods at small steps: drag, held wrench, a current that varies in space and time.
    body = body_of(*CONSERVATIVE, *WATER, *DISSIPATIVE, excess=0.3)
    x = begin(body)
    rk8 = explicit.advance(explicit.stepper(tableaux.DOP853), x, body, 0.025, 80)
    gauss, _ = collocation.advance(x, body, 0.125, 16, 6)
    assert difference(from_state(body, rk8), from_state(body, gauss)) < 1e-12
    assert rk8.t == pytest.approx(2.0)
    lie = explicit.advance(munthe_kaas.rkmk4, x, body, 0.0125, 160)
    assert 1e-12 < difference(from_state(body, lie), from_state(body, gauss)) < 1e-8
    cg3 = explicit.advance(munthe_kaas.cg3, x, body, 0.0125, 160)
    assert 1e-10 < difference(from_state(body, cg3), from_state(body, gauss)) < 1e-5


def test_splitting_tends_to_the_same_solution():
    # The sub-maps and the right-hand side are the same equations: psi_s differs by O(h^2).
    body, steps = body_of(*CONSERVATIVE, *WATER, *DISSIPATIVE, excess=0.3), np.array([0.04, 0.02, 0.01])
    x = begin(body)
    truth, _ = collocation.advance(x, body, 0.125, 16, 6)
    truth = from_state(body, truth)
    measured = [
        difference(from_state(body, advance.advance(x, body, PROGRAMS["psi_s"], h, round(2 / h))), truth) for h in steps
    ]
    assert slope(steps, measured) == pytest.approx(2.0, abs=0.05)


def test_what_laws_remember_is_advanced_as_in_K():
    # The same noise, keyed by the step: the paths of the current agree to the last digit, the states to O(h^2).
    current = GaussMarkovCurrent(standard_deviation=np.array([0.1, 0.2, 0.1]), time_constant=2.0, seed0=7)
    body = body_of(*CONSERVATIVE, current)
    x = begin(body)
    y = explicit.advance(explicit.stepper(tableaux.RK4), x, body, 0.02, 50)
    z = advance.advance(x, body, PROGRAMS["psi_s"], 0.02, 50)
    np.testing.assert_allclose(y.memory[2], z.memory[2], rtol=1e-13)
    assert np.abs(y.memory[2]).max() > 0.01
    assert difference(from_state(body, y), from_state(body, z)) < 1e-3


def test_coupled_inertia_keeps_energy():
    # With M and J coupled, without forces: nu.p + Om.pi is kept, so the right-hand side is right.
    C = np.array([[0.1, -0.2, 0.3], [0.05, 0.2, -0.1], [-0.3, 0.1, 0.15]])
    body = replace(body_of(), C=C)
    x = begin(body)
    y = explicit.advance(explicit.stepper(tableaux.DOP853), x, body, 0.02, 100)
    kinetic = [0.5 * P @ np.linalg.solve(body.I6, P) for P in (np.append(z.p, z.pi) for z in (x, y))]
    assert kinetic[1] == pytest.approx(kinetic[0], rel=1e-13)
    np.testing.assert_allclose(energy.angular_momentum(y), energy.angular_momentum(x), atol=1e-12)


def test_adaptive_follows_time_scales():
    # Fast at first: more steps in the first 0.1 s than in the last 2 s; the sampled state is that of a fixed small step.
    body = body_of(*CONSERVATIVE, Drag(linear=np.full(6, 2.0), quadratic=np.full(6, 4.0)))
    x = begin(body, speed=20.0)
    states = explicit.adaptive(x, body, [0.1, 2.0, 4.0], 1e-9, 1e-9, tableaux.DOP853)
    assert states[0].step > states[2].step - states[1].step
    gauss, _ = collocation.advance(x, body, 0.0025, 40, 4)
    assert difference(from_state(body, states[0]), from_state(body, gauss)) < 1e-7


def test_adaptive_refuses_too_small_steps():
    body = replace(body_of(), terms=(Wrench(force=np.array([np.nan, 0.0, 0.0]), torque=np.zeros(3)),))
    with pytest.raises(ValueError, match="too small"):
        explicit.adaptive(begin(body), body, [1.0], 1e-9, 1e-9, tableaux.DOP853, h=0.1)


# The two-part splitting.


def free_body(x, body, h, order, t1=2.0):
    for _ in range(round(t1 / h)):
        x = near_integrable.D(x, body, h, order)
    return x


@pytest.mark.ci
@pytest.mark.parametrize(("order", "steps"), [(2, (0.1, 0.05, 0.025)), (4, (0.2, 0.1, 0.05)), (6, (0.2, 0.1, 0.05)),
                                              (8, (0.4, 0.25, 0.2)), (10, (0.5, 0.4, 0.25))])  # fmt: skip
def test_order_of_the_rotation(order, steps):
    # h |Om| up to 0.5 about no axis of symmetry, J full.
    body = Body(np.eye(3), TURN @ J @ TURN.T)
    x = State(np.zeros(3), np.eye(3), np.zeros(3), np.array([0.8, 1.2, -1.4]))
    truth, _ = collocation.advance(x, body, 0.1, 20, 6)
    ends = [free_body(x, body, h, order) for h in steps]
    for name in ("R", "pi"):
        measured = [np.abs(getattr(y, name) - getattr(truth, name)).max() for y in ends]
        assert slope(np.array(steps), measured) == pytest.approx(order, abs=0.05 * order)


def test_the_rotation_keeps_what_the_free_body_keeps():
    body = Body(np.eye(3), J)
    states = [begin(body, speed=2.0)]
    for _ in range(500):
        states.append(near_integrable.D(states[-1], body, 0.2))
    assert change([x.pi @ x.pi for x in states]) < 1e-12
    assert change([x.pi @ np.linalg.solve(J, x.pi) for x in states]) < 1e-12
    assert change([x.R @ x.pi for x in states]) < 1e-12


@pytest.mark.parametrize(("order", "at_most"), [(4, 1e-4), (8, 1e-8), (10, 1e-9)])
def test_the_rotation_is_symplectic_to_its_order(order, at_most):
    # Derivatives by differences are exact to 1e-10. D of equation (24) has no defect but that.
    def defect(h, order):
        def f(x):
            return near_integrable.D(x, body, h, order)

        columns = [(coordinates(f(moved(x, d)), f(x)) - coordinates(f(moved(x, -d)), f(x))) / 2e-5 for d in directions]
        derivative = np.array(columns).T
        return np.abs(derivative.T @ two_form(f(x)) @ derivative - two_form(x)).max()

    body, directions = body_of(), 1e-5 * np.eye(12)
    x = begin(body)
    assert defect(0.4, 2) < 2e-10
    assert defect(0.4, order) < at_most
    if order == 4:
        assert slope([0.4, 0.2], [defect(0.4, 4), defect(0.2, 4)]) == pytest.approx(5.0, abs=0.2)


def test_the_parts_commute():
    # Free rotation and the kick of U_b; T and the kick of U_R: so both parts are flows.
    body = body_of(*CONSERVATIVE)
    x, h, order = begin(body), 0.3, 10
    force = replace(body, terms=(CONSERVATIVE[0],))
    other = near_integrable.A(x, force, h, order)
    f, _ = body.wrench(x.b, x.R)
    swapped = near_integrable.D(replace(x, p=x.p + h * f), body, h, order)
    assert difference(from_state(body, other), from_state(body, swapped)) < 1e-15
    _, m = body.wrench(x.b, x.R)
    swapped = T(replace(x, pi=x.pi + h * m), body, h)
    assert difference(from_state(body, near_integrable.B(x, body, h)), from_state(body, swapped)) < 1e-15


def pendulum(program, n):
    """(q, p) at t = 4, A: q' = p, B: p' = -sin q: a Runge-Kutta-Nystroem problem of no other structure."""
    q, p = 1.5, 0.7
    for _ in range(n):
        for part, c in program:
            if part == "A":
                q += c * 4.0 / n * p
            else:
                p -= c * 4.0 / n * math.sin(q)
    return np.array([q, p])


@pytest.mark.parametrize(("name", "counts"), [("strang", (64, 128)), ("rkn4_6", (32, 64)), ("rkn6_11", (8, 12, 16)),
                                              ("rkn6_14", (12, 16, 20))])  # fmt: skip
def test_order_of_the_coefficients(name, counts):
    program, truth = near_integrable.PROGRAMS[name], pendulum(near_integrable.PROGRAMS["rkn6_11"], 300)
    assert [sum(c for part, c in program if part == letter) for letter in "AB"] == pytest.approx([1.0, 1.0], abs=1e-15)
    measured = [np.abs(pendulum(program, n) - truth).max() for n in counts]
    order = near_integrable.ORDERS[name]
    assert slope(1.0 / np.array(counts), measured) == pytest.approx(order, abs=0.1 * order)


def test_the_rotation_refuses_large_steps():
    body = body_of()
    with pytest.raises(rotation.NoSolution):
        near_integrable.D(begin(body), body, 3.0)


# Equation (24) by a Riccati equation.

SHAPES = {
    "paper": np.diag([5.46, 5.29, 5.72]), "general": TURN @ J @ TURN.T, "near sphere": np.diag([1.0, 1.001, 1.002]),
}  # fmt: skip


@pytest.mark.parametrize("fraction", [1e-6, 0.01, 0.5, 0.9, 0.999])
@pytest.mark.parametrize("shape", SHAPES)
def test_riccati_agrees_with_newton(shape, fraction):
    # fraction: |J^-1 a|, below 1. a near 0 loses digits of a, not of F.
    inertia, rng = SHAPES[shape], np.random.default_rng(5)
    size = np.linalg.norm(rotation.modified_inertia(inertia), 2)
    for u in rng.normal(size=(10, 3)):
        a = inertia @ (fraction / np.linalg.norm(u) * u)
        F = riccati.sign(a, inertia)
        # About ten inverses of 6 by 6, each with 6 units of round-off of the sign's norm, which grows as the step nears
        # its limit; in units of Jd, on which F does not depend.
        sign = riccati.matrix_sign(riccati.hamiltonian(a / size, inertia / size))
        round_off = 10 * 6 * np.finfo(float).eps * np.linalg.norm(sign, 2)
        np.testing.assert_allclose(F, rotation.newton(a, inertia), rtol=0.0, atol=round_off)
        np.testing.assert_allclose(F, rotation.riccati(a, inertia), rtol=0.0, atol=round_off)
        A, Jd = 0.5 * rotation.hat(a), rotation.modified_inertia(inertia)
        S = scipy.linalg.solve_continuous_are(-A, np.eye(3), A @ A + Jd @ Jd, np.eye(3))
        np.testing.assert_allclose(F, (A + S) @ np.linalg.inv(Jd), rtol=0.0, atol=round_off)
        residual, orthogonality = riccati.quality(F, a, inertia)
        assert residual < max(1e-14, 1e-15 / fraction)
        assert orthogonality < 2.0 * round_off


def largest(solve, direction, inertia):
    """The largest |a| along a direction that it solves, by bisection."""
    low, high = 0.0, 4.0 * np.linalg.norm(inertia @ direction)
    for _ in range(30):
        middle = 0.5 * (low + high)
        try:
            solve(middle * direction, inertia)
            low = middle
        except ValueError:
            high = middle
    return low


def test_range_of_riccati():
    # Up to the largest a for which (24) has a solution: a double root of the quartic, past |J^-1 a| = 1 off the axes.
    inertia = SHAPES["general"]
    for u in np.random.default_rng(6).normal(size=(3, 3)):
        reach = largest(riccati.sign, u, inertia)
        assert reach == pytest.approx(largest(rotation.quartic, u, inertia), rel=1e-4)
        assert np.linalg.norm(np.linalg.solve(inertia, reach * u)) > 1.0


def test_where_riccati_fails():
    a = np.array([0.01, 0.02, 0.03])
    with pytest.raises(rotation.NoSolution, match="plate"):
        riccati.sign(a, np.diag([1.0, 2.0, 3.0]))
    # A thin rod has a nearly singular Jd: digits of orthogonality go as its condition, where Newton keeps all.
    rod = np.diag([1e-4, 1.0, 1.0])
    a = rod @ np.array([0.3, 0.2, 0.1])
    assert riccati.quality(riccati.sign(a, rod), a, rod)[1] > 1e-12
    assert riccati.quality(rotation.newton(a, rod), a, rod)[1] < 1e-15
