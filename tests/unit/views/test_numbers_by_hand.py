# SPDX-License-Identifier: Apache-2.0
"""Pictures, recordings and pages of results given by hand: the numbers that are drawn, and the words beside them."""

import base64
import dataclasses
import time
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import Status, WarningArray
from lgvi_warp.statistics.estimates.estimate import Estimate, Estimates
from lgvi_warp.views import choice, fleet
from lgvi_warp.views.pages import report
from lgvi_warp.views.plots import canvas, fans, read, words
from lgvi_warp.views.recording import drawn, live, rerun, viewer
from lgvi_warp.views.recording import words as told
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


# Choice ------------------------------------------------------------------------------------------------------------------


def test_parameters_of_some_members_are_theirs():
    result = dataclasses.replace(sinking(), parameters={"own": np.arange(N) * 2.0, "shared": np.array([7.0])})
    few = choice.few(result, np.array([3, 5]), ("position", "nothing"), np.array([0, 4]))
    assert few.parameters["own"].tolist() == [6.0, 10.0]
    assert few.parameters["shared"].tolist() == [7.0]
    assert list(few.parameters) == ["own", "shared"]
    assert len(few.parameters) == 2
    assert few.time.tolist() == [0.0, 4.0]
    assert list(few.samples) == ["position"]
    assert few.members == 2
    assert few.position[..., 2].tolist() == [[4.0, 6.0], [8.0, 10.0]]
    assert few.store is None
    whole = choice.few(result, slice(2, 4), ("position",))
    assert whole.time.tolist() == result.time.tolist()
    assert whole.position[0, :, 2].tolist() == [3.0, 4.0]


def test_vectors_are_finite_in_all_three():
    rows = np.ones((4, 3))
    rows[0, 0], rows[1, 1], rows[2, 2] = np.nan, np.inf, -np.inf
    assert choice.finite_rows(rows).tolist() == [False, False, False, True]


def test_the_hash_is_that_of_the_paper():
    # The first numbers of SplitMix64 from the seed 0.
    assert choice.mixed(np.arange(3)).tolist() == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]


def test_frames_are_the_nearest():
    time = np.array([0.0, 1.0, 2.0, 3.4, 3.6, 10.0])
    assert choice.frames_of(time, 3).tolist() == [0, 4, 5]
    assert choice.frames_of(time, 6).tolist() == list(range(6))
    assert choice.frames_of(np.array([0.0, 4.0, 6.0, 10.0]), 3).tolist() == [0, 2, 3]  # of two as near the later one


# Fleet -------------------------------------------------------------------------------------------------------------------


def test_titles_and_the_number_of_the_run():
    result = sinking(status=[FLOOR] * 4 + [OK] * 6)
    assert fleet.title(sinking()) == "10 members, psi_s, step 0.01 s"
    assert fleet.title(result).startswith("10 members, psi_s, step 0.01 s: ")
    assert "4 floor" in fleet.title(result)
    part = dataclasses.replace(result, provenance=result.provenance | {"members": 1200})
    assert fleet.members_of_run(part) == 1200
    assert fleet.title(part).startswith("10 of 1,200 members")
    for planned, count in ((None, 10), (7, 10), (30, 30)):
        ensemble = {"ensemble": {"members": planned}}
        assert fleet.members_of_run(dataclasses.replace(result, provenance=result.provenance | ensemble)) == count
    assert fleet.LOOKS[Status.FLOOR].rgb == (0xE6, 0x9F, 0x00)


def test_a_change_of_any_number_changes_the_identity():
    result = sinking()
    same = fleet.identity(result)
    assert len(same) == 16
    assert same == fleet.identity(sinking())
    position = result.position.copy()
    position[-1, 3, 0] += 1.0
    start = result.position.copy()
    start[0, 3, 0] += 1.0
    floor = [FLOOR] * N
    others = [dataclasses.replace(result, time=result.time + 1.0), sinking(status=floor),
              sinking(status=floor, end=np.ones(N)),
              dataclasses.replace(result, provenance=result.provenance | {"step": 0.02})]  # fmt: skip
    others += [
        dataclasses.replace(result, samples=dict(result.samples) | {"position": moved}) for moved in (position, start)
    ]
    names = {fleet.identity(changed) for changed in others}
    assert same not in names
    assert len(names) == len(others)


