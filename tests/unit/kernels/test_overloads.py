# SPDX-License-Identifier: Apache-2.0
"""Lanes are declared for the types that are asked for; the hash of a kernel knows their code, not what else is declared."""

import json
import os
import shutil
import subprocess
import sys

import pytest
import warp as wp

from lgvi_kernels.lanes.arithmetic import WIDTHS, add, lane, mul, ones  # noqa: F401
from lgvi_kernels.lanes.functions import sine
from tests.conftest import ROOT


def kernel_hash():
    """Hash of a kernel made now, of four float64 lanes."""
    Lane = lane(4, wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(x: wp.array(dtype=Lane)):
        x[0] = sine(x[0]) * x[0] + ones(x[0])

    return kernel.module.get_module_hash().hex()


def hashes():
    """Print the hash before and after other lanes are declared, how many functions `sine` has then, and a later one."""
    found = [kernel_hash(), len(sine.user_overloads)]
    from lgvi_kernels.lanes.noise import wandered

    found.append(len(wandered.user_templates))
    for width in WIDTHS:
        lane(width, wp.float32)
    print(json.dumps([*found, kernel_hash(), len(sine.user_overloads), len(wandered.user_templates)]))


def in_a_new_process(kernels):
    """Output of `hashes` with the device code of a folder."""
    environment = os.environ | {"PYTHONPATH": f"{kernels}{os.pathsep}{ROOT}"}
    code = "from tests.unit.kernels.test_overloads import hashes; hashes()"
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment)
    return json.loads(run.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def as_it_is():
    return in_a_new_process(ROOT / "kernels")


def test_a_type_is_declared_when_it_is_asked_for(as_it_is):
    _, first, _, _, then, _ = as_it_is
    assert then - first == len(WIDTHS)
    assert first == 2  # that of the type, and the family's own


def test_a_function_that_is_imported_later_knows_the_types(as_it_is):
    _, _, first, _, _, then = as_it_is
    assert first == 2  # a key for each step of the run, and one for steps of a grid
    assert then == 2 * len(WIDTHS)


def test_a_hash_does_not_depend_on_other_types(as_it_is):
    before, _, _, after, _, _ = as_it_is
    assert before == after


def test_a_hash_changes_with_the_code_of_lanes(as_it_is, tmp_path):
    copy = shutil.copytree(ROOT / "kernels", tmp_path / "kernels", ignore=shutil.ignore_patterns("__pycache__"))
    path = copy / "lgvi_kernels" / "lanes" / "series.py"
    path.write_text(path.read_text().replace("PI = 3.14", "PI = 3.15", 1))
    assert in_a_new_process(copy)[0] != as_it_is[0]
