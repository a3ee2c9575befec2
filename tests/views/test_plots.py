# SPDX-License-Identifier: Apache-2.0
"""Pictures that everybody can read, and what no record of tests/support/fixed_pictures.py has. No run is solved but one."""

import dataclasses
import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

import lgvi_warp as lw
from lgvi_warp.accuracy.stability.grid import Line
from lgvi_warp.accuracy.stability.map import StabilityMap
from lgvi_warp.accuracy.tradeoff import Measurement, Tradeoff
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import StatusArray
from lgvi_warp.measuring.comparison import Candidate
from lgvi_warp.robustness.linear.margins import Margins
from lgvi_warp.views.drawn import at_levels
from lgvi_warp.views.plots.read import quantity_of, survey_of
from tests.support.made import made, turned
from tests.unit.views.test_cost_pictures import RUNS, TERMS

N, FLOOR = 40, 20.0
STATISTICS = [lw.statistics.Quantiles("depth"), lw.statistics.Mean("velocity"),
              lw.statistics.Histogram("depth", bins=10, limits=(0.0, 25.0)),
              lw.statistics.Covariance("position"), lw.statistics.PathMaximum("speed")]  # fmt: skip


@pytest.fixture(scope="module")
def solved():
    """One run: samples of all members and statistics; some reach the floor, none fails."""
    vehicle = lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(10.0, 10.0, 10.0), buoyancy=200.0)
    scene = lw.Scene(vehicle, lw.Environment(gravity=10.0), events=[lw.events.Floor(depth=FLOOR)])
    speeds = np.linspace(-0.5, 2.0, N)
    down, side = np.array([0.0, 0.0, 1.0]), np.array([0.3, 0.0, 0.0])
    level, turn = np.broadcast_to(np.eye(3), (N, 3, 3)), np.tile([0.0, 0.0, 0.1], (N, 1))
    fleet = lw.Ensemble.from_states(scene, np.tile(5.0 * down, (N, 1)), level, np.outer(speeds, down) + side, turn)
    result = lw.solve(fleet, h=0.1, t1=20.0, save=lw.SaveAt(every=1.0), statistics=STATISTICS)
    assert result.status.counts().keys() == {"ok", "floor"}
    return result


def few(result, members, frames=slice(None)):
    part = result.part(np.asarray(members))
    return dataclasses.replace(part, time=part.time[frames], samples={k: v[frames] for k, v in part.samples.items()})


def ending(result, codes, times):
    status = np.array(codes, np.uint8).view(StatusArray)
    return dataclasses.replace(result, status=status, failure_time=np.array(times), failure_value=np.ones(len(codes)))


def measurement(name, h, dtype, cost, error):
    of = {"position": {"path_max": error}}
    return Measurement(Candidate(name, h, dtype), cost, 0.0, of, 0.0, {"position_mean": 1.0 / h}, 2, {"position": True})


def of_methods():
    """A trade-off of nine methods in three precisions, of which three are on the front."""
    points = []
    for i, name in enumerate(("psi_x", "psi_s", "rk4", "psi", "phi", "rk8", "kl8(psi_x)", "su8_15(psi_x)", "rkn6_11")):
        for j, dtype in enumerate(("float64", "float32", "float32_compensated")):
            cost = 0.3 if name in ("psi_x", "psi_s", "kl8(psi_x)") else 5.0
            for h in (0.01, 0.02, 0.04):
                order = {"psi_x": 2, "psi_s": 3}.get(name, 6 if i == 6 else 2)
                least = 0.0 if dtype == "float64" else 1e-7 * (j + 1)
                points.append(measurement(name, h, dtype, cost * (1 + i) / h, (10 * h) ** order + least))
    return Tradeoff(tuple(points), "position", 8, 4.0, 4.0, "rk8 at 1e-3 s", {}, None)


