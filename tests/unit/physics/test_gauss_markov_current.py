# SPDX-License-Identifier: Apache-2.0
"""A random current starts as it goes on: at zero, or as one number of its stationary spread for each member."""

import numpy as np
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.physics.terms.base import PackingContext

SPREAD = np.array([[0.3, 0.1, 0.02]])


def starts(start, members, seed=1):
    term = lw.terms.GaussMarkovCurrent(standard_deviation=SPREAD[0], time_constant=10.0, start=start)
    context = PackingContext({}, None, members, seed, 0.01)
    return term.water_at_start({"standard_deviation": SPREAD}, np.zeros((len(members), 3)), context)


def test_the_start_has_the_stationary_spread():
    u = starts("stationary", np.arange(4000))
    assert u.shape == (4000, 3)
    assert not starts("zero", np.arange(4000)).any()
    for i, spread in enumerate(SPREAD[0]):
        assert stats.kstest(u[:, i], stats.norm(scale=spread).cdf).pvalue > 1e-4
    assert abs(np.corrcoef(u.T)[np.triu_indices(3, 1)]).max() < 0.08


def test_a_member_starts_alike_in_any_company():
    some = np.array([7, 3, 900])
    np.testing.assert_array_equal(starts("stationary", some), starts("stationary", np.arange(1000))[some])
    assert (starts("stationary", some) != starts("stationary", some, seed=2)).all()
