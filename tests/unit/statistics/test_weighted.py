# SPDX-License-Identifier: Apache-2.0
"""Weighted members: equal weights change nothing, whole ones repeat a member, none leaves it out; and the sketch of many."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.estimates.tree import Tree
from lgvi_warp.statistics.values.values import Values

S = lw.statistics
TWO = ["position[0]", "position[1]"]
OF_TWO = [
    S.Mean(TWO), S.Covariance(TWO), S.Histogram(TWO, bins=5, limits=(-2, 2)), S.Exceedance(TWO, above=0.5),
    S.CircularMean(TWO), S.Extremes(TWO),
]  # fmt: skip
TIME = np.array([0.0, 1.0, 2.0])


def gathered(statistic, x, weight=None, size=128, good=None):
    """The estimate of values (k, d, n), in blocks of so many members."""
    tree = Tree(statistic.join_any)
    for block, first in enumerate(range(0, x.shape[2], size)):
        at = slice(first, first + size)
        gathers = statistic.open(TIME[: len(x)], x[:, :, at].shape[2])
        known = None if good is None else good[:, at]
        values = Values(x[:, :, at], known, first, block, size, weight=None if weight is None else weight[at])
        gathers.take(values, slice(0, len(x)))
        tree.add(block, gathers.close())
    return statistic.estimates(tree.parts(), TIME[: len(x)])[0]


def ended(statistic, status, time, weight=None, size=100):
    """The estimate of members' ends (n,), in blocks of so many members."""
    tree = Tree(statistic.join_any)
    for block, first in enumerate(range(0, len(status), size)):
        at = slice(first, first + size)
        ends = Ends(status[at], np.zeros_like(status[at]), time[at])
        gathers = statistic.open(TIME, len(status[at]))
        values = Values(
            *statistic.at_ends(ends, None), first, block, size, weight=None if weight is None else weight[at]
        )
        gathers.take(values, slice(0, 1))
        tree.add(block, gathers.close())
    return statistic.estimates(tree.parts(), TIME)[0]


def numbers(seed, n=1000):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(3, 2, n)), rng.exponential(size=n)


def assert_alike(first, second, names):
    for name in names:
        np.testing.assert_allclose(first[name], second[name], rtol=1e-12, atol=1e-12, err_msg=f"{first.name}: {name}")


@pytest.mark.parametrize("statistic", [*OF_TWO, S.MeanAttitude()], ids=lambda one: one.type)
def test_equal_weights_change_nothing(statistic):
    """Sums of other order: some units of the last digit of sums of 1,000."""
    x, _ = numbers(0)
    if statistic.type == "mean_attitude":
        x = attitudes(0)
    plain = gathered(statistic, x)
    weighted = gathered(statistic, x, np.full(x.shape[2], 2.5))
    assert_alike(weighted, plain, plain.arrays)
    np.testing.assert_array_equal(weighted["members"], 1000)
    assert "weighted" in weighted.interval


def attitudes(seed, n=1000):
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_rotvec(np.random.default_rng(seed).normal(size=(3 * n, 3)) * 0.3).as_matrix()
    return np.ascontiguousarray(np.moveaxis(turns.reshape(3, n, 9), 1, 2))


@pytest.mark.parametrize(
    "statistic", [S.FirstPassage("depth", above=1.0), S.FirstPassage("depth", above=0.0, below=1.0)]
)
def test_equal_weights_change_no_passage_also_where_members_fail(statistic):
    x = numbers(1)[0][:, :1]
    good = np.ones((3, 1000), bool)
    good[1:, ::7] = False
    for known in (None, good):
        plain, weighted = gathered(statistic, x, good=known), gathered(statistic, x, np.full(1000, 0.3), good=known)
        assert_alike(weighted, plain, plain.arrays)


def test_equal_weights_change_no_outcome_also_where_members_fail():
    rng = np.random.default_rng(2)
    for codes in ([0, 16, 17], [0, 16, 1]):
        status = rng.choice(np.array(codes, np.uint8), size=1000)
        time = np.where(status > 0, rng.uniform(0.0, 2.0, 1000), 2.0)
        statistic = S.Outcome("stopped")
        plain, weighted = ended(statistic, status, time), ended(statistic, status, time, np.full(1000, 4.0))
        assert_alike(weighted, plain, plain.arrays)


@pytest.mark.parametrize("statistic", [*OF_TWO, S.FirstPassage("depth", above=0.5)], ids=lambda one: one.type)
def test_whole_weights_repeat_members(statistic):
    x, _ = numbers(3)
    x = x[:, :1] if statistic.type == "first_passage" else x
    times = np.random.default_rng(4).integers(0, 4, 1000)
    weighted, repeated = gathered(statistic, x, 1.0 * times), gathered(statistic, np.repeat(x, times, axis=2))
    if statistic.type == "covariance":
        # The factor n / (n - 1) is of the effective number.
        wanted = np.array([np.cov(x[i], aweights=times) for i in range(3)])
        np.testing.assert_allclose(weighted.value, wanted, rtol=1e-12)
        return
    assert_alike(weighted, repeated, ["value"])
    members = weighted["members"]
    assert (members == np.count_nonzero(times)).all()


