# SPDX-License-Identifier: Apache-2.0
"""Rare events of vehicles: a neutrally buoyant sphere in linear drag, whose place at the end is linear in its start."""

import copy
import json
import pickle

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

import lgvi_warp as lw
from lgvi_warp.calls.prepared import FailedMembers
from lgvi_warp.statistics.metrics.nearest import LEAST, least_between
from tests.support.pages import blocks
from tests.support.refusals import says

DRAG, T1 = 20.0, 3.0
RUN = {"method": "psi_x", "h": 0.1, "t1": T1, "threads": 1}
VEHICLE = lw.Scene.named("sphere").vehicle
# Mass and added mass of a sphere, m + m / 2; a speed v leads to tau (1 - exp(-t / tau)) v.
TAU = 1.5 * float(VEHICLE.mass) / DRAG
WAY = TAU * (1.0 - np.exp(-T1 / TAU))
NORTH, SPEED = 0.5, 0.3
NOISE = lw.terms.WrenchNoise(force=(30.0, 0.0, 0.0))


def scene_of(*more, events=()):
    drag = lw.terms.Drag(linear=[DRAG] * 3 + [1.0] * 3)
    return lw.Scene(VEHICLE, terms=[drag, *more], start=lw.Start(velocity=[1.0, 0.0, 0.5]), events=events)


def fleet_of(**scene):
    vary = {
        "start.position[0]": lw.distributions.Normal(std=NORTH),
        "start.velocity[0]": lw.distributions.Normal(std=SPEED),
    }
    return lw.Ensemble(scene_of(**scene), vary=vary)


def bound_of(p):
    """Quantile p of a member's place north."""
    return WAY - ndtri(p) * np.hypot(NORTH, SPEED * WAY)


@pytest.fixture(scope="module")
def answer():
    return lw.rare_event(fleet_of(), f"position[0] - {bound_of(1e-5):.12g}", **RUN)


@pytest.mark.ci
def test_the_probability_of_a_place_is_that_of_a_normal(answer):
    # The step's error, of second order, moves the place by 1e-5 of itself, and the probability by less than 0.1 %.
    assert answer.estimator == "importance"
    assert abs(answer.probability / 1e-5 - 1.0) < 3.0 * answer.relative_error
    assert answer.relative_error < 0.1
    assert answer.members == {"the scene's own": pytest.approx(12_000, rel=0.4)}
    assert answer.interval[0] < answer.probability < answer.interval[1]
    assert answer.plain_members == pytest.approx(1e5 / answer.relative_error**2, rel=0.2)
    # The failing members' mean lies along (0.5, 0.3 WAY), a little beyond the 4.26 sd of the event.
    toward = np.array([NORTH, SPEED * WAY]) / np.hypot(NORTH, SPEED * WAY)
    moved = np.array([answer.moved["start.position[0]"], answer.moved["start.velocity[0]"]])
    np.testing.assert_allclose(moved / np.linalg.norm(moved), toward, atol=0.05)
    assert np.linalg.norm(moved) == pytest.approx(
        np.exp(-0.5 * ndtri(1e-5) ** 2) / np.sqrt(2.0 * np.pi) / 1e-5, rel=0.02
    )
    assert answer.distance == pytest.approx(-ndtri(1e-5), rel=0.03)


@pytest.mark.ci
def test_failing_members_fail_again(answer):
    again = lw.solve(lw.Ensemble(scene_of(), sampling=answer.failing), **RUN)
    assert again.members == len(answer.weights) > 300
    assert (again.samples["position"][-1, :, 0] > bound_of(1e-5)).all()
    assert answer.weights.sum() == pytest.approx(1.0)
    place = answer.likeliest["start.position[0]"] + WAY * answer.likeliest["start.velocity[0]"]
    assert place == pytest.approx(bound_of(1e-5), rel=0.02)


