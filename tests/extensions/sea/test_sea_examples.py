# SPDX-License-Identifier: Apache-2.0
"""Examples of the sea: what they print, and that they draw."""

import re
import subprocess
import sys

import pytest

from tests.conftest import ROOT


def lines_of(script, picture, *options):
    """Lines that an example prints while it draws."""
    command = [sys.executable, ROOT / "examples" / script, picture, *options]
    printed = subprocess.run(command, check=True, capture_output=True, text=True, cwd=picture.parent).stdout
    assert picture.stat().st_size > 10_000
    return printed.splitlines()


@pytest.mark.slow
def test_a_survey_in_a_seaway_is_the_steadier_the_deeper(tmp_path):
    *_, last = lines_of("studies/survey_in_a_seaway.py", tmp_path / "picture.png", "100")
    assert last.startswith("P(depth error > 0.5 m) = ")
    shares = [int(text) for text in re.findall(r"(\d+) % \[", last)]
    assert len(shares) == 3
    assert shares[0] > shares[-1]


@pytest.mark.slow
def test_landers_rest_or_slide_as_their_friction_says(tmp_path):
    # The slope's tangent is 0.325; the current pulls as well.
    first, second, _ = lines_of("laws/land_on_a_slope.py", tmp_path / "picture.png")
    assert float(first.rpartition(" ")[2]) >= 0.32
    assert float(second.partition("up to ")[2].partition(";")[0]) < 0.55
