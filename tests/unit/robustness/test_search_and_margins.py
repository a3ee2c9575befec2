# SPDX-License-Identifier: Apache-2.0
"""Searches whose members' numbers are made up, and margins of loops whose runs are."""

import dataclasses
import json
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.special import gamma
from scipy.stats import binom

import lgvi_warp as lw
from lgvi_warp.common.errors import Faults
from lgvi_warp.criteria import risk
from lgvi_warp.robustness.linear import loops
from lgvi_warp.robustness.linear.edges import edges
from lgvi_warp.robustness.linear.margins import Margins
from lgvi_warp.robustness.search import box, numbers, tune, worst_case
from lgvi_warp.robustness.search.box import SearchBox

SCENE = lw.Scene(lw.Vehicle(2.0, inertia=(1.0, 1.0, 1.0)), terms=[lw.terms.Drag(linear=[1.0] * 6)])
STARTS = {"start.position[2]": lw.distributions.Normal(std=1.0)}
OVER = {"vehicle.mass": (1.0, 4.0), "drag.linear[0]": (1.0, 100.0, "log")}


# Boxes and the search


def test_a_search_spends_its_budget_in_generations_corners_and_a_walk():
    """Evolution has 70 % of the budget; what is near the walk's end is found to the last step."""
    asked = []

    def cost(places):
        asked.append(len(places))
        assert (places >= 0.0).all()
        assert (places <= 1.0).all()
        return np.abs(places - (0.3, 0.8)).sum(axis=1)

    found = box.search(cost, 2, 640, 5, 3)
    # Three evolutions of 149 candidates each have nine generations of sixteen; then the four corners, then steps of four.
    assert len(found.restarts) == 3
    assert sum(asked) == found.runs <= 640
    assert asked[:27] == [16] * 27
    assert (asked[27], set(asked[28:])) == (4, {4})
    assert np.abs(found.at - (0.3, 0.8)).max() < 1e-4
    assert found.cost == np.abs(found.at - (0.3, 0.8)).sum()
    assert found.cost <= found.restarts.min()
    one = box.search(lambda places: places[:, 0], 1, 100, 0, 3)
    assert len(one.restarts) == 1
    assert one.runs <= 100
    # Too few are left for the corners of ten dimensions.
    sizes = []
    box.search(lambda places: (sizes.append(len(places)), places.sum(axis=1))[1], 10, 400, 0, 1)
    assert 1024 not in sizes
    assert sizes[-1] == 20
    with pytest.raises(ValueError, match="mine"):
        box.search(lambda places: (_ for _ in ()).throw(ValueError("mine")), 1, 100, 0, 1)


def test_a_search_differs_by_its_seed_alone():
    def places(seed):
        asked = []
        box.search(lambda x: (asked.append(x.copy()), x.sum(axis=1))[1], 2, 200, seed, 2)
        return np.concatenate(asked)

    one, same, other = places(1), places(1), places(2)
    assert np.array_equal(one, same)
    assert not np.array_equal(one[:16], other[:16])
    assert not np.array_equal(one[:16], one[80:96])


def radius_of(part, d):
    """The radius of a ball that takes this part of the unit cube."""
    return (part * gamma(1.0 + d / 2.0) / math.pi ** (d / 2.0)) ** (1.0 / d)


def two_peaks(d, seed, width):
    """(cost, least): a wide peak of height 1 and one of 1.5 with this width, at random places."""
    wide, narrow = np.random.default_rng((d, seed)).uniform(0.1, 0.9, (2, d))

    def cost(x):
        wide_, narrow_ = (((x - place) ** 2).sum(axis=1) / (2.0 * w**2) for place, w in ((wide, 0.3), (narrow, width)))
        return -np.exp(-wide_) - 1.5 * np.exp(-narrow_)

    return cost, float(cost(narrow[None])[0])


