# SPDX-License-Identifier: Apache-2.0
"""A step that is too large is said to be so by the limit of the method that was used."""

import dataclasses

import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.results.outcomes import outcome_text
from tests.unit.views.test_recording import fleet


@pytest.mark.parametrize(("method", "limit"), [
    ("phi", "below 1 / |angular velocity|"),  # equation (24) over h: |J^-1 a| = h |Omega|
    ("psi_1", "below 1 / |angular velocity|"),
    ("psi", "below 2 / |angular velocity|"),  # over h / 2
    ("psi_s", "below 2 / |angular velocity|"),
    ("psi_w", "below 2 / |angular velocity|"),
    ("psi_x", "below 4 / |angular velocity|, and more for a slender body"),  # half the angle of a turn over h / 2
    ("su4(psi_s)", "below 3.04 / |angular velocity|"),  # Suzuki's longest stage is 4 / (4 - 4^(1/3)) - 1 = 0.658
    ("rkn4_6", "so that no part of it turns by a quarter turn"),
])  # fmt: skip
def test_a_step_that_is_too_large_has_the_limit_of_its_method(method, limit):
    result = fleet(4, 5)
    status = 0 * result.status + int(Status.STEP_TOO_LARGE)
    told = dict(result.provenance) | {"method": {"name": method}}
    text = outcome_text(dataclasses.replace(result, status=status, provenance=told), lw.Status.STEP_TOO_LARGE)
    assert limit in text
    assert text.count("angular velocity") == ("velocity" in limit)
    assert "psi_x" not in text
    assert "rkn" not in text
