# SPDX-License-Identifier: Apache-2.0
"""Names that a file gives, in what is written of a study: no formula, no control character, no Markdown, no HTML."""

import csv
import json
import re

import pytest

import lgvi_warp as lw
from lgvi_warp.common import tables

ODD = ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "\n=1", '=HYPERLINK("http://a")']


@pytest.mark.parametrize("name", ODD)
def test_no_cell_is_a_formula(name, tmp_path):
    path = tables.write_csv([{name: name, "value": -1.5, "number": "-2.5e-3", "plain": "a = b"}], tmp_path / "a.csv")
    with path.open(newline="") as file:
        head, row = csv.reader(file)
    for text in (*head, *row):
        assert text[:1] not in ("=", "+", "-", "@", "\t", "\r", "\n") or text in ("-1.5", "-2.5e-3")
        assert text.isprintable()
    assert head[0] == row[0] == "'" + name.replace("\t", r"\t").replace("\r", r"\r").replace("\n", r"\n")
    assert row[1:] == ["-1.5", "-2.5e-3", "a = b"]


@pytest.mark.parametrize("name", ["a\x1b[2Jb", "a\x07", "a\u202eb", "a\x9bb", "a\x00b"])
def test_control_characters_are_text(name, tmp_path):
    content = tables.write_csv([{"case": name}], tmp_path / "a.csv").read_text()
    (tmp_path / "sweep.json").write_text(json.dumps({"baseline": name}))
    (tmp_path / "summary.md").write_text(f"- {name}: 1\n")
    page = lw.report(tmp_path, tmp_path / "report.html").read_text()
    for text in (content, page, tables.markdown(f"- {name}: 1")):
        assert ascii(name)[1:-1] in re.sub(r"\\([^\w\s])", r"\1", text)
        assert text.replace("\r\n", "").replace("\n", "").isprintable()


def test_names_are_no_markdown():
    text = "# Sweep\n\n- a](http://b) <img src=x> `c` *d* | e: passes\n1. [x]: 3 %\n"
    assert tables.markdown(text) == (
        "# Sweep\n\n- a\\](http://b) \\<img src=x\\> \\`c\\` \\*d\\* \\| e: passes\n1. \\[x\\]: 3 %\n"
    )