def peaks_found(d, most, part, seeds):
    """Number of narrow peaks, as large as a part of the cube, that evolution finds to a thousandth, and the whole search."""
    found = np.zeros(2, int)
    for seed in seeds:
        cost, least = two_peaks(d, seed, 0.5 * radius_of(part, d))
        runs = [box.search(cost, d, most, seed, 3, spend=spend) for spend in (False, True)]
        assert runs[1].cost <= runs[0].cost
        assert runs[0].runs <= runs[1].runs <= most
        assert runs[1].runs > 0.95 * most
        assert box.least_peak(runs[1].points) < part
        found += [run.cost < 0.999 * least for run in runs]
    return found.tolist()


@pytest.mark.parametrize(("d", "most", "part"), [(1, 2000, 0.02), (2, 5000, 0.002), (4, 20_000, 1e-3)])
def test_a_separate_peak_is_found_by_what_evolution_leaves(d, most, part):
    before, now = peaks_found(d, most, part, range(4))
    assert now == 4
    assert before < 4


@pytest.mark.slow
@pytest.mark.parametrize("d", [1, 2, 4, 6])
@pytest.mark.parametrize("times", [1.2, 3.0, 10.0])
def test_separate_peaks_are_found_over_seeds(d, times):
    """Parts of the box from that which is told as hardly missed, by the points that are left of 20,000 runs or 10,000."""
    part = times * box.least_peak({1: 9000, 6: 8000}.get(d, 11_000))
    before, now = peaks_found(d, 20_000 if d > 1 else 10_000, part, range(20))
    # The points are spread at random: a peak of `times` the part that is missed once in 20 is missed with 0.05^times.
    assert now >= binom.ppf(0.01, 20, 1.0 - 0.05**times)
    assert before <= 12


@pytest.mark.parametrize("d", [1, 2, 4, 6])
def test_spread_points_meet_what_they_are_said_to(d):
    """At least 95 % of balls anywhere with the reported part have a point within."""
    asked = []
    found = box.search(lambda x: (asked.append(x), np.zeros(len(x)))[1], d, 3000, d, 1, spend=True)
    assert found.runs <= 3000
    points = np.concatenate(asked)
    first = next(i for i, each in enumerate(asked) if len(each) == box.AT_ONCE)
    spread = np.concatenate(asked[first : first + 2])
    assert len(np.unique(spread, axis=0)) == len(spread)
    assert found.points > 2500 - 50 * d
    assert len(points) == found.runs
    radius = radius_of(box.least_peak(len(spread)), d)
    centres = np.random.default_rng(d).uniform(radius, 1.0 - radius, (4000, d))
    assert (cKDTree(spread).query(centres)[0] < radius).mean() > 0.94
    assert box.least_peak(0) == 1.0
    assert box.least_peak(1) == pytest.approx(0.95)
    assert box.least_peak(10_000) == pytest.approx(3e-4, rel=0.01)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["sphere", "valley", "many valleys"])
def test_an_answer_is_never_worse_for_what_is_spent_more(name):
    costs = {
        "sphere": lambda x: ((x - 0.37) ** 2).sum(axis=1),
        "valley": lambda x: (
            100.0 * ((4 * x[:, 1:] - 2) - (4 * x[:, :-1] - 2) ** 2).sum(axis=1) ** 2 + (3 - 4 * x[:, 0]) ** 2
        ),
        "many valleys": lambda x: (64 * (x - 0.6) ** 2 - 3 * np.cos(16 * np.pi * (x - 0.6)) + 3).sum(axis=1),
    }
    for d in (2, 6):
        for seed in range(3):
            less, more = (box.search(costs[name], d, 4000, seed, 3, spend=spend) for spend in (False, True))
            assert more.cost <= less.cost
            assert np.array_equal(more.restarts, less.restarts)


def test_places_of_the_cube_are_numbers_of_the_box():
    inside = SearchBox(("a", "b"), np.array([1.0, 1.0]), np.array([3.0, 100.0]), np.array([False, True]))
    np.testing.assert_allclose(inside.values(np.array([[0.25, 0.25], [0.5, 0.5]])), [[1.5, 100.0**0.25], [2.0, 10.0]])
    wide = SearchBox(("a",), np.array([0.1]), np.array([0.3]), np.array([True])).values(np.array([[0.0], [1.0]]))
    assert wide.tolist() == [[0.1], [0.3]]


