# SPDX-License-Identifier: Apache-2.0
"""Rare events of standard normals whose probabilities have closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import chi2, multivariate_normal

from lgvi_warp.uncertainty.rare import search
from lgvi_warp.uncertainty.rare.cheaper import compared
from lgvi_warp.uncertainty.rare.mixture import Mixture, WeightedMembers, doubts, fitted, log_weights, uncovered
from lgvi_warp.uncertainty.rare.plain import sampled
from lgvi_warp.uncertainty.rare.search import joined, unseen
from lgvi_warp.uncertainty.rare.subset import NoProgress, climb, share_variance
from tests.support.levels import first_levels
from tests.support.rare import searched

CASES = ("one side", "two sides", "unequal sides", "a ball", "20 inputs")


def case(name, p):
    """(limit, number of normals) of an event of probability p."""
    beyond = -ndtri(p)
    if name == "one side":
        return (lambda u: u.sum(axis=1) / 3.0 - beyond), 9
    if name == "two sides":
        return (lambda u: np.abs(u[:, 0]) + ndtri(p / 2)), 4
    if name == "unequal sides":
        return (lambda u: np.maximum(u[:, 0] + ndtri(0.62 * p), -u[:, 0] + ndtri(0.38 * p))), 4
    if name == "a ball":
        return (lambda u: np.sqrt((u**2).sum(axis=1)) - math.sqrt(chi2.isf(p, 6))), 6
    return (lambda u: u.sum(axis=1) / math.sqrt(20.0) - beyond), 20


def answers(name, p, seeds, **more):
    limit, d = case(name, p)
    return [searched(limit, d, seed=seed, **more) for seed in seeds]


@pytest.mark.ci
@pytest.mark.parametrize("name", CASES)
def test_the_answer_is_within_three_spreads(name):
    (found,) = answers(name, 1e-5, [1])
    assert abs(found.probability / 1e-5 - 1.0) < 3.0 * found.spread
    assert found.members < 1e5
    low, high = found.interval()
    assert low < found.probability < high
    limit, _ = case(name, 1e-5)
    assert (limit(found.failing) > 0.0).all()
    assert found.weights.sum() == pytest.approx(1.0)
    assert len(np.unique(found.failing, axis=0)) == len(found.failing)


@pytest.mark.slow
@pytest.mark.parametrize("p, most", [(1e-5, 1e5), (1e-7, 2.5e5)])
@pytest.mark.parametrize("name", CASES)
def test_spreads_are_told_as_they_are_over_seeds(name, p, most, monkeypatch):
    hidden = []
    monkeypatch.setattr(search, "unseen", lambda *values: hidden.append(unseen(*values)) or hidden[-1])
    found = answers(name, p, range(40))
    ratios = np.array([each.probability for each in found]) / p
    spreads = np.array([each.spread for each in found])
    # 38 of 40 is 19 in 20.
    assert (np.abs(ratios - 1.0) <= 3.0 * spreads).sum() >= 38
    # A standard deviation of 40 runs is known to 11 %, which is less than what 1.5 allows.
    assert ratios.std() / math.sqrt((spreads**2).mean()) < 1.5
    # What weights may not have seen (B18) is told beside, and is absent here.
    by_weights = [each for each in found if each.estimator == "importance"]
    beside = np.square(hidden).mean() * len(by_weights) / len(found) if hidden else 0.0
    assert ratios.std() / math.sqrt((spreads**2).mean() - beside) > 1.0 / 1.5
    assert np.mean([each.members for each in found]) <= most
    if name in ("one side", "two sides", "unequal sides"):
        # The few whose weights were not believed took chains.
        assert len(by_weights) >= 32
        # Two levels more take 6,000 members more.
        assert np.mean([each.members for each in by_weights]) <= (2e4 if p == 1e-5 else 2.6e4)


@pytest.mark.slow
def test_no_side_is_lost_in_200_runs():
    found = answers("unequal sides", 1e-5, range(200))
    ratios = np.array([each.probability for each in found]) / 1e-5
    assert ratios.min() > 0.7


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two sides", "a ball"])
def test_chains_alone_are_right(name):
    found = answers(name, 1e-5, range(20), weighted=False)
    ratios = np.array([each.probability for each in found]) / 1e-5
    assert {each.estimator for each in found} == {"subset"}
    assert (np.abs(ratios - 1.0) <= 3.0 * np.array([each.spread for each in found])).sum() >= 19
    # A second round, where four runs happen to differ, has no more members than the first.
    assert np.mean([each.members for each in found]) < 1.1e5
    assert max(each.members for each in found) < 2e5


def test_chains_keep_the_law_of_each_level():
    # Beyond 1 the normal has the mean phi(1) / (1 - Phi(1)) = 1.525; where the event says nothing it stays N(0, 1).
    rng = np.random.default_rng(3)
    (run,) = climb(lambda u: u[:, 0] - 1.0, first_levels(lambda u: u[:, 0] - 1.0, 2, 20_000, [rng]), [rng])
    assert run.thresholds.tolist() == [-math.inf]  # 16 % of the first level: no chains
    rng = np.random.default_rng(4)
    (run,) = climb(lambda u: u[:, 0] - 3.0, first_levels(lambda u: u[:, 0] - 3.0, 2, 20_000, [rng]), [rng])
    beyond = math.exp(-4.5) / math.sqrt(2.0 * math.pi) / ndtr(-3.0)
    assert run.failing[:, 0].mean() == pytest.approx(beyond, abs=0.02)
    assert run.failing[:, 1].mean() == pytest.approx(0.0, abs=0.15)
    assert run.failing[:, 1].std() == pytest.approx(1.0, abs=0.1)
    assert run.probability == pytest.approx(ndtr(-3.0), rel=0.15)
    assert 0.35 < run.acceptance[1:].mean() < 0.55


def test_the_same_seed_has_the_same_bits():
    a, b = answers("unequal sides", 1e-5, [7]) + answers("unequal sides", 1e-5, [7])
    assert (a.probability, a.spread, a.members) == (b.probability, b.spread, b.members)
    np.testing.assert_array_equal(a.failing, b.failing)
    assert answers("unequal sides", 1e-5, [8])[0].probability != a.probability


def test_progress_is_told_and_never_taken_back():
    told = []
    answers("a ball", 1e-5, [1], report=told.append)
    assert told == sorted(told)
    assert 0.0 < told[0] < 0.3
    assert told[-1] == 1.0


def test_what_is_likely_is_sampled_plainly():
    found = searched(lambda u: u[:, 0] - 2.0, 3)
    assert found.estimator == "plain"
    assert abs(found.probability / ndtr(-2.0) - 1.0) < 4.0 * found.spread
    assert found.spread < 0.1
    many = searched(lambda u: u.sum(axis=1) / math.sqrt(300.0) - 2.0, 300)
    assert many.estimator == "plain"
    assert abs(many.probability / ndtr(-2.0) - 1.0) < 4.0 * many.spread


def test_plain_members_that_meet_no_event_leave_it_to_chains():
    # Some 3,000 plain members expect 4 events: of a hundred seeds one meets none.
    p, d = 1.2e-3, 70
    found = searched(lambda u: u.sum(axis=1) / math.sqrt(d) + ndtri(p), d, relative_error=0.5, seed=45)
    assert found.estimator == "subset"
    assert abs(found.probability / p - 1.0) < 3.0 * found.spread
    assert found.weights.sum() == pytest.approx(1.0)


def test_plain_members_are_told_where_they_are_too_few():
    found = searched(lambda u: u[:, 0] - 2.0, 3, relative_error=0.005, most=10_000)
    assert found.estimator == "plain"
    assert found.members < 20_000
    assert any("more than the 10,000 members" in note for note in found.notes)


def test_plain_members_are_those_that_happen():
    found = sampled(lambda u: u[:, 0] - 1.0, 2, 4096, seed=0)
    assert (found.failing[:, 0] > 1.0).all()
    np.testing.assert_array_equal(found.limits, found.failing[:, 0] - 1.0)
    none = sampled(lambda u: u[:, 0] - 100.0, 2, 256, seed=0)
    assert (none.probability, none.spread, len(none.failing)) == (0.0, math.inf, 0)


def test_members_that_may_be_run_end_the_search():
    found = searched(case("a ball", 1e-7)[0], 6, seed=1, most=20_000)
    assert found.members < 30_000
    assert found.spread > 0.15
    assert any("more than the 20,000 members" in note for note in found.notes)


def test_chains_by_a_cheaper_limit_answer_for_the_right_one():
    limit, d = case("one side", 1e-5)
    ran = []

    def counted(u):
        ran.append(len(u))
        return limit(u)

    found = searched(counted, d, seed=2, chained=lambda u: limit(u) + 0.1 * np.sin(5.0 * u[:, 0]), margin=0.4)
    assert found.estimator == "importance"
    assert abs(found.probability / 1e-5 - 1.0) < 3.0 * found.spread
    assert sum(ran) < 0.5 * found.members  # the draws of mixtures alone


def test_chains_go_on_by_the_right_limit_near_failure():
    limit, d = case("a ball", 1e-5)
    ran = []

    def counted(u):
        ran.append(len(u))
        return limit(u)

    chained = lambda u: limit(u) + 0.1 * np.sin(5.0 * u[:, 0])  # noqa: E731
    found = searched(counted, d, seed=2, weighted=False, chained=chained, margin=0.4)
    assert abs(found.probability / 1e-5 - 1.0) < 3.0 * found.spread
    assert sum(ran) < 0.6 * found.members


def test_a_cheaper_limit_that_shuts_failures_out_is_noticed():
    limit, d = case("two sides", 1e-5)
    # It does not see one of the sides.
    found = searched(limit, d, seed=2, weighted=False, chained=lambda u: u[:, 0] + ndtri(5e-6) - 0.3, margin=0.3)
    assert any("hardly near failure" in note for note in found.notes)


@pytest.mark.parametrize("limit, kind", [
    (lambda u: np.where(u[:, 0] > 9.0, 1.0, -1.0), "steps"),
    (lambda u: np.floor(u[:, 0]) - 8.0, "steps"),
    (lambda u: np.minimum(u[:, 0], 2.0) - 3.0, "steps"),
    (lambda u: np.tanh(u[:, 0]) - 1.1, "never"),
    (lambda u: 1000.0 - (u[:, 0] - 1.0) ** 2 - 1000.1, "never"),
])  # fmt: skip
def test_what_comes_no_nearer_ends(limit, kind):
    with pytest.raises(NoProgress) as stuck:
        searched(limit, 2)
    assert stuck.value.kind == kind
    assert stuck.value.largest <= 0.0


def test_members_that_fail_count_as_the_event():
    # A member that fails has an infinite limit: it is beyond every threshold. Here on the way to the event.
    found = searched(lambda u: np.where((u[:, 0] > 3.5) & (u[:, 1] > 1.0), np.inf, u[:, 0] - 4.0), 2, seed=1)
    p, lost = ndtr(-4.0) + (ndtr(-3.5) - ndtr(-4.0)) * ndtr(-1.0), ndtr(-3.5) * ndtr(-1.0)
    assert abs(found.probability / p - 1.0) < 3.0 * found.spread
    assert found.weights[np.isinf(found.limits)].sum() == pytest.approx(lost / p, abs=0.1)


def test_a_mixture_finds_two_places():
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.normal(4.0, 0.2, (300, 2)), rng.normal(-4.0, 0.2, (100, 2))])
    found = fitted(points, rng)
    assert len(found.shares) == 2
    assert sorted(found.shares) == pytest.approx([0.25, 0.75], abs=0.01)
    assert sorted(found.means[:, 0]) == pytest.approx([-4.0, 4.0], abs=0.1)


def test_the_density_of_a_mixture_is_that_of_scipy():
    from scipy.stats import multivariate_normal

    root = np.array([[[1.0, 0.0], [0.5, 2.0]], [[0.3, 0.0], [0.0, 0.4]]])
    mixture = Mixture(np.array([0.3, 0.7]), np.array([[1.0, 2.0], [-1.0, 0.0]]), root)
    u = np.random.default_rng(1).standard_normal((50, 2))
    density = sum(
        share * multivariate_normal(mean, each @ each.T).pdf(u)
        for share, mean, each in zip(mixture.shares, mixture.means, root, strict=True)
    )
    np.testing.assert_allclose(np.exp(mixture.log_density(u)), density, rtol=1e-12)
    np.testing.assert_allclose(
        np.exp(log_weights(mixture, u)), multivariate_normal(np.zeros(2)).pdf(u) / density, rtol=1e-12
    )
    wide = mixture.widened()
    assert len(wide.shares) == 4
    assert wide.shares.sum() == pytest.approx(1.0)


def test_weights_of_a_shifted_normal_are_right():
    # Beyond 3, drawn from N(3, 1): E[w 1] = Phi(-3), and the variance of w has a closed form: exp(9) Phi(-6).
    rng, n = np.random.default_rng(5), 200_000
    shifted = Mixture(np.ones(1), np.array([[3.0]]), np.ones((1, 1, 1)))
    u = shifted.draw(rng, n)
    found = WeightedMembers.of(u, u[:, 0] - 3.0, shifted)
    p, square = ndtr(-3.0), math.exp(9.0) * ndtr(-6.0)
    spread = math.sqrt((square - p**2) / n) / p
    assert found.spread == pytest.approx(spread, rel=0.02)
    assert abs(found.probability / p - 1.0) < 4.0 * spread
    assert found.effective == pytest.approx(n * p**2 / square, rel=0.05)


def test_a_side_that_weights_do_not_see_is_doubted():
    # Members on two sides; the mixture is about one of them.
    rng = np.random.default_rng(6)
    one = Mixture(np.ones(1), np.array([[4.5, 0.0]]), np.array([np.diag([0.3, 1.0])])).widened()
    u = one.draw(rng, 4000)
    found = WeightedMembers.of(u, np.abs(u[:, 0]) - 4.2, one)
    here = np.column_stack([rng.normal(4.4, 0.1, 200), rng.standard_normal(200)])
    assert uncovered(found, one, [here]) == 0.0
    assert uncovered(found, one, [here, here * [-1.0, 1.0]]) == 1.0
    told = doubts(found, one, found.probability, 0.2, [here, here * [-1.0, 1.0]], 0.1)
    assert any("hardly draws" in reason for reason in told)
    assert doubts(found, one, found.probability, 0.2, [here], 0.1) == []
    assert any(
        "where the chains give" in reason for reason in doubts(found, one, 5.0 * found.probability, 0.2, [here], 0.1)
    )


def test_nothing_drawn_that_fails_has_no_weight():
    one = Mixture(np.ones(1), np.zeros((1, 2)), np.eye(2)[None])
    found = WeightedMembers.of(np.zeros((5, 2)), -np.ones(5), one)
    assert (found.probability, found.spread) == (0.0, math.inf)
    assert doubts(found, one, 1e-5, 0.2, [np.ones((3, 2))], 0.1)


def test_chains_that_differ_more_than_they_say_are_believed():
    limit, d = case("two sides", 1e-5)
    gens = [np.random.default_rng(i) for i in range(4)]
    runs = climb(limit, first_levels(limit, d, 500, gens), gens)
    _, _, degrees = joined(runs)
    assert degrees > 3.0
    from dataclasses import replace

    apart = [replace(run, probability=p) for run, p in zip(runs, (1e-5, 9e-5, 1e-6, 2e-6), strict=True)]
    probability, spread, degrees = joined(apart)
    assert (probability, degrees) == (pytest.approx(25.75e-6), 3.0)
    assert spread == pytest.approx(np.std([1e-5, 9e-5, 1e-6, 2e-6], ddof=1) / 2.0 / probability)


def test_the_variance_of_a_share():
    happens = np.arange(100) < 10
    assert share_variance(happens, 100) == pytest.approx(0.9 / (0.1 * 100))
    # Ten chains, one of which is all inside: as one of ten independent members.
    assert share_variance(happens, 10) == pytest.approx(np.var([1.0] + [0.0] * 9, ddof=1) / (0.01 * 10))


def test_limits_are_compared_where_both_are_numbers():
    x = np.linspace(-1.0, 0.0, 40)
    own = 2.0 * x + 0.5
    offset, slope, missed, shared = compared(own, np.where(np.arange(40) == 3, np.inf, x))
    assert (offset, slope, shared) == pytest.approx((0.5, 2.0, 1.0))
    assert missed == pytest.approx(0.0, abs=1e-12)
    assert compared(own, -x)[3] == 0.0
    assert compared(own, np.zeros(40))[3] == 0.0


@pytest.mark.parametrize("n", [0, 1, 499, 501, 2000])
def test_a_mixture_has_the_density_of_its_parts(n):
    """Products are made in parts of rows; SciPy has the density of each normal part as a whole."""
    rng = np.random.default_rng(n)
    roots = np.tril(0.1 * rng.standard_normal((2, 20, 20))) + np.eye(20)
    mixture, u = Mixture(np.array([0.3, 0.7]), rng.standard_normal((2, 20)), roots), rng.standard_normal((n, 20))
    parts = zip(mixture.shares, mixture.means, roots, strict=True)
    density = sum((p * multivariate_normal(m, root @ root.T).pdf(u) for p, m, root in parts), np.zeros(n))
    # Exponents are of the order 100, and condition numbers of the covariances below 1e3: 1e5 eps.
    np.testing.assert_allclose(mixture.log_density(u), np.log(density), rtol=0.0, atol=2e-11)
