# SPDX-License-Identifier: Apache-2.0
"""Tables of speed from clocks that the tests make up, and files of studies."""

import dataclasses
import json
import math
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.criteria import files
from lgvi_warp.measuring import cost, speed, term_cost
from lgvi_warp.measuring.cost import Cost, Kind
from lgvi_warp.methods.method import Method
from lgvi_warp.runs.request import ensemble_of, scene_of


class Clock:
    """Time that only the test moves on."""

    def __init__(self):
        self.time = 0.0

    def __call__(self):
        return self.time


def test_what_each_term_costs():
    """Ten nanoseconds without terms, seven more for each of a scene's."""
    drag, wrench = lw.terms.Drag(linear=[1.0] * 6), lw.terms.Wrench(force=[1.0, 0.0, 0.0])
    scene = dataclasses.replace(speed.example(), terms=[drag, wrench])
    plans = term_cost.plans_of_terms(scene, 16, "psi_x", 0.02, "float32")
    prices = [Cost(1e-3 * (10.0 + 7.0 * len(plan.ensemble.scene.terms)) / plan.grid.h, 1.0) for plan in plans.values()]
    names = [("none", 10.0), ("drag", 17.0), ("wrench", 17.0), ("all terms", 24.0)]
    assert term_cost.priced(plans, prices) == [
        {"term": name, "method": "psi_x", "dtype": "float32", "ns_per_vehicle_step": ns, "more_than_none": ns - 10.0}
        for name, ns in names]  # fmt: skip
    assert all(plan.ensemble.members == 16 and plan.grid.h == 0.02 and plan.grid.steps == 10 for plan in plans.values())
    assert list(term_cost.plans_of_terms(dataclasses.replace(scene, terms=[drag]), 4, "psi_x", 0.02, None)) == [
        "none", "drag"]  # fmt: skip
    run = dataclasses.replace(scene.run, method="rk4", step=0.05)
    ending = dataclasses.replace(scene, run=run, events=[{"type": "floor", "depth": 20.0}])
    for plan in term_cost.plans_of_terms(ending, 64, None, 0.05, None).values():
        assert (plan.method.name, plan.dtype, plan.grid.h, plan.ensemble.members) == ("rk4", "float64", 0.05, 64)
        assert not plan.ensemble.scene.events
    with pytest.raises(
        lw.SceneError, match=r"scene\.terms is empty. Give the scene terms whose cost is to be measured"
    ):
        lw.bench.term_cost(speed.example())


def test_the_least_reading_counts_without_a_first_call():
    clock = Clock()
    lengths = {"a": iter([3.0, 1.0, 2.0]), "b": iter([5.0, 6.0, 4.0])}
    calls = []

    def call(name):
        calls.append(name)
        clock.time += next(lengths[name])

    assert speed.least([lambda: call("a"), lambda: call("b")], 3, clock=clock) == [1.0, 4.0]
    assert calls == ["a", "b"] * 3


# Costs


def test_costs_that_are_unsure_are_read_again():
    """One of two kernels is disturbed: it alone is read again, at most three times, until two readings are near."""
    left = [iter([1.0] * 9), iter([1.0, 9.0, 5.0, 3.0, 2.0, 2.05] + [1.0] * 9)]
    read = []

    def of_kinds(which):
        read.append(list(which))
        return np.array([[next(left[i]) for _ in range(2)] for i in which])

    kinds = [Kind("quiet", 0.5), Kind("busy", 0.5)]
    seconds = cost.readings(kinds, of_kinds)
    assert read == [[0, 1], [1], [1], [1]]
    nan = np.nan
    np.testing.assert_array_equal(seconds, [[1, 1, *[nan] * 6], [1, 9, 5, 3, 2, 2.05, 1, 1]])
    assert cost.of_steps(kinds, seconds) == [(1.0, 1.0), (1.0, np.median([1, 9, 5, 3, 2, 2.05, 1, 1]))]


