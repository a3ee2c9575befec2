# SPDX-License-Identifier: Apache-2.0
"""The gallery: twelve short scripts, each with a picture that its present text drew, on a page that has both."""

import sys
from pathlib import Path

import pytest
from PIL import Image

from lgvi_warp.views.recording.movie import SIZE
from tests.conftest import ROOT

sys.path.append(str(ROOT / "docs"))

from site_parts import gallery, movie, pictures

SCRIPTS = gallery.scripts()
# What these print depends on the machine's speed.
TIMED = {"07", "10"}


def test_there_are_twelve():
    assert [script.name[:2] for script in SCRIPTS] == [f"{i:02}" for i in range(1, 13)]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_it_is_short_and_its_picture_is_of_its_text(script):
    assert len(script.read_text().splitlines()) < 80
    assert gallery.notes(script)["script"] == pictures.made_of_script(script), "stale: run `make gallery`"


def test_the_page_is_as_the_scripts_and_pictures_say():
    assert gallery.PAGE.read_text() == gallery.page(), "stale: run `make gallery`"


def test_the_moving_picture_is_of_its_script():
    with Image.open(movie.MOVIE) as picture:
        assert (picture.n_frames, picture.size) == (movie.FRAMES, SIZE)
        assert picture.info["xmp"].decode() == pictures.digest(Path(movie.__file__)), "stale: run `make gallery`"
    assert movie.MOVIE.stat().st_size < 600_000


def test_a_changed_script_is_found(tmp_path):
    changed = tmp_path / SCRIPTS[0].name
    changed.write_text(SCRIPTS[0].read_text() + "x = 1\n")
    drawing = [ROOT / source for source in pictures.sources_of(SCRIPTS[0])[1:]]
    assert drawing
    assert gallery.notes(SCRIPTS[0])["script"] != pictures.digest(changed, *drawing)


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_it_prints_what_the_page_says(script, tmp_path):
    printed = gallery.run(script, tmp_path)
    before = gallery.notes(script)["printed"]
    assert (tmp_path / f"{script.stem}.png").stat().st_size > 10_000
    assert len(printed.splitlines()) == len(before.splitlines())
    assert script.name[:2] in TIMED or printed == before
