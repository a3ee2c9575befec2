"""The snippets of the pages on sampling and sensitivity run as they stand."""

import re

import matplotlib
import numpy as np
import pytest
import SALib.analyze.sobol
import SALib.sample.sobol
import scipy.stats

import lgvi_warp as lw
from tests.conftest import ROOT

matplotlib.use("Agg")


def snippets(language):
    """(page and line, text) of every fenced snippet of a language."""
    found = []
    for name in ("sampling.md", "sensitivity.md"):
        text = (ROOT / "docs" / "guide" / name).read_text()
        for match in re.finditer(rf"```{language}\n(.*?)```", text, re.DOTALL):
            found.append(pytest.param(match[1], id=f"{name}:{text[: match.start()].count(chr(10)) + 1}"))
    return found


@pytest.mark.parametrize("text", snippets("toml"))
def test_toml(text, tmp_path):
    paper = (ROOT / "examples" / "paper.toml").read_text()
    whole = re.sub(r"\[ensemble\].*?(?=\[run\])", "", paper, flags=re.DOTALL) + text
    (tmp_path / "scene.toml").write_text(whole)
    scene = lw.Scene.load(tmp_path / "scene.toml")
    assert lw.Ensemble.from_scene(scene).members > 1


@pytest.mark.parametrize("text", snippets("python"))
def test_python(text, scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(text, {"lw": lw, "np": np, "scipy": scipy, "SALib": SALib, "scene": scene})


def test_there_are_snippets():
    assert len(snippets("toml")) >= 6 and len(snippets("python")) >= 6
