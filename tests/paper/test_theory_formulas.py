# SPDX-License-Identifier: Apache-2.0
"""Formulas of docs/theory/ as they are printed there, evaluated by other means, against the functions that hold them."""

import itertools

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.optimize
import scipy.stats

import lgvi_warp as lw
from lgvi_warp.reference import classical, collocation, coupled, rotation
from lgvi_warp.reference.control import Part
from lgvi_warp.reference.control.loop import Loop
from lgvi_warp.reference.submaps import Body, State
from lgvi_warp.reference.terms.drag import Drag
from lgvi_warp.reference.terms.driven import ControlWrench
from lgvi_warp.reference.terms.following import chased
from lgvi_warp.statistics.counts import Exceedance
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.moments import Covariance, Mean
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.uncertainty.estimating import estimators, target
from lgvi_warp.uncertainty.rare.search import joined
from lgvi_warp.uncertainty.rare.subset import SubsetRun

# The paper's example: J, and h Omega = h (0.3, 0.2, 0.1) with h = 0.01; larger steps beside it.
J = np.array([5.46, 5.29, 5.72])
RNG = np.random.default_rng(24)


def printed_quartic(a):
    """The coefficients of (R8) from s^4 down, by elementary symmetric functions of D = 2 J."""
    D1, D2, D3 = D = 2.0 * J
    A = a @ a
    _, d1, d2, d3 = np.poly(-D)
    e = a[0] ** 2 * D2 * D3 + a[1] ** 2 * D3 * D1 + a[2] ** 2 * D1 * D2
    return [1.0, -d1, d2 + 2.0 * A, -(d3 + d1 * A), e + A**2]


@pytest.mark.parametrize("h", [0.01, 0.5, 2.0])
def test_the_root_of_the_quartic_solves_equation_24(h):
    # (R7), (R8): s by numpy's roots, c by numpy's solve, F by the Cayley map in its other form.
    a = h * J * np.array([0.3, 0.2, 0.1])
    roots = np.roots(printed_quartic(a))
    s = min(root.real for root in roots if abs(root.imag) < 1e-9 * abs(root))
    c = np.linalg.solve(np.diag(2.0 * J - s) - rotation.hat(a), a)
    F = np.linalg.solve(np.eye(3) - rotation.hat(c), np.eye(3) + rotation.hat(c))
    Jd = np.diag(0.5 * J.sum() - J)
    # A root of a quartic by eigenvalues has some 1e-12 of the largest root, which s is far below.
    assert np.abs(F @ Jd - Jd @ F.T - rotation.hat(a)).max() < 1e-10
    assert a @ c == pytest.approx(s, rel=1e-6)
    np.testing.assert_allclose(rotation.quartic(a, np.diag(J)), F, atol=1e-11)


def test_the_series_of_the_root():
    # (R10) is off by the fourth power of x, of x itself by the third, and x goes as h^2: 64 from h to h / 2.
    def missed(h):
        _, minus_d1, q2, minus_q1, q0 = printed_quartic(h * J * np.array([0.3, 0.2, 0.1]))
        x = q0 / -minus_q1
        u, w = q2 * x / -minus_q1, -minus_d1 * x**2 / -minus_q1
        root = scipy.optimize.brentq(lambda s: np.polyval(printed_quartic(h * J * np.array([0.3, 0.2, 0.1])), s), 0.0, 4 * x,
                                     xtol=1e-18, rtol=1e-15)  # fmt: skip
        return abs(x * (1.0 - u - w) / (1.0 - 2.0 * u) - root) / root

    # The next order changes the ratio by some 25 h^2: 1.6 of 64 at h = 1/4.
    assert missed(0.25) / missed(0.125) == pytest.approx(64.0, rel=0.05)


def test_the_cubic_of_moser_and_veselov():
    # (R13): three points more than its degree in lambda^2, by the determinant itself; (R14) is then tested by (24).
    a, Jd = 0.4 * J * np.array([0.3, -0.5, 0.6]), 0.5 * J.sum() - J
    for root in rotation.moser_veselov_roots(a, Jd**2):
        assert abs(np.linalg.det(np.eye(3) - root * rotation.hat(a) - root**2 * np.diag(Jd**2))) < 1e-12
    assert rotation.residual(rotation.moser_veselov(a, np.diag(J)), a, np.diag(J)) < 1e-12