# Histograms, fans and refusals -------------------------------------------------------------------------------------------


def test_a_survey_of_all_members():
    result = sinking(status=[OK] * 9 + [FLOOR], end=[np.nan] * 9 + [2.0])
    survey = read.survey_of(result, read.quantity_of("depth"))
    assert survey.low.tolist() == [1, 2, 3, 4, 5]
    assert survey.high.tolist() == [10, 11, 12, 12, 13]
    assert survey.under_way.tolist() == [10, 10, 10, 9, 9]
    assert survey.last.tolist() == list(range(5, 15))
    assert (survey.above, survey.total, survey.ranked) == (0, N, N)
    high = dataclasses.replace(
        result, samples=dict(result.samples) | {"position": result.position - np.array([0.0, 0.0, 3.0])}
    )
    assert read.survey_of(high, read.quantity_of("depth")).above == 2
    bodiless = dataclasses.replace(result, samples={"velocity": result.velocity})
    everyone = read.everyone(bodiless)
    assert everyone.members.tolist() == everyone.ranked.tolist() == list(range(N))
    assert everyone.total == N
    assert read.survey_of(bodiless, read.quantity_of("speed")).ranked == N


def areas(axes):
    """Colour, label and vertical range at the first time of each area."""
    found = []
    for area in axes.collections:
        points = area.get_paths()[0].vertices
        first = points[points[:, 0] == 0.0, 1]
        found.append((to_hex(area.get_facecolor()[0]).upper(), area.get_label(), first.min(), first.max()))
    return found


def test_a_fan_of_statistics():
    levels = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    value = np.zeros((K, 5, 2))
    value[:, :, 1] = np.arange(5.0) + 10.0
    quantiles = statistic("quantiles", {"level": levels}, value=value)
    axes = lw.plots.fan(bare(sinking(), quantiles), "depth")
    outer, inner = fans.TINTS[1:]
    assert areas(axes) == [(outer, "90%", 10.0, 14.0), (inner, "50%", 11.0, 13.0)]
    (median,) = (line for line in axes.lines if line.get_label() == "50% quantile")
    assert set(median.get_ydata()) == {12.0}
    assert to_hex(median.get_color()) == "#000000"
    assert axes.get_xlabel() == "time [s]"
    assert axes.yaxis_inverted()
    assert axes.get_legend().get_title().get_text() == "10 members, from statistics"
    even = statistic("quantiles", {"level": levels[[0, 4]]}, value=value[:, [0, 4]])
    axes = lw.plots.fan(bare(sinking(), even), "depth")
    assert areas(axes) == [(fans.TINTS[2], "90%", 10.0, 14.0)]
    assert not any("quantile" in str(line.get_label()) for line in axes.lines)
    low, middle, high = (np.stack([np.zeros(K), np.full(K, number)], axis=1) for number in (8.0, 9.0, 9.5))
    mean = statistic("mean", value=middle, lower=low, upper=high)
    axes = Figure().subplots()
    assert lw.plots.fan(bare(sinking(), mean), "depth", ax=axes) is axes
    assert axes.get_title() == ""
    assert areas(axes) == [(fans.TINTS[1], "its 95% interval", 8.0, 9.5)]
    (line,) = (line for line in axes.lines if line.get_label() == "mean")
    assert set(line.get_ydata()) == {9.0}
    assert line.get_linewidth() == 1.2
    axes = lw.plots.fan(bare(sinking(), statistic("extremes", minimum=low, maximum=high)), "depth")
    assert areas(axes) == [(fans.TINTS[0], "all", 8.0, 9.5)]
    assert axes.get_title() == "10 members, psi_s, step 0.01 s"
    with pytest.raises(NothingToDraw, match="no samples were kept"):
        lw.plots.fan(bare(sinking()), "depth")


