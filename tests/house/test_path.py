# SPDX-License-Identifier: Apache-2.0
"""Length of an argument's path from `lw.solve` to the kernel."""

import re
import subprocess
import sys

import pytest

from tests.house.graph import ROOT
from tests.house.path import climbs, walked


@pytest.mark.slow  # the watched run takes long
def test_the_step_passes_few_places_on_its_way_to_the_kernel():
    stays = walked("h")
    assert {"solve", "Request.plan", "class TimeGrid"} <= {name for name, *_ in stays}
    assert len(stays) <= 25
    assert len({file for *_, file in stays}) <= 15
    assert climbs(stays) <= 6


@pytest.mark.slow  # a process of its own, where no kernel has been made yet
def test_the_page_of_the_way_names_the_files_of_a_run_in_the_order_of_their_calls():
    page = (ROOT / "docs" / "develop" / "from_solve_to_the_kernel.md").read_text()
    named = re.findall(r"^\d+\. \[`[\w/.]+`\]\(\.\./\.\./([\w/]+\.py)\)", page, re.MULTILINE)
    command = [sys.executable, "-m", "tests.house.path", "files"]
    entered = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    assert len(named) == 17
    assert [file for file in entered if file in named] == named
