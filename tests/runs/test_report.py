# SPDX-License-Identifier: Apache-2.0
"""The report of a run or of a study: one file, whole, that says what became of the members and how to run them again."""

import re
import tomllib
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.cli.command import main
from tests.conftest import ROOT
from tests.support.refusals import says

DEPTH = 101.0


@pytest.fixture(scope="module")
def result():
    """The paper's vehicle above a floor that some members reach."""
    scene = lw.Scene.load(ROOT / "examples" / "paper.toml", {"ensemble.members": 64})
    content = scene.to_dict() | {"events": [{"type": "floor", "depth": DEPTH}]}
    start = {"start.position[2]": {"uniform": {"low": DEPTH - 40.0, "high": DEPTH - 0.01}}}
    content["ensemble"]["vary"] = start
    statistics = [lw.statistics.Mean("position"), lw.statistics.Quantiles("depth")]
    return lw.solve(lw.Scene.from_dict(content), h=0.02, t1=4.0, save=lw.SaveAt(every=0.5), statistics=statistics)


class Page(HTMLParser):
    """Content of a page: its tags, those that are open, and what it would load."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.open, self.loads = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)
        self.loads += [value for name, value in attributes if name in ("src", "href") and not value.startswith("#")]

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)
        self.loads += [value for name, value in attributes if name in ("src", "href") and not value.startswith("#")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.mark.ci
def test_of_a_run(result, tmp_path):
    path = lw.report(result, tmp_path / "report.html")
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    # The summary, the inputs that tell apart who reaches the floor, the statistics.
    assert not page.open
    assert page.tags.count("svg") == 3
    assert path.stat().st_size < 5_000_000
    # Nothing is loaded: the page opens without a network.
    assert [source for source in page.loads if not source.startswith("data:")] == []
    counts = result.status.counts()
    assert set(counts) == {"ok", "floor"}
    for name, number in counts.items():
        assert re.search(rf"</span> {name}</td><td>{number}</td><td>{100.0 * number / 64:.3g} %</td>", text)
    for word in ("mean position", "quantiles depth", "warp-lang", "float64"):
        assert word in text
    # The scene that the page holds is the run's.
    scene = tomllib.loads(unescape(re.findall("<pre>(.*?)</pre>", text, re.DOTALL)[-1]))
    again = lw.Scene.from_dict(scene)
    assert lw.Scene.from_dict(result.provenance["scene"]).to_dict() == again.to_dict()


def test_of_a_folder_by_the_command(result, tmp_path, capsys):
    result.save(tmp_path / "result.npz")
    assert main(["report", str(tmp_path)]) == 0
    assert "report.html" in capsys.readouterr().out
    of_file = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "floor" in of_file
    assert Page(of_file).tags.count("svg") == 3


def test_of_a_run_without_samples(result, tmp_path):
    few = lw.solve(lw.Scene.load(ROOT / "examples" / "paper.toml", {"ensemble.members": 8}), h=0.02, t1=4.0, keep="none",
                   statistics=[lw.statistics.Mean("position")])  # fmt: skip
    text = lw.report(few, tmp_path / "report.html").read_text(encoding="utf-8")
    assert Page(text).tags.count("svg") == 1


def test_of_a_study(tmp_path):
    rows = "\n".join(f"psi_s,{i}" for i in range(300))
    (tmp_path / "tradeoff.csv").write_text(f"method,ns <&>\n{rows}\n")
    (tmp_path / "tradeoff.json").write_text('{"seed": 3, "rows": []}')
    (tmp_path / "tradeoff.png").write_bytes(b"\x89PNG")
    text = lw.report(tmp_path, tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.loads == ["data:image/png;base64,iVBORw=="]
    assert text.count("<tr>") == 201
    says(text, "The first 200 of 300 rows", "ns &lt;&amp;&gt;", "&quot;seed&quot;: 3")


def test_what_is_no_run(tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert (
        f"{tmp_path} holds no run and no study. Give a folder that lgvi-warp run wrote, or a study"
        in capsys.readouterr().err
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.ci
def test_names_are_text(result, tmp_path):
    evil = lw.Scene.from_dict(result.provenance["scene"] | {"terms": []})
    few = lw.solve(evil, h=0.02, t1=0.04)
    few.provenance["scene"]["vehicle"]["title"] = "<script>alert(1)</script>"
    text = lw.report(few, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script>" not in text
    assert np.isfinite(few.position).any()
