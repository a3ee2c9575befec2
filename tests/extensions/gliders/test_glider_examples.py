# SPDX-License-Identifier: Apache-2.0
"""The examples of vehicles that move by themselves: what they print is what their pages say."""

import re
import subprocess
import sys

import pytest

from tests.conftest import ROOT

# An example, its page, and a pattern of the numbers that both have.
EXAMPLES = {
    "laws/glider_by_its_battery.py": (
        "moving_mass.md",
        (r"roll -(\d+)\.", r"([\d.]+) min"),
        r"by (\d+) degrees it turns once in ([\d.]+) min",
    ),
    "laws/rescue_vehicle.py": (
        "quadratic_form.md",
        (r"0\.5 m/s: within 0.5 deg after (\d+) s", r"1\.5 m/s: within 0.5 deg after (\d+) s"),
        r"within (\d+) s, at 1\.5 m/s within (\d+) s",
    ),
    "studies/glider_survey.py": (
        "buoyancy_engine.md",
        (r"(\d+) m north", r"(\d+) % of them"),
        r"comes (\d+) m to the north, and the pump takes (\d+) %",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_its_page_says_what_it_prints(name, tmp_path):
    page, printed, said = EXAMPLES[name]
    command = [sys.executable, ROOT / "examples" / name, tmp_path / "picture.png"]
    told = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout
    assert (tmp_path / "picture.png").stat().st_size > 20_000
    found = re.search(said, (ROOT / "docs/guide/terms" / page).read_text()).groups()
    assert found == tuple(re.search(pattern, told)[1] for pattern in printed)
