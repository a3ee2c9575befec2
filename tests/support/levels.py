# SPDX-License-Identifier: Apache-2.0
"""First levels of subset simulation."""

import numpy as np

from lgvi_warp.uncertainty.rare.subset import levels_of


def first_levels(limit, d, size, generators):
    """Independent members of the first level of several runs, as one batch."""
    u = np.concatenate([rng.standard_normal((size, d)) for rng in generators])
    return levels_of(u, limit(u), size)
