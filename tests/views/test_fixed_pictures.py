# SPDX-License-Identifier: Apache-2.0
"""Pictures, recordings and reports show what they showed when they were last looked at (tests/support/fixed_pictures.py)."""

import json

import pytest

from tests.support import fixed_pictures
from tests.support.fixed_pictures import FILE, PICTURES, RECORDINGS, differing, libraries

KNOWN = json.loads(FILE.read_text())
pytestmark = [
    pytest.mark.guard(in_ci=True),
    pytest.mark.skipif(KNOWN["libraries"] != libraries(), reason="drawn by other libraries than recorded"),
]


def check(recorded, shown):
    """Difference of a picture from the recorded one, and the remedy."""
    faults = differing(recorded, json.loads(json.dumps(shown)))
    remedy = "look at it (make gallery), then python -m tests.support.fixed_pictures --write"
    assert not faults, "\n".join([*faults[:20], remedy])


@pytest.mark.ci
@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_shows_what_it_showed(name):
    check(KNOWN["pictures"][name], fixed_pictures.picture(name))


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_recording_shows_what_it_showed(name, tmp_path):
    check(KNOWN["recordings"][name], fixed_pictures.recording(name, tmp_path))


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    return fixed_pictures.reports(tmp_path_factory.mktemp("reports"))


@pytest.mark.ci
@pytest.mark.parametrize("name", KNOWN["reports"])
def test_a_report_says_what_it_said(name, output):
    check(KNOWN["reports"][name], output[name])


def test_a_difference_is_found_and_round_off_is_none():
    known = {"axes": [{"drawn": [["Line2D", "median", 2.0, [3, 6.0, 6.0, -1.0]]]}]}
    near = {"axes": [{"drawn": [["Line2D", "median", 2.0, [3, 6.0 + 1e-7, 6.0, -1.0]]]}]}
    assert differing(known, near) == []
    for other in (["Line2D", "mean", 2.0, [3, 6.0, 6.0, -1.0]], ["Line2D", "median", 3.0, [3, 6.0, 6.0, -1.0]],
                  ["Line2D", "median", 2.0, [3, 6.0, 6.0, 1.0]], ["Line2D", "median", 2.0]):  # fmt: skip
        assert len(differing(known, {"axes": [{"drawn": [other]}]})) == 1
