# SPDX-License-Identifier: Apache-2.0
"""Pictures and pages of results given by hand, beyond what is recorded: statistics alone, refusals, words and their places."""

import dataclasses
import time
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import Status
from lgvi_warp.statistics.estimates.estimate import Estimate, Estimates
from lgvi_warp.views import fleet
from lgvi_warp.views.pages import report
from lgvi_warp.views.plots import canvas
from tests.support.made import made

N, K = 10, 5
OK, FLOOR, FAILED = int(Status.OK), int(Status.FLOOR), int(Status.NON_FINITE)


def sinking(**named):
    """Members in depths of 1 to 10 m that sink a metre a second."""
    depth = 1.0 + np.arange(N) + np.arange(K)[:, None]
    return made(np.stack([0.0 * depth, 0.0 * depth, depth], axis=-1), **named)


def statistic(kind, coordinates=None, **arrays):
    """A statistic of the depth, of a component before it."""
    coordinates = {"time": np.arange(float(K)), "component": np.array(["speed", "depth"])} | (coordinates or {})
    settings = {"type": kind, "of": "depth"}
    return Estimate(f"{kind} depth", settings, "m", 0.95, "", {"value": ("time",)}, arrays, coordinates)


def bare(result, *gathered):
    """A result of which statistics alone were kept."""
    return dataclasses.replace(result, samples={}, kept=None, statistics=Estimates(gathered))


def test_titles_and_the_number_of_the_run():
    result = sinking(status=[FLOOR] * 4 + [OK] * 6)
    assert fleet.title(result) == "10 members, psi_s, step 0.01 s: 6 ok, 4 floor"
    part = dataclasses.replace(result, provenance=result.provenance | {"members": 1200})
    assert fleet.title(part).startswith("10 of 1,200 members")
    for planned, count in ((None, 10), (7, 10), (30, 30)):
        ensemble = {"ensemble": {"members": planned}}
        assert fleet.members_of_run(dataclasses.replace(result, provenance=result.provenance | ensemble)) == count


def test_a_change_of_any_number_changes_the_identity():
    result = sinking()
    moved = []
    for frame in (0, -1):
        moved.append(result.position.copy())
        moved[-1][frame, 3, 0] += 1.0
    others = [dataclasses.replace(result, samples=dict(result.samples) | {"position": position}) for position in moved]
    others += [dataclasses.replace(result, time=result.time + 1.0), sinking(status=[FLOOR] * N),
               sinking(status=[FLOOR] * N, end=np.ones(N)),
               dataclasses.replace(result, provenance=result.provenance | {"step": 0.02})]  # fmt: skip
    names = {fleet.identity(changed) for changed in others}
    assert fleet.identity(result) == fleet.identity(sinking())
    assert fleet.identity(result) not in names
    assert len(names) == len(others)


def test_a_statistic_at_one_time_is_no_fan():
    once = statistic("mean", {"time": np.array([4.0])}, value=np.zeros((1, 2)))
    with pytest.raises(NothingToDraw, match="no samples were kept"):
        lw.plots.fan(bare(sinking(), once), "depth")


def test_what_cannot_be_drawn_says_why():
    with pytest.raises(NothingToDraw, match="no statistic against time was gathered"):
        lw.plots.statistics(sinking())
    with pytest.raises(NothingToDraw, match="no setting was measured"):
        lw.plots.tradeoff(SimpleNamespace(of="position", measurements=[]))
    nothing = SimpleNamespace(quantities=["depth"], factors=["a"], columns=["first"], first=np.full((1, 1), np.nan))
    with pytest.raises(NothingToDraw, match="no quantity varies"):
        lw.plots.sensitivity(nothing)


def test_factors_without_effect_take_no_rows():
    """The second of three factors has indices of zero for both quantities, the third for one of them."""
    numbers = np.array([[0.7, 0.0, 0.0], [0.4, 0.0, 0.6]])
    found = SimpleNamespace(name="Sobol indices", quantities=["depth", "speed"], factors=["a", "b", "c"], samples=8,
                            members=80, failed=0, confidence=0.95, columns=["first", "total"], first=numbers, total=numbers,
                            intervals={"first": "half"}, half=0.1 * numbers)  # fmt: skip
    left, right = lw.plots.sensitivity(found)
    assert [label.get_text() for label in left.get_yticklabels()] == ["a", "c"]
    for axes, widths in ((left, [0.7, 0.0]), (right, [0.4, 0.6])):
        bars = [bars for bars in axes.containers if hasattr(bars, "patches")]
        assert [[bar.get_width() for bar in each] for each in bars] == [widths] * 2
    assert left.figure.get_suptitle().replace("\n", " ").endswith("; factors without effect: b")
    found.first = found.total = found.half = 0.0 * numbers
    assert len(lw.plots.sensitivity(found)[0].get_yticklabels()) == 3