def general_body():
    """A 6x6 inertia with coupling of all kinds."""
    A = np.random.default_rng(6).normal(size=(6, 6))
    return A @ A.T + 3.0 * np.diag([6.0, 8.0, 9.0, 1.0, 2.0, 3.0])


def test_the_square_is_a_sum_of_moments_about_three_lines():
    # (X3), (X8): (pi - U^T p)_i = (pi - a_i x p)_i - k_i p_i.
    body = coupled.reduce_x(general_body())
    p, pi = RNG.normal(size=(2, 3))
    lines = [(pi - np.cross(body.a[i], p))[i] - body.U[i, i] * p[i] for i in range(3)]
    np.testing.assert_allclose(pi - body.U.T @ p, lines, atol=1e-14)
    # The energy of the user's velocities is (X3) in the momenta.
    nu, Om = RNG.normal(size=(2, 3))
    x = body.to_reduced(np.zeros(3), np.eye(3), nu, Om)
    rest = x.pi - body.U.T @ x.p
    by_momenta = 0.5 * x.p @ body.A @ x.p + 0.5 * rest @ (rest / body.Js)
    assert coupled.energy(np.zeros(3), np.eye(3), nu, Om, general_body()) == pytest.approx(by_momenta, rel=1e-13)


@pytest.mark.parametrize("i", [1, 2, 3])
def test_angle_and_slide_of_a_screw_have_one_generating_function(i):
    # (X9): differences of chi, order 2 of 1e-5 and round-off over it.
    body, h = coupled.reduce_x(general_body()), 0.3
    p, pi = RNG.normal(size=(2, 3))
    g, k = 0.5 * h / body.Js[i - 1], body.U[i - 1, i - 1]

    def chi(p_i, pi_i):
        turned = scipy.integrate.quad(lambda y: 2.0 * np.arctan(g * y + (g * y) ** 3 / 3.0), 0.0, pi_i, epsabs=1e-14)[0]
        return turned + 2.0 * pi_i * np.arctan(-g * k * p_i) + g * k**2 * p_i**2

    d = 1e-5
    angle = (chi(p[i - 1], pi[i - 1] + d) - chi(p[i - 1], pi[i - 1] - d)) / (2.0 * d)
    slide = (chi(p[i - 1] + d, pi[i - 1]) - chi(p[i - 1] - d, pi[i - 1])) / (2.0 * d)
    x = coupled.R_i(coupled.CoupledState(np.zeros(3), np.eye(3), p, pi), body, i, h)
    np.testing.assert_allclose(x.b, slide * np.eye(3)[i - 1], atol=1e-8)
    np.testing.assert_allclose(x.R, scipy.linalg.expm(angle * rotation.hat(np.eye(3)[i - 1])), atol=1e-8)


def test_a_screw_moves_by_the_exponential_of_its_twist():
    # (K14): the exponential of a matrix (4, 4).
    d, theta = RNG.normal(size=(2, 3))
    twist = np.zeros((4, 4))
    twist[:3, :3], twist[:3, 3] = rotation.hat(theta), d
    b, R = classical.along_screw(np.zeros(3), np.eye(3), d, theta)
    motion = scipy.linalg.expm(twist)
    np.testing.assert_allclose(np.column_stack([R, b]), motion[:3], atol=1e-14)


def test_the_two_stages_of_gauss():
    # (K17): Hairer, Norsett & Wanner, table II.7.3.
    r = np.sqrt(3.0) / 6.0
    method = collocation.gauss(2)
    np.testing.assert_allclose(method.a, [[0.25, 0.25 - r], [0.25 + r, 0.25]], atol=1e-15)


class Numbered(Part):
    """Commands that are the number of the tick, from 1 on."""

    def allocate(self, w, actuators):
        actuators["control_wrench"].command = np.full(6, self.of[0].tick + 1.0)
        return w


class Tick(Part):
    """Tells the others which tick it is."""

    def measure(self, y):
        self.of[:] = [y]
        return y