def test_the_answer_says_what_it_is(answer):
    text = str(answer)
    assert text.endswith(answer.answer)
    for word in ("95 % interval", "Probability of position[0] above", "weights of members", "at random   ",
                 "likeliest", "moved       ", " its mean"):  # fmt: skip
        assert word in text
    for again in (pickle.loads(pickle.dumps(answer)), copy.copy(answer), copy.deepcopy(answer)):
        assert str(again) == text
        assert repr(again) == repr(answer)
    assert answer.provenance["versions"]
    assert answer.provenance["scene"]["vehicle"]


def test_the_answer_is_kept_in_files(answer, tmp_path):
    paths = answer.save(tmp_path)
    assert sorted(path.name for path in paths) == ["rare.csv", "rare.json", "rare.txt"]
    again = lw.studies.RareEvent.load(tmp_path / "rare.json")
    assert str(again) == str(answer)
    np.testing.assert_array_equal(again.normals, answer.normals)
    np.testing.assert_array_equal(
        again.failing.own_values()["start.velocity[0]"], answer.failing.own_values()["start.velocity[0]"]
    )
    assert json.loads((tmp_path / "rare.json").read_text())["probability"] == answer.probability
    table = lw.designs.Table(tmp_path / "rare.csv", ignore=["weight"])
    assert lw.Ensemble(scene_of(), sampling=table).members == len(answer.weights)


@pytest.mark.ci
def test_the_same_seed_has_the_same_answer(answer):
    again = lw.rare_event(fleet_of(), f"position[0] - {bound_of(1e-5):.12g}", **RUN)
    assert again.probability == answer.probability
    np.testing.assert_array_equal(again.normals, answer.normals)


@pytest.mark.slow
def test_ways_to_say_an_event(answer):
    bound = bound_of(1e-5)
    for limit in (f"position[0] above {bound:.12g}", {"position[0]": {"above": float(f"{bound:.12g}")}}):
        assert lw.rare_event(fleet_of(), limit, **RUN).probability == answer.probability
    below = lw.rare_event(fleet_of(), f"{2.0 * WAY - bound:.12g} - position[0]", **RUN)
    assert abs(below.probability / 1e-5 - 1.0) < 3.0 * below.relative_error
    assert below.event == f"position[0] below {2.0 * WAY - bound:g}"

    def beyond(result):
        return result.samples["position"][-1, :, 0] - bound

    of_function = lw.rare_event(fleet_of(), beyond, save=lw.SaveAt(at=[T1]), **RUN)
    assert of_function.probability == pytest.approx(answer.probability, rel=1e-3)
    assert of_function.event == "beyond above 0"


@pytest.mark.ci
def test_any_of_several_conditions_is_the_event():
    vary = dict(fleet_of().vary) | {"start.position[1]": lw.distributions.Normal(std=NORTH)}
    limit = {
        "max(position[0])": {"above": bound_of(5e-6)},
        "max(position[1])": {"above": -ndtri(5e-6) * NORTH},
    }
    either = lw.rare_event(lw.Ensemble(scene_of(), vary=vary), limit, save=lw.SaveAt(every=0.1), **RUN)
    assert either.event.count(" or ") == 1
    assert abs(either.probability / 1e-5 - 1.0) < 3.0 * either.relative_error
    # Half of them go east: their mean is half of what one alone would be, 4.6 sd.
    assert either.moved["start.position[1]"] == pytest.approx(2.3, abs=0.4)
    north, east, of_any, of_all = either.by_condition.values()
    assert north.lower <= 5e-6 <= north.upper
    assert east.lower <= 5e-6 <= east.upper
    assert of_any == (either.probability, *either.interval)
    assert of_all.lower <= 25e-12 <= of_all.upper
    again = lw.studies.RareEvent.from_dict(json.loads(either.to_json()))
    assert again.by_condition == either.by_condition
    assert str(again) == str(either)
    assert f"{list(either.by_condition)[1]}: " in str(either)


