# SPDX-License-Identifier: Apache-2.0
"""Pictures of sweeps beyond what is recorded: numbers against those of the sweep, what is refused, what is run again."""

from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.views.plots import sweep_pictures as sweeps
from tests.support.swept import ByHand, N, swept


def half(i):
    """Half of the members of every cell pass."""
    return 0.5


def bars(container):
    """Values of error bars, and their ends (n, 2, 2)."""
    line, _, (segments,) = container
    return line, np.array(segments.get_segments())


def test_boxes_beyond_the_most_are_counted():
    for count, words in ((20, "case, k"), (21, "case, k; 2 more cells are not shown")):
        (axes,) = sweeps.plot_metrics(swept(half, {"k": list(range(count))}))
        assert axes.get_xlabel() == words
        assert len(axes.patches) == 40


def test_values_that_are_no_finite_numbers_stand_evenly():
    for values in (["p", 3.0], [3.0, float("inf")]):
        (axes,) = sweeps.plot_success(swept(half, {"law": values}))
        assert axes.get_xticks().tolist() == [0.0, 1.0]


def without_causes(*explained):
    """A sweep that so many inputs explain."""
    sweep = swept((0.9, 0.4, 0.65).__getitem__, cases="abc")
    sweep.__class__ = type("Explained", (ByHand,), {"explained": explained})
    return sweep


def test_one_cause_is_drawn_over_the_members():
    (axes,) = sweeps.plot_causes(without_causes("delay"))
    assert axes.get_ylabel() == "member index"
    assert axes.lines[0].get_ydata().tolist() == list(range(16))
    assert axes.lines[0].get_xdata().tolist() == [i**2 for i in range(16)]


ALIKE = "some members pass and some do not, or nothing varies"


@pytest.mark.parametrize(("draw", "sweep", "words"), [
    (sweeps.plot_causes, without_causes(), ALIKE), (sweeps.plot_causes, swept(lambda i: i % 2), ALIKE),
    (sweeps.plot_metrics, swept(half, metrics=()), "there are no metrics"),
    (sweeps.plot_differences, swept(half, refused=(1,)), "no other case that ran"),
])  # fmt: skip
def test_a_sweep_with_nothing_to_draw_says_why(draw, sweep, words):
    with pytest.raises(NothingToDraw, match=words):
        draw(sweep)


def test_responses_are_those_of_the_best_and_the_worst_cell():
    """The second of four cells is best and the third worst. Medians of depth are less apart than those of heading."""
    sweep = swept([0.5, 0.9, 0.1, 0.6].__getitem__, {"k": [1, 2]})
    sweep.setup.metrics["h"] = SimpleNamespace(unit="rad", quantity=SimpleNamespace(unit=""), of="heading")
    for i, cell in enumerate(sweep.cells):
        sweep.record(cell).numbers["h"] = 100.0 * i + np.arange(N)
    panels = sweeps.plot_responses(sweep, members=3)
    assert [asked[:3] for asked in sweep.asked] == [("a", range(3), {"k": 2}), ("b", range(3), {"k": 1})]
    assert [panel.get_title() for panel in panels] == ["best, 90 % pass: a at k = 2", "worst, 10 % pass: b at k = 1"]
    assert panels[0].figure.get_supylabel() == "heading [rad]: 3 members"


def test_responses_of_cells_that_are_alike_are_those_of_the_cases():
    sweep = swept(half, {"k": [1, 2]})
    panels = sweeps.plot_responses(sweep, members=3)
    assert [panel.get_title() for panel in panels] == ["50 % pass: a at k = 1", "50 % pass: b at k = 1"]


def test_the_worst_cell_is_explained_if_some_pass_there():
    for shares, title in (((0.9, 0.4, 0.65), "Worst cell: b"),
                          ((0.9, 0.0, 0.65), "Worst cell of those in which some members pass: c")):  # fmt: skip
        (axes,) = sweeps.plot_causes(swept(shares.__getitem__, cases="abc"))
        assert axes.get_title() == title
        passes = round(N * (0.4 if "b" in title[-1] else 0.65))
        assert [line.get_label() for line in axes.lines] == [f"passes: {passes}", f"fails: {N - passes}"]


def test_axes_have_the_units_of_their_numbers():
    sweep = swept(half, {"vehicle.mass": [5.0, 6.0]}, cases="a")
    assert sweeps.plot_success(sweep)[0].get_xlabel() == "vehicle.mass [kg]"
    (axes,) = sweeps.plot_metrics(sweep)
    assert axes.get_xlabel() == "case, vehicle.mass [kg]"
    maps = sweeps.plot_success(swept(half, {"vehicle.mass": [5.0, 6.0], "start.velocity[0]": [1.0, 2.0]}, cases="a"))
    assert (maps[0].get_xlabel(), maps[0].get_ylabel()) == ("vehicle.mass [kg]", "start.velocity[0] [m/s]")


def test_responses_of_a_distance_and_their_times():
    sweep = swept(half, cases="a")
    sweep.setup.settings["t1"] = 400.0
    (axes,) = sweeps.plot_responses(sweep, of="position")
    # 800 ticks are too many: every fourth.
    save = lw.SaveAt(every=2.0, fields=("position", "reference_position"))
    assert [asked[1::2] for asked in sweep.asked] == [(range(N), save)]
    assert axes.figure.get_supylabel() == "error of position [m]: 40 members"
    assert not axes.yaxis_inverted()
    lines = {line.get_label(): line for line in axes.lines}
    assert "reference" not in lines
    assert set(lines["median"].get_ydata()) == {5.0}


def test_pictures_have_their_files():
    names = ["success.png", "metrics.png", "causes.png", "responses.png"]
    assert list(sweeps.pictures(swept(half, cases="a"))) == names
    assert list(sweeps.pictures(swept(half))) == [*names[:2], "differences.png", *names[2:]]