def test_a_statistic_of_a_quantity_is_found():
    mean, spread = statistic("mean", value=np.zeros((K, 2))), statistic("quantiles", value=np.zeros((K, 1, 2)))
    result = bare(sinking(), spread, mean)
    assert read.estimate_for(result, "depth", ("mean", "quantiles")) == (mean, 1)
    assert read.estimate_for(result, "position[2]", ("quantiles", "mean")) == (spread, 1)
    assert read.estimate_for(result, "speed", ("extremes", "mean")) == (mean, 0)
    assert read.estimate_for(result, "energy", ("mean",)) is None
    once = statistic("mean", {"time": np.array([4.0])}, value=np.zeros((1, 2)))
    assert read.estimate_for(bare(sinking(), once), "depth", ("mean",)) is None


def test_what_cannot_be_drawn_says_why():
    with pytest.raises(NothingToDraw, match="no statistic against time was gathered"):
        lw.plots.statistics(sinking())
    with pytest.raises(NothingToDraw, match="no setting was measured"):
        lw.plots.tradeoff(SimpleNamespace(of="position", measurements=[]))
    nothing = SimpleNamespace(quantities=["depth"], factors=["a"], columns=["first"], first=np.full((1, 1), np.nan))
    with pytest.raises(NothingToDraw, match="no quantity varies"):
        lw.plots.sensitivity(nothing)
    assert words.unit_of("depth") == "m"
    assert words.unit_of("my own number") == ""


def test_factors_without_effect_take_no_rows():
    """Of three factors the second has indices of zero for both quantities, the third for one of them."""
    numbers = np.array([[0.7, 0.0, 0.0], [0.4, 0.0, 0.6]])
    found = SimpleNamespace(name="Sobol indices", quantities=["depth", "speed"], factors=["a", "b", "c"], samples=8,
                            members=80, failed=0, confidence=0.95, columns=["first", "total"], first=numbers, total=numbers,
                            intervals={"first": "half"}, half=0.1 * numbers)  # fmt: skip
    left, right = lw.plots.sensitivity(found)
    assert [label.get_text() for label in left.get_yticklabels()] == ["a", "c"]
    for axes, widths in ((left, [0.7, 0.0]), (right, [0.4, 0.6])):
        assert [[bar.get_width() for bar in bars] for bars in axes.containers if hasattr(bars, "patches")] == [
            widths
        ] * 2
    assert left.figure.get_suptitle().replace("\n", " ").endswith("; without any effect: b")
    found.first = found.total = found.half = 0.0 * numbers
    assert len(lw.plots.sensitivity(found)[0].get_yticklabels()) == 3


def test_text_is_wrapped_to_a_share_of_a_figure():
    figure = Figure(figsize=(10.0, 4.0))
    assert canvas.text_size(figure) == 9.0
    assert canvas.text_size(Figure(figsize=(20.0, 4.0))) == 18.0
    # 10 inches have 720 points, and a letter takes 5.4: 133 of them.
    text = "a " * 150
    assert [len(line) for line in canvas.wrapped(text, figure).split("\n")] == [133, 133, 31]
    assert len(canvas.wrapped(text, figure, 0.5).split("\n")[0]) == 65
    assert [canvas.style(i)["linestyle"] for i in (0, 1, 7)] == ["-", "--", "--"]
    assert canvas.style(8)["color"] == canvas.COLORS[1]
    assert canvas.hatch(9) == canvas.HATCHES[1]
    assert canvas.style(48) != canvas.style(0)
    assert canvas.style(49)["linestyle"] == "-"


@pytest.mark.parametrize(
    ("low", "high", "said", "at"),
    [(100.0, 101.0, "surface\n100 m\nabove", 1.0), (-7.0, -5.0, "surface\n5 m\nbelow", 0.0)],
)
def test_a_far_surface_is_told_with_its_side(low, high, said, at):
    """Three lines beside the axes, whose middle is half their height from the end of the axes."""
    axes = Figure().subplots()
    axes.set_ylim(low, high)
    canvas.point_down(axes)
    (text,) = axes.texts
    assert (text.get_text(), text.get_ha(), text.get_va()) == (said, "left", "center")
    x, y = text.get_position()
    assert x > 1.0
    assert 0.02 < abs(at - y) < 0.2
    assert axes.get_ylim() == (high, low)
    assert not axes.lines


