# SPDX-License-Identifier: Apache-2.0
"""Ratio of the probabilities of two rare events of standard normals, against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from lgvi_warp.uncertainty.rare.ratio import Share, carried, members_of, ratio_of, shared
from tests.support.rare import searched


class Limit:
    """A limit of normals with names and sources, as that of a vehicle."""

    def __init__(self, function, names, sources=()):
        self.function, self.names, self.sources = function, names, sources
        self.d = len(names) + sum(each.numbers for each in sources)

    def __call__(self, u):
        return self.function(u)


def source(of, column, numbers=2):
    return SimpleNamespace(
        of=of, stream="noise", first=0.0, spacing=0.1, numbers=numbers, columns=slice(column, column + numbers)
    )


def beyond(bound):
    return Limit(lambda u: u[:, 0] - bound, ("a", "b", "c"))


def answer(limit, seed, parted=False, **more):
    found = searched(limit.rows if parted else limit, limit.d, seed=seed, **more)
    return SimpleNamespace(
        probability=found.probability,
        relative_error=found.spread,
        estimator=found.estimator,
        normals=found.failing,
        draws=np.zeros((len(found.failing), 0)),
        weights=found.weights,
        ancestors=found.ancestors,
    )


def compared(first, second, seed, seed_of_second=None, **more):
    # As in sweeps, no two answers have a seed in common: the same first members would be wrong in the same way.
    a, b = (
        answer(first, seed, **more),
        answer(second, seed + 1000 if seed_of_second is None else seed_of_second, **more),
    )
    shares = shared(members_of(a), first, second), shared(members_of(b), second, first)
    return ratio_of(a, b, *shares)


@pytest.mark.ci
@pytest.mark.parametrize("weighted", [True, False], ids=["weights", "chains"])
def test_the_ratio_is_that_of_the_normal_law(weighted):
    near, far = -ndtri(1e-5), -ndtri(4e-6)
    found = compared(beyond(near), beyond(far), 1, weighted=weighted)
    # Weights know each probability to 2 %: either way may have the shorter interval.
    assert found.paired or weighted
    assert found.lower < 0.4 < found.upper
    assert np.log(found.upper / found.lower) < (0.13 if weighted else 0.9)
    back = compared(beyond(far), beyond(near), 1001, 1, weighted=weighted)
    assert back.value == pytest.approx(1.0 / found.value, rel=1e-9)


def test_events_that_have_nothing_in_common_are_compared_by_their_answers():
    first = Limit(lambda u: u[:, 0] + ndtri(1e-5), ("a", "b"))
    second = Limit(lambda u: -u[:, 0] + ndtri(2e-5), ("a", "b"))
    found = compared(first, second, 2)
    assert not found.paired
    assert found.lower < 2.0 < found.upper


def test_an_event_and_itself_are_as_likely_and_not_more_sure_than_members_can_tell():
    found = compared(beyond(4.2), beyond(4.2), 3, 3)
    assert found.value == 1.0
    assert found.lower < 1.0 < found.upper
    assert found.p == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("weighted", [True, False], ids=["weights", "chains"])
def test_intervals_hold_as_often_as_they_say(weighted):
    first = beyond(-ndtri(1e-5))
    # As likely, about a direction 11 degrees away.
    second = Limit(lambda u: (u[:, 0] + 0.2 * u[:, 1]) / 1.04**0.5 + ndtri(1e-5), ("a", "b", "c"))
    found = [compared(first, second, seed, weighted=weighted, relative_error=0.2) for seed in range(30)]
    logs = np.log([each.value for each in found])
    told = np.array([np.log(each.upper / each.lower) / (2.0 * 1.96) for each in found])
    assert all(each.paired for each in found)
    # 28.5 of 30 are expected, and fewer than 26 in 2 of 100 such tests.
    assert sum(each.lower < 1.0 < each.upper for each in found) >= 26
    assert 1.0 / 1.5 < np.sqrt((logs**2).mean()) / np.sqrt((told**2).mean()) < 1.5


def to_both_sides(middle):
    """Off a middle to either side, or a third way that is seldom; and its probability."""
    rows = lambda u: np.stack([np.abs(u[:, 0] - middle) - 4.5, u[:, 1] - 5.0])  # noqa: E731
    limit = Limit(lambda u: rows(u).max(axis=0), ("a", "b", "c"))
    limit.rows = rows
    return limit, ndtr(-4.5 - middle) + ndtr(-4.5 + middle) + ndtr(-5.0)


@pytest.mark.slow
@pytest.mark.parametrize("middle", [0.06, 0.25])
@pytest.mark.parametrize("parted", [False, True], ids=["one limit", "two conditions"])
def test_intervals_hold_where_failure_modes_have_other_shares_in_either(middle, parted):
    (first, p), (second, q) = to_both_sides(0.0), to_both_sides(middle)
    z = []
    for seed in range(40):
        found = compared(first, second, seed, weighted=False, relative_error=0.12, parted=parted)
        assert found.paired
        z.append(np.log(found.value / (q / p)) / (np.log(found.upper / found.lower) / (2.0 * 1.96)))
    # A mean of 40 squares of standard normals is above 1.7 once in 500 times, below 0.4 once in 1,000.
    assert 0.4 < np.mean(np.square(z)) < 1.7


def test_members_are_carried_by_the_names_of_numbers_and_draws():
    own = Limit(None, ("a", "b"), [source("compass", 0), source("cell", 2)])
    other = Limit(None, ("b", "new"), [source("cell", 0), source("gyro", 2), source("compass", 4, numbers=4)])
    u = np.arange(5.0)[:, None] * np.ones(6) + 0.1 * np.arange(6)
    v = carried(u, own, other, 1)
    assert v.shape == (5, 2 + 8)
    np.testing.assert_array_equal(v[:, 0], u[:, 1])
    np.testing.assert_array_equal(v[:, 2:4], u[:, 4:6])
    # What the first has not, or draws otherwise, is drawn.
    assert len(np.unique(v[:, [1, 4, 5, 6, 7, 8, 9]])) == 35
    assert np.abs(v[:, [1, 4, 5, 6, 7, 8, 9]]).max() < 5.0


def test_a_share_of_chains_is_no_surer_than_their_number():
    happens = np.repeat([1.0, 0.0, 1.0, 1.0], 10)
    share = Share.of(happens, np.ones(40), np.repeat(np.arange(4), 10))
    assert share.value == 0.75
    assert share.count == 4.0
    # Of four chains, each all or nothing: the binomial law of four.
    assert share.spread == pytest.approx(np.sqrt(0.25 * 0.75 / 4.0) / 0.75)
    alone = Share.of(happens, np.ones(40), np.arange(40))
    assert alone.spread == pytest.approx(np.sqrt(0.25 * 0.75 / 40.0) / 0.75)
    every = Share.of(np.ones(40), np.ones(40), np.arange(40))
    assert (every.value, every.count) == (1.0, 40.0)
    assert 0.0 < every.spread < 0.03
    assert Share.of(np.zeros(40), np.ones(40), np.arange(40)).spread == np.inf


def test_many_members_are_drawn_by_their_weights():
    found = answer(Limit(lambda u: np.sqrt((u**2).sum(axis=1)) - 6.0, tuple("abcdef")), 1)
    assert found.estimator == "subset"
    members = members_of(found)
    assert len(members.u) == 4000 < len(found.normals)
    assert members.weights.sum() == pytest.approx(1.0)
    # Roots are as many as weights make them, and no more.
    whole = np.bincount(np.unique(found.ancestors, return_inverse=True)[1], found.weights)
    drawn = np.bincount(members.ancestors, members.weights, len(whole))
    assert np.abs(drawn - whole).max() < 5.0 * np.sqrt(whole.max() / 4000.0)
