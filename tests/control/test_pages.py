# SPDX-License-Identifier: Apache-2.0
"""Each part of a controller has a section on the page of laws or of guidance, with all its keys."""

import re

import pytest

import lgvi_warp as lw
from tests.conftest import ROOT

PAGES = {"laws": lw.laws.ControlLaw, "guidance": lw.laws.Guidance}
FURTHER = {"laws": "other_laws", "guidance": "circles_and_docks"}


def text(page):
    return (ROOT / "docs" / "controllers" / f"{page}.md").read_text()


@pytest.mark.parametrize("page", PAGES)
def test_each_part_has_a_section_with_all_its_keys(page):
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", f"{text(page)}\n{text(FURTHER[page])}", re.S | re.M))
    for name, kind in PAGES[page].kinds.items():
        if kind.__module__.startswith("lgvi_warp."):
            fields = {item.name.removesuffix("_") for item in kind.number_fields()}
            assert name in sections, f"Write its section, ## {name}, into docs/controllers/{page}"
            assert fields <= set(re.findall(r"`(\w+)`", sections[name])), name