def test_a_near_surface_and_floor_are_lines():
    for low, shown in ((1.0, True), (1.01, False)):
        axes = Figure().subplots()
        axes.set_ylim(low, low + 2.0)
        canvas.point_down(axes, {"floor": [low + 3.0]})
        names = [text.get_text() for text in axes.texts]
        assert ("surface" in names) == shown
        assert "floor" in names
        assert axes.get_ylim()[0] == pytest.approx(low + 3.1)
        assert axes.get_ylim()[1] == pytest.approx(-0.1 if shown else low)
        colors = [line.get_color() for line in axes.lines]
        assert colors == (["#0072B2", "#7A4A00"] if shown else ["#7A4A00"])


# Recordings --------------------------------------------------------------------------------------------------------------


def test_the_energy_of_a_recording_in_words(monkeypatch):
    run = SimpleNamespace(few=sinking())
    for conserved, drift, text in (({"energy"}, 0.123, "drift 0.12 J, the largest of the members drawn"),
                                   (set(), 1.0, "not conserved: drag, waves do work"),
                                   (set(), np.nan, "not known: every member drawn failed")):  # fmt: skip
        monkeypatch.setattr(told.invariants, "drift", lambda _, drift=drift: {"energy": drift})
        monkeypatch.setattr(told.invariants, "conserved", lambda _, conserved=conserved: conserved)
        monkeypatch.setattr(told.invariants, "at_work", lambda _: ["drag", "waves"])
        assert told.energy_text(run) == text
    run.few = dataclasses.replace(run.few, samples={"position": run.few.position})
    assert told.energy_text(run) == "not known: not all of the motion was kept"


def test_fans_of_statistics_stand_for_members():
    fan = drawn.Fan("height", "Height", "m", np.ones((len(drawn.LEVELS), 3)))
    frames = np.array([0, 2, 4])
    depth = np.arange(K)[:, None] + 10.0
    extremes = statistic("extremes", minimum=depth, maximum=depth + 5.0)
    streamed = drawn.streamed(bare(sinking(), extremes), fan, frames)
    assert streamed.title == "Height, by the run's statistics"
    assert streamed.levels[0].tolist() == [-15.0, -17.0, -19.0]
    assert streamed.levels[-1].tolist() == [
        -10.0,
        -12.0,
        -14.0,
    ]
    assert np.isnan(streamed.levels[1:-1]).all()
    quantiles = statistic("quantiles", {"level": np.array([0.05, 0.5])}, value=np.stack([depth, depth + 2.0], axis=1))
    streamed = drawn.streamed(bare(sinking(), quantiles), fan, frames)
    levels = list(drawn.LEVELS)
    assert streamed.levels[levels.index(0.95)].tolist() == [-10.0, -12.0, -14.0]
    assert streamed.levels[levels.index(0.5)].tolist() == [-12.0, -14.0, -16.0]
    assert np.isfinite(streamed.levels).any(axis=1).sum() == 2
    sampled = dataclasses.replace(sinking(), statistics=Estimates([extremes]))
    pitch = dataclasses.replace(fan, name="pitch")
    of_mean = bare(sinking(), statistic("mean", value=depth))
    for result, same in ((sampled, fan), (of_mean, fan), (bare(sinking(), extremes), pitch)):
        assert drawn.streamed(result, same, frames) is same


def test_members_of_a_recording_are_places_among_those_kept():
    kept = np.array([2, 5, 9])
    assert drawn.places_of([9, 2, 9], 10, kept).tolist() == [0, 2]
    assert drawn.places_of(np.array([0, 9]), 10, np.arange(10)).tolist() == [0, 9]
    for members, text in (([10], "members = 10: is none of the 10 members; give indices from 0 to 9"),
                          ([-1, 3], "members = -1: is none of the 10 members"), ([3, 2], "members = 3: has no samples"),
                          ([], "is no list of members"), ([1.0], "is no list of members"), (3, "is no list")):  # fmt: skip
        with pytest.raises(lw.SceneError, match=text):
            drawn.places_of(members, 10, kept)


