# SPDX-License-Identifier: Apache-2.0
"""The examples of the pages on laws and guidance are scenes, and each part has a section."""

import re

import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT

SCENE = """
[vehicle]
mass = 20.0
inertia = [5.0, 8.0, 11.0]
[[terms]]
type = "control_wrench"
limit = [60.0, 60.0, 60.0, 9.0, 9.0, 9.0]
[controller]
period = 0.1
"""
WANTED = '[[controller.guidance]]\ntype = "set_point"\nposition = [0.0, 0.0, 5.0]\nspeed = 1.0\n'
LAW = '[[controller.laws]]\ntype = "heave_pid"\nkp = 1.0\n'
PAGES = {"laws": lw.ControlLaw, "guidance": lw.Guidance}


def text(page):
    return (ROOT / "docs" / "controllers" / f"{page}.md").read_text()


@pytest.mark.parametrize(
    ("page", "example"),
    [(page, example) for page in PAGES for example in re.findall(r"```toml\n(.*?)```", text(page), re.S)],
)
def test_an_example_is_a_scene(page, example, tmp_path):
    np.savez(
        tmp_path / "policy.npz",
        weights_0=np.ones((3, 2)),
        biases_0=np.ones(3),
        weights_1=np.ones((1, 3)),
        biases_1=np.ones(1),
    )
    (tmp_path / "scene.toml").write_text(SCENE + example + (WANTED if page == "laws" else LAW))
    scene = lw.Scene.load(tmp_path / "scene.toml")
    assert lw.Scene.from_dict(scene.to_dict()).to_dict() == scene.to_dict()


@pytest.mark.parametrize("page", PAGES)
def test_each_part_has_a_section_with_all_its_keys(page):
    sections = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", text(page), re.S | re.M))
    for name, kind in PAGES[page].kinds.items():
        if kind.__module__.startswith("lgvi_warp."):
            fields = {item.name.removesuffix("_") for item in kind.number_fields()}
            assert fields <= set(re.findall(r"`(\w+)`", sections[name])), name
