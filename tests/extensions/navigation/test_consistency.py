# SPDX-License-Identifier: Apache-2.0
"""The test of NEES averaged over time, on errors whose correlation in time is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from lgvi_warp.extensions.navigation.consistency import STATES, time_average


def errors(seed, members, times, phi):
    """NEES (k, n) of filters that are right: 15 normal errors, each correlated by phi from one time to the next."""
    random = np.random.default_rng(seed)
    x = np.sqrt(1.0 - phi**2) * random.normal(size=(times, members, STATES))
    x[0] /= np.sqrt(1.0 - phi**2)
    return (lfilter([1.0], [1.0, -phi], x, axis=0) ** 2).sum(axis=-1)


# One filter for long, many for a short time, and none that are correlated.
CASES = [(1, 1000, 0.9), (8, 100, 0.9), (30, 41, 0.95), (4, 200, 0.0)]


@pytest.mark.parametrize(("members", "times", "phi"), CASES)
def test_a_right_filter_is_refused_as_often_as_said(members, times, phi):
    p = np.array([time_average(errors(seed, members, times, phi)).p for seed in range(100)])
    # 5 of 100 on average; 13 and more of a binomial count with a chance of 1e-3, and the sample size is estimated.
    assert np.count_nonzero(p < 0.05) <= 13
    assert np.count_nonzero(p < 0.5) >= 30
    # Errors 20 % larger than believed are seen, and 20 % smaller ones.
    for scale in (1.2, 1.0 / 1.2):
        assert time_average(scale * errors(0, members, times, phi)).p < 0.05


def test_the_sample_size_is_that_of_the_correlation():
    # NEES of AR(1) errors is correlated by phi^2k, so that values count 1 / (1 + 2 phi^2 / (1 - phi^2)) each.
    phi, found = 0.9, [time_average(errors(seed, 4, 2000, 0.9)).effective for seed in range(20)]
    assert np.mean(found) == pytest.approx(8000 * (1.0 - phi**2) / (1.0 + phi**2), rel=0.1)


def test_what_cannot_be_judged_is_not():
    assert np.isnan(time_average(np.full((5, 3), np.nan)).p)
    one = time_average(np.full((1, 1), 15.0))
    assert (one.effective, one.mean) == (1.0, 15.0)
    assert 0.8 < one.p <= 1.0
