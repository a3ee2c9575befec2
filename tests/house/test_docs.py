# SPDX-License-Identifier: Apache-2.0
"""The snippets of pages run as they stand, where no test of their subject runs them."""

import re
import shutil
import tomllib

import matplotlib
import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.statistics.base import TYPES as STATISTICS
from tests.conftest import ROOT
from tests.support.pages import blocks, snippets

matplotlib.use("Agg")


def cases(language, *names):
    """Every fenced snippet of a language, by page and line; those with events, kernels of their own, are slow."""
    return [
        pytest.param(code, id=f"{name}:{line}", marks=[pytest.mark.slow] if "events=" in code else [])
        for name in names
        for line, code, _ in snippets(f"docs/guide/{name}", language)
    ]


TOML = cases("toml", "sampling.md", "distributions.md", "sensitivity.md")


@pytest.mark.parametrize("text", TOML)
def test_toml(text, tmp_path):
    paper = (ROOT / "examples" / "paper.toml").read_text()
    whole = re.sub(r"\[ensemble\].*?(?=\[run\])", "", paper, flags=re.DOTALL) + text
    (tmp_path / "scene.toml").write_text(whole)
    scene = lw.Scene.load(tmp_path / "scene.toml")
    assert lw.Ensemble.from_scene(scene).members > 1


def test_there_are_snippets():
    assert len(TOML) >= 6
    assert len(blocks("docs/guide/statistics.md", "python")) == 4


REMUS = '[vehicle]\nname = "remus_100"\n'
ROV = '[vehicle]\nname = "bluerov2_heavy"\n'
LAW = """[controller]
period = 0.1
guidance = [{ type = "set_point", heading = 0.5 }]
laws = [{ type = "heading_pid", kp = 1.0 }]
"""
# Page -> what stands before each of its snippets in a scene file.
BEFORE = {
    "docs/controllers/README.md": [REMUS], "docs/controllers/actuators.md": [REMUS],
    "docs/controllers/allocation.md": [REMUS + LAW, REMUS + LAW, ROV + LAW, ROV + LAW], "docs/guide/events.md": [REMUS],
}  # fmt: skip


@pytest.mark.parametrize("page", BEFORE)
def test_snippets_are_parts_of_scenes(page):
    for before, text in zip(BEFORE[page], blocks(page, "toml"), strict=True):
        scene = lw.Scene.from_dict(tomllib.loads(before + text))
        assert scene.events or scene.controller


def test_a_vehicle_from_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "tests" / "data" / "vehicles" / "frame_rov.sdf", "model.sdf")
    world = '<sdf version="1.9"><world name="ocean"><gravity>0 0 -9.7</gravity></world></sdf>'
    (tmp_path / "ocean.world").write_text(world)
    (text,) = blocks("docs/guide/vehicles.md", "python")
    exec(text, names := {})
    assert (names["scene"].environment.gravity, names["scene"].start.position[2]) == (9.7, 5.0)


@pytest.mark.slow
def test_failed_members(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    page = "docs/guide/failed_members.md"
    exec(blocks(page, "python")[0], {})
    printed = "".join(f"    {line}\n" for line in capsys.readouterr().out.splitlines())
    assert f"```\n\n{printed}\n1." in (ROOT / page).read_text()


@pytest.mark.slow
def test_many_calls(monkeypatch):
    monkeypatch.chdir(ROOT)
    text, noise, given = blocks("docs/guide/many_calls.md", "python")
    exec(text, names := {})
    assert names["depths"].shape == (2,)
    assert np.all(names["depths"] > 9.0)
    exec(noise, names)
    still = names["run"](names["x"], seed=7, indices=names["index"])
    # Same noise: the start's 0.1 m alone, to round-off; other noise: other depths.
    np.testing.assert_allclose(names["moved"] - still, 0.1, atol=1e-12)
    assert np.all(names["drawn"] != still)
    before = names["run"](names["x"], seed=7, indices=names["index"] + 100)
    exec(given, names)
    assert [(draws.of, draws.stream, draws.count) for draws in names["run"].draws] == [("wrench_noise", "force", 40)]
    assert np.all(names["depths"] != before)


@pytest.mark.slow
def test_a_controller_in_python_and_its_signals(monkeypatch):
    monkeypatch.chdir(ROOT)
    (text,) = blocks("docs/controllers/callback.md", "python")
    exec(text, names := {})
    sections = {"vehicle": {"mass": 20.0, "inertia": [5.0, 8.0, 11.0]}, "run": {"step": 0.05, "duration": 20.0}}
    terms = {"terms": [{"type": "control_wrench"}], "controller": names["controller"]}
    scene = lw.Scene.from_dict(sections | terms)
    result = lw.solve(scene, save=lw.SaveAt(every=1.0, fields=("command",)))
    assert (result.command.shape, result.status.counts()) == ((21, 1, 6), {"ok": 1})
    (text,) = blocks("docs/controllers/signals.md", "python")
    exec(text, names := {})
    assert names["result"].command.shape[1:] == (20, 2)


def test_statistics_in_a_scene_file(tmp_path):
    (text,) = blocks("docs/guide/statistics.md", "toml")
    (tmp_path / "scene.toml").write_text((ROOT / "examples" / "paper.toml").read_text() + text)
    assert len(lw.Scene.load(tmp_path / "scene.toml").run.statistics) == 4


def test_shapes_of_statistics_are_those_of_the_page(monkeypatch):
    monkeypatch.chdir(ROOT)
    exec(blocks("docs/guide/statistics.md", "python")[0], names := {})
    depth = names["depth"]
    assert depth.time.shape == depth.count.shape == (6,)
    assert depth.value.shape == depth.lower.shape == (6, 3, 1)
    assert names["result"].statistics["mean position"].half_width.shape == (6, 3)


@pytest.mark.parametrize("at_ticks", [True, False])
def test_every_type_of_statistic_is_on_its_page(at_ticks):
    page = (ROOT / "docs" / ("controllers/metrics.md" if at_ticks else "guide/statistics.md")).read_text()
    door = "metrics" if at_ticks else "statistics"
    for name, kind in STATISTICS.items():
        if bool(kind.ticks) is at_ticks:
            assert f"`{name}`" in page
            assert f"`lw.{door}.{kind.__name__}`" in page


def test_each_word_of_the_glossary_is_defined_once_and_in_order():
    text = (ROOT / "docs" / "reference" / "glossary.md").read_text()
    sections = [re.findall(r"^\| ([a-z][\w ,-]*) \| ", part, re.MULTILINE)[1:] for part in text.split("\n## ")[1:]]
    words = [word for section in sections for row in section for word in row.split(", ")]
    assert len(words) > 60
    assert len(set(words)) == len(words)
    assert all(section == sorted(section) for section in sections)