def test_disagreement_is_above_its_bound():
    assert cost.disagreement([("a", 1.3)]) is None
    assert cost.disagreement([]) is None
    text = cost.disagreement([("b", 1.31), ("a", 2.0), ("b", 4.0), ("b", 3.0)])
    assert text == ("readings of cost disagree: their median is above the least, which is taken, for b (4 times), a (2 "
                    "times); other programs run at the same time, and costs that lie closer are not told apart. Run again "
                    "on an idle machine")  # fmt: skip
    assert " and 1 more; " in cost.disagreement([(f"m{i}", 2.0 + i) for i in range(7)])
    assert " more" not in cost.disagreement([(f"m{i}", 2.0 + i) for i in range(6)])
    head = "CPU time of one thread, the least of several readings; their median is at most "
    assert cost.agreement_text([1.0, 2.345, math.inf]) == f"{head}2.35 times that"
    assert cost.agreement_text([]) == cost.agreement_text([math.nan]) == f"{head}1.00 times that"


def test_readings_near_the_least():
    nan = np.nan
    ones = [Kind("a", 1.0), Kind("b", 1.0), Kind("c", 1.0)]
    readings = np.array([[1.0, 1.05], [1.0, 1.051], [1.0, nan]])
    assert cost.confirmed(ones, readings) == [True, False, False]
    assert cost.confirmed([Kind("a", 1.0)], np.array([[1.0]])) == [False]
    growing = [Kind("a", 1.0, True), Kind("a", 2.0, True)]
    assert cost.confirmed(growing, np.array([[1.0, 3.0], [1.0, 3.0]])) == [True, False]
    # Only readings of the very same step can disagree where longer ones are more work.
    (_, short), (_, long) = cost.of_steps(growing, np.array([[1.0, 3.0, 3.0], [8.0, 8.0, 8.0]]))
    assert (short, long) == (3.0, 1.0)


def test_launches_are_long_enough_to_time():
    """A step that costs `price` for each vehicle is launched so often that it takes two milliseconds."""
    now, asked = SimpleNamespace(time=0.0), []

    class Packets:
        def __init__(self, plan, members):
            assert members == ("members", 0, plan.ensemble.members)
            self.plan = plan

        def advance(self, first, stop):
            asked.append((first, stop))
            now.time += self.plan.price * (stop - first) * self.plan.ensemble.members

    def plan(price, n=100, stages=1):
        return SimpleNamespace(price=price, spec=SimpleNamespace(width=8), method=SimpleNamespace(stages=(1.0,) * stages),
                               ensemble=SimpleNamespace(members=n, select=lambda a, b: ("members", a, b)))  # fmt: skip

    calls, steps = cost.launches([plan(20e-9), plan(1.0), plan(1e-15), plan(20e-9, 100, 10), plan(20e-9, 2)],
                                 make=Packets, clock=lambda: now.time)  # fmt: skip
    assert [stop for _, stop in asked] == [200, 200, 200, 20, 2500]
    assert all(first == 0 for first, _ in asked)
    assert steps[:, 0] == pytest.approx([1000 * 100, 10 * 100, 100_000 * 100, 1000 * 100, 50_000 * 2], rel=1e-2)
    begun = now.time
    calls[0]()
    assert now.time - begun == pytest.approx(2e-3, rel=1e-2)


# Files


def test_numbers_that_json_cannot_hold_are_none():
    content = {"a": math.inf, "b": [1.0, math.nan, (2, np.float32(3.0))], "c": np.array([[1.0, -math.inf]]), "d": "x",
               "e": None}  # fmt: skip
    plain = files.finite_or_none(content)
    assert plain == {"a": None, "b": [1.0, None, [2, 3.0]], "c": [[1.0, None]], "d": "x", "e": None}
    assert type(plain["b"][2][1]) is float
    assert files.with_missing_as(plain, 7.0) == {
        "a": 7.0,
        "b": [1.0, 7.0, [2, 3.0]],
        "c": [[1.0, 7.0]],
        "d": "x",
        "e": 7.0,
    }