def test_text_is_wrapped_to_a_share_of_a_figure():
    figure = Figure(figsize=(10.0, 4.0))
    assert canvas.text_size(figure) == 9.0
    assert canvas.text_size(Figure(figsize=(20.0, 4.0))) == 18.0
    # 10 inches have 720 points, and a letter takes 5.4: 133 of them.
    assert [len(line) for line in canvas.wrapped("a " * 150, figure).split("\n")] == [133, 133, 31]
    assert len(canvas.wrapped("a " * 150, figure, 0.5).split("\n")[0]) == 65


def test_49_lines_differ_in_colour_or_style():
    assert len({tuple(map(str, canvas.style(i).values())) for i in range(49)}) == 49
    neighbours = [(canvas.style(i), canvas.style(i + 1)) for i in range(48)]
    assert all(one["color"] != other["color"] for one, other in neighbours)


@pytest.mark.parametrize(
    ("low", "high", "output", "at"),
    [(100.0, 101.0, "surface\n100 m\nabove", 1.0), (-7.0, -5.0, "surface\n5 m\nbelow", 0.0)],
)
def test_a_far_surface_is_told_with_its_side(low, high, output, at):
    """Three lines beside the axes, whose middle is half their height from the end of the axes."""
    axes = Figure().subplots()
    axes.set_ylim(low, high)
    canvas.point_down(axes)
    (text,) = axes.texts
    assert text.get_text() == output
    x, y = text.get_position()
    assert x > 1.0
    assert 0.02 < abs(at - y) < 0.2
    assert axes.get_ylim() == (high, low)


@pytest.mark.parametrize(("low", "shown"), [(1.0, True), (1.01, False)])
def test_a_near_surface_and_floor_are_lines(low, shown):
    """Near is within half of the 2 m that are shown; beyond a line there is a twentieth of these."""
    axes = Figure().subplots()
    axes.set_ylim(low, low + 2.0)
    canvas.point_down(axes, {"floor": [low + 3.0]})
    assert {text.get_text() for text in axes.texts if "\n" not in text.get_text()} == {"floor", *["surface"] * shown}
    assert axes.get_ylim() == pytest.approx((low + 3.1, -0.1 if shown else low))
    assert len(axes.lines) == 1 + shown


# Pages: their words are recorded (tests/data/pictures.json); here are pages that no record has.


def page(result, tmp_path):
    """The text of a report."""
    return lw.report(result, tmp_path / "a.html").read_text(encoding="utf-8")


def told(result, **provenance):
    """The same result, with what a run says of itself."""
    return dataclasses.replace(result, provenance=result.provenance | {"machine": {}} | provenance)


@pytest.mark.parametrize("more", [0, 1])
def test_a_picture_of_more_than_a_million_bytes_is_in_pixels(more):
    drawn = []

    def draw(result, path):
        drawn.append(path.suffix)
        path.write_text(f"<?xml?>{'<svg>':x<{report.MOST_SVG - 7 + more}}" if path.suffix == ".svg" else "pixels")
        return path

    text = report.inline(draw, sinking())
    pixels = '<img alt="picture" src="data:image/png;base64,cGl4ZWxz">'
    assert drawn == [".svg", ".png"][: 1 + more]
    assert text == (pixels if more else f"{'<svg>':x<{report.MOST_SVG - 7}}")


def test_a_page_of_a_run_with_nothing_to_draw_says_so(tmp_path):
    text = page(told(sinking(status=[FAILED] * N, end=np.zeros(N))), tmp_path)
    assert "<h2>Pictures</h2><p>every member failed before the second sample: there is nothing to draw" in text


def test_a_law_of_python_is_in_no_page(tmp_path):
    callback = {"controller": {"laws": [{"type": "callback"}]}, "vehicle": {"title": "a < ball"}}
    text = page(told(sinking(), scene=callback), tmp_path)
    assert "A law is a Python function, which no file holds: run the script again. The scene but for it:" in text
    assert "lgvi-warp run scene.toml" not in text
    assert "<h1>a &lt; ball</h1>" in text


def test_tables_of_a_study(tmp_path):
    today = time.strftime("%Y-%m-%d")
    for count, more in ((200, ""), (201, "<p>The first 200 of 201 rows; stability.csv has all.</p>")):
        (tmp_path / "stability.csv").write_text("h\n" + "".join(f"{i}\n" for i in range(count)))
        (tmp_path / "stability.json").write_text('{"of": 3, "cells": [1]}')
        (tmp_path / "a_map.png").write_bytes(b"a")
        text = page(tmp_path, tmp_path)
        head = f"<h1>Stability of {tmp_path.name}</h1><p>Stability of {today}, in {tmp_path.name}.</p>"
        assert f"{head}<h2>A map</h2><img " in text
        assert f"<h2>Table</h2>{more}<table><tr><th>h</th></tr><tr><td>0</td></tr>" in text
        assert text.count("<td>") == 200
        assert "<h2>Settings of the study</h2><pre>{\n &quot;of&quot;: 3\n}</pre>" in text
    (tmp_path / "stability.csv").write_text("")
    assert "<h2>Table</h2><table></table>" in page(tmp_path, tmp_path)
