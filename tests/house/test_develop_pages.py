# SPDX-License-Identifier: Apache-2.0
"""The complete examples of the pages on adding a method, a statistic and a sampling run as they stand."""

import re

import pytest

from lgvi_warp.methods import limits, method
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.statistics import base
from tests.conftest import ROOT
from tests.support.pages import blocks


@pytest.mark.ci
@pytest.mark.parametrize("page", ["add_a_method.md", "add_a_statistic.md", "add_a_sampling.md"])
def test_example(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    for table in (method.PROGRAMS, method.ORDERS, limits.MUNK, limits.RESTORING):
        monkeypatch.setitem(table, "psi_k", None)  # what the example of a method adds goes with the test
    for owner, name in ((base, "TYPES"), (Sampling, "kinds")):
        monkeypatch.setattr(owner, name, dict(getattr(owner, name)))
    (example,) = blocks(f"docs/develop/{page}", "python")
    exec(example, names := {})
    assert len(names) > 4, "the example defines what the page adds"


def test_files_to_touch_exist():
    for page in sorted((ROOT / "docs" / "develop").glob("add_*.md")):
        for path in re.findall(r"`((?:lgvi_warp|kernels|tests|docs)/[\w./]+?)`", page.read_text()):
            if "NAME" not in path:
                assert (ROOT / path).exists(), (page.name, path)