class Study(files.Saved):
    study = "example"
    answer = "One and a half."

    def _content(self):
        return {"x": 1.5}

    def rows(self):
        return [{"x": 1.5, "y": "a"}]

    @classmethod
    def _of_content(cls, content):
        assert content == {"x": 1.5}
        return cls()


def test_a_study_writes_two_files(tmp_path):
    paths = Study().save(tmp_path / "new" / "folder")
    assert [path.relative_to(tmp_path).as_posix() for path in paths] == [
        "new/folder/example.json",
        "new/folder/example.csv",
    ]
    assert (paths[0].read_text(), paths[1].read_text().split()) == (
        '{\n "answer": "One and a half.",\n "x": 1.5\n}', ["x,y", "1.5,a"])  # fmt: skip
    named = Study().save(tmp_path, "other")
    assert [path.name for path in named] == ["other.json", "other.csv"]
    assert json.loads(named[0].read_text()) == {"answer": Study.answer, "x": 1.5}
    assert isinstance(Study.load(named[0]), Study)


def test_a_damaged_file_is_said_to_be_damaged(tmp_path):
    for error in (ValueError("a"), KeyError("b"), TypeError("c"), AttributeError("d")):
        with pytest.raises(lw.SceneError) as caught, files.of_study(tmp_path / "x.json"):
            raise error
        head = f"{tmp_path / 'x.json'} is damaged, or of another version"
        assert str(caught.value) == f"{head}: {error}. Run the study again."
        assert caught.value.__cause__ is error
    with pytest.raises(lw.SceneError, match="itself"), files.of_study(tmp_path):
        raise lw.SceneError(["itself"])
    with pytest.raises(OSError, match="gone"), files.of_study(tmp_path):
        raise OSError("gone")


def test_whose_members_a_study_is_about(scene):
    fleet = lw.Ensemble(scene, 3)
    assert ensemble_of(fleet) is fleet
    assert scene_of(fleet) is fleet.scene
    assert scene_of(scene) is scene
    assert ensemble_of(scene).members == scene.ensemble_settings.members
    with pytest.raises(lw.SceneError) as caught:
        ensemble_of(3)
    assert str(caught.value) == "fleet = 3 is neither an Ensemble nor a Scene. Give lw.Scene(...) or lw.Ensemble(...)."
    with pytest.raises(lw.SceneError) as caught:
        scene_of(3, "scene")
    assert str(caught.value) == "scene = 3 is neither an Ensemble nor a Scene. Give lw.Scene(...) or lw.Ensemble(...)."


def test_speeds_beside_the_peak_of_the_core():
    plan = SimpleNamespace(method=Method("psi_s"), dtype="float64", spec=SimpleNamespace(width=8))
    record = {"method": "psi_s", "dtype": "float64", "width": 8, "ns_per_vehicle_step": 10.0, "operations": 501,
              "peak_gfma": 50.0, "part_of_peak": round(501 / 1e-8 / 10e10, 3)}  # fmt: skip
    assert speed.record(plan, 1e-8, 5e10, 501) == record
    assert speed.record(plan, 1e-8, 5e10, None) == record | {"operations": None, "part_of_peak": None}
    example = speed.fleet(5, lw.terms.Drag(linear=[1.0] * 6))
    assert (example.members, example.seed) == (5, 1)
    assert [term.key for term in example.scene.terms] == ["drag"]
    assert example.vary["start.angular_velocity"].relative == 0.1
    assert example.scene.vehicle.mass == 123.8
    packets, plan = mock.Mock(), mock.Mock()
    plan.grid.steps = 100
    call = speed.stepper(plan, make=packets)
    plan.compile.assert_called_once_with()
    assert packets.call_args.args[0] is plan
    call()
    packets.return_value.advance.assert_called_once_with(0, 100)