@pytest.mark.parametrize(("bounds", "words"), [
    ({"vehicle.mass": (2.0, 2.0)}, 'over."vehicle.mass" = (2.0, 2.0) does not rise. Give (low, high)'),
    ({"vehicle.mass": (0.0, 2.0, "log")}, "has no logarithm. Give bounds above 0"),
    ({"vehicle.mass": (1.0, 2.0, "lin")}, 'over."vehicle.mass"'), ({"vehicle.mass": (1.0,)}, 'over."vehicle.mass"'),
    ({"vehicle.mas": (1.0, 2.0)}, "vehicle.mas"), ({"x": 3}, '"x"'),
    ({5: (1.0, 2.0)}, 'over = 5 is not a name of a number. Give {"heading_pid.kp": (0.5, 5.0)}'),
    ({}, 'over = {} maps no names to bounds. Give {"heading_pid.kp": (0.5, 5.0)}'), ([], "maps no names to bounds"),
])  # fmt: skip
def test_bounds_that_are_none(bounds, words):
    with pytest.raises(lw.SceneError) as caught:
        SearchBox.of("over", bounds, SCENE)
    assert words in str(caught.value)


def test_risks_at_their_ends():
    costs = np.array([[4.0, 1.0, 3.0, 2.0]])
    assert lw.metrics.CVaR(0.25)(costs).tolist() == [4.0]
    assert lw.metrics.CVaR(0.5)(costs).tolist() == [3.5]
    assert lw.metrics.CVaR()(costs).tolist() == [4.0]
    assert lw.metrics.CVaR(0.375)(costs)[0] == pytest.approx((4.0 + 0.5 * 3.0) / 1.5)
    assert (lw.metrics.CVaR(1.0)(costs)[0], lw.metrics.CVaR().share) == (2.5, 0.05)
    assert str(lw.metrics.CVaR(0.125)) == "mean of the worst 12.5 %"
    assert risk.risk_of(Faults(), 0.25)(costs).tolist() == [1.0]
    assert risk.risk_of(Faults(), 0.26)(costs).tolist() == [2.0]
    assert risk.risk_of(Faults(), "mean")(costs).tolist() == [2.5]
    assert str(risk.risk_of(Faults(), 0.8)) == "80 % quantile"
    lost = np.array([[1.0, 1.0, 1.0, 1.0, np.inf]])
    assert (lw.metrics.CVaR(0.2)(lost)[0], risk.risk_of(Faults(), 0.8)(lost)[0]) == (np.inf, 1.0)
    for wrong in (0.0, 1.0, 1, "means"):
        faults = Faults()
        assert str(risk.risk_of(faults, wrong)) == "mean"
        assert faults
    for wrong in (0.0, 1.1, -1.0):
        with pytest.raises(
            lw.SceneError, match=r"CVaR\.share = .* is not a part. Give a number in \(0, 1\], such as 0\.05"
        ):
            lw.metrics.CVaR(wrong)
    given = lw.metrics.CVaR(0.3)
    assert risk.risk_of(Faults(), given) is given


# One number of each member


class Told:
    """Stands for `prepare`: notes what it is asked for, and answers by a function of members' numbers."""

    common_noise = False

    def __init__(self, monkeypatch, answer):
        self.asked, self.answer, self.states = [], answer, self.of_states
        monkeypatch.setattr(numbers, "prepare", self.prepare)

    def prepare(self, *arguments, **settings):
        self.asked.append((arguments, settings))
        return self

    def __call__(self, X):
        return self.answer(X)

    def of_states(self, *, position, parameters, indices, seed, **state):
        self.asked.append((position, parameters, indices, seed))
        return self.answer(position[:, 2], parameters, indices, seed)


