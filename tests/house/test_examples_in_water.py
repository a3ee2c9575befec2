# SPDX-License-Identifier: Apache-2.0
"""Shipped scenes and sweeps stay in the water, or are listed here with how many of their members leave it."""

import json

import pytest

import lgvi_warp as lw
from lgvi_warp.cli import main
from lgvi_warp.common.status import Warnings
from tests.conftest import ROOT

FILES = [path for path in sorted((ROOT / "examples").rglob("*.toml")) if path.name != "pyproject.toml"]
SCENES = {path.name: path for path in FILES if path.parent.name != "sweeps"}
SWEEPS = {path.name: path for path in FILES if path.parent.name == "sweeps"}
# Manoeuvres in deep water whose depth counts from the start: members that leave the water, of the members that run.
LEAVE = {"remus_100_pitch_up.toml": (1, 1), "remus_100_turn.toml": (1, 1)}
# One minute of a few members tells; a sweep's cells are whole.
MEMBERS, MOST, QUICK = 16, 60.0, "paper.toml"


def slow_but(names, quick):
    return [name if name == quick else pytest.param(name, marks=pytest.mark.slow) for name in names]


@pytest.mark.parametrize("name", slow_but(SCENES, QUICK))
def test_scenes_stay_in_the_water(name):
    scene = lw.Scene.load(SCENES[name])
    fleet = lw.Ensemble.from_scene(scene)
    fleet = fleet.subset(range(min(MEMBERS, fleet.members)))
    step, duration = scene.run.step or 0.05, min(scene.run.duration or MOST, MOST)
    result = lw.solve(fleet, h=step, t1=duration, save=lw.SaveAt(every=duration / round(duration)))
    high = int(result.warnings.has(Warnings.ABOVE_SURFACE).sum())
    assert (high, fleet.members) == LEAVE.get(name, (0, fleet.members))


@pytest.mark.slow
@pytest.mark.parametrize("name", SWEEPS)
def test_sweeps_stay_in_the_water(name, tmp_path):
    assert main(["sweep", str(SWEEPS[name]), "--members", str(MEMBERS), "--out", str(tmp_path), "--quiet"]) == 0
    cells = json.loads((tmp_path / "sweep.json").read_text())["cells"]
    assert [text for cell in cells for text in cell["messages"] if "above the surface" in text] == []
    assert "leave the water" not in (tmp_path / "summary.md").read_text()


@pytest.mark.slow
def test_a_sweep_that_leaves_the_water_says_so(tmp_path):
    """The dive from the surface that depth_gain_map.toml once was: most members of the best gains rise above it."""
    text = SWEEPS["depth_gain_map.toml"].read_text().replace('"../scenes/', f'"{ROOT}/examples/scenes/')
    file = tmp_path / "dive.toml"
    file.write_text(text.replace("[0.0, 0.0, 5.0]", "[0.0, 0.0, 0.0]"))
    assert main(["sweep", str(file), "--members", "100", "--out", str(tmp_path / "out"), "--quiet"]) == 0
    cells = json.loads((tmp_path / "out" / "sweep.json").read_text())["cells"]
    told = [int(text.split()[1]) for cell in cells for text in cell["messages"] if "rise above the surface" in text]
    assert len(told) == len(cells)
    assert min(told) > 50
    assert "In 16 of 16 cells members leave the water" in (tmp_path / "out" / "summary.md").read_text()