@pytest.mark.ci
def test_a_condition_that_never_differs_hides_no_other():
    # Nobody moves east, so that half a metre is missing for ever: nearer than most are to the event in their own spreads.
    limit = {"max(position[0])": {"above": bound_of(1e-5)}, "max(position[1])": {"above": 0.5}}
    found = lw.rare_event(fleet_of(), limit, save=lw.SaveAt(every=0.1), **RUN)
    assert abs(found.probability / 1e-5 - 1.0) < 3.0 * found.relative_error


@pytest.mark.slow
def test_an_event_of_the_scene_is_named():
    floor, rate = 2.0, 0.15
    p = 1e-5
    depth = 0.5 * WAY - ndtri(p) * rate * WAY
    fleet = lw.Ensemble(
        scene_of(events=[lw.events.Floor(depth=depth, name="bottom")]),
        vary={"start.velocity[2]": lw.distributions.Normal(std=rate)},
    )
    found = lw.rare_event(fleet, "bottom", **RUN)
    assert found.event == "bottom"
    assert abs(found.probability / p - 1.0) < 3.0 * found.relative_error + 0.01
    again = lw.solve(lw.Ensemble(fleet.scene, sampling=found.failing), **RUN)
    assert set(again.status.counts()) == {"floor"}
    assert floor < depth


@pytest.mark.slow
def test_the_least_distance_to_an_event():
    scene = scene_of(
        events=[lw.events.Floor(depth=1.2), lw.events.Box(lower=[-1, -1, -1], upper=[9, 1, 9], name="basin")]
    )
    table = lw.designs.Table({"start.velocity[2]": [0.5, 1.0, 0.0], "start.position[2]": [0.0, 0.0, 1.1]})
    each = [lw.metrics.Nearest("floor", then=lw.statistics.MemberValues()),
            lw.metrics.Nearest("basin", kind="box", then=lw.statistics.MemberValues())]  # fmt: skip
    fleet = lw.Ensemble(scene, sampling=table)
    result = lw.solve(fleet, save=lw.SaveAt(every=0.1), statistics=each, **RUN)
    assert result.status[1] == lw.Status.FLOOR
    nearest = result.statistics["each nearest floor"].value[0, 0]
    # The first falls by WAY / 2, the second is stopped, the third stays.
    np.testing.assert_allclose(nearest, [1.2 - 0.5 * WAY, 0.0, 0.1], atol=1e-4)
    basin = result.statistics["each nearest basin"].value[0, 0]
    np.testing.assert_allclose(basin, [1.0, 1.0, 1.0], atol=1e-9)
    assert basin[1] > LEAST
    assert result.statistics["each nearest floor"].unit == "m"


@pytest.mark.slow
def test_the_least_distance_is_between_looks():
    # A body falls back from a turning point, v0^2 / 2 g below its start: with looks 2 s apart none is near that.
    mass, up, rate = float(VEHICLE.mass), 33.0, 0.9
    pull = lw.terms.Wrench(force=[0.0, 0.0, -up])
    events = [lw.events.Floor(depth=5.0), lw.events.Surface(depth=-9.0), lw.events.Box(lower=[-9] * 3, upper=[9] * 3)]
    scene = lw.Scene(VEHICLE, terms=[pull], start=lw.Start(velocity=[0.0, 0.0, rate]), events=events)
    each = [lw.metrics.Nearest(name, then=lw.statistics.MemberValues()) for name in ("floor", "surface", "box")]
    settings = RUN | {"save": lw.SaveAt(every=2.0), "t1": 4.0}
    found = lw.solve(scene, statistics=each, **settings).statistics
    a = up / (1.5 * mass)
    deepest, end = 0.5 * rate**2 / a, rate * 4.0 - 8.0 * a
    np.testing.assert_allclose(found["each nearest floor"].value[0, 0], 5.0 - deepest, rtol=1e-9)
    np.testing.assert_allclose(found["each nearest surface"].value[0, 0], 9.0 + min(0.0, end), rtol=1e-9)
    np.testing.assert_allclose(found["each nearest box"].value[0, 0], 9.0 - max(deepest, -end), rtol=1e-9)
    assert 0.3 < rate / a % 2.0 < 1.7