@pytest.mark.parametrize(("N", "d"), [(1, 0), (4, 0), (4, 3), (4, 4), (3, 7), (5, 11)])
def test_which_command_acts_in_which_step(N, d):
    # (C1), (C3), (C4): j = floor((n - d) / N), none before the first.
    shared, h = [], 0.1
    actuator = ControlWrench(limit=np.full(6, 1e6))
    loop = Loop([Tick(of=shared), Numbered(of=shared)], {"control_wrench": actuator}, N, d)
    body = Body(np.eye(3), np.eye(3), (actuator,))
    loop.begin()
    for n in range(40):
        x = State(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3), n * h, n, (np.zeros(0),))
        if n % N == 0:
            loop.tick(x, body, h)
        loop.act(n, h)
        j = (n - d) // N
        assert actuator.held[0] == (j + 1.0 if j >= 0 else 0.0), n


@pytest.mark.parametrize(("n", "lag", "rate"), [(-2.0, 0.5, 1.0), (0.4, 0.5, 1.0), (3.0, 0.2, 0.7)])
def test_the_way_of_an_actuator_to_its_command(n, lag, rate):
    # (C6): the equation by SciPy at 1e-10, over a step in which the rate's limit ends.
    def slope(t, y):
        return np.clip((0.8 - y) / lag, -rate, rate)

    end = scipy.integrate.solve_ivp(slope, (0.0, 2.6), [n], rtol=1e-10, atol=1e-12, max_step=0.01).y[0, -1]
    assert chased(n, 0.8, 0.8, lag, rate, 2.6) == pytest.approx(end, abs=1e-7)


def estimate_of(statistic, x, weight=None):
    """An estimate of numbers x (d, n) at one time."""
    part = statistic.rows_of_any(Values(x[None], weight=weight))
    return statistic.read_any(part, np.zeros(1))


def test_the_error_of_a_covariance():
    # (E3): its sums, one by one.
    x = RNG.gamma(2.0, size=(2, 30))
    found = estimate_of(Covariance(("depth", "speed")), x)
    n, (u, v) = 30, x - x.mean(axis=1, keepdims=True)
    lacking = (np.mean(u * u) * np.mean(v * v) + 2.0 * np.mean(u * v) ** 2) / n
    squared = (n / (n - 1)) ** 2 * (np.mean(u * u * v * v) - np.mean(u * v) ** 2 + lacking) / (n - 1)
    assert found.value[0, 0, 1] == pytest.approx(np.cov(x)[0, 1], rel=1e-12)
    assert found["standard_error"][0, 0, 1] == pytest.approx(np.sqrt(squared), rel=1e-12)


def test_weighted_members():
    # (E15), (E16) and (E17): their sums, one by one.
    x, w = RNG.normal(size=40), RNG.uniform(0.1, 3.0, 40)
    n, mean = w.sum() ** 2 / (w @ w), w @ x / w.sum()
    found = estimate_of(Mean("depth"), x[None], w)
    assert found.value[0, 0] == pytest.approx(mean, rel=1e-12)
    squared = n / (n - 1.0) * (w**2) @ (x - mean) ** 2 / w.sum() ** 2
    assert found["standard_error"][0, 0] == pytest.approx(np.sqrt(squared), rel=1e-12)
    above = x > 0.3
    p = w @ above / w.sum()
    variance = (w**2) @ (above - p) ** 2 / w.sum() ** 2
    ends = intervals.wilson(np.array(p), np.array(p * (1.0 - p) / variance), 0.95)
    share = estimate_of(Exceedance("depth", above=0.3), x[None], w)
    np.testing.assert_allclose([share.lower[0, 0], share.upper[0, 0]], ends, rtol=1e-12)


def test_the_worst_part_is_the_least_of_a_convex_function():
    # (E10), (E11): Rockafellar & Uryasev's minimum, over a share that ends within a member.
    costs, share = RNG.normal(size=37), 0.13

    def spread(threshold):
        return threshold + np.maximum(costs - threshold, 0.0).mean() / share

    least = min(spread(cost) for cost in costs)
    assert lw.metrics.CVaR(share)(costs[None])[0] == pytest.approx(least, rel=1e-13)
    solved = target.Sought("cvar", share).solved([(1.0, costs)])
    assert solved.value == pytest.approx(least, rel=1e-12)