def of_cells():
    names = ("psi", "psi_s", "rk4")
    x = Line("h", "step", "s", True, np.geomspace(0.01, 1.0, 6))
    y = Line("omega", "angular velocity", "rad/s", True, np.geomspace(0.1, 10.0, 5))
    classes = {name: np.clip(np.add.outer(np.arange(5), np.arange(6) - 3), 0, 4).astype(np.uint8) for name in names}
    ratios = {
        name: {"rotation": np.multiply.outer(y.values, x.values), "munk": np.outer(y.values, x.values) * 3}
        for name in names
    }
    zeros = dict.fromkeys(names, np.zeros((5, 6)))
    return StabilityMap(x, y, classes, zeros, zeros, zeros, ratios, "position", 0.01, 3.0, 10.0, 4, "conservative",
                        "rk8", 0, {}, unit="m")  # fmt: skip


def of_factors():
    d, q = 6, 5
    values = np.linspace(0.0, 1.0, d * q).reshape(q, d)
    columns, intervals = ("S1", "ST"), {"S1": "S1_confidence", "ST": "ST_confidence"}
    return SimpleNamespace(
        factors=tuple(f"vehicle.inertia[{i}]" for i in range(d)), quantities=tuple(f"max(position[{i}])" for i in range(q)),
        S1=values, ST=values + 0.1, S1_confidence=values * 0.1, ST_confidence=values * 0.1, columns=columns,
        intervals=intervals, samples=64, members=900, failed=2, confidence=0.95, name="Sobol indices",
    )  # fmt: skip


ALL_OF_A_RUN = (
    "summary", "fan", "paths", "plan_view", "phase", "attitude", "outcomes", "histogram", "pairs", "drift", "statistics",
)  # fmt: skip


def of_studies():
    """The pictures of what studies found, as of `pictures`."""
    return {
        "tradeoff": (lw.plots.tradeoff, (of_methods(),)), "stability": (lw.plots.stability, (of_cells(),)),
        "sensitivity": (lw.plots.sensitivity, (of_factors(),)),
        "margins": (lw.plots.margins, (margins_of([True, True, True, True, False]),)),
        "scaling": (lw.plots.scaling, (RUNS,)), "term_cost": (lw.plots.term_cost, (TERMS,)),
    }  # fmt: skip


def pictures(solved):
    """Every picture, by name, as (function, arguments)."""
    found = {name: (getattr(lw.plots, name), (solved,)) for name in ALL_OF_A_RUN}
    found["compare"] = lw.plots.compare, ({"a": solved, "b": few(solved, range(9))}, "speed")
    found |= of_studies()
    found["one vehicle"] = lw.plots.summary, (few(solved, [3]),)
    found["two samples"] = lw.plots.summary, (few(solved, range(9), [0, -1]),)
    found["all stopped"] = lw.plots.summary, (ending(solved, [17] * N, [9.0] * N),)
    found["failures"] = lw.plots.fan, (ending(solved, [1, 2, 3, 6, 17] * 8, [9.0] * N),)
    return found


NAMES = (*ALL_OF_A_RUN, "compare", "tradeoff", "stability", "sensitivity", "margins", "scaling", "term_cost", "one vehicle",
         "two samples", "all stopped", "failures")  # fmt: skip


@pytest.fixture(scope="module")
def drawn(solved):
    """Figures of all pictures, each drawn once."""
    figures = {}
    for name, (draw, arguments) in pictures(solved).items():
        axes = draw(*arguments)
        figures[name] = np.ravel(axes)[0].figure
        figures[name].draw_without_rendering()
    return figures


def texts(figure):
    """All texts that are seen, but for those that Matplotlib leaves out as outside the view."""
    return [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]


@pytest.mark.ci
@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_cut_off(drawn, name):
    figure = drawn[name]
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert box.x0 >= -0.01
    assert box.y0 >= -0.01
    assert box.x1 <= width + 0.01
    assert box.y1 <= height + 0.01


@pytest.mark.ci
@pytest.mark.parametrize("name", NAMES)
def test_text_can_be_read_at_700_pixels(drawn, name):
    figure = drawn[name]
    pixels = [text.get_fontsize() / 72.0 * 700.0 / figure.get_figwidth() for text in texts(figure)]
    assert len(pixels) > 5
    assert min(pixels) >= 8.0


# Axes of numbers without a unit, and of names.
NO_UNIT = {"attitude", "sensitivity", "pairs", "margins"}