@pytest.mark.parametrize("size", [64, 2048])
def test_quantiles_are_those_of_the_weighted_sample(size):
    """A sketch of 64 values in 2^5 blocks is off by at most (1 + 5) / (2 64) of the weight."""
    x, weight = numbers(5, 4096)
    levels = (0.1, 0.5, 0.9)
    estimate = gathered(S.Quantiles("depth", levels=levels, size=size), x[:1, :1], weight)
    order = np.argsort(x[0, 0])
    share = np.cumsum(weight[order]) / weight.sum()
    below = np.interp(estimate.value[0, :, 0], x[0, 0][order], share)
    bound = 1.5 * weight.max() / weight.sum() + float(estimate["rank_error"][0])
    assert np.abs(below - levels).max() < bound
    # One joint of two halves of 2,048 values is thinned, of which half a share is 1 / 4,096.
    assert float(estimate["rank_error"][0]) <= (6.5 / 128 if size == 64 else 1.01 / 4096)
    even = gathered(S.Quantiles("depth", levels=levels), x[:1, :1, :500], np.full(500, 3.0))
    np.testing.assert_allclose(even.value[0, :, 0], np.quantile(x[0, 0, :500], levels), rtol=1e-12)


def test_one_member_and_none():
    x, _ = numbers(6, 1)
    one = gathered(S.Mean(TWO), x, np.array([3.0]))
    np.testing.assert_allclose(one.value, x[:, :, 0], rtol=1e-15)
    assert np.isnan(one["standard_error"]).all()
    assert one.count.tolist() == [1.0] * 3
    lost = gathered(S.Mean(TWO), x, np.array([3.0]), good=np.zeros((3, 1), bool))
    assert np.isnan(lost.value).all()
    assert lost.count.tolist() == [0.0] * 3
    fraction = gathered(S.Exceedance("depth", above=0.0), x[:, :1], np.array([3.0]), good=np.zeros((3, 1), bool))
    assert (fraction.lower.ravel() == 0.0).all()
    assert (fraction.upper.ravel() == 1.0).all()


def test_numbers_of_every_member_are_as_they_are():
    x, weight = numbers(7)
    np.testing.assert_array_equal(gathered(S.MemberValues(TWO), x, weight).value, x)


@pytest.mark.parametrize(
    ("weights", "text"),
    [
        ([1.0, -2.0, 3.0], "weights = -2.0 is below 0, of member 1"),
        ([0.0, 0.0, 0.0], "are all 0"),
        ("v", "is not a column of the table"),
        ([1.0, 2.0], "are the columns' lengths"),
        (["a", "b", "c"], "weights"),
    ],
)
def test_what_are_no_weights_is_refused(weights, text):
    with pytest.raises(lw.SceneError, match=text):
        lw.designs.Table({"vehicle.mass": [1.0, 2.0, 3.0]}, weights=weights)


def test_a_table_keeps_its_weights(tmp_path):
    """Weights as a column, as numbers, from a file, and as a scene file has them."""
    (tmp_path / "draws.csv").write_text("vehicle.mass,w\n1,1\n2,3\n3,2\n")
    of_file = lw.designs.Table(tmp_path / "draws.csv", weights="w", columns=["vehicle.mass"])
    named = lw.designs.Table({"vehicle.mass": [1.0, 2.0, 3.0], "w": [1.0, 3.0, 2.0]}, weights="w")
    beside = lw.designs.Table({"vehicle.mass": [1.0, 2.0, 3.0]}, weights=np.array([10.0, 30.0, 20.0]))
    for table in (of_file, named, beside):
        np.testing.assert_allclose(table.own_weights(), [0.5, 1.5, 1.0])
        assert set(table.own_values()) == {"vehicle.mass"}
        ((_, settings),) = table.to_dict().items()
        np.testing.assert_array_equal(lw.designs.Table(**settings).own_weights(), table.own_weights())
    with pytest.raises(lw.SceneError, match="Name a column of the file"):
        lw.designs.Table(tmp_path / "draws.csv", weights=[1.0, 2.0, 3.0])


def test_many_values_are_read_a_few_times_at_once():
    """More than two million values are sorted in pieces of some sample times."""
    x, weight = np.random.default_rng(8).normal(size=(3, 1, 700_000)), np.full(700_000, 2.0)
    estimate = gathered(S.Quantiles("depth", levels=(0.5,), size=2**20), x, weight, size=700_000)
    np.testing.assert_allclose(estimate.value[:, 0, 0], np.median(x[:, 0], axis=1), rtol=1e-9, atol=1e-12)
