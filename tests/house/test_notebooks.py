# SPDX-License-Identifier: Apache-2.0
"""The notebooks of the site: stored with small outputs of their present code, which a fresh execution repeats."""

import base64
import io
import json
import re
import sys

import pytest

from tests.conftest import ROOT

pytest.importorskip("nbclient")
sys.path.append(str(ROOT / "docs"))

from site_parts import notebooks

BOOKS = sorted(notebooks.BOOKS.glob("*.ipynb"))
# Three tell of much at once; each of the others is of one how-to page, and ends in its picture.
OVERVIEWS = {"first_look", "uncertainty", "method_and_step"}
HOW_TO = [page for room in ("guide", "develop", "controllers") for page in (ROOT / "docs" / room).glob("*.md")]
# Paths of a machine, and addresses of objects.
LOCAL = re.compile(r"(?<![\w.])/(?:home|root|tmp|work|usr|opt|var|Users|private)/|[A-Z]:\\\\|\bat 0x[0-9a-f]+")
METADATA = {"kernelspec", "language_info", "lgvi_warp"}


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
def test_it_holds_text_and_code_and_the_outputs_of_this_code(path):
    book = notebooks.nbformat.read(path, as_version=4)
    assert book.cells[0].cell_type == "markdown"
    assert book.cells[0].source.startswith("# Notebook: ")
    code = [cell for cell in book.cells if cell.cell_type == "code"]
    assert len(code) >= 5
    again = f"run `make notebooks ONLY={path.stem}`, and look at it"
    assert book.metadata.get("lgvi_warp", {}).get("code") == notebooks.code_of(book), f"stale: {again}"
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1)), again
    outputs = [output for cell in code for output in cell.outputs]
    assert {output.output_type for output in outputs} <= {"stream", "execute_result", "display_data"}
    assert {output.get("name", "stdout") for output in outputs} == {"stdout"}, "a warning is not an output to store"
    assert {"image/png", "text/plain"} <= {kind for output in outputs for kind in output.get("data", ())}
    assert path.stem in OVERVIEWS or "image/png" in [kind for kind, _ in notebooks.parts(code[-1])]


@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
def test_it_is_small_and_tells_nothing_of_the_machine(path):
    assert path.stat().st_size < notebooks.MOST
    book = notebooks.nbformat.read(path, as_version=4)
    assert set(book.metadata) == METADATA
    assert set(book.metadata["language_info"]) == {"name"}
    for cell in book.cells:
        assert set(cell.metadata) <= {"tags"}
        for kind, content in notebooks.parts(cell) if cell.cell_type == "code" else ():
            assert kind == "image/png" or LOCAL.search(content) is None, (cell.id, content[:200])


@pytest.mark.parametrize(("stored", "fresh", "same"), [
    ("depth 12.34 m", "depth 12.35 m", True), ("depth 12.34 m", "depth 12.36 m", False),
    ("depth 12.34 m", "speed 12.34 m", False), ("1,234 members", "1,235 members", True),
    ("1,234 members", "1,254 members", False), ("error 2.31e-04", "error 2.32e-04", True),
    ("error 2.31e-04", "error 2.34e-04", False), ("error 6e-12", "error 9e-13", True), ("[1. 2.]", "[1. 4.]", False),
    ("0.1 of {'ok': 5}", "0.12 of  {'ok':  5}", True), ("-0.5", "0.5", False), ("nan", "1.0", False),
])  # fmt: skip
def test_numbers_are_compared_as_far_as_they_are_printed(stored, fresh, same):
    assert notebooks.same_text(stored, fresh) is same


def drawn(height, members=200, width=400):
    """A picture in base64, of a curve."""
    from matplotlib.figure import Figure

    figure, file = Figure(figsize=(width / 100.0, 3.0)), io.BytesIO()
    figure.subplots().plot([0.0, 1.0, 2.0], [0.0, height, 1.0], label=f"{members} members")
    figure.axes[0].set_ylim(0.0, 2.0)
    figure.legend()
    figure.savefig(file, format="png")
    return base64.b64encode(file.getvalue()).decode()


def test_pictures_are_compared_by_what_is_seen():
    kept = notebooks.small(drawn(1.0))
    assert len(kept) < len(drawn(1.0))
    assert notebooks.same_picture(kept, drawn(1.0))
    assert notebooks.same_picture(kept, drawn(1.001, members=201))
    assert not notebooks.same_picture(kept, drawn(1.2))
    assert not notebooks.same_picture(kept, drawn(1.0, width=420))


def test_of_measured_cells_the_kinds_of_outputs_are_compared():
    def cell(text, *tags):
        output = notebooks.nbformat.v4.new_output("stream", text=text)
        return notebooks.nbformat.v4.new_code_cell("1", outputs=[output], metadata={"tags": list(tags)})

    assert not notebooks.same_cell(cell("3.6 s"), cell("9.9 s"))
    assert notebooks.same_cell(cell("3.6 s", "measured"), cell("9.9 s", "measured"))
    silent = notebooks.nbformat.v4.new_code_cell("1")
    assert not notebooks.same_cell(cell("3.6 s", "measured"), silent)


@pytest.mark.slow
@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
def test_a_fresh_execution_repeats_its_outputs(path):
    stored = notebooks.nbformat.read(path, as_version=4)
    assert notebooks.differing(stored, notebooks.execute(path)) == [], f"run `make notebooks ONLY={path.stem}`"