@pytest.mark.parametrize(("n", "q"), [(40, 0.5), (200, 0.05), (61, 0.9)])
def test_ranks_hold_the_quantile_as_often_as_they_say(n, q):
    # (E8): the sum of binomial probabilities; one rank less on either side holds too little in its tail.
    low, high = (int(rank[0]) for rank in intervals.ranks(np.array([n]), np.array([q]), 0.95))
    law = scipy.stats.binom(n, q)
    assert law.cdf(high - 1) - law.cdf(low - 1) >= 0.95
    assert law.cdf(low - 1) <= 0.025 < law.cdf(low)
    assert law.sf(high - 1) <= 0.025 < law.sf(high - 2)


def test_wilson_holds_all_that_are_near_enough():
    # (E5): the ends are where |p - p0| = z sqrt(p0 (1 - p0) / n).
    p, n = 0.17, 90.0
    for p0 in intervals.wilson(np.array(p), np.array(n), 0.95):
        assert abs(p - p0) == pytest.approx(scipy.stats.norm.ppf(0.975) * np.sqrt(p0 * (1.0 - p0) / n), rel=1e-12)


def test_numbers_of_members_are_the_cheapest():
    # (E22): SciPy's minimum of the cost in logarithms, subject to the variance, is no cheaper.
    V, C, v = np.array([4.0, 0.3, 0.02]), np.array([1.0, 5.0, 40.0]), 1e-3
    n = estimators.best_numbers([estimators.VarianceModel(*each) for each in zip(V, C, strict=True)], v)
    assert np.sum(V / n) == pytest.approx(v, rel=1e-12)
    found = scipy.optimize.minimize(
        lambda log: np.log(C @ np.exp(log)), np.log(np.full(3, 1e4)), method="SLSQP", options={"ftol": 1e-14},
        constraints={"type": "eq", "fun": lambda log: np.log(np.sum(V * np.exp(-log)) / v)},
    )  # fmt: skip
    assert np.log(C @ n) == pytest.approx(found.fun, abs=1e-7)


def test_levels_add_up_for_any_factors():
    # (E20): of the same members at every level the sum is the finest mean, whatever the factors.
    x, factors = RNG.normal(size=(3, 50)), (0.7, -1.3)
    total, weight = 0.0, 1.0
    for (fine, coarse), factor in zip(itertools.pairwise(x), factors, strict=True):
        total += weight * np.mean(fine - factor * coarse)
        weight *= factor
    assert total + weight * x[-1].mean() == pytest.approx(x[0].mean(), rel=1e-12)
    # (E21): no other factor leaves less.
    factor, left = estimators.slope(x[0], x[1])
    assert left == pytest.approx(1.0 - np.corrcoef(x[0], x[1])[0, 1] ** 2, rel=1e-12)
    for other in (0.9 * factor, 1.1 * factor):
        assert np.var(x[0] - other * x[1]) > np.var(x[0] - factor * x[1])


def test_runs_of_chains_are_joined_by_what_both_say():
    # (B6): the sums, one by one; the spread between these runs is what chance explains.
    P, spreads, N = np.array([1.1e-5, 0.9e-5, 1.2e-5]), np.array([0.11, 0.12, 0.1]), np.array([1000, 1000, 2000])
    nothing = np.zeros(0)
    runs = [
        SubsetRun(p, spread, nothing, (), nothing, nothing.reshape(0, 1), nothing, int(size), int(size))
        for p, spread, size in zip(P, spreads, N, strict=True)
    ]
    mean = N @ P / N.sum()
    between, own = N @ (P / mean - 1.0) ** 2 / 2.0, np.mean(N * (1.2 * spreads) ** 2)
    probability, spread, degrees = joined(runs)
    assert (probability, degrees) == (pytest.approx(mean, rel=1e-13), 14.0)
    assert spread == pytest.approx(np.sqrt((2.0 * between + 12.0 * own) / 14.0 / N.sum()), rel=1e-13)


def test_drag_alone_by_its_equation():
    # (S13): SciPy at 1e-10.
    law, inertia = Drag(linear=np.full(6, 3.0), quadratic=np.full(6, 20.0)), np.full(6, 12.0)
    end = scipy.integrate.solve_ivp(
        lambda t, v: -(3.0 + 20.0 * abs(v)) * v / 12.0, (0.0, 0.7), [-1.3], rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(law.exact(inertia * -1.3, inertia, 0.7) / inertia, end.y[0, -1], rtol=1e-8)