def test_a_recording_goes_where_it_is_sent(monkeypatch):
    with pytest.raises(ValueError, match="neither path nor to is given: the recording would go nowhere"):
        lw.log_rerun(sinking())
    with pytest.raises(NothingToDraw, match="there is no result to draw"):
        lw.log_rerun({}, "a.rrd")
    acts = []
    monkeypatch.setattr(rerun, "_send", lambda to, runs: acts.append(("sent", to, len(runs))))
    stream = SimpleNamespace(flush=lambda: acts.append("flushed"))
    assert lw.log_rerun(sinking(), to=stream) is None
    assert acts == [("sent", stream, 1), "flushed"]


def test_a_viewer_is_shown_a_file_of_its_own(monkeypatch):
    acts = []
    monkeypatch.setattr(rerun, "log_rerun", lambda result, path, members: acts.append((result, path, members)))
    monkeypatch.setattr(viewer, "is_open", lambda: acts.append("looked"))
    monkeypatch.setattr(viewer, "start", lambda arguments, remedy: acts.append((arguments, remedy)))
    lw.show("a result", members=[3])
    (result, path, members), looked, (arguments, remedy) = acts
    assert (result, path.name, members, looked, arguments) == ("a result", "fleet.rrd", [3], "looked", [path])
    assert path.parent.name.startswith("lgvi_warp_")
    assert path.parent.is_dir()
    assert remedy == f"the recording is {path}: open it where there is a display"


def test_what_a_live_view_says_and_draws(monkeypatch):
    logged, counts = [], []
    recording = SimpleNamespace(log=lambda *given, **options: logged.append((*given, options)),
                                flush=lambda timeout_sec: counts.append(timeout_sec))  # fmt: skip
    drawing = live.Live(recording)
    monkeypatch.setattr(live.choice, "MOST_BODIES", 6)
    places = []
    monkeypatch.setattr(drawing, "_draw", lambda block, chosen, first: places.append((chosen.tolist(), first)))
    block = sinking(status=[OK] * 9 + [FLOOR])
    block = dataclasses.replace(block, provenance=block.provenance | {"members": 20})
    drawing.add(block)
    drawing.add(dataclasses.replace(block, samples={}))
    drawing.add(block)
    assert [first for _, first in places] == [0, 20]
    assert all(len(chosen) == 3 for chosen, _ in places)
    for chosen, first in places:
        order = np.argsort(choice.mixed(np.arange(first, first + 10)), kind="stable")
        assert chosen == sorted(order[:3].tolist())
    said = [text for _, document, _ in logged for text in document.text.as_arrow_array().to_pylist()]
    assert said == [
        "10 of 20 members done: ok 9, floor 1",
        "20 members done: ok 18, floor 2",
        "20 members done: ok 27, floor 3",
    ]
    assert counts == [30.0] * 3
    assert logged[0][0] == "run/summary"
    assert logged[0][2] == {"static": True, "strict": True}


