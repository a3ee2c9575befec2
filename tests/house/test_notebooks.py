# SPDX-License-Identifier: Apache-2.0
"""The notebooks of the site: kept without outputs, and run from the first cell to the last."""

import json
import re

import pytest

from tests.conftest import ROOT

BOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
# Three tell of much at once; each of the others is of one how-to page, and ends in its picture.
OVERVIEWS = {"first_look", "uncertainty", "method_and_step"}
HOW_TO = [page for room in ("guide", "develop", "controllers") for page in (ROOT / "docs" / room).glob("*.md")]


def test_there_are_fifteen():
    assert len(BOOKS) == 15
    assert {path.stem for path in BOOKS} > OVERVIEWS


@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
def test_it_and_its_page_link_to_each_other(path):
    linking = [page for page in HOW_TO if f"notebooks/{path.name})" in page.read_text()]
    assert "notebooks" in {page.stem for page in linking}, "docs/guide/notebooks.md lists all notebooks"
    cells = json.loads(path.read_text())["cells"]
    text = "".join(line for cell in cells if cell["cell_type"] == "markdown" for line in cell["source"])
    pages = {(path.parent / target).resolve() for target in re.findall(r"\]\(([^)#]+\.md)", text)}
    assert all(page.is_file() for page in pages)
    if path.stem not in OVERVIEWS:
        assert pages & {page.resolve() for page in linking if page.stem != "notebooks"}


@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
def test_it_holds_text_and_code_and_no_outputs(path):
    cells = json.loads(path.read_text())["cells"]
    assert cells[0]["cell_type"] == "markdown"
    assert "".join(cells[0]["source"]).startswith("# Notebook: ")
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 5
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)


@pytest.mark.slow
@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
def test_it_runs(path, tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    book = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(book, timeout=600, kernel_name="python3", resources=resources).execute()
    outputs = [output for cell in book.cells for output in cell.get("outputs", ())]
    kinds = {kind for output in outputs for kind in output.get("data", ())}
    assert {"image/png", "text/plain"} <= kinds
    assert not any(output.output_type == "error" for output in outputs)
    last = [cell for cell in book.cells if cell.cell_type == "code"][-1]
    shown = {kind for output in last.outputs for kind in output.get("data", ())}
    assert path.stem in OVERVIEWS or "image/png" in shown
    assert not list(tmp_path.iterdir())
