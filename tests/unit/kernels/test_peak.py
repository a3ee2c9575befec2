# SPDX-License-Identifier: Apache-2.0
"""The chains of the core's limit: each its own start, its multiplier and its addend, in whole numbers, which are exact."""

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes.peak import CHAINS, make_peak

pytestmark = pytest.mark.kernel


@pytest.mark.ci
def test_the_sum_of_the_chains():
    kernel, Lane = make_peak(2, wp.float64)
    m, c, starts = np.array([3.0, 2.0]), np.array([5.0, 7.0]), 2.0 ** np.arange(CHAINS)
    given = np.vstack([m, c, np.outer(starts, (1.0, 3.0)), (0.0, 0.0)])
    data = wp.array(given, dtype=Lane, device="cpu")
    wp.launch(kernel, 1, inputs=[data, 3], device="cpu")
    chains = m * given[2:-1]
    for _ in range(3):
        chains = m * chains + c
    np.testing.assert_array_equal(data.numpy()[-1], chains.sum(axis=0))
