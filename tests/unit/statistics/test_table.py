# SPDX-License-Identifier: Apache-2.0
"""The lines of text that a run prints of its statistics: the numbers of each estimate at the last time, and no others."""

import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.statistics.estimates.estimate import Estimates
from lgvi_warp.statistics.estimates.table import table
from tests.unit.statistics import test_outcomes
from tests.unit.statistics.test_statistics import gathered, rotations, scalar

NUMBER = r"-?(?:\d+\.?\d*(?:e[+-]?\d+)?|inf|nan)"
# Other numbers at each time, fewer members as time goes, and other numbers in each component.
X = np.random.default_rng(5).gamma(3.0, size=(3, 900, 2)) * np.array([1.0, 7.0]) * np.arange(1, 4)[:, None, None]
GOOD = np.random.default_rng(6).random((3, 900)) < np.array([1.0, 0.8, 0.6])[:, None]


def rows_of(*estimates):
    """(label, value, lower or None, upper or None, members) of each line."""
    found = []
    for line in table(Estimates(estimates)):
        label, value, ends, members = re.split(r"  +", line)
        interval = [float(end) for end in re.findall(NUMBER, ends)] or [None, None]
        found.append((label, float(re.match(NUMBER, value)[0]), *interval, int(re.sub(r"\D", "", members))))
    return found


def said(rows):
    """Rows as the table rounds them: six digits of values, five of ends."""

    def rounded(number, digits):
        return None if number is None else float(f"{number:.{digits}g}")

    return [
        (label, rounded(value, 6), rounded(lower, 5), rounded(upper, 5), members)
        for label, value, lower, upper, members in rows
    ]


def entries(single, at):
    return single.value[at], single.lower[at], single.upper[at]


def estimate(kind, *arguments, d=2, **named):
    (found,) = gathered(kind(scalar(d), *arguments, **named), X[..., :d], good=GOOD)
    return found


COUNT = int(GOOD[-1].sum())


@pytest.mark.parametrize("kind", [lw.statistics.Mean, lw.statistics.CircularMean])
def test_one_line_a_component(kind):
    one = estimate(kind)
    name = one.settings["type"]
    assert rows_of(one) == said([(f"{name} x[{i}]", *entries(one, (-1, i)), COUNT) for i in (0, 1)])
    alone = estimate(kind, d=1, name="mine")
    assert rows_of(alone) == said([("mine", *entries(alone, (-1, 0)), COUNT)])
    both = estimate(kind, name="mine")
    assert [row[0] for row in rows_of(both)] == ["mine: x[0]", "mine: x[1]"]


def test_a_line_for_each_level_of_quantiles():
    one = estimate(lw.statistics.Quantiles, levels=(0.1, 0.9))
    expected = [
        (f"quantiles x[{i}] {level}", *entries(one, (-1, j, i)), COUNT)
        for i in (0, 1)
        for j, level in enumerate((0.1, 0.9))
    ]
    assert rows_of(one) == said(expected)


def test_lines_of_a_covariance():
    one = estimate(lw.statistics.Covariance)
    expected = [(f"covariance x[{i}], x[{j}]", *entries(one, (-1, i, j)), COUNT) for i, j in ((0, 0), (1, 0), (1, 1))]
    assert rows_of(one) == said(expected)
    x = np.random.default_rng(1).normal(size=(2, 300, 4)) * np.arange(1.0, 5.0)
    (many,) = gathered(lw.statistics.Covariance(scalar(4)), x)
    # Of more than three components the variances alone.
    expected = [(f"covariance x[{i}], x[{i}]", *entries(many, (-1, i, i)), 300) for i in range(4)]
    assert rows_of(many) == said(expected)


def test_lines_of_extremes_name_their_members():
    one = estimate(lw.statistics.Extremes)
    expected = []
    for i in (0, 1):
        x = np.where(GOOD[-1], X[-1, :, i], np.nan)
        for name, at in (("minimum", np.nanargmin(x)), ("maximum", np.nanargmax(x))):
            expected.append((f"extremes x[{i}]: {name} (member {at})", x[at], None, None, COUNT))
    assert rows_of(one) == said(expected)


def test_the_fullest_bin_of_a_histogram():
    edges = np.linspace(0.0, 60.0, 7)
    one = estimate(lw.statistics.Histogram, edges=edges)
    expected = []
    for i in (0, 1):
        best = np.argmax(np.histogram(X[-1, GOOD[-1], i], edges)[0])
        middle = 0.5 * (edges[best] + edges[best + 1])
        expected.append((f"histogram x[{i}]: fullest bin, at {middle:g}", *entries(one, (-1, i, best)), COUNT))
    assert rows_of(one) == said(expected)


def test_lines_of_a_passage():
    (one,) = gathered(lw.statistics.FirstPassage(scalar(1), above=8.0, levels=(0.1, 0.3)), X[..., :1], good=GOOD)
    (label, *first), *times = rows_of(one)
    assert label == one.name
    assert first[0] == float(f"{one.value[-1]:.6g}")
    assert first[3] == len(X[0])
    assert [row[1] for row in times] == [float(f"{t:.6g}") for t in one["passage_time"]]
    assert [row[0] for row in times] == [f"{one.name}: time [s] of {level}" for level in (0.1, 0.3)]
    ends = [float(f"{one[f'passage_time_{end}'][j]:.5g}") for j in (0, 1) for end in ("lower", "upper")]
    assert [end for row in times for end in row[2:4]] == ends


def test_lines_of_an_outcome():
    members = test_outcomes.ends_of(1000)
    (one,) = test_outcomes.gathered(lw.statistics.Outcome("floor", levels=(0.25, 0.5)), members)
    whole, of_all, *times = rows_of(one)
    assert whole == said([(one.name, one.value[-1], one.lower[-1], one.upper[-1], 1000)])[0]
    share = np.mean(members.status == test_outcomes.FLOOR)
    assert of_all[:2] == (f"{one.name}: of all members", share)
    assert of_all[2] < share < of_all[3]
    ends = ("end_time", "end_time_lower", "end_time_upper")
    expected = [
        (f"{one.name}: time [s] of {level}", *(one[name][j] for name in ends), 1000)
        for j, level in enumerate((0.25, 0.5))
    ]
    assert times == said(expected)
    # Where nothing else ends a member, both fractions are one.
    (alone,) = test_outcomes.gathered(lw.statistics.Outcome("floor"), test_outcomes.ends_of(500, rates=(0.1, 0.0, 0.0)))
    assert not any("of all members" in row[0] for row in rows_of(alone))


def test_lines_of_a_mean_attitude():
    rng = np.random.default_rng(8)
    R = rotations(np.array([0.02, 0.01, 0.03]) * np.arange(1, 3)[:, None, None] * rng.normal(size=(2, 500, 3)))
    (one,) = gathered(lw.statistics.MeanAttitude(), R.reshape(2, 500, 9))
    spread, *axes = rows_of(one)
    assert spread == said([(f"{one.name}: dispersion [rad]", one["dispersion"][-1], None, None, 500)])[0]
    half = one["rotation_half_width"][-1]
    assert axes == said(
        [(f"{one.name}: about {axis} [rad]", 0.0, -half[i], half[i], 500) for i, axis in enumerate("xyz")]
    )
