# SPDX-License-Identifier: Apache-2.0
"""The package of examples/extension_template installs, its tests pass, and its page says what is there."""

import json
import os
import re
import subprocess
import sys

import pytest

from tests.conftest import ROOT

TEMPLATE = ROOT / "examples" / "extension_template"
PAGE = (ROOT / "docs" / "develop" / "publish_a_law.md").read_text()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run Python in an environment that has the package, installed into a folder of its own without network."""
    folder = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--target", str(folder), str(TEMPLATE)], check=True)
    paths = os.pathsep.join([str(folder), str(ROOT), str(ROOT / "kernels")])

    def python(*arguments):
        return subprocess.run(
            [sys.executable, *arguments], cwd=folder, env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True
        )  # fmt: skip

    return python


@pytest.mark.ci
@pytest.mark.kernel
def test_its_tests_pass(run):
    done = run("-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(TEMPLATE), str(TEMPLATE / "tests"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed" in done.stdout


def test_the_page_prints_what_it_shows(run):
    (code,) = re.findall(r'^    python -c "(.*)"$', PAGE, re.MULTILINE)
    assert run("-c", code).stdout == "<class 'lgvi_magnet.term.Magnet'>\n"
    assert "    <class 'lgvi_magnet.term.Magnet'>\n" in PAGE


def test_lists_have_its_words(run):
    done = run("-c", "import json; from lgvi_warp.scene.schema import schema; print(json.dumps(schema()))")
    types = [
        entry["properties"]["type"]["const"]
        for entry in json.loads(done.stdout)["properties"]["terms"]["items"]["anyOf"]
    ]
    assert "magnet" in types
    assert "magnet" in run("-m", "lgvi_warp", "list", "terms").stdout


def test_the_page_names_every_file_and_table():
    files = {path.relative_to(TEMPLATE).as_posix() for path in TEMPLATE.rglob("*.py") if "tests" not in path.parts}
    assert all(f"`{name}`" in PAGE for name in files)
