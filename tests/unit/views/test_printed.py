# SPDX-License-Identifier: Apache-2.0
"""Pictures for a printed page: as wide as its columns, with text of 8 points and fonts that are in the file."""

import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import lgvi_warp as lw
from lgvi_warp.views.plots.picture import WIDTHS
from tests.support.made import made, turned

STYLES = tuple(WIDTHS)


def fleet_result():
    """Twelve members that sink side by side."""
    time = np.linspace(0.0, 30.0, 31)
    position = np.ones((31, 12, 3)) * np.arange(12)[:, None] + time[:, None, None]
    return made(position, time, attitude=turned(0.01 * time[:, None] * np.arange(12)))


@pytest.mark.parametrize("style", STYLES)
def test_a_pdf_is_as_wide_as_a_column_and_holds_its_fonts(style, tmp_path):
    axes = lw.plots.fan(fleet_result(), "depth", path=tmp_path / "fan.pdf", style=style)
    content = (tmp_path / "fan.pdf").read_bytes()
    box = [float(x) for x in re.search(rb"/MediaBox \[\s*([^\]]*)\]", content)[1].split()]
    assert box[2] == pytest.approx(72.0 * WIDTHS[style])  # points
    assert b"/FontFile2" in content  # TrueType outlines
    assert b"/Type3" not in content
    assert axes.xaxis.get_label().get_size() == 8.0


@pytest.mark.parametrize("style", STYLES)
def test_a_png_has_300_dots_per_inch(style, tmp_path):
    lw.plots.plan_view(fleet_result(), path=tmp_path / "plan.png", style=style)
    with Image.open(tmp_path / "plan.png") as picture:
        assert picture.width == pytest.approx(300.0 * WIDTHS[style], abs=1)


def test_panels_of_a_summary_stand_below_each_other_in_one_column():
    places = [axes.get_subplotspec() for axes in lw.plots.summary(fleet_result(), style="one_column")]
    assert {place.colspan.start for place in places} == {0}
    assert [place.rowspan.start for place in places] == list(range(len(places)))
    assert {axes.get_subplotspec().colspan.start for axes in lw.plots.summary(fleet_result())} == {0, 1}


def test_the_style_ends_with_its_picture():
    lw.plots.fan(fleet_result(), style="one_column")
    assert lw.plots.fan(fleet_result()).figure.get_figwidth() == 8.0
    with pytest.raises(lw.SceneError):
        lw.plots.fan(fleet_result(), "no quantity", style="one_column")
    assert lw.plots.fan(fleet_result()).figure.get_figwidth() == 8.0


def test_every_picture_takes_a_style():
    assert all("style" in getattr(lw.plots, name).__doc__ for name in lw.plots.__all__ if name != "movie")


def test_what_is_no_style_is_refused():
    with pytest.raises(lw.SceneError, match="style = 'column' is not known"):
        lw.plots.fan(fleet_result(), style="column")
    with pytest.raises(lw.SceneError, match=r"is given with ax, whose size is its owner's. Leave out style or ax"):
        lw.plots.fan(fleet_result(), ax=Figure().subplots(), style="one_column")
    with pytest.raises(lw.SceneError, match="is given with figure"):
        lw.plots.summary(fleet_result(), figure=Figure(), style="one_column")
    assert np.all(fleet_result().status == 0)