def test_numbers_of_quantities_and_of_metrics(monkeypatch):
    told = Told(monkeypatch, lambda X: np.array([1.0, np.inf]))
    plain = numbers.Numbers(SCENE, ["a"], "of", "max(depth)", {"h": 0.1})
    assert (plain.label, plain.of_metric) == ("max(depth)", False)
    assert plain(lambda run: run(None)).tolist() == [1.0, np.inf]
    assert told.asked == [((SCENE, ["a"], "max(depth)"), {"failed": "nan", "h": 0.1})]
    assert numbers.Numbers(SCENE, None, "of", test_risks_at_their_ends, {}).label == "test_risks_at_their_ends"
    with pytest.raises(lw.SceneError, match=r"of = '3 numbers' is not a single number. Name one of its entries"):
        plain(lambda run: np.zeros((2, 3)))
    for of in ("iae depth", lw.metrics.IAE("depth"), {"type": "iae", "of": "depth"}):
        told.asked.clear()
        metric = numbers.Numbers(SCENE, None, "minimise", of, {"h": 0.1})
        assert (metric.label, metric.of_metric) == ("iae depth", True)
        (((scene, names, interest), settings),) = told.asked
        assert (scene, names, settings) == (SCENE, None, {"failed": "nan", "h": 0.1})
        assert (interest.label, interest.fields, interest.may_be_infinite) == ("iae depth", ("position",), True)
        assert [(name, metric.key) for name, metric in interest.gathered(()).items()] == [
            ("each iae depth", "iae depth")
        ]
        each = SimpleNamespace(value=np.array([[[1.0, 2.0, np.inf]]]))
        status = np.array([0, lw.Status.NON_FINITE, lw.Status.FLOOR], np.uint8)
        result = SimpleNamespace(status=status, statistics={"each iae depth": each})
        np.testing.assert_array_equal(interest.values(result)[:, 0], [1.0, np.nan, np.inf])


def test_the_worst_case_of_a_sum(monkeypatch):
    told = Told(monkeypatch, lambda X: X[:, 0] - np.log10(X[:, 1]))
    shares = []
    found = worst_case.worst_case(SCENE, OVER, "depth", budget=400, seed=2, progress=shares.append, h=0.1)
    assert found.parameters == {"vehicle.mass": 4.0, "drag.linear[0]": 1.0}
    assert found.value == 4.0
    assert found.at_bounds == {"vehicle.mass": "high", "drag.linear[0]": "low"}
    assert (found.of, found.worst) == ("depth", "largest")
    ((scene, names, of), settings) = told.asked[0]
    assert (scene, names, of) == (SCENE, list(OVER), "depth")
    assert settings == {"failed": "nan", "h": 0.1, "common_noise": True}
    assert shares == sorted(shares)
    assert shares[-1] == found.runs / 400
    assert len(found.restarts) == 3
    assert found.restarts.max() <= 4.0
    assert found.fleet.members == 1
    assert found.fleet.select(0, 1).parameters["vehicle.mass"] == 4.0
    least = worst_case.worst_case(lw.Ensemble(SCENE, 3, 1), OVER, "depth", worst="smallest", budget=400)
    assert least.value == 1.0 - 2.0
    assert least.parameters == {"vehicle.mass": 1.0, "drag.linear[0]": 100.0}
    lost = Told(monkeypatch, lambda X: np.where(X[:, 0] > 3.0, np.nan, X[:, 0]))
    for worst in ("largest", "smallest"):
        failed = worst_case.worst_case(SCENE, OVER, "depth", worst=worst, budget=400)
        assert failed.value == math.inf
        assert failed.parameters["vehicle.mass"] > 3.0
        assert failed.runs < 100
    assert lost.asked
    for budget in (15, 16.0):
        with pytest.raises(lw.SceneError, match=r"budget = .* is less than a generation. Give 16 or more"):
            worst_case.worst_case(SCENE, OVER, "depth", budget=budget)
    assert worst_case.worst_case(SCENE, {"vehicle.mass": (1.0, 2.0)}, "depth", budget=16).runs <= 16


def test_worst_cases_in_words():
    one = worst_case.WorstCase({"a": 1.23456789, "b": 2.0}, 3.0, "depth", "largest", {"a": "", "b": "high"},
                               np.array([3.0, 2.5]), 64, None)  # fmt: skip
    assert str(one).splitlines() == ["bound       a lower bound of the largest; restarts: 3, 2.5", one.answer]
    assert "an upper bound of the smallest;" in str(dataclasses.replace(one, worst="smallest"))
    assert "; a separate peak in 0.0003 of the box or more would be found with probability 95 %\n" in str(
        dataclasses.replace(one, points=10_000)
    )
    assert (one.unseen, dataclasses.replace(one, points=10_000).unseen) == (1.0, box.least_peak(10_000))
    lost = dataclasses.replace(one, value=math.inf)
    assert str(lost) == lost.answer