def test_a_live_view_logs_bodies_paths_and_curves_of_each_block(monkeypatch):
    calls, layouts = [], []
    for name in ("log_bodies", "log_paths", "log_frame", "log_member"):
        monkeypatch.setattr(live, name, lambda *given, name=name: calls.append((name, *given)))
    monkeypatch.setattr(
        live, "live_layout", lambda run, box, scale: layouts.append((run.label, box.size, scale)) or "laid out"
    )
    recording = SimpleNamespace(send_blueprint=lambda layout: calls.append(("layout", layout)))
    drawing = live.Live(recording)
    monkeypatch.setattr(live, "CURVES", 5)
    block = sinking()
    drawing._draw(block, np.array([2, 5, 7]), 100)
    assert [name for name, *_ in calls] == ["log_frame", "layout", "log_bodies", "log_paths", *["log_member"] * 3]
    frame, layout, bodies, paths, *curves = calls
    run = bodies[2]
    assert all(given[1] is recording for given in (frame, bodies, paths, *curves))
    assert layout[1] == "laid out"
    assert run.label == "from_100"
    assert frame[2].label == ""
    assert paths[2] is run
    assert bodies[3] == layouts[0][2]
    assert [given[2:] for given in curves] == [(run, 0, 102), (run, 1, 105), (run, 2, 107)]
    assert run.position[0, :, 2].tolist() == [3.0, 6.0, 8.0]
    assert layouts[0][:2] == ("", frame[3].size)
    # The next block is of two curves more; the view is laid out anew where it is outgrown alone.
    calls.clear()
    drawing._draw(block, np.array([2, 5, 7]), 200)
    assert [name for name, *_ in calls] == ["log_bodies", "log_paths", "log_member", "log_member"]
    far = dataclasses.replace(
        block, samples=dict(block.samples) | {"position": block.position + np.array([500.0, 0.0, 0.0])}
    )
    calls.clear()
    drawing._draw(far, np.array([2]), 300)
    assert [name for name, *_ in calls] == ["log_frame", "layout", "log_bodies", "log_paths"]
    assert calls[0][3].low[0] <= 0.0
    assert calls[0][3].high[0] >= 500.0
    assert calls[2][3] == layouts[0][2]
    calls.clear()
    lost = dataclasses.replace(block, samples=dict(block.samples) | {"position": np.full((K, N, 3), np.nan)})
    drawing._draw(lost, np.array([2]), 400)
    assert calls == []


def test_a_viewer_that_is_gone_ends_a_live_view(monkeypatch):
    drawing = live.Live(SimpleNamespace())
    calls = []

    def gone(block):
        calls.append(block)
        raise RuntimeError

    monkeypatch.setattr(drawing, "_add", gone)
    drawing.add("a")
    drawing.add("b")
    assert drawing.closed
    assert calls == ["a"]


def test_addresses_of_viewers(monkeypatch):
    asked = []

    def connect(address, timeout):
        asked.append((address, timeout))
        raise OSError("refused")

    monkeypatch.setattr("socket.create_connection", connect)
    for address in ("rerun+http://a:5/proxy", "rerun+http://b/proxy", "c"):
        assert viewer.answers(address) is False
        text = (
            f'to = {address!r}: no viewer answers (refused); start a viewer with "rerun", or give to="{viewer.ADDRESS}"'
        )
        with pytest.raises(OSError) as caught:
            viewer.reach(address)
        assert str(caught.value) == text
    assert asked[::2] == [(("a", 5), 10.0), (("b", 9876), 10.0), (("", 9876), 10.0)]
    assert viewer.answers("rerun+http://a:x") is False
    assert viewer.is_open() is False


# Pages -------------------------------------------------------------------------------------------------------------------


def test_the_page_of_a_run_by_hand(tmp_path, monkeypatch):
    drawings = []

    def plot(result, path):
        drawings.append(path.suffix)
        path.write_bytes(b"x" * (report.MOST_SVG + 1) if path.suffix == ".svg" else b"\x89PNG")
        return path

    monkeypatch.setattr(report, "plot", plot)
    bits = np.zeros(N, np.uint16)
    bits[:3] = 1
    result = dataclasses.replace(
        sinking(status=[OK] * 8 + [FLOOR] * 2), messages=("a < b",), warnings=bits.view(WarningArray)
    )
    scene = {"vehicle": {"title": "A & B"}, "ensemble": {"seed": 4}}
    method = {"name": "psi_x", "chosen": "since drag acts"}
    machine = {"cpu": "a cpu", "threads": 2}
    more = {"scene": scene, "method": method, "machine": machine, "versions": {"numpy": "2"}, "steps": 15000}
    more["ensemble"] = {"members": 10, "seed": 4}
    result = dataclasses.replace(result, provenance=result.provenance | more)
    text = lw.report(result, tmp_path / "a.html").read_text(encoding="utf-8")
    assert text.startswith('<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>A &amp; B</title><style>')
    today = time.strftime("%Y-%m-%d")
    assert f"<body><h1>A &amp; B</h1><p>Written on {today}.</p><p>10 members, psi_x, step 0.01 s: " in text
    assert text.endswith("</body></html>\n")
    headings = ["What became of the members", "Notes and warnings", "Pictures", "How it was run", "Run it again"]
    places = [text.index(f"<h2>{heading}</h2>") for heading in headings]
    assert places == sorted(places)
    assert text.count("<h2>") == 5
    assert "<ul><li>a &lt; b</li><li>inertia, 3 members: " in text
    assert drawings == [".svg", ".png"]
    code = base64.b64encode(b"\x89PNG").decode()
    assert f'<h2>Pictures</h2><img alt="picture" src="data:image/png;base64,{code}">' in text
    color = fleet.LOOKS[Status.FLOOR].color
    mark = f'<span class="outcome" style="background:{color}"></span> floor'
    assert f"<td>{mark}</td><td>2</td><td>20 %</td>" in text
    rows = {"method": "psi_x, since drag acts", "step": "0.01 s, 15,000 steps", "numbers": "float64", "members": "10",
            "seed": "4", "versions": "numpy 2", "machine": "a cpu, 2"}  # fmt: skip
    table = "".join(f"<tr><td>{name}</td><td>{value}</td></tr>" for name, value in rows.items())
    assert f"<h2>How it was run</h2><table>{table}</table>" in text
    again = "<p>Save this scene as scene.toml, then:</p><pre>lgvi-warp run scene.toml --step 0.01 --duration 150</pre>"
    again += "<pre>[vehicle]\ntitle = &quot;A &amp; B&quot;"
    assert again in text


