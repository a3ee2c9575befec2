# SPDX-License-Identifier: Apache-2.0
"""Summaries of objects at a prompt and in a notebook: short, with units, whatever their size."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common import summaries
from lgvi_warp.common.status import Status, StatusArray, WarningArray, Warnings
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.results.quantities import samples_of
from lgvi_warp.statistics.estimates.estimate import Estimate, Estimates
from lgvi_warp.statistics.values.quantity import KNOWN
from tests.conftest import ROOT
from tests.support.refusals import says


def estimate(name, unit="m"):
    """An estimate of one number at three times."""
    values = np.arange(3.0)[:, None]
    dims = {"value": ("time", "component"), "lower": ("time", "component"), "upper": ("time", "component"),
            "count": ("time",)}  # fmt: skip
    arrays = {"value": values, "lower": values - 1.0, "upper": values + 1.0, "count": np.full(3, 7)}
    return Estimate(
        name, {"type": "mean"}, unit, 0.95, "", dims, arrays, {"time": np.arange(3.0), "component": np.array(["x"])}
    )


def result(members=5, times=4, statuses=(0,), samples=True):
    """A result that nothing computed: depths rise from 10 m, speeds are 5 m/s, roll is 0.5 rad."""
    rng, shape = np.random.default_rng(1), (times, members)
    position = rng.normal(size=(*shape, 3))
    position[..., 2] = 10.0 + np.arange(times)[:, None]
    roll = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(0.5), -np.sin(0.5)], [0.0, np.sin(0.5), np.cos(0.5)]])
    fields = {"position": position, "attitude": np.broadcast_to(roll, (*shape, 3, 3)),
              "velocity": np.broadcast_to([3.0, 0.0, 4.0], (*shape, 3)),
              "angular_velocity": np.zeros((*shape, 3))}  # fmt: skip
    nothing = np.full(members, np.nan)
    how = {"method": {"name": "psi_s"}, "dtype": "float64", "step": 0.1, "steps": 10}
    return lw.Result(
        np.arange(float(times)), fields if samples else {}, np.resize(np.array(statuses, np.uint8), members).view(StatusArray),
        nothing, nothing, np.zeros(members, np.uint16).view(WarningArray), nothing, nothing, np.zeros(members, np.uint32), {},
        ("a remark",) * 40, how, statistics=Estimates([estimate("mean depth"), estimate("mean speed", "m/s")]),
    )  # fmt: skip


SCENE = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
MANY = {
    f"start.{name}[{i}]": lw.distributions.Normal(std=0.1)
    for name in ("position", "velocity", "angular_velocity")
    for i in range(3)
}
OBJECTS = {"vehicle": SCENE.vehicle, "scene": SCENE,
           "remarks": lw.Vehicle(mass=1.0, inertia=(1.0, 1.0, 1.0), warnings=["x" * 500] * 50),
           "ensemble": lw.Ensemble.from_scene(SCENE), "ensemble of much": lw.Ensemble(SCENE, 7, 1, MANY),
           "method": lw.Method("kl8(psi_x)", iterations=3), "result": result(),
           "result of many": result(100_000, 2, (0, 1, 16, 17)), "result without samples": result(samples=False),
           "estimates": Estimates([estimate(f"mean {i}") for i in range(300)]), "no estimates": Estimates(),
           "status": np.resize(np.array([0, 16, 3], np.uint8), 10_000).view(StatusArray)}  # fmt: skip


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_is_short(name):
    text = repr(OBJECTS[name])
    assert len(text.splitlines()) <= 20
    assert len(text) <= 2000
    assert text.strip()


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_is_a_table_in_a_notebook(name):
    html = OBJECTS[name]._repr_html_()
    ElementTree.fromstring(html.replace("<br>", "<br/>"))
    assert len(html) < 60_000
    # What the text says, the table says: each of its words stands in it.
    if name not in ("method", "status"):
        whole = [line for line in repr(OBJECTS[name]).splitlines() if not line.endswith("...")]
        words = set(re.findall(r"[\w.]{4,}", "\n".join(whole)))
        assert words <= set(re.findall(r"[\w.]{4,}", html))


def test_units_and_values_are_shown():
    text = repr(SCENE)
    for words in (r"vehicle.weight +299 N", r"start.velocity +\[1.54, 0, 0\] m/s", "gravity 9.81 m/s2", "control_fins",
                  r"controller +every 0.1 s: depth_cell", "members 10000, varied: vehicle.buoyancy", "step 0.01"):  # fmt: skip
        assert re.search(words, text), words
    says(repr(OBJECTS["ensemble"]), "Ensemble of 10,000 members", "heading_pid.kp")
    shown = repr(result(6, statuses=(0, 0, 17)))
    assert shown.startswith("Result of 6 members at 4 times, 0 to 3 s\n")
    for words in (f"ok 4, {Status(17).name.lower()} 2", "psi_s, float64, step 0.1 s, 10 steps", "position [m]",
                  "velocity [m/s]", "mean depth, mean speed", "... "):  # fmt: skip
        assert words in shown, words


def test_a_status_array_counts_and_its_masks_are_arrays():
    status = OBJECTS["status"]
    assert repr(status) == f"StatusArray of 10,000 members: {summaries.counted(status.counts())}"
    assert "ok 3,334" in repr(status)
    assert "True" in repr(status == Status.OK)
    assert "[" in repr(status[:4].reshape(2, 2))
    assert repr(status[:0]) == "StatusArray of 0 members: none"
    assert str(status[:3]) == "[ 0 16  3]"


def test_texts_are_escaped_and_cut():
    class Odd(Summarized):
        def summary_rows(self):
            return "<b>", [("<i>", "a & b"), ("two\nlines", "y" * 5000)]

    assert "<i>" not in Odd()._repr_html_()
    says(Odd()._repr_html_(), "&lt;i&gt;", "a &amp; b")
    first, *lines = repr(Odd()).splitlines()
    assert first == "<b>"
    assert len(lines) == 2
    assert all(len(line) <= summaries.WIDTH for line in lines)


@pytest.mark.parametrize(("value", "unit", "text"), [
    (1.0 / 3.0, "m", "0.333333 m"), ([1, 2.5, 3], "", "[1, 2.5, 3]"), (np.diag([1.0, 2.0]), "kg", "diagonal [1, 2] kg"),
    (np.ones((2, 2)), "kg", "2 x 2 numbers kg"), (np.zeros(9), "1", "9 numbers"),
])  # fmt: skip
def test_numbers(value, unit, text):
    assert summaries.few_digits(value, unit) == text


def test_the_thumbnail_has_depth_down_and_marks_who_did_not_end_ok():
    one = result(2, 3, (0, 17))
    one.samples["position"][:, 1, 2] = (10.0, np.nan, 30.0)
    svg = ElementTree.fromstring(one.summary_picture().partition("<br>")[0])
    lines = [[tuple(map(float, point.split(","))) for point in line.get("points").split()] for line in svg]
    assert [len(line) for line in lines] == [3, 2]  # the sample that is not finite is left out
    (x, y), (_, middle), (last, lower) = lines[0]
    assert (x, y) == (6.0, 6.0)
    assert last == 254.0
    assert lower > middle > y
    assert max(point[1] for line in lines for point in line) == 84.0
    assert [line.get("stroke-dasharray") for line in svg] == [None, "4 2"]
    assert "depth [m], down, over 0 to 2 s; dashed: did not end ok: 10 to 30" in one.summary_picture()


def test_the_thumbnail_says_of_how_many_and_is_left_out_where_there_are_no_paths():
    svg = result(1000).summary_picture()
    assert svg.count("<polyline") == 20
    assert "of 20 of 1,000 members" in svg
    assert result(samples=False).summary_picture() == ""
    assert result(times=1).summary_picture() == ""


@pytest.mark.ci
def test_a_notebook_loads_no_library_of_pictures():
    code = "import tests.unit.common.test_summaries as t, sys; [x._repr_html_() for x in t.OBJECTS.values()]; " \
           "print(sorted({'matplotlib', 'rerun', 'IPython', 'tqdm'} & set(sys.modules)))"  # fmt: skip
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


# Results: quantities, and names that are not there ------------------------------------------------------------------------


def test_depth_speed_and_euler_are_those_of_the_statistics():
    one = result()
    assert one.depth.shape == one.speed.shape == (4, 5)
    assert one.euler.shape == (4, 5, 3)
    np.testing.assert_array_equal(one.depth[:, 0], [10.0, 11.0, 12.0, 13.0])
    np.testing.assert_array_equal(one.speed, 5.0)
    np.testing.assert_allclose(one.euler[2, 3], [0.5, 0.0, 0.0], atol=1e-15)
    for name in ("depth", "speed", "euler"):
        of_statistics = np.moveaxis(KNOWN[name](*samples_of(one)), 1, -1)
        np.testing.assert_array_equal(getattr(one, name).reshape(of_statistics.shape), of_statistics)
        assert getattr(one, name).dtype == np.float64


def test_a_quantity_without_its_samples_says_which():
    one = result()
    few = lw.Result(**{**vars(one), "samples": {"position": one.position}})
    assert few.depth.shape == (4, 5)
    with pytest.raises(AttributeError, match="velocity was not kept"):
        few.speed
    with pytest.raises(AttributeError, match="position was not kept: give keep='all'"):
        result(samples=False).depth


def test_a_statistic_that_is_not_there_is_answered_with_those_that_are():
    statistics = result().statistics
    with pytest.raises(KeyError, match=r"'mean dept' is not a statistic of this run. Did you mean 'mean depth'"):
        statistics["mean dept"]
    with pytest.raises(KeyError, match="Known: mean depth, mean speed"):
        statistics["xyz"]
    with pytest.raises(KeyError, match="None were asked for"):
        Estimates()["mean depth"]
    assert "mean dept" not in statistics
    assert statistics.get("mean dept") is None
    assert "mean depth" in statistics


def test_an_estimate_shows_its_numbers_and_no_whole_arrays():
    lines = [line.split() for line in repr(estimate("mean depth")).splitlines()]
    assert lines == [text.split() for text in (
        "Estimate 'mean depth' at 2 s", "mean depth 2 m, 1 to 3, 7 members", "arrays value, lower, upper, count")]  # fmt: skip
    lines = repr(result().statistics).splitlines()
    assert lines[0] == "Estimates of 2 statistics at 2 s"
    assert "2 m/s, 1 to 3, 7 members" in lines[2]


def test_an_estimate_has_the_attributes_that_it_has():
    one = Estimate(
        "extremes depth", {"type": "extremes"}, "m", 0.95, "", {}, {"minimum": np.zeros(1)}, {"time": np.zeros(1)}
    )
    assert not any(hasattr(one, name) for name in ("value", "lower", "upper", "count", "half_width"))
    assert hasattr(estimate("mean depth"), "lower")
    with pytest.raises(AttributeError, match=r"'extremes depth' has no lower. It has minimum"):
        one.lower
    with pytest.raises(KeyError):
        one["lower"]


def test_completion_of_names():
    """dir() before any name was used: every public name, and no other."""
    code = "import lgvi_warp as lw; print(*dir(lw)); print(*lw.__all__)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    names, public = (line.split() for line in done.stdout.splitlines())
    assert sorted(names) == sorted([*public, "__version__"])
    assert "solve" in names
    assert sorted(dir(lw.uq)) == sorted(lw.uq.__all__)
    assert all(hasattr(lw.uq, name) for name in dir(lw.uq))


def test_a_member_s_warnings_are_read_from_their_bits():
    bits = np.array([2 | 128, 0], np.uint16).view(WarningArray)
    assert Warnings(bits[0]) == Warnings(130)
    assert Warnings(bits[1]) == Warnings(0)
    with pytest.raises(ValueError, match=r"3\.5"):
        Warnings(3.5)
