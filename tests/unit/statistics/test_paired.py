# SPDX-License-Identifier: Apache-2.0
"""Intervals of probabilities, and of differences on the same members: against scipy, and how often they cover."""

import numpy as np
import pytest
from scipy import optimize, stats

from lgvi_warp.statistics.estimates import intervals, paired


@pytest.mark.parametrize(("hits", "count"), [(0, 10), (1, 10), (7, 10), (10, 10), (13, 4000), (0, 0)])
@pytest.mark.parametrize("confidence", [0.9, 0.95])
def test_exact_intervals_are_scipys(hits, count, confidence):
    lower, upper = intervals.clopper_pearson(hits, count, confidence)
    if not count:
        assert (lower, upper) == (0.0, 1.0)
        return
    for method, ends in (("exact", (lower, upper)), ("wilson", intervals.wilson(hits / count, count, confidence))):
        expected = stats.binomtest(hits, count).proportion_ci(confidence, method)
        np.testing.assert_allclose(ends, expected, rtol=1e-10, atol=1e-14)


def test_of_none_seen_the_limit_is_one_sided():
    assert intervals.none_of(0, 0.95) == 1.0
    for n in (1, 59, 4000):
        # n trials without a hit have probability 0.05 at the limit.
        assert (1.0 - intervals.none_of(n, 0.95)) ** n == pytest.approx(0.05, rel=1e-12)
    assert intervals.none_of(59, 0.95) < 0.05 < intervals.none_of(58, 0.95)


def score(delta, more, less, n):
    """The score statistic of a difference, whose discordant probability maximises the likelihood numerically."""

    def minus_log_likelihood(q):
        p = np.array([q + delta, q, 1.0 - 2.0 * q - delta])
        return -np.sum(np.array([more, less, n - more - less]) * np.log(np.maximum(p, 1e-300)))

    ends = max(0.0, -delta), 0.5 * (1.0 - delta)
    q = optimize.minimize_scalar(minus_log_likelihood, bounds=ends, method="bounded", options={"xatol": 1e-12}).x
    return (more - less - n * delta) / np.sqrt(n * (2.0 * q + delta * (1.0 - delta)))


@pytest.mark.parametrize(("less", "more", "n"), [(2, 12, 50), (0, 7, 60), (9, 9, 30), (1, 0, 400)])
def test_the_score_is_at_its_limit_at_both_ends(less, more, n):
    found = paired.proportions(less, more, n, 0.95)
    assert found.lower < found.value < found.upper
    assert found.value == (more - less) / n
    # The numerical maximum knows q to the root of the round-off, 1e-8.
    assert score(found.lower, more, less, n) == pytest.approx(stats.norm.ppf(0.975), abs=1e-5)
    assert score(found.upper, more, less, n) == pytest.approx(-stats.norm.ppf(0.975), abs=1e-5)


def test_where_nothing_differs_the_interval_is_of_the_number_of_pairs():
    # With no member that differs the score is -n d / sqrt(n d (1 - d)): n d / (1 - d) = z^2 at the end.
    z2 = stats.norm.ppf(0.975) ** 2
    none = paired.proportions(0, 0, 54, 0.95)
    assert none.lower == pytest.approx(-none.upper)
    assert none.upper == pytest.approx(z2 / (54 + z2), rel=1e-9)
    assert none.p == 1.0


def test_mcnemar_is_the_binomial_test():
    for b, c in ((0, 5), (3, 9), (20, 20), (1, 0)):
        expected = stats.binomtest(b, b + c, 0.5).pvalue
        assert paired.proportions(b, c, 100, 0.95).p == pytest.approx(expected, rel=1e-12)


def test_paired_t_is_scipys():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 40))
    a[3], b[7] = np.nan, np.inf
    good = np.isfinite(a) & np.isfinite(b)
    expected = stats.ttest_rel(b[good], a[good])
    found = paired.means(a, b, 0.95)
    assert found.pairs == 38
    assert found.p == pytest.approx(expected.pvalue, rel=1e-12)
    np.testing.assert_allclose(found[1:3], expected.confidence_interval(0.95), rtol=1e-12)
    assert paired.means(a, a, 0.95)[:4] == (0.0, 0.0, 0.0, 1.0)


def test_holm_of_a_known_example():
    # Holm (1979): 0.01, 0.04, 0.03, 0.005 -> 0.03, 0.06, 0.06, 0.02.
    np.testing.assert_allclose(
        paired.holm(np.array([0.01, 0.04, 0.03, 0.005, np.nan])), [0.03, 0.06, 0.06, 0.02, np.nan]
    )


