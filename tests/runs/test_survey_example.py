# SPDX-License-Identifier: Apache-2.0
"""The survey of README: gliders through an eddy beside a shoal."""

import re
import subprocess
import sys

import pytest

from tests.conftest import ROOT


@pytest.mark.slow
def test_the_survey_tells_how_probable_the_floor_is(tmp_path):
    script = ROOT / "examples/studies/glider_in_an_eddy.py"
    command = [sys.executable, script, tmp_path / "picture.png", "300"]
    told, path = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout.splitlines()
    assert (tmp_path / "picture.png").stat().st_size > 30_000
    assert path.endswith("picture.png")
    value, low, high = (float(x) for x in re.findall(r"(\d+\.\d\d)", told))
    # Ten thousand members: 6.92 %.
    assert low < 6.92 < high
    assert low < value < high