def test_pages_of_odd_runs(tmp_path, monkeypatch):
    def small(result, path):
        path.write_text("<?xml?><svg>a picture</svg>")
        return path

    monkeypatch.setattr(report, "plot", small)
    result = sinking()
    callback = {"controller": {"laws": [{"type": "callback"}]}, "vehicle": {"title": "a ball"}}
    provenance = result.provenance | {"scene": callback, "machine": {}, "steps": 1}
    text = lw.report(dataclasses.replace(result, provenance=provenance), tmp_path / "a.html").read_text()
    assert "A law is a Python function, which no file holds: run the script again. The scene but for it:" in text
    assert "lgvi-warp run scene.toml" not in text
    assert "<h1>a ball</h1>" in text
    seed = result.provenance["ensemble"]["seed"]
    assert f"<td>seed</td><td>{seed}</td>" in text
    assert "<h2>Pictures</h2><svg>a picture</svg><h2>" in text
    assert "<h2>Notes" not in text
    nameless = provenance | {"scene": {"vehicle": {}}}
    few = dataclasses.replace(result, provenance=nameless, samples={})
    text = lw.report(few, tmp_path / "b.html").read_text()
    assert "<h1>Run</h1>" in text
    assert "<h2>Pictures</h2>" not in text
    assert "Statistics" not in text

    def nothing(result, path):
        raise NothingToDraw("nothing to < see")

    monkeypatch.setattr(report, "plot", nothing)
    text = lw.report(dataclasses.replace(result, provenance=provenance), tmp_path / "c.html").read_text()
    assert "<h2>Pictures</h2><p>nothing to &lt; see</p>" in text


def test_tables_of_a_study(tmp_path):
    today = time.strftime("%Y-%m-%d")
    for count, more in ((200, ""), (201, "<p>The first 200 of 201 rows; stability.csv has all.</p>")):
        (tmp_path / "stability.csv").write_text("h\n" + "".join(f"{i}\n" for i in range(count)))
        (tmp_path / "stability.json").write_text('{"of": 3, "cells": [1]}')
        (tmp_path / "a_map.png").write_bytes(b"a")
        text = lw.report(tmp_path, tmp_path / "a.html").read_text()
        head = f"<h1>Stability of {tmp_path.name}</h1><p>Stability of {today}, in {tmp_path.name}.</p>"
        assert f"{head}<h2>A map</h2><img " in text
        assert f"<h2>Table</h2>{more}<table><tr><th>h</th></tr><tr><td>0</td></tr>" in text
        assert text.count("<td>") == 200
        assert "<h2>How it was made</h2><pre>{\n &quot;of&quot;: 3\n}</pre>" in text
    (tmp_path / "stability.csv").write_text("")
    assert "<h2>Table</h2><table></table>" in lw.report(tmp_path, tmp_path / "a.html").read_text()