def test_common_members_make_the_interval_narrower_as_theory_says():
    """Normal variables with correlation 0.9: the variance of the difference is 0.1 of that of independent members."""
    rng = np.random.default_rng(2)
    common, own = rng.normal(size=20_000), rng.normal(size=(2, 20_000))
    a, b = np.sqrt(0.9) * common + np.sqrt(0.1) * own
    found = paired.means(a, b, 0.95)
    # Two independent means have a difference with variance 2 / n; a standard deviation of 20,000 is known to 0.5 %.
    independent = 2.0 * 1.96 * np.sqrt(2.0 / 20_000)
    assert (found.upper - found.lower) / independent == pytest.approx(np.sqrt(0.1), rel=0.025)


TIMES = 1000
# Of 1,000 repetitions at 95 %: between 93 and 97 % except with probability 0.004 (binomial, standard deviation 0.69 %).


def covered(truth, ends):
    return np.mean([lower <= truth <= upper for lower, upper in ends])


@pytest.mark.parametrize(("p", "n"), [(0.5, 200), (0.9, 400), (0.03, 600), (0.993, 2000)])
def test_wilson_covers_95_percent(p, n):
    hits = np.random.default_rng(3).binomial(n, p, 20_000)
    lower, upper = intervals.wilson(hits / n, np.full(20_000, n), 0.95)
    assert 0.93 <= np.mean((lower <= p) & (p <= upper)) <= 0.97
    lower, upper = intervals.clopper_pearson(hits, np.full(20_000, n), 0.95)
    # At least what it says; 20,000 repetitions know that to 0.15 %.
    assert np.mean((lower <= p) & (p <= upper)) >= 0.9455


@pytest.mark.parametrize(("least", "most", "low", "high"), [(5.0, 100.0, 0.93, 0.975), (0.02, 5.0, 0.83, 0.99)])
def test_where_few_are_expected_the_coverage_is_what_the_page_says(least, most, low, high):
    """Exactly, by the binomial distribution, from p = 1 / 50,000 on, and of 1 - p as of p."""
    n, p = 1000, np.linspace(least, most, 400) / 1000
    hits = np.arange(n + 1)
    weights = stats.binom.pmf(hits, n, p[:, None])

    def coverage(lower, upper, p):
        return (weights * ((lower <= p[:, None]) & (p[:, None] <= upper))).sum(axis=1)

    wilson = coverage(*intervals.wilson(hits / n, np.full(n + 1, n), 0.95), p)
    assert low <= wilson.min()
    assert wilson.max() <= high
    lower, upper = (end[::-1] for end in intervals.wilson(hits / n, np.full(n + 1, n), 0.95))
    np.testing.assert_allclose(coverage(lower, upper, 1.0 - p), wilson, atol=1e-12)
    assert coverage(*intervals.clopper_pearson(hits, np.full(n + 1, n), 0.95), p).min() >= 0.95


@pytest.mark.parametrize(("both", "first", "second"), [
    (0.45, 0.1, 0.15), (0.93, 0.02, 0.04), (0.975, 0.002, 0.02), (0.01, 0.02, 0.01), (0.5, 0.1, 0.1),
])  # fmt: skip
def test_differences_of_proportions_cover_95_percent(both, first, second):
    rng = np.random.default_rng(4)
    counts = rng.multinomial(800, [both, first, second, 1.0 - both - first - second], TIMES)
    found = [paired.proportions(b, c, 800, 0.95)[1:3] for _, b, c, _ in counts.tolist()]
    assert 0.93 <= covered(second - first, found) <= 0.97


def test_paired_t_covers_95_percent():
    rng = np.random.default_rng(5)
    a = rng.gamma(2.0, size=(TIMES, 100))
    b = a + 0.1 + rng.normal(size=(TIMES, 100)) * a
    assert 0.93 <= covered(0.1, [paired.means(x, y, 0.95)[1:3] for x, y in zip(a, b, strict=True)]) <= 0.97


@pytest.mark.slow
@pytest.mark.parametrize(("level", "factor", "size"), [(0.9, 1.5, 500), (0.5, 1.2, 400), (0.95, 1.0, 1000)])
def test_bootstrap_of_quantiles_covers_95_percent(level, factor, size):
    rng = np.random.default_rng(6)

    def drawn(shape):
        common = rng.exponential(size=shape)
        return common + 0.1 * rng.normal(size=shape), factor * common + 0.1 * rng.normal(size=shape)

    a, b = drawn(4_000_000)
    # 4,000,000 members know it to a fiftieth of an interval.
    truth = np.quantile(b, level) - np.quantile(a, level)
    found = [
        paired.quantiles(x, y, level, 0.95, 299, i)[1:3]
        for i, (x, y) in enumerate(zip(*drawn((TIMES, size)), strict=True))
    ]
    assert 0.93 <= covered(truth, found) <= 0.97