@pytest.mark.parametrize("curve, least", [
    (lambda s: (s - 0.3) ** 2 + 1.0, 1.0),
    (lambda s: 1.0 - (s - 0.3) ** 2, 0.51),
    (lambda s: s**3 - 0.75 * s**2 + 2.0, 1.9375),
    (lambda s: -(s**3) + 1.5 * s**2 - 0.5625 * s + 1.0, 0.9375),
    (lambda s: 2.0 - s, 1.0),
    (lambda s: 0.0 * s + 3.0, 3.0),
])  # fmt: skip
def test_the_least_value_of_a_cubic(curve, least):
    e = 1e-6
    slopes = [(curve(s + e) - curve(s - e)) / (2.0 * e) for s in (0.0, 1.0)]
    ends = curve(0.0), curve(1.0)
    assert least_between(*map(np.array, (*ends, *slopes))) == pytest.approx(least, abs=1e-8)


def test_a_metric_of_an_event_that_is_not_there():
    with pytest.raises(lw.SceneError, match="is not an outcome of this scene"):
        lw.solve(scene_of(), statistics=[lw.metrics.Nearest("floor")], **RUN)
    with pytest.raises(lw.SceneError, match="of no type whose distance is known"):
        lw.metrics.Nearest("bottom")
    with pytest.raises(lw.SceneError, match="looks at the truth"):
        lw.metrics.Nearest("floor", measured=True)


@pytest.mark.ci
def test_chains_at_a_cheaper_setting(answer):
    limit = f"position[0] - {bound_of(1e-5):.12g}"
    cheap = lw.rare_event(fleet_of(), limit, cheaper=[{"drag.linear[0]": 21.0}], **RUN)
    assert abs(cheap.probability / 1e-5 - 1.0) < 3.0 * cheap.relative_error
    assert cheap.members["drag.linear[0] = 21.0"] > cheap.members["the scene's own"]
    assert cheap.members["the scene's own"] < 0.5 * answer.members["the scene's own"]


@pytest.mark.ci
def test_a_cheaper_scene_that_tells_nothing_is_left_out(answer):
    limit = f"position[0] - {bound_of(1e-5):.12g}"
    # Ten times the drag: where members end is where they began.
    told = lw.rare_event(fleet_of(), limit, cheaper=[{"drag.linear[0]": 4000.0}], **RUN)
    assert any("Name a setting nearer to the scene's own" in message for message in told.messages)
    assert told.probability == answer.probability


@pytest.mark.ci
def test_members_that_fail_are_the_event_and_told_apart():
    def lost(result):
        north = result.samples["position"][-1, :, 0]
        return np.where(north > bound_of(1e-5) + 0.1, np.nan, north - bound_of(1e-5))

    more = {"save": lw.SaveAt(at=[T1]), **RUN}
    found = lw.rare_event(fleet_of(), lost, **more)
    assert abs(found.probability / 1e-5 - 1.0) < 3.0 * found.relative_error
    sd = np.hypot(NORTH, SPEED * WAY)
    assert found.failed_share == pytest.approx(ndtr(ndtri(1e-5) - 0.1 / sd) / 1e-5, abs=0.06)
    assert "failed      " in str(found)
    with pytest.raises(FailedMembers, match='failed="event"'):
        lw.rare_event(fleet_of(), lost, failed="refuse", **more)


@pytest.mark.ci
def test_minus_infinity_is_no_member_that_failed():
    def logarithm(result):
        with np.errstate(divide="ignore"):
            return np.log(np.maximum(result.samples["position"][-1, :, 0], 0.0) / bound_of(1e-5))

    found = lw.rare_event(fleet_of(), logarithm, save=lw.SaveAt(at=[T1]), **RUN)
    assert abs(found.probability / 1e-5 - 1.0) < 4.0 * found.relative_error
    assert found.failed_share == 0.0

    def never(result):
        north = result.samples["position"][-1, :, 0]
        return np.where(north > bound_of(1e-4), np.nan, north - bound_of(1e-3) - 99.0)

    lost = lw.rare_event(fleet_of(), never, save=lw.SaveAt(at=[T1]), **RUN)
    assert abs(lost.probability / 1e-4 - 1.0) < 4.0 * lost.relative_error
    assert lost.failed_share == pytest.approx(1.0)
    assert any("every failing member" in message for message in lost.messages)


