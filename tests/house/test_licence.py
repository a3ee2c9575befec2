# SPDX-License-Identifier: Apache-2.0
"""Every source file names its licence, that of the package, in its first line."""

import subprocess
import tomllib

from tests.conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LINE = f"# SPDX-License-Identifier: {PROJECT['license']}"


def without_line(paths):
    """Files whose head does not name the licence: the first line, or the second below a `#!`."""
    heads = ((path, path.read_text().splitlines()[:2]) for path in paths)
    return [path for path, head in heads if LINE not in (head if "".join(head[:1]).startswith("#!") else head[:1])]


def test_every_source_file_names_the_licence():
    listed = subprocess.run(["git", "ls-files", "*.py", "*.pyi"], cwd=ROOT, check=True, capture_output=True, text=True)
    paths = [ROOT / name for name in listed.stdout.splitlines() if (ROOT / name).exists()]
    assert len(paths) > 500
    assert [str(path.relative_to(ROOT)) for path in without_line(paths)] == []


def test_the_licence_is_that_of_the_file():
    assert "Apache License" in (ROOT / "LICENSE").read_text()
    assert PROJECT["license"] == "Apache-2.0"


def test_a_file_without_the_line_is_found(tmp_path):
    for name, text in {
        "a.py": f"{LINE}\n",
        "b.py": f"#!/usr/bin/env python\n{LINE}\n",
        "c.py": f'"""x"""\n{LINE}\n',
        "d.py": "",
    }.items():
        (tmp_path / name).write_text(text)
    assert [path.name for path in without_line(sorted(tmp_path.iterdir()))] == ["c.py", "d.py"]