def test_tuning_meets_the_same_members_and_then_fresh_ones(monkeypatch):
    """The cost of a member is its start's depth, squared, and the distance of the two numbers from the best ones."""

    def answer(depth, parameters, indices, seed):
        mass, drag = parameters["vehicle.mass"], parameters["drag.linear[0]"]
        return depth**2 + (mass - 2.5) ** 2 + np.log10(drag / 10.0) ** 2

    told = Told(monkeypatch, answer)
    shares, fleet = [], lw.Ensemble(SCENE, 5, 7, STARTS)
    found = tune.tune_gains(fleet, OVER, "depth", budget=5 * 300, seed=3, progress=shares.append, h=0.1)
    depth = fleet.select(0, 5).position[:, 2]
    assert list(found.parameters.values()) == pytest.approx([2.5, 10.0], rel=1e-3)
    assert found.cost == pytest.approx((depth**2).mean(), rel=1e-5)
    assert found.before == {"vehicle.mass": 2.0, "drag.linear[0]": 1.0}
    others = lw.Ensemble(SCENE, 20, 8, STARTS).select(0, 20).position[:, 2]
    assert found.fresh_cost == pytest.approx((others**2).mean(), rel=1e-5)
    assert (found.members, found.fresh) == (5, 20)
    assert found.fresh_before == pytest.approx((others**2).mean() + 0.25 + 1.0)
    assert found.optimism == found.fresh_cost - found.cost
    assert (found.of, found.risk, found.at_bounds) == ("depth", "mean", ())
    assert len(found.restarts) == 1
    searched = sum(len(position) for position, *_ in told.asked[1:]) - 2 * 20
    assert found.runs == searched + 40
    assert shares[-1] == min(1.0, searched / 1500)
    assert searched <= 1500
    position, parameters, indices, seed = told.asked[1]
    assert seed == 7
    assert indices.tolist() == [0, 1, 2, 3, 4] * 16
    assert np.array_equal(position[:5, 2], depth)
    assert (np.ptp(parameters["vehicle.mass"].reshape(16, 5), axis=1) == 0.0).all()
    assert told.asked[-1][3] == 8
    assert told.asked[-1][2].tolist() == list(range(20))
    worst = tune.tune_gains(fleet, {"vehicle.mass": (3.0, 4.0)} | {"drag.linear[0]": (1.0, 100.0)}, "depth", budget=600,
                            fresh=0,
                      risk=lw.metrics.CVaR(0.2))  # fmt: skip
    assert worst.at_bounds == ("vehicle.mass",)
    assert math.isnan(worst.fresh_cost)
    assert worst.fresh == 0
    assert worst.cost == pytest.approx((depth**2).max() + 0.25, rel=1e-4)
    assert worst.runs <= 600
    alone = tune.tune_gains(lw.Ensemble(SCENE, 5, 7), OVER, "depth", budget=100)
    assert alone.fresh == 0
    assert math.isnan(alone.fresh_before)
    lost = Told(
        monkeypatch, lambda depth, parameters, indices, seed: np.where(parameters["vehicle.mass"] > 2.0, np.nan, 1.0)
    )
    assert tune.tune_gains(fleet, OVER, "depth", budget=200).parameters["vehicle.mass"] <= 2.0
    assert lost.asked
    for budget, words in (
        (79, "budget = 79 is less than a generation of all members. Give 80 or more"),
        (1e3, "budget = 1000.0"),
    ):
        with pytest.raises(lw.SceneError) as caught:
            tune.tune_gains(fleet, OVER, "depth", budget=budget)
        assert words in str(caught.value)
    with pytest.raises(lw.SceneError, match=r"varies by member too. Leave it out of one of them"):
        tune.tune_gains(fleet, {"start.position[0]": (0.0, 1.0)}, "depth")
    for fresh in (-1, 1.5):
        with pytest.raises(lw.SceneError, match=r"is not a number of members. Give a whole number, 0 for none"):
            tune.tune_gains(fleet, OVER, "depth", fresh=fresh)


