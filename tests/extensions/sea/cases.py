# SPDX-License-Identifier: Apache-2.0
"""Terms of the sea beside their twins. Import tests.laws.cases, which includes them, not this."""

import numpy as np

from lgvi_warp import terms
from lgvi_warp.extensions.sea.twin.sea_state import SeaState
from tests.laws.case import Case
from tests.laws.cases_water import GRAVITY, arrays

RNG = np.random.default_rng(4)
# Times 1.3 (tests/laws/test_parity.py) they are below 1 still.
SEA = dict(significant_height=0.8, peak_period=4.5, heading_deg=40.0, spreading=6.0)
RANDOM = SEA | {"levels": 0.05 + 0.7 * RNG.random((5, 4)), "depth": 11.0}
GROWN = SEA | {"levels": 0.05 + 0.7 * RNG.random((5, 3))}


def sea(numbers, **words):
    """A Case of a sea."""
    twin = SeaState(**arrays(numbers), gravity=GRAVITY)
    twin.spectrum, twin.amplitudes_are = (words.get(name, twin_default) for name, twin_default in
                                          (("spectrum", "jonswap"), ("amplitudes", "equal")))  # fmt: skip
    return Case((terms.SeaState(**numbers, components=len(numbers["levels"]), **words),), (twin,))


HELD, ALONE = {}, {}
CASES = {
    "sea state": sea(RANDOM, amplitudes="rayleigh"),
    "grown sea": sea(GROWN, spectrum="pierson_moskowitz"),
}
