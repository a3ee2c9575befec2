# SPDX-License-Identifier: Apache-2.0
"""Every benchmark case runs to its end with --quick, in a process of its own, and prints what it measured."""

import json
import os
import subprocess
import sys

import pytest

from benchmarks import pages
from tests.house.test_benchmarks import CASES


def lines(tmp_path, *arguments):
    """The records of a command of the benchmarks."""
    run = [sys.executable, "-m", "benchmarks", *arguments]
    environment = os.environ | {"LGVI_WARP_BENCH_DIR": str(tmp_path)}
    done = subprocess.run(run, cwd=pages.ROOT, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_case_runs_to_its_end(name, tmp_path):
    machine, *records = lines(tmp_path, "run", name, "--quick")
    assert machine["case"] == "machine"
    assert records
    assert {record["case"] for record in records} == {name}
    assert all(len(record) > 1 for record in records)
