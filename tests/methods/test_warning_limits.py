# SPDX-License-Identifier: Apache-2.0
"""The limits that warnings compare with are those that runs show: of the Munk moment, and of a restoring moment.

Reference: the fastest oscillation of 0.3 rad that stays bounded over 1,000 steps (`benchmarks.tables.warning_limits`), against
the tables of lgvi_warp.methods.limits; and for the Munk moment with M = (1, 100, 100) the figures known beforehand. The
amplitude at the limit grows without bound in w, so that the criterion of 1 rad moves it by a few per cent: within 5 %.
"""

import pytest

from benchmarks.tables.warning_limits import limit, munk, names, restoring
from lgvi_warp.methods import limits

KNOWN = {"phi": 1.41, "psi": 1.50, "psi_s": 2.13, "psi_1": 2.00, "cg3": 1.69, "rkmk4": 2.43}


@pytest.mark.ci
def test_the_default_method():
    assert limit(munk, "psi_s") == pytest.approx(limits.MUNK["psi_s"], rel=0.05)


def test_the_table_holds_what_was_known():
    assert {name: limits.MUNK[name] for name in KNOWN} == pytest.approx(KNOWN, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in names() if not name.startswith("gauss")])
def test_every_method(name):
    assert limit(munk, name) == pytest.approx(limits.MUNK[name], rel=0.05)
    assert limit(restoring, name) == pytest.approx(limits.RESTORING[name], rel=0.05)