@pytest.mark.ci
def test_what_moved_is_the_number_that_decides():
    """Gusts push north, and the event is of the depth alone, on both sides: its mean says nothing, nor does the noise."""
    vary = {"start.velocity[2]": lw.distributions.Normal(std=SPEED)}

    def deep_or_high(result):
        return np.abs(result.samples["position"][-1, :, 2] - 0.5 * WAY) - 3.5 * SPEED * WAY

    fleet = lw.Ensemble(scene_of(NOISE), vary=vary)
    found = lw.rare_event(fleet, deep_or_high, relative_error=0.2, save=lw.SaveAt(at=[T1]), **RUN)
    assert found.probability == pytest.approx(2.0 * ndtr(-3.5), rel=4.0 * found.relative_error)
    assert found.moved_size["start.velocity[2]"] == pytest.approx(3.75, abs=0.1)
    assert (
        "start.velocity[2] is on average 3.7" in found.answer or "start.velocity[2] is on average 3.8" in found.answer
    )
    assert found.answer.endswith("standard deviations from its mean, to both sides.")
    assert "wrench_noise" not in str(found)
    assert abs(found.noise_moved["wrench_noise"]) < 4.5


def test_more_draws_than_memory_holds_are_refused_before_anything_runs():
    settings = RUN | {"t1": 600.0, "save": lw.SaveAt(at=[600.0])}
    with pytest.raises(lw.SceneError, match=r'draws of noise a member: chains keep some 16,000 .* Give by="splitting"'):
        lw.rare_event(scene_of(NOISE), "position[0] - 99.0", **settings)


@pytest.mark.ci
def test_what_is_likely_is_sampled():
    found = lw.rare_event(fleet_of(), f"position[0] - {bound_of(0.02):.12g}", **RUN)
    assert found.estimator == "plain"
    assert found.probability == pytest.approx(0.02, abs=4.0 * 0.02 * found.relative_error)


@pytest.mark.ci
def test_noise_is_never_frozen():
    """Chains move the draws of the noise, too: frozen by row, they would meet the same few noises for ever."""
    # White noise S of force: the variance of the place is the integral of (tau (1 - exp(-(T - s) / tau)) S / m)^2.
    s = np.linspace(0.0, T1, 20_001)
    of_noise = np.trapezoid((TAU * (1.0 - np.exp(-(T1 - s) / TAU)) * 30.0 / (1.5 * float(VEHICLE.mass))) ** 2, s)
    bound = WAY - ndtri(1e-5) * np.sqrt(NORTH**2 + of_noise)
    fleet = lw.Ensemble(scene_of(NOISE), vary={"start.position[0]": lw.distributions.Normal(std=NORTH)})
    limit = f"position[0] - {bound:.12g}"
    found = lw.rare_event(fleet, limit, **RUN)
    assert found.estimator == "subset"
    # Steps of 0.1 s have 0.1 % less variance, 2 % less probability.
    assert abs(found.probability / 1e-5 - 1.0) < 3.0 * found.relative_error
    assert found.draws.shape == (len(found.weights), 90)
    assert found.noise_moved["wrench_noise"] > 4.5
    assert any("90" in message or "91" in message for message in found.messages)
    again = lw.prepare(fleet, of="position[0]", levels=True, draws="given", **RUN)(ndtr(found.normals), found.draws)
    assert (again > bound).all()


