# SPDX-License-Identifier: Apache-2.0
"""The snippets of the page on statistics run as they stand."""

import re

import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "guide" / "statistics.md").read_text()


def snippets(language):
    """(line, text) of every fenced snippet of a language; those with events, kernels of their own, are slow."""
    return [
        pytest.param(
            match[1],
            id=f"line {PAGE[: match.start()].count(chr(10)) + 1}",
            marks=[pytest.mark.slow] if "events=" in match[1] else [],
        )
        for match in re.finditer(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    ]


@pytest.mark.parametrize("text", snippets("toml"))
def test_toml(text, tmp_path):
    (tmp_path / "scene.toml").write_text((ROOT / "examples" / "paper.toml").read_text() + text)
    assert len(lw.Scene.load(tmp_path / "scene.toml").run.statistics) == 4


@pytest.mark.parametrize("text", snippets("python"))
def test_python(text, scene, capsys):
    before = {"lw": lw, "np": np, "scene": scene}
    exec(text, names := dict(before))
    assert names.keys() - before.keys() - {"__builtins__"}


def test_shapes_are_those_of_the_page(scene):
    names = {"lw": lw, "np": np, "scene": scene}
    exec(snippets("python")[0].values[0], names)
    depth = names["depth"]
    assert depth.time.shape == depth.count.shape == (6,)
    assert depth.value.shape == depth.lower.shape == (6, 3, 1)
    assert names["result"].statistics["mean position"].half_width.shape == (6, 3)


def test_there_are_snippets():
    assert len(snippets("toml")) == 1
    assert len(snippets("python")) == 6


def test_every_type_is_on_the_page():
    from lgvi_warp.statistics import TYPES

    metrics = (ROOT / "docs" / "controllers" / "metrics.md").read_text()
    for name, kind in TYPES.items():
        page = metrics if kind.looks else PAGE
        assert f"`{name}`" in page
        assert f"`lw.{kind.__name__}`" in page
