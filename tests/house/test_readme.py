# SPDX-License-Identifier: Apache-2.0
"""The examples of README and of the first pages print what the pages say."""

import re
import runpy
import tomllib

import matplotlib
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.support.pages import blocks, snippets

matplotlib.use("Agg")


@pytest.mark.ci
def test_readme(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    _, code, output = snippets("README.md", "python")[0]
    exec(code, {})
    assert capsys.readouterr().out == output
    assert output.count("\n") == 3
    assert (tmp_path / "where_to_search.png").stat().st_size > 1000


def test_the_picture_of_readme_is_made_by_its_lines():
    _, code, _ = snippets("README.md", "python")[0]
    assert (ROOT / "examples" / "where_to_search.py").read_text().endswith('"""\n\n' + code)


def test_the_readme_is_short_and_shows_what_comes_of_it():
    text = (ROOT / "README.md").read_text()
    assert len(text.split()) < 600
    order = [
        "How far off", "fleet.webp", "pip install", "```python", "where_to_search.png)", "make run", "make test",
        "beside_others.png", "glider_in_an_eddy.png", "depth_gain_map.png", "accuracy_remus.png",
        "## What is verified", "## What is not modelled",
        "## Citation",
    ]  # fmt: skip
    assert sorted(order, key=text.index) == order


def test_the_readme_can_be_cited():
    text = (ROOT / "README.md").read_text().partition("```bibtex")[2].partition("```")[0]
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"version = {{{version}}}" in text
    assert re.findall(r"^@(\w+)\{", text, re.MULTILINE) == ["software", "inproceedings"]
    assert text.count("{") == text.count("}")


def test_six_questions_are_answered_where_the_page_says():
    page = (ROOT / "docs" / "develop" / "site.md").read_text().partition("## What a stranger asks")[2]
    rows = re.findall(r'^\| .*\? \| "(.*)" \| "(.*)" \|$', page, re.MULTILINE)
    assert len(rows) == 6
    readme, first = ((ROOT / name).read_text() for name in ("README.md", "docs/index.md"))
    assert [words for words, _ in rows if words not in readme] == []
    assert [words for _, words in rows if words not in first] == []


@pytest.mark.ci
def test_the_first_example(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "01_first_dive.py"), run_name="__main__")
    printed = capsys.readouterr().out.splitlines()
    page = (ROOT / "docs" / "start" / "tutorial.md").read_text()
    assert len(printed) == 3
    assert all(f"\n    {line}\n" in page for line in printed)


def test_the_methods_of_the_guide():
    code = blocks("docs/guide/methods.md", "python")[0]
    methods = [eval(line, {"lw": lw}) for line in code.splitlines() if line.startswith("lw.")]
    assert [method.name for method in methods] == ["psi_s", "psi", "rk8"]
    assert methods[2].adaptive