@pytest.mark.parametrize("name", [name for name in NAMES if name not in NO_UNIT])
def test_axes_have_units(drawn, name):
    for axes in drawn[name].axes:
        if axes.get_visible() and axes.axison and axes.get_label() != "<colorbar>":
            for label in (axes.get_xlabel(), axes.get_ylabel()):
                inner = name == "stability" and not label
                ratio = "/ standard error" in label
                logarithm = name == "drift" and label == "largest change since the start"
                assert inner or ratio or logarithm or ("[" in label and "]" in label), (name, label)


def srgb(color):
    value = np.asarray(to_rgb(color))
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


# Machado, Oliveira & Fernandes 2009, A physiologically-based model for simulation of color vision deficiency, severity 1.
DEFICIENCIES = {
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def lab(color, matrix):
    """CIE 1976 L*a*b* (D65) of a colour as someone with a deficiency sees it."""
    linear = np.clip(np.asarray(matrix) @ srgb(color), 0.0, 1.0)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    t = to_xyz @ linear / np.array([0.9505, 1.0, 1.089])
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def key(handle):
    """Style (all but the colour) and colour on white of one key of a legend."""
    if isinstance(handle, Line2D):
        return (
            handle._unscaled_dash_pattern,
            handle.get_marker(),
            handle.get_fillstyle(),
            handle.get_linewidth(),
        ), handle.get_color()
    if isinstance(handle, PathCollection):
        return ("marker", handle.get_paths()[0].vertices.tobytes()), handle.get_facecolor()[0]
    face = np.asarray(handle.get_facecolor()).ravel()
    return ("area", handle.get_hatch()), 1.0 - face[3] * (1.0 - face[:3])


@pytest.mark.parametrize("name", NAMES)
def test_keys_of_a_legend_differ_for_all_eyes(drawn, name):
    legends = [axes.get_legend() for axes in drawn[name].axes] + drawn[name].legends
    for legend in filter(None, legends):
        handles, labels = legend.legend_handles, [text.get_text() for text in legend.get_texts()]
        assert len(set(labels)) == len(labels) > 0
        for (one, other), (a, b) in zip(
            itertools.combinations(handles, 2), itertools.combinations(labels, 2), strict=True
        ):
            if type(one) is type(other) and key(one)[0] == key(other)[0]:
                for matrix in (np.eye(3), *DEFICIENCIES.values()):
                    distance = np.linalg.norm(lab(key(one)[1], matrix) - lab(key(other)[1], matrix))
                    assert distance > 10.0, (name, a, b, distance)


def test_two_samples_have_marks_and_a_hint(drawn):
    two = drawn["two samples"]
    assert "SaveAt(every=...)" in two.get_suptitle()
    assert next(line for line in two.axes[1].lines if line.get_label() == "median").get_marker() == "o"


def test_angles_are_drawn_about_their_mean_direction(solved):
    heading = np.linspace(3.0, 3.3, N)[None] + np.linspace(0.0, 9.0, len(solved.time))[:, None]
    samples = {**solved.samples, "attitude": turned(heading)}
    result = dataclasses.replace(ending(solved, [0] * N, [np.nan] * N), samples=samples)
    (axes,) = lw.plots.fan(result, "euler[2]").figure.axes
    median = next(line for line in axes.lines if line.get_label() == "median").get_ydata()
    np.testing.assert_allclose(np.diff(median), 9.0 / (len(solved.time) - 1), atol=1e-9)


def test_probabilities_have_an_axis_of_their_own(solved):
    """The axis says what the line is, and not the quantity of its condition."""
    asked = [lw.statistics.Exceedance("depth", above=1.0), lw.statistics.Outcome("failed"), lw.statistics.Mean("depth")]
    result = dataclasses.replace(solved, statistics=lw.gather(solved, asked))
    labels = [axes.get_ylabel() for axes in lw.plots.statistics(result)]
    assert labels[:2] == ["probability", "probability"]
    assert labels[2].startswith("depth [m]")


def test_statistics_stand_for_samples(solved, drawn):
    bare = dataclasses.replace(solved, samples={})
    (axes,) = lw.plots.fan(bare).figure.axes
    middle = solved.statistics["quantiles depth"].value[:, :, 0]
    median = next(line for line in axes.lines if line.get_label() == "50% quantile").get_ydata()
    np.testing.assert_array_equal(median, middle[:, middle.shape[1] // 2])
    assert axes.get_legend().get_title().get_text() == f"{N} members, from statistics"
    bars = lw.plots.histogram(bare, at=0.0)
    assert sum(bar.get_width() for bar in bars.patches) == pytest.approx(100.0)
    assert bars.yaxis_inverted()
    assert lw.plots.summary(bare)[0].get_title() == "quantiles depth"
    assert lw.plots.outcomes(bare).get_ylabel() == "share of members [%]"
    for name in ("paths", "plan_view", "phase", "attitude", "pairs", "drift"):
        with pytest.raises(NothingToDraw, match=r'keep="all"'):
            getattr(lw.plots, name)(bare)


def test_a_histogram_counts_every_member_once(solved, drawn):
    (axes,) = drawn["histogram"].axes
    assert sum(bar.get_width() for bar in axes.patches) == pytest.approx(100.0)
    speed = lw.plots.histogram(solved, "max(speed)")
    assert sum(bar.get_height() for bar in speed.patches) == pytest.approx(100.0)
    assert speed.get_xlabel() == "max(speed) [m/s]"
    same = dataclasses.replace(solved, samples={**solved.samples, "position": np.full_like(solved.position, 20.0)})
    assert sum(bar.get_width() for bar in lw.plots.histogram(same).patches) == pytest.approx(100.0)


@pytest.mark.ci
@pytest.mark.parametrize("ending_of_name", ["svg", "pdf", "png"])
def test_files_and_axes(solved, tmp_path, ending_of_name):
    figure = Figure()
    left, right = figure.subplots(1, 2)
    path = tmp_path / f"picture.{ending_of_name}"
    assert lw.plots.fan(solved, "speed", ax=left) is left
    assert not list(tmp_path.iterdir())
    assert lw.plots.paths(solved, ax=right, path=path) is right
    assert path.stat().st_size > 5000
    assert len(figure.axes) == 2
    assert len(lw.plots.summary(solved)) == 4


def test_refusals_name_the_remedy(solved):
    with pytest.raises(lw.SceneError, match=r"Name one: position\[0\]"):
        lw.plots.fan(solved, "position")
    with pytest.raises(NothingToDraw, match="SaveAt"):
        lw.plots.fan(dataclasses.replace(solved, samples={"position": solved.position}), "speed")
    with pytest.raises(lw.SceneError, match="from 2 to 6"):
        lw.plots.pairs(solved, ["depth"])
    with pytest.raises(lw.SceneError, match="holds no result"):
        lw.plots.compare({})


def test_pieces_give_what_the_whole_gives(solved):
    of = quantity_of("speed")
    whole, parts = survey_of(solved, of), survey_of(solved, of, at_once=7 * len(solved.time))
    for name in ("values", "counted", "low", "high", "last"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
    assert at_levels(whole.values, whole.counted, [0.0])[0] == pytest.approx(whole.low)


def margins_of(steady):
    upper = np.array([2.0, 4.0, np.inf, 3.0, np.nan])
    values = {"gain_upper": np.where(steady, upper, np.nan),
              "delay": np.where(steady, [0.1, 0.3, 0.2, 0.4, 0.0], np.nan)}  # fmt: skip
    why = np.where(steady, "", "does not settle").astype(object)
    return Margins("heading_pid", values, {"gain_upper": 1.1 * upper, "delay": values["delay"]}, why, 0.02)


def test_margins_of_nobody_are_no_picture(tmp_path):
    with pytest.raises(NothingToDraw, match=r"none of the 5 members has margins \(5: does not settle\)"):
        lw.plots.margins(margins_of([False] * 5), path=tmp_path / "margins.png")
    assert not list(tmp_path.iterdir())


def test_a_drift_of_nothing_names_what_does_work():
    pushed = lw.Scene(
        lw.Scene.named("sphere").vehicle, terms=[lw.terms.Wrench(force=[1.0, 2.0, 3.0], torque=[1.0, 2.0, 3.0])]
    )
    with pytest.raises(NothingToDraw, match=r"nothing is conserved, since wrench does work: draw lw\.plots\.fan"):
        lw.plots.drift(made(np.arange(18.0).reshape(3, 2, 3), scene=pushed))