def test_tuned_numbers_in_words():
    one = tune.Tuned(
        {"a": 1.5, "b": 2.0}, {"a": 1.0, "b": 3.0}, 4.0, 4.5, 9.0, "depth", "mean", 5, 20, (), np.ones(1), 100
    )
    assert str(one).splitlines() == ["search      4 over its 5 members (optimism 0.5); 100 runs", one.answer]
    bound = dataclasses.replace(one, at_bounds=("a", "b"))
    assert str(bound).splitlines()[1] == "bounds      may be too narrow, they are reached: a, b"


# Margins


def test_margins_in_words_and_by_member():
    values = {"gain_lower": np.array([0.5, 0.25, np.nan, 0.125]), "gain_upper": np.array([2.0, 8.0, np.nan, 4.0]),
              "delay": np.array([0.3, 0.1, np.nan, 0.2])}  # fmt: skip
    by_runs = {name: 10.0 * column for name, column in values.items()}
    found = Margins("heading_pid", values, by_runs, np.array(["", "", "at its limit: fins[1]", ""], dtype=object), 0.01)
    lines = str(found).splitlines()
    assert lines[:2] == ["heading_pid: margins of 4 members",
                         "1 of them have none (1: at its limit: fins[1]); the others:"]  # fmt: skip
    assert found.steady.tolist() == [True, True, False, True]
    assert found.reasons == {"at its limit: fins[1]": 1}
    plain = found.to_dict()
    assert plain["why"] == ["", "", "at its limit: fins[1]", ""]
    assert plain["eigenvalues"]["gain_upper"] == [2.0, 8.0, None, 4.0]
    assert json.loads(json.dumps(plain, allow_nan=False))["runs"]["delay"] == [3.0, 1.0, None, 2.0]
    assert lines[2].split() == ["0", "%", "5", "%", "25", "%", "50", "%", "75", "%", "95", "%", "100", "%"]
    assert lines[4].split() == ["gain_upper", "2", "2", "2", "4", "8", "8", "8"]
    assert lines[5].split()[:3] == ["delay", "s", "0.1"]
    assert found.percentiles([50.0])["delay"].tolist() == [0.2]
    assert found.members == 4
    x, share = found.curve("gain_upper")
    assert x.tolist() == [2.0, 4.0, 8.0]
    assert share == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert found.curve("delay", "runs")[0].tolist() == [1.0, 2.0, 3.0]
    assert found.curve("delay", "eigenvalues")[0][0] == 0.1
    assert (found.worst().tolist(), found.worst(2, "delay").tolist()) == ([2, 0, 3, 1], [2, 1])
    assert found.worst(name="gain_lower").tolist() == [2, 0, 1, 3]
    runs = Margins("all laws", {}, {"delay": np.array([0.2, np.inf])}, np.array(["", ""], dtype=object), 0.01)
    assert runs.worst(1).tolist() == [0]
    assert "none" not in str(runs)
    assert runs.curve("delay")[0].tolist() == [0.2, np.inf]
    assert runs.to_dict()["runs"] == {"delay": [0.2, "inf"]}
    assert "eigenvalues" not in runs.to_dict()
    none = Margins("all laws", {"delay": np.full(2, np.nan)}, {}, np.array(["failed", "failed"], dtype=object), 0.01)
    assert np.isnan(none.percentiles()["delay"]).all()
    assert len(none.percentiles()["delay"]) == 7
    assert [len(column) for column in none.curve("delay")] == [0, 0]


