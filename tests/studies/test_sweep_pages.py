"""The snippets of the pages on metrics and sweeps run as they stand, and so do the examples of sweeps, with fewer members."""

import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.studies.sweeps.file import arguments_of_file
from tests.conftest import ROOT

pytestmark = pytest.mark.kernel

SCENE = ROOT / "examples" / "scenes" / "remus_100_autopilot.toml"
PAGES = {
    "metrics": ROOT / "docs" / "controllers" / "metrics.md",
    "guide": ROOT / "docs" / "guide" / "is_my_controller_robust.md",
}


def snippets(page, language):
    return re.findall(rf"```{language}\n(.*?)```", PAGES[page].read_text(), re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_python(page):
    scene = lw.Scene.load(SCENE)
    fleet = lw.Ensemble(scene, 50, seed=1, vary=scene.ensemble_settings.vary)
    names = {"lw": lw, "np": np, "scene": scene, "fleet": fleet}
    for text in snippets(page, "python"):
        exec(text, names)
    assert "found" in names or names["metric"].unit == "rad"


def test_toml(tmp_path):
    (text,) = snippets("guide", "toml")
    (tmp_path / "sweep.toml").write_text(text)
    (tmp_path / "remus_100_autopilot.toml").write_text(SCENE.read_text())
    arguments = arguments_of_file(tmp_path / "sweep.toml")
    assert [case["name"] for case in arguments["cases"]] == ["pid", "stiff"] and arguments["t1"] == 60.0
    (text,) = snippets("metrics", "toml")
    (tmp_path / "scene.toml").write_text(SCENE.read_text() + text)
    assert lw.Scene.load(tmp_path / "scene.toml").run.statistics[0].key == "settling_time depth"


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "sweeps").glob("*.toml")), ids=lambda path: path.stem)
def test_examples(path):
    arguments = arguments_of_file(path)
    found = lw.sweep(**{**arguments, "members": 8})
    assert not any(row["refused"] for row in found.rows()) and len(str(found)) > 100
