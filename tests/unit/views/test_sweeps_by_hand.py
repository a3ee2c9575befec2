# SPDX-License-Identifier: Apache-2.0
"""Pictures of sweeps whose numbers are given by hand: every bar, field, box, point and word."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import to_hex

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import Status
from lgvi_warp.studies.sweeps.output import Sweep, against_baseline
from lgvi_warp.studies.sweeps.record import Record
from lgvi_warp.studies.sweeps.setup import END, SweepCell
from lgvi_warp.views.plots import sweep_pictures as sweeps
from tests.support.made import made

N = 40


class ByHand(Sweep):
    """A sweep whose members vary in two inputs, and whose runs again are those of `path`."""

    explained = ("mass", "delay")

    def inputs(self, cell, first=0, stop=None):
        return {"mass": np.arange(N) * 1.0, "delay": np.arange(N) ** 2.0}

    def causes(self, case, at=None, of="success"):
        return [{"input": name, "share": share} for name, share in zip(self.explained, (0.754321, 0.25), strict=False)]

    def again(self, case, members, at=None, save=None):
        self.__dict__.setdefault("asked", []).append((case, members, at, save))
        z = np.arange(5.0)[:, None] + np.arange(len(members))
        result = made(np.stack([z, 0.0 * z, 10.0 + z], axis=-1))
        wanted = {"reference_depth": z + 12.0, "reference_position": result.position + np.array([3.0, 4.0, 0.0]),
                  "reference_heading": 0.0 * z}  # fmt: skip
        result.samples.update(wanted)
        return result


def swept(share, axes=None, cases="ab", refused=(), metrics=("m",), failed=0, baseline="a"):
    """A sweep; share: function of the index of a cell, the share of members that pass."""
    axes = axes or {}
    cases = [SimpleNamespace(name=name) for name in cases]
    points = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    controller = SimpleNamespace(controller=SimpleNamespace(period=0.5), run=SimpleNamespace(duration=100.0))
    cells, records = [], {}
    for i, (case, point) in enumerate(itertools.product(cases, points)):
        cells.append(SweepCell(i, case, point, str(i), SimpleNamespace(scene=controller), ()))
        status = np.where(np.arange(N) < failed, Status.NON_FINITE, Status.OK)
        numbers = {"m": np.arange(N) * (1.0 + i), "n": np.full(N, np.nan), END: np.ones(N)}
        numbers["passes"] = np.arange(N) < round(N * share(i))
        records[str(i)] = Record.of_refusal("odd") if i in refused else Record(status, numbers)
    unit = {"m": "m/s", "n": "1", END: "s"}
    statistics = {name: SimpleNamespace(unit=unit[name], quantity=SimpleNamespace(unit=""), of="depth") for name in
                  (*metrics, END)}  # fmt: skip
    setup = SimpleNamespace(
        cases=cases, axes=axes, metrics=statistics, members=SimpleNamespace(members=N, seed=1), settings={}
    )
    conditions = SimpleNamespace(passed=lambda status, numbers: numbers["passes"], limits={})
    return ByHand(setup, cells, records, conditions, baseline, 0.9, "wilson")


def bars(container):
    """Places, values and ends of error bars."""
    line, _, (segments,) = container
    ends = np.array(segments.get_segments())
    return line.get_xdata().tolist(), line.get_ydata(), ends


def look(line):
    """Colour, marker and style of a line."""
    return to_hex(line.get_color()).upper(), line.get_marker(), line.get_linestyle()


@pytest.mark.parametrize(("names", "turned"), [("abcdef", 0.0), ("abcdefg", 90.0)])
def test_success_by_case_and_when_names_stand_upright(names, turned):
    found = swept(lambda i: i / 8, cases=names)
    (axes,) = sweeps.plot_success(found)
    places, values, ends = bars(*axes.containers)
    expected = 100.0 * np.array([found.success(name) for name in names])
    assert places == list(range(len(names)))
    np.testing.assert_allclose(values, expected[:, 0])
    np.testing.assert_allclose(ends[:, :, 1], expected[:, 1:])
    assert axes.get_ylabel() == "passes [%], 90% interval"
    labels = axes.get_xticklabels()
    assert [label.get_text() for label in labels] == list(names)
    assert labels[0].get_rotation() == turned


def test_success_over_an_axis_has_places_by_value():
    found = swept(lambda i: 0.5, {"delay": [0.5, 2.0, 4], "gain": [1.0]}, refused=(0, 3, 4, 5))
    (axes,) = sweeps.plot_success(found)
    assert bars(*axes.containers)[0] == [2.0, 4.0]
    assert [label.get_text() for label in axes.get_legend().get_texts()] == ["a"]
    assert axes.get_xticks().tolist() == [0.5, 2.0, 4.0]
    assert axes.get_xlabel() == "delay"
    for values in (["p", 3.0], [3.0, float("inf")]):  # not all are numbers, or finite: evenly
        axes = sweeps.plot_success(swept(lambda i: 0.5, {"law": values}))[0]
        assert bars(axes.containers[1])[0] == axes.get_xticks().tolist() == [0.0, 1.0]
        assert look(axes.containers[0][0]) != look(axes.containers[1][0])


def test_a_map_has_a_field_for_each_point():
    axes = {"x": [1, 2, 3], "y": [5, 6], "z": [0.5, 0.6], "w": ["u", "v"], "one": [1]}
    found = swept(lambda i: (i % 24) / 24, axes, refused=(4,))
    panels = sweeps.plot_success(found)
    assert panels[0].figure.get_suptitle() == "at z = 0.5, w = u"
    assert [panel.get_title() for panel in panels] == ["a: passes [%]", "b: passes [%]"]
    assert (panels[0].get_xlabel(), panels[0].get_ylabel(), panels[1].get_ylabel()) == ("x", "y", "")
    image = panels[0].get_images()[0]
    assert image.get_array().shape == (2, 3)
    assert image.get_clim() == (0.0, 100.0)
    assert image.origin == "lower"
    assert [tick.get_text() for tick in panels[0].get_xticklabels()] == ["1", "2", "3"]
    assert [tick.get_text() for tick in panels[0].get_yticklabels()] == ["5", "6"]
    words = {text.get_position(): text for text in panels[0].texts}
    assert set(words) == {(j, i) for j in range(3) for i in range(2)}
    refused = words[(0, 1)]
    assert (refused.get_text(), refused.get_color()) == ("refused", "black")
    assert np.isnan(np.ma.filled(image.get_array(), np.nan)[1, 0])
    for (j, i), text in words.items():
        point = {"x": axes["x"][j], "y": axes["y"][i], "z": 0.5, "w": "u"}
        if (j, i) == (0, 1):
            continue
        value, lower, upper = 100.0 * np.array(found.success("a", point))
        assert text.get_text() == f"{value:.1f}\n{lower:.1f} to {upper:.1f}"
        assert image.get_array()[i, j] == value
        assert text.get_color() == ("white" if value < 50.0 else "black")
    exact = sweeps.plot_success(swept(lambda i: 0.5, {"x": [1, 2], "y": [1, 2]}))
    assert {text.get_color() for text in exact[0].texts} == {"black"}
    assert exact[0].figure.get_suptitle() == ""


def test_boxes_of_metrics():
    found = swept(lambda i: 0.5, {"delay": [1, 2]}, metrics=("m", "n"), failed=3, refused=(3,))
    upper, lower = sweeps.plot_metrics(found)
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("m\n[m/s]", "n")
    colors = [sweeps.COLORS[0], sweeps.COLORS[0], sweeps.COLORS[1]]
    assert [to_hex(box.get_facecolor()).upper() for box in upper.patches] == colors
    for i, box in enumerate(upper.patches):
        numbers = np.arange(3, N) * (1.0 + i)
        corners = box.get_path().vertices[:, 1]
        np.testing.assert_allclose((corners.min(), corners.max()), np.quantile(numbers, (0.25, 0.75)))
        whiskers = np.concatenate([line.get_ydata() for line in upper.lines[5 * i : 5 * i + 5]])
        np.testing.assert_allclose((whiskers.min(), whiskers.max()), np.quantile(numbers, (0.05, 0.95)))
    assert [label.get_text() for label in lower.get_xticklabels()] == ["a, 1", "a, 2", "b, 1"]
    assert lower.get_xlabel() == "case, delay"
    with pytest.raises(NothingToDraw, match="there are no metrics"):
        sweeps.plot_metrics(swept(lambda i: 0.5, metrics=()))


def test_boxes_beyond_the_most_are_counted():
    for count, words in ((20, "case, k"), (21, "case, k; 2 more are not shown")):
        (axes,) = sweeps.plot_metrics(swept(lambda i: 0.5, {"k": list(range(count))}))
        assert axes.get_xlabel() == words
        assert len(axes.patches) == 40


def test_differences_to_the_baseline():
    found = swept(lambda i: (0.2, 0.95, 0.225)[i], cases="abc")
    (axes,) = sweeps.plot_differences(found)
    rows = [row for row in against_baseline(found) if row.of == "success"]
    real, unreal = axes.containers
    for container, row, place in ((real, rows[0], 0), (unreal, rows[1], 1)):
        line, _, (segments,) = container
        ((x,), (y,)), d = (line.get_xdata(), line.get_ydata()), row.difference
        np.testing.assert_allclose(
            (x, *segments.get_segments()[0][:, 0]), 100.0 * np.array([d.value, d.lower, d.upper])
        )
        assert y == place
        assert bool(row.real) == (place == 0)
    assert axes.get_xlabel() == "passes more than a [points], 90% interval"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["b", "c"]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["real", "not real"]
    with pytest.raises(NothingToDraw, match="no other case that ran"):
        sweeps.plot_differences(swept(lambda i: 0.5, cases="ab", refused=(1,)))


def test_causes_where_most_is_open():
    found = swept(lambda i: (0.9, 0.4, 0.65)[i], cases="abc")
    (axes,) = sweeps.plot_causes(found)
    passes, fails = axes.lines
    assert axes.get_title() == "b"
    assert axes.get_xlabel() == "mass: explains 75.4 % of success"
    assert axes.get_ylabel() == "delay: explains 25 % of success"
    assert passes.get_xdata().tolist() == list(range(16))
    assert fails.get_xdata().tolist() == list(range(16, N))
    assert fails.get_ydata().tolist() == [i**2 for i in range(16, N)]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["passes: 16", "fails: 24"]
    found.__class__ = type("OneCause", (ByHand,), {"explained": ("delay",)})
    (axes,) = sweeps.plot_causes(found)
    assert axes.get_ylabel() == "member"
    assert axes.lines[0].get_ydata().tolist() == list(range(16))
    assert axes.lines[0].get_xdata().tolist() == [i**2 for i in range(16)]
    found.__class__ = type("NoCause", (ByHand,), {"explained": ()})
    for nothing in (found, swept(lambda i: i % 2)):
        with pytest.raises(NothingToDraw, match="some members pass and some do not, or nothing varies"):
            sweeps.plot_causes(nothing)


def test_responses_by_case():
    found = swept(lambda i: 0.5, {"k": [1, 2]}, cases="abcd")
    panels = sweeps.plot_responses(found, members=7)
    assert found.asked == [(name, range(7), {"k": 1}, lw.SaveAt(every=0.5, fields=("position", "reference_depth"))) for name in
                           "abcd"]  # fmt: skip
    figure = panels[0].figure
    assert figure.get_supylabel() == "depth [m]: 7 members"
    assert panels[0].yaxis_inverted()
    assert [panel.get_title() for panel in panels] == [f"{name} at k = 1" for name in "abcd"]
    assert [panel.axison for panel in figure.axes] == [True] * 4 + [False] * 2
    lines = {line.get_label(): line for line in panels[0].lines}
    np.testing.assert_allclose(lines["median"].get_ydata(), np.arange(5.0) + 13.0)
    np.testing.assert_allclose(lines["wanted"].get_ydata(), np.arange(5.0) + 15.0)


def test_responses_are_drawn_where_cases_differ_and_of_what_differs():
    """Passes of two cases at two points: 50 and 60 %, 90 and 10 %. Medians of depth are less apart than those of heading."""
    found = swept([0.5, 0.9, 0.6, 0.1].__getitem__, {"k": [1, 2]})
    heading = SimpleNamespace(unit="rad", quantity=SimpleNamespace(unit=""), of="heading")
    found.setup.metrics["h"] = heading
    for i, cell in enumerate(found.cells):
        found.record(cell).numbers["h"] = 100.0 * i + np.arange(N)
    panels = sweeps.plot_responses(found, members=3)
    assert [asked[:3] for asked in found.asked] == [(name, range(3), {"k": 2}) for name in "ab"]
    assert [panel.get_title() for panel in panels] == ["a at k = 2", "b at k = 2"]
    assert panels[0].figure.get_supylabel() == "heading [rad]: 3 members"


def test_responses_of_a_distance_and_their_times():
    found = swept(lambda i: 0.5, cases="a")
    found.setup.settings["t1"] = 400.0
    (axes,) = sweeps.plot_responses(found, of="position")
    (asked,) = found.asked
    # 800 looks are too many: every fourth.
    assert asked[1] == range(N)
    assert asked[3] == lw.SaveAt(every=2.0, fields=("position", "reference_position"))
    assert axes.figure.get_supylabel() == "position from what is wanted [m]: 40 members"
    assert not axes.yaxis_inverted()
    lines = {line.get_label(): line for line in axes.lines}
    assert "wanted" not in lines
    assert set(lines["median"].get_ydata()) == {5.0}


def test_pictures_have_their_files():
    names = ["success.png", "metrics.png", "causes.png", "responses.png"]
    assert list(sweeps.pictures(swept(lambda i: 0.5, cases="a"))) == names
    two = sweeps.pictures(swept(lambda i: 0.5))
    assert list(two) == [*names[:2], "differences.png", *names[2:]]
    assert two["success.png"] is sweeps.plot_success