@pytest.mark.parametrize(("call", "words"), [
    (lambda margins: margins.curve("gain_uper"), "name = 'gain_uper' is not known. Did you mean 'gain_upper'?"),
    (lambda margins: margins.curve("gain_upper", by="run"), "by = 'run' is not known. Did you mean 'runs'?"),
    (lambda margins: margins.curve("gain_upper", by="runs"), "name = 'gain_upper' is not known. Known: delay."),
    (lambda margins: margins.worst(name="delays"), "name = 'delays' is not known. Did you mean 'delay'?"),
    (lambda margins: margins.worst(-1), "count = -1 is not a whole number from 0"),
    (lambda margins: margins.percentiles([50.0, 101.0]), "of[1] = 101.0 is above 100. Give a number [%] from 0 to 100."),
    (lambda margins: margins.percentiles([[50.0]]), "of[0] = [50.0] has shape (1,). Give a number [%]."),
])  # fmt: skip
def test_what_margins_do_not_have_is_refused(call, words):
    upper, delay = {"gain_upper": np.array([2.0, 8.0])}, {"delay": np.array([0.3, 0.1])}
    found = Margins("heading_pid", upper | delay, delay, np.array(["", ""], dtype=object), 0.01)
    with pytest.raises(lw.SceneError, match=re.escape(words)):
        call(found)


@pytest.mark.parametrize("guess", [np.nan, 0.5, 3.0, 3.3, 20.0, 1e9])
def test_edges_are_found_from_any_guess(guess):
    """Members hold below 3.3, 1.0000001 and 50 upwards, and down to 0.2."""
    limits = np.array([3.3, 1.0000001, 50.0, 0.2])
    last = np.array([100.0, 100.0, 40.0, 0.01])

    def holds(values, members):
        assert ((values <= 100.0 * (1 + 1e-12)) & (values >= 0.01 * (1 - 1e-12))).all()
        return np.where(last[members] > 1.0, values < limits[members], values > limits[members])

    found = edges(holds, np.ones(4), last, np.full(4, guess), 1e-3)
    inner, outer = found.T
    assert inner[0] < 3.3 <= outer[0] < inner[0] * np.exp(1.0011e-3)
    assert outer[3] <= 0.2 < inner[3]
    assert inner[1] <= 1.0000001 <= outer[1] < np.exp(1.0011e-3)
    assert outer[2] == np.inf
    assert inner[2] == pytest.approx(40.0)
    assert inner[3] / outer[3] < np.exp(1.0011e-3)
    whole = edges(
        lambda values, members: values <= 7.0,
        np.zeros(2),
        np.array([100.0, 5.0]),
        np.full(2, guess),
        1.0,
        whole_numbers=True,
    )
    assert whole.tolist() == [[7.0, 8.0], [5.0, np.inf]]
    nobody = edges(holds, np.full(4, np.nan), last, np.full(4, guess), 1e-3)
    assert np.isnan(nobody).all()


@pytest.mark.parametrize(("thirds", "settles", "near"), [
    ((1.0, 0.8, 0.6), True, False), ((1.0, 0.8, 0.7), True, True), ((1.0, 0.8, 0.78), False, False),
    # What has faded to a 1e-5th, in which slower modes do not shrink yet, is judged by a longer run.
    ((1.0, 8e-6, 9e-6), False, True),
    ((1.0, 3e-7, 3e-7), True, True), ((1.0, 2e-6, 2e-6), False, True),
    # It grows until something holds it, where it swings by chance a little less.
    ((0.01, 3.0, 2.8), False, False), ((1.0, 1.3, 1.1), False, False),
    # Nothing but round-off swings, or nothing at all, or no number is left.
    ((0.0, 0.0, 0.0), True, False), ((1e-12, 1e-12, 2e-12), True, False), ((np.inf, np.nan, np.nan), False, False),
])  # fmt: skip
def test_loops_settle_where_their_envelope_shrinks(thirds, settles, near):
    found = loops.shrinks(np.array([thirds, (1.0, 0.5, 0.1)]).T, 0.1)
    assert [each.tolist() for each in found] == [[settles, True], [near, False]]


def test_a_command_is_at_its_limit_where_it_could_be_more():
    command = np.array([[0.0, 0.35, -0.35, 0.34, 1e5, np.nan]])
    limits = np.array([[0.0, 0.35, 0.35, 0.35, np.inf, 0.35]])
    assert loops.at_limit(command, limits).tolist() == [[False, True, True, False, False, False]]