@pytest.mark.ci
def test_noise_alone_can_be_the_cause():
    s = np.linspace(0.0, T1, 20_001)
    of_noise = np.trapezoid((TAU * (1.0 - np.exp(-(T1 - s) / TAU)) * 30.0 / (1.5 * float(VEHICLE.mass))) ** 2, s)
    found = lw.rare_event(scene_of(NOISE), f"position[0] - {WAY - ndtri(1e-5) * np.sqrt(of_noise):.12g}", **RUN)
    assert abs(found.probability / 1e-5 - 1.0) < 3.0 * found.relative_error
    assert found.failing is None
    assert "the scene and its noise" in str(found)


@pytest.mark.ci
@pytest.mark.parametrize("limit, words", [
    ("floor", "neither a quantity nor an event of the scene"),
    ("outcome floor", "is there or not"),
    ({"status": "floor"}, 'rare_event(fleet, "floor")'),
    ({}, "is a status"),
    ("peak depth", "is a metric without a bound"),
    ("position", "is 3 numbers. Name one of its entries"),
    ("position[0] - 1000.0", "within 17 levels, each a tenth of the one before"),
    ("position[0] + 1000.0", "happens for each of"),
    ("position[1] - 1.0", "has the same value for most members"),
    (3.0, "is not an event"),
    ({"position[0]": {"near": 1.0}}, "is not a condition"),
    ({"max(depth)": {"above": 9.0}, "position[0]": {"above": 9.0}}, 'Give "max(position[0])"'),
])  # fmt: skip
def test_what_is_no_rare_event_is_refused(limit, words):
    with pytest.raises(lw.SceneError) as error:
        lw.rare_event(fleet_of(), limit, **RUN)
    assert words in str(error.value)


def test_faulty_arguments_are_told_at_once():
    with pytest.raises(lw.SceneError) as error:
        lw.rare_event(fleet_of(), "depth", relative_error=2.0, failed="drop", levels=True, **RUN)
    says(str(error.value), "failed = 'drop'", "relative_error = 2.0", "levels = True")
    for more, words in (({"cheaper": {"h": 1.0}}, "is not a list"), ({"cheaper": [{}]}, "names nothing that differs"),
                        ({"cheaper": [{"start.position[0]": 1.0}]}, "is of a number that varies"),
                        ({"most": 10}, "most = 10"), ({"by": np.zeros(2)}, r"by = \[0.0, 0.0\] is not known")):  # fmt: skip
        with pytest.raises(lw.SceneError, match=words):
            lw.rare_event(fleet_of(), "position[0] - 9.0", **more, **RUN)
    with pytest.raises(lw.SceneError, match="nothing that varies, and no noise"):
        lw.rare_event(scene_of(), "position[0] - 9.0", **RUN)
    table = lw.designs.Table({"vehicle.mass": [70.0]})
    with pytest.raises(lw.SceneError, match="gives members values and no distribution"):
        lw.rare_event(lw.Ensemble(scene_of(), sampling=table), "position[0] - 9.0", **RUN)


def test_the_picture(answer, tmp_path):
    pytest.importorskip("matplotlib")
    axes = lw.plots.rare(answer, path=tmp_path / "rare.png")
    assert len(axes) == 2
    assert (tmp_path / "rare.png").stat().st_size > 10_000
    from lgvi_warp.views.plots.rare import survival

    limits, chances = survival(answer.runs[0])
    assert (np.diff(limits) >= 0.0).all()
    assert chances[0] == 1.0
    # At the event the curve is the run's probability.
    at_event = chances[np.searchsorted(limits, 0.0)]
    assert at_event == pytest.approx(answer.runs[0].probability, rel=0.02)


@pytest.mark.slow
def test_the_snippets_of_the_page_on_rare_events(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    names = {"lw": lw}
    for text in blocks("docs/guide/rare_events.md", "python"):
        exec(text, names)
    # In 5 s a speed v leads tau (1 - exp(-5 / tau)) v down.
    way = TAU * (1.0 - np.exp(-5.0 / TAU))
    p = ndtr(-4.0 / np.hypot(0.5, 0.3 * way))
    assert abs(names["found"].probability / p - 1.0) < 3.0 * names["found"].relative_error
    assert (names["again"].samples["position"][-1, :, 2] > 9.0).all()
