# SPDX-License-Identifier: Apache-2.0
"""Every picture of the pages was drawn by what stands in the repository now, and the table of fronts follows from its rows."""

import sys
from pathlib import Path

import pytest
from PIL import Image

from benchmarks import pages
from benchmarks.tables import fronts
from lgvi_warp.measuring.comparison import Sample
from tests.conftest import ROOT

sys.path.append(str(ROOT / "docs"))

from site_parts import pictures

DOCS = ROOT / "docs"
# Columns of README's page [pixels], and the least height of a letter that is read there.
NARROW, LEGIBLE = 700, 9.0


def test_every_picture_is_made_by_something():
    """The gallery has its own test."""
    there = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.png") if path.parent.name != "gallery"}
    assert there == set(pictures.MADE)


@pytest.mark.parametrize("name", pictures.MADE)
def test_it_is_of_what_made_it(name):
    told = pictures.notes(DOCS / name).get("script")
    assert told == pictures.made_of(name), f"stale: run `make pictures ONLY={Path(name).stem}`, and look at it"


def test_a_stale_picture_is_found(tmp_path):
    """Code of any source changes the hash; line ends, comments, docstrings and imports do not."""
    a, b = tmp_path / "a.py", tmp_path / "b.toml"
    a.write_text('# SPDX-License-Identifier: X\n"""One."""\nimport math\nx = 1\n')
    b.write_text("y = 2\n")
    digest = pictures.digest(a, b)
    a.write_bytes(b'# Y\r\n"""Two."""\r\nfrom math import (\r\n  pi)\r\n\r\nx = 1\r\n')
    assert pictures.digest(a, b) == digest
    b.write_text("y = 3\n")
    assert pictures.digest(a, b) != digest
    drawn, kept = tmp_path / "drawn.png", tmp_path / "kept.png"
    Image.new("RGB", (4, 4), "white").save(drawn)
    pictures.keep(drawn, kept, script=digest)
    assert pictures.notes(drawn) == {}
    assert pictures.notes(kept) == {"script": digest}


def test_of_a_page_its_code_counts_and_its_prose_does_not(tmp_path):
    page = tmp_path / "page.md"
    text = "# Title\n\n```toml\nx = 1\n```\n\nProse.\n\n    $ run it\n    printed\n"
    page.write_text(text)
    digest = pictures.digest(page)
    for same in ("Prose.", "# Title", "printed"):
        page.write_text(text.replace(same, "Other"))
        assert pictures.digest(page) == digest, same
    for other in ("x = 1", "run it"):
        page.write_text(text.replace(other, "y"))
        assert pictures.digest(page) != digest, other


def test_the_table_of_fronts_follows_from_its_rows():
    before, after = pages.parts("fronts", ROOT / pages.PAGES["fronts"])
    text = (ROOT / pages.PAGES["fronts"]).read_text()
    assert text == f"{before}\n\n{fronts.text_of().strip()}\n\n{after}", (
        "run `python -m benchmarks table fronts --kept`"
    )


@pytest.mark.parametrize("name", fronts.SCENES)
def test_the_rows_are_of_the_methods_that_the_scene_takes_now(name):
    """A method that a scene began or ceased to take makes its rows stale: measure again."""
    fleet, t1 = fronts.SCENES[name]()
    methods = fronts.METHODS[fronts.KINDS[name]]
    taken, _ = Sample(fleet, t1).accepted(methods)
    content = fronts.kept_rows(name)
    measured = {row[0] for row in content["rows"]} | {text.split()[0] for text in content["missing"]}
    assert set(taken) <= measured
    assert {"rk4", "rk8", "psi_x"} <= set(taken)
    assert len(methods) <= 7
    assert {row[0].split()[0] for row in content["rows"]} <= set(methods)


def test_pictures_of_fronts_are_readable_in_a_narrow_column():
    """By arithmetic: the smallest letters, at 12 points of a picture 8.38 inches wide, shown 700 pixels wide."""
    from benchmarks.fronts_picture import FINE, SIZE, picture_of

    assert 12.0 / 72.0 * NARROW / SIZE[0] > LEGIBLE
    for name in fronts.SCENES:
        with Image.open(picture_of(name)) as picture:
            assert abs(picture.width - SIZE[0] * FINE) <= 1
