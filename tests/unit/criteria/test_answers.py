# SPDX-License-Identifier: Apache-2.0
"""The sentence at the end of every study, by content: its numbers are computed here from the arrays of the answer."""

import dataclasses
import itertools
import json
import re

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.accuracy.stability.map import Cell
from lgvi_warp.common.status import Status
from lgvi_warp.common.summaries import percent
from lgvi_warp.criteria.files import Saved
from lgvi_warp.criteria.success import Success
from lgvi_warp.linear import Margins
from lgvi_warp.results.outcomes import answer_of
from lgvi_warp.results.quantities import unit_of
from lgvi_warp.store.layout import units_of_numbers
from lgvi_warp.studies import Derivatives, RareEvent
from lgvi_warp.uncertainty.sensitivity.given_data import GivenDataIndices
from lgvi_warp.uncertainty.sensitivity.indices import MorrisEffects, SobolIndices
from tests.studies.test_saved_answers import steady, tuned
from tests.support.made import made
from tests.support.swept import N, swept
from tests.unit.accuracy.test_stability_maps import made_map
from tests.unit.cli.test_study_verbs import loops, worst
from tests.unit.measuring.test_comparison import measured, suggested, traded
from tests.unit.uncertainty.test_estimating import answer as estimated

# Characters of a sentence, names of usual length in it.
LONGEST = 230


def numbers(text):
    """All numbers of a text that stand alone, in their order."""
    return [float(word) for word in re.findall(r"(?<![\w.\[])-?\d[\d.,]*(?:e[-+]?\d+)?", text.replace(",", ""))]


def near(text, *expected):
    """A text has these numbers, among others and in this order, to the digits that it prints."""
    found = iter(numbers(text.rstrip(".")))
    for value in expected:
        assert any(each == pytest.approx(value, rel=6e-3) for each in found), (value, text)


def one_sentence(text):
    assert text == text.strip()
    assert text.endswith(".")
    assert "\n" not in text
    assert "nan" not in text
    assert len(text) <= LONGEST, len(text)
    return text


def ends(passed):
    """Wilson's interval of a sweep of 40 members at 90 % [%]."""
    return [100.0 * end for end in stats.binomtest(passed, N).proportion_ci(0.9, "wilson")]


# Sweeps


def test_a_single_best_and_a_single_worst_cell():
    counts = [20, 36, 24, 4]
    sweep = swept(
        [count / N for count in counts].__getitem__, {"vehicle.mass": [5, 6], "law.kp": [1.0, 2.0]}, cases="a"
    )
    text = one_sentence(sweep.answer)
    best, rest = text.split("; worst: ")
    assert best.startswith("Best: vehicle.mass 5 kg, law.kp 2.0: ")
    near(best, 5, 2, 90.0, *ends(36), N)
    assert rest.startswith("vehicle.mass 6 kg, law.kp 2.0: ")
    near(rest, 6, 2, 10.0, *ends(4))
    assert "members hold" in best


def test_ties_of_a_sweep_are_listed_and_cut():
    shares = {(1, 1): 1.0, (1, 2): 1.0, (2, 1): 0.5, (2, 2): 0.0}
    points = list(itertools.product((1, 2), (1, 2)))
    sweep = swept(lambda i: shares[points[i]], {"p": [1, 2], "q": [1, 2]}, cases="a")
    assert sweep.answer.startswith("Best: p 1, q 1 or 2: 100 % (")
    near(sweep.answer, 1, 1, 2, 100.0, *ends(N), N, 2, 2, 0.0, *ends(0))
    # No rectangle of values: points by themselves, and of five the rest is counted.
    sweep = swept(lambda i: float(i % 2), {"p": [1, 2, 3], "q": [1, 2, 3]}, cases="a")
    assert sweep.answer.startswith("Best: p 1, q 2 or 3 more: 100 %")
    assert "; worst: p 1, q 1 or 4 more: 0 %" in one_sentence(sweep.answer)
    line = swept(lambda i: float(i < 3), {"p": [1, 2, 3, 4, 5]}, cases="a")
    assert line.answer.startswith("Best: p 1 or 2 or 1 more: 100 %")
    assert "; worst: p 4 or 5: 0 %" in line.answer
    cases = swept([0.5, 0.5, 0.25].__getitem__, cases="abc")
    assert cases.answer.startswith("Best: a or b: 50 %")
    assert "; worst: c: 25 %" in cases.answer


def test_a_sweep_without_a_best_cell():
    alike = swept(lambda i: 0.75, {"p": [1, 2]}, cases="ab").answer
    assert alike.startswith("In all 4 cells 75 % (")
    near(alike, 4, 75.0, *ends(30), N)
    alone = swept(lambda i: 0.75, cases="a").answer
    assert alone.startswith("75 % (")
    assert swept(lambda i: 1.0, cases="ab", refused=(0, 1)).answer == "No cell ran: 2 cells refused."
    left = swept(lambda i: 1.0, cases="ab", refused=(1,)).answer
    assert left.startswith("In a 100 % (")
    assert left.endswith("hold; 1 cell refused.")
    # Without conditions of its own, success is to reach the end.
    plain = dataclasses.replace(swept(lambda i: 1.0, cases="a", failed=8), conditions=Success())
    near(plain.answer, 80.0, *ends(32), N)
    assert plain.answer.endswith("members reach the end.")


def test_a_share_is_0_or_100_percent_of_none_or_all_alone():
    assert (percent(0.0, 3), percent(1.0, 3), percent(0.5, 3)) == ("0", "100", "50")
    for value in (1.0 - 1e-6, 1.0 - 1e-12):
        assert float(percent(value, 3)) == pytest.approx(100.0 * value, rel=1e-13)
        assert percent(value, 3) != "100"
    assert percent(np.nan, 3) == "nan"


# Sensitivity


def sobol(total, half, quantities=("depth",)):
    table, width = np.atleast_2d(total), np.atleast_2d(half)
    names = tuple(f"f{i}" for i in range(table.shape[1]))
    return SobolIndices(names, quantities, *np.ones((2, len(quantities))), 8, 48, 0, 0.95, (), {}, 0.1 * table, width,
                        table, width, None, None)  # fmt: skip


def test_the_factor_that_explains_most_and_the_next():
    text = one_sentence(sobol([0.2, 0.72, 0.1], [0.02, 0.05, 0.01]).answer)
    assert text.startswith(
        "depth depends most on f1 (72 +- 5 % of its variance, with interactions), then on f0 (20 +- 2 %"
    )
    assert "f2" not in text
    # What sampling error explains as well is not named.
    assert (
        sobol([0.72, 0.1], [0.05, 0.1]).answer
        == "depth depends most on f0 (72 +- 5 % of its variance, with interactions)."
    )


def test_no_factor_explains_more_than_all():
    assert sobol([1.04], [0.1]).answer == "depth depends most on f0 (100 +- 10 % of its variance)."


def test_factors_that_overlap_are_not_told_apart():
    # 0.3 + 0.1 reaches 0.5 - 0.1, and 0.29 + 0.1 does not.
    both = sobol([0.29, 0.3, 0.5], [0.1, 0.1, 0.1]).answer
    assert "f2 (50 +- 10" in both
    assert "f1 (30 +- 10" in both
    assert "f0" not in both
    assert "within sampling error" in both
    many = sobol([0.5] * 5, [0.1] * 5).answer
    assert "and 3 more, whose order is within sampling error" in one_sentence(many)


def test_quantities_that_depend_on_nothing():
    text = sobol([[0.1, 0.05], [np.nan, np.nan], [1.0, 0.1]], np.full((3, 2), 0.1), ("a", "b", "c")).answer
    assert text == "a depends on no factor beyond sampling error; b does not vary, or has no finite values; and 1 more."
    assert sobol([0.9], [np.nan]).answer.startswith("depth depends most on f0 (90 ")


def test_effects_have_units_and_shares_of_runs_their_intervals():
    table = np.array([[0.5, 2.5]])
    effects = MorrisEffects(("a", "b"), ("max(depth)",), *np.ones((2, 1)), 8, 48, 0, 0.95, (), {}, table, 0.1 * table,
                            table, table)  # fmt: skip
    assert effects.answer.startswith(
        "max(depth) depends most on b (2.5 +- 0.25 m over its range), then on a (0.5 +- 0.05 m"
    )
    given = GivenDataIndices(("a", "b"), ("depth",), *np.ones((2, 1)), 8, 48, 0, 0.95, (), {}, table / 5.0, 0.02 * table,
                             table, table, table, table)  # fmt: skip
    assert given.answer.startswith("depth depends most on b (50 +- 5 % of its variance), then on a (10 +- 1 %")
    assert [unit_of(name) for name in ("iae depth", "depth at floor", "odd name")] == ["m s", "m", ""]


# Rare events


def rare(moved=None, law="normal", **more):
    """An answer; moved: (mean, size, spread, z) by name."""
    columns = [{name: each[i] for name, each in (moved or {}).items()} for i in range(4)]
    fields = {"weights": np.ones(3) / 3.0, "probability": 1.23e-5, "interval": (1e-5, 1.5e-5), "noise_moved": {}} | more
    return RareEvent(
        event="depth above 12", relative_error=0.1, estimator="subset", members={"scene": 100}, failing=None,
        normals=np.zeros((3, 0)), draws=np.zeros((3, 0)), failed_share=0.0, likeliest={}, likeliest_draws=np.zeros(0),
        distance=4.0, moved=columns[0], moved_size=columns[1], moved_spread=columns[2], moved_z=columns[3], runs=(),
        plain_members=1e6, plain_seconds=1.0, seconds=1.0,
        provenance={"ensemble": {"vary": {name.partition("[")[0]: {law: {}} for name in moved or {}}}}, **fields,
    )  # fmt: skip


def test_the_clearest_difference_of_failing_members_is_said():
    moved = {"vehicle.mass": (0.5, 0.9, 1.0, 5.0), "vehicle.buoyancy": (-3.5, 3.5, 0.5, -60.0)}
    text = one_sentence(rare(moved).answer)
    near(text, 12, 1.23e-5, 95, 1e-5, 1.5e-5, 3.5)
    said = "in failing members vehicle.buoyancy is on average 3.5 standard deviations below its mean and 1 more."
    assert text.endswith(said)
    assert "moved       vehicle.mass is on average 0.5 standard deviations above its mean" in str(rare(moved))
    # Another law has its scale: a uniform number has no 3.5 of its own deviations.
    assert "3.5 standard deviations of its normal score below its median" in rare(moved, "uniform").answer
    entry = rare({"start.position[0]": (2.0, 2.0, 0.5, 30.0)}).answer
    assert entry.endswith("start.position[0] is on average 2.0 standard deviations above its mean.")


def test_differences_of_size_and_of_noise_and_none():
    assert rare({"a": (0.0, 2.5, 2.6, 30.0)}).answer.endswith(
        "a is on average 2.5 standard deviations from its mean, to both sides."
    )
    assert rare({"a": (0.0, 0.1, 0.12, -30.0)}).answer.endswith(
        "a is near its mean, with a spread of 0.1 standard deviations."
    )
    assert rare({"a": (3.0, 3.0, 0.1, 4.4)}).answer.endswith("nothing differs beyond chance.")
    noise = {"compass": 12.3, "log": 4.4}
    assert rare(noise_moved=noise).answer.endswith("the noise of compass differs from that of all (z = 12).")
    nothing = rare(weights=np.zeros(0), probability=0.0, interval=(0.0, 3e-4)).answer
    assert nothing.endswith("0 (95 % interval 0 to 0.0003); no failing member was found.")


# Searches


def test_the_worst_case_has_its_place_and_units():
    units = {"max(depth)": "m", "vehicle.buoyancy": "N"}
    text = one_sentence(worst(units=units).answer)
    assert text.startswith("The largest max(depth) found is 3.5 m at vehicle.buoyancy 297 N (its lower bound), ")
    near(text, 3.5, 297.0, 1000.0, 64)
    assert worst(worst="smallest", value=-2.0).answer.startswith("The smallest max(depth) found is -2 at ")
    lost = worst(value=np.inf)
    assert lost.answer.startswith("A member fails at vehicle.buoyancy 297 (its lower bound), ")
    metric = dataclasses.replace(lost, of_metric=True)
    assert metric.answer.startswith("max(depth) is infinite, or a member fails, at ")
    names = [f"a{i}" for i in range(9)]
    many = dataclasses.replace(worst(), parameters=dict.fromkeys(names, 1.0), at_bounds=dict.fromkeys(names, ""))
    assert "a3 1 and 5 more, in 64 runs." in many.answer


def test_tuned_numbers_are_judged_on_fresh_members():
    one = dataclasses.replace(tuned(), fresh_cost=0.2, units={"depth": "m", "heading_pid.kp": "s"})
    text = one_sentence(one.answer)
    assert text == "mean of depth falls from 0.3 m to 0.2 m over 16 fresh members with heading_pid.kp 3 s (was 1)."
    assert "rises from 0.1 m to 0.2 m" in dataclasses.replace(one, fresh_before=0.1).answer
    assert "stays 0.2 m over" in dataclasses.replace(one, fresh_before=0.2).answer
    assert "rises from 0.3 to infinite, as members fail, over 16" in tuned().answer
    alone = dataclasses.replace(one, fresh=0, fresh_cost=np.nan, fresh_before=np.nan)
    assert alone.answer.startswith("mean of depth is 0.1 m over the 4 members of the search with ")
    assert "is infinite, as members fail, over" in dataclasses.replace(alone, cost=np.inf).answer


# Linear models


def test_margins_are_those_that_all_members_bear():
    def both(*why):
        found = loops(*why)
        return dataclasses.replace(found, values=found.values | found.by_runs)

    text = one_sentence(both("", "", "", "").answer)
    upper = np.geomspace(2.0, 8.0, 4)
    upper[-1] = np.inf
    near(text, (1.0 / upper).max(), upper.min(), 0.1 * upper.min(), 4)
    assert text.startswith(
        "The loop of heading_pid tolerates 0.5 to 2 times its gain or 0.2 s more delay in 4 members; "
    )
    assert text.endswith("member 0 has the least margin.")
    some = both("does not settle", "", "").answer
    near(some, 0.25, 4.0, 0.4, 2, 3, 1)
    assert some.endswith("in 2 of 3 members (1: does not settle); member 1 has the least margin.")
    assert loops("failed", "failed").answer == "The loop of heading_pid has no margins in any of 2 members (2: failed)."
    one = Margins(
        "all laws", {"disk": np.array([0.6]), "sensitivity_peak": np.array([1.7])}, {}, np.array([""], object), 0.1
    )
    assert (
        one.answer
        == "The loop of all laws tolerates a disk margin of 0.6 and has sensitivity_peak up to 1.7 in 1 member."
    )


def test_the_numbers_of_a_steady_motion():
    text = one_sentence(steady().answer)
    assert text == "The motion is steady with pitch 0.1 rad, thrusters[0] 0.25."
    many = dataclasses.replace(steady(), values={f"thrusters[{i}]": 0.5 for i in range(8)})
    assert many.answer.endswith("thrusters[4] 0.5 and 3 more.")
    assert "thrusters[7] 0.5" in str(many)
    small = dataclasses.replace(steady(), values={"roll": -1e-11, "speed": 1.23456789})
    assert small.answer == "The motion is steady with roll 0 rad, speed 1.235 m/s."
    assert "roll -1e-11 rad, speed 1.23457 m/s" in str(small)
    still = dataclasses.replace(steady(), values={})
    assert still.answer == "The motion is steady with roll 0 rad."
    assert "fixed       nothing" in str(dataclasses.replace(steady(), fixed={}))


# Accuracy


def test_the_cheapest_and_the_most_accurate_setting():
    ones = [
        measured("a", 1.0, 1e-2, h=0.2),
        measured("b", 2.0, 1e-3),
        measured("c", 30.0, 1e-7),
        measured("d", 40.0, 1.0),
    ]
    text = one_sentence(traded(*ones).answer)
    cheap, accurate = text.split(", the most accurate ")
    near(cheap, 0.2, 1e-2, 1.0)
    near(accurate, 0.1, 1e-7, 30.0, 1, 4)
    assert cheap.startswith("For position the cheapest is a float64 at 0.2 s (0.01 m, ")
    assert accurate.startswith("c float64")
    assert traded(*ones[::3]).answer.startswith(
        "For position a float64 at 0.2 s (0.01 m, 1 us/vehicle/s) is the cheapest and"
    )
    assert traded().answer == "No setting of a method has a measurement up to 4 s."
    fine = [dataclasses.replace(each, trusted={}) for each in ones]
    assert (
        traded(*fine).answer
        == "No setting of 4 is the most accurate: the reference is too inaccurate for their errors in position."
    )
    assert traded(*fine, reference_error={}).answer.endswith("most accurate: noise acts.")


def test_the_setting_that_is_suggested():
    text = one_sentence(suggested().answer)
    near(text, 0.0123457, 1e-3, 150, 4e-4)
    assert "keeps position to 0.001 m up to 150 s: 0.0004 m is expected." in text


def test_methods_of_a_map_by_their_cells():
    codes = {"psi_s": [[0, 1, 2], [0, 0, 4]], "rk4": [[0, 3, 3], [2, 0, 4]], "psi": [[0, 0, 2], [1, 0, 4]]}
    one = made_map(codes["psi_s"])
    found = dataclasses.replace(one, classes={name: np.array(each) for name, each in codes.items()})
    text = one_sentence(found.answer)
    shares = {name: (np.array(each) <= Cell.BOUNDED).mean() for name, each in codes.items()}
    assert max(shares.values()) == shares["psi_s"] == shares["psi"]
    assert text.startswith("Runs with psi_s, psi stay bounded without a flag in ")
    near(text, 100.0 * shares["psi"], 6, 50.0, 2.0, 100.0 * shares["rk4"], 1, 1, 1)
    assert "with rk4 in 33.3 %, the least" in text
    assert text.endswith("unbounded without a flag: psi_s in 1, rk4 in 1, psi in 1.")
    good = made_map([[0, 0, 0], [0, 0, 0]]).answer
    assert (
        good
        == "Runs with psi_s stay bounded without a flag in 100 % of 6 cells (accurate in 100 %), in every row up to h 4 s."
    )
    none = made_map([[3, 3, 3], [3, 3, 3]])
    ends = np.array([[255, 255, 255], [255, 1, 1]])
    none = dataclasses.replace(none, statuses={"psi_s": ends}).answer
    refused = "Runs with psi_s stay bounded without a flag in 0 % of 6 cells (accurate in 0 %)"
    assert none == f"{refused}; the most frequent status is refused."


# Estimates and derivatives


def test_an_estimate_is_a_value_with_its_interval_and_error():
    text = one_sentence(estimated().answer)
    near(text, 22.41, 95, 22.24, 22.58, np.hypot(0.062, 0.018), 0.1)
    assert text.startswith("mean depth is 22.41 m, 95 % interval 22.24 to 22.58; ")
    assert "requested" not in dataclasses.replace(estimated(), error=np.inf).answer
    assert dataclasses.replace(estimated(), unit="1").answer.startswith("mean depth is 22.41, 95 %")
    assert dataclasses.replace(estimated(), value=np.nan).answer == "mean depth has no finite value."


def slopes(jacobian, error=None, by=("a", "b"), of=("depth", "speed"), units=("m", "m/s")):
    jacobian = np.array(jacobian)
    error = np.full(jacobian.shape, 1e-4) if error is None else error
    return Derivatives(of, units, by, np.ones(jacobian.shape[:-1]), jacobian, error, error, {}, by_units=("N", "1"))


def test_derivatives_have_the_units_of_both():
    text = one_sentence(slopes([[2.0, 0.5], [-3.0, 4.0]]).answer)
    near(text, 2.0, 1e-4, 0.5, 1e-4, -3.0, 1e-4, 1)
    assert text.startswith(
        "depth changes by 2 m (+- 0.0001) per N of a, 0.5 m (+- 0.0001) per unit of b; speed changes by -3 m/s"
    )
    assert text.endswith("of a, and 1 more derivative.")
    alone = slopes([[2.0, np.nan]], of=("depth",), units=("m",)).answer
    assert alone == "depth changes by 2 m (+- 0.0001) per N of a; 1 of 2 are undefined."
    none = dataclasses.replace(
        slopes([[np.nan]], by=("a",), of=("depth",), units=("m",)), undefined={"depth by a": "a sticks"}
    )
    assert none.answer == "depth has no derivative by a: a sticks."
    two = dataclasses.replace(
        slopes([[np.nan] * 2] * 2), undefined={"depth by a": "a sticks", "speed by a": "all fail"}
    )
    assert two.answer == "None of 4 derivatives is defined: a sticks; all fail."
    fleet = np.array([[[1.0, 5.0]], [[3.0, np.nan]], [[5.0, 7.0]]])
    mean = slopes(fleet, of=("depth",), units=("",)).answer
    assert mean == "depth changes by 3 per N of a, 6 per unit of b, on average over 3 members."


# Runs


@pytest.mark.parametrize(("status", "ends", "words"), [
    ([0] * 300, {}, "All 300 members end ok at 1 s."),
    ([0], {}, "The member ends ok at 1 s."),
    ([17, 17], {0: 0.7, 1: 0.5}, "All 2 members are stopped by an event (floor 2), the first at 0.5 s."),
    ([2], {0: 0.25}, "The member fails (not_converged 1), the first at 0.25 s."),
    ([0, 0, 17, 16, 1, 3, 3], {2: 0.7, 3: 0.6, 4: 0.3, 5: 0.2, 6: 0.1},
     "Of 7 members 2 end ok at 1 s; 2 are stopped by an event (surface 1, floor 1), the first at 0.6 s; "
     "3 fail (step_too_large 1, non_finite 2), the first at 0.1 s."),
])  # fmt: skip
def test_how_the_members_of_a_run_ended(status, ends, words):
    end = np.full(len(status), np.nan)
    end[list(ends)] = list(ends.values())
    result = made(np.zeros((2, len(status), 3)), status=np.array(status), end=end)
    assert answer_of(result) == words
    later = dataclasses.replace(result, provenance=result.provenance | {"start": {"time": 9.0}})
    assert answer_of(later) == words.replace("at 1 s", "at 10 s")
    assert {Status.FLOOR, Status.SURFACE} == {17, 16}


# One home


def test_every_answer_ends_its_text_and_begins_its_file(tmp_path):
    """The key of the file is not read: it follows from the rest."""
    for found in (rare(), worst(), tuned(), steady(), loops("", ""), traded(), made_map([[0, 1, 2], [2, 0, 4]]), estimated(),
                  sobol([0.5], [0.1]), slopes([[2.0, 0.5], [-3.0, 4.0]])):  # fmt: skip
        assert isinstance(found, Saved)
        assert str(found).splitlines()[-1] == found.answer
        content = json.loads(found.to_json())
        assert next(iter(content)) == "answer"
        assert content["answer"] == found.answer
        if found.study not in ("estimate", "worst_case", "tradeoff"):  # their stand-ins are not whole
            (tmp_path / "a.json").write_text(json.dumps(content | {"answer": "another"}))
            assert type(found).load(tmp_path / "a.json").answer == found.answer


def test_units_of_numbers_and_of_their_entries():
    drag = lw.terms.Drag(linear=[1.0] * 6, name="hull")
    scene = lw.Scene(lw.Vehicle(2.0, inertia=(1.0, 1.0, 1.0)), terms=[drag])
    units = {"vehicle.mass": "kg", "start.position[2]": "m", "environment.gravity": "m s-2", "odd": "1",
             "hull.linear[2]": "N s/m", "hull.linear[3]": "N m s", "hull.linear": "N s/m, N m s"}  # fmt: skip
    assert units_of_numbers(scene, units) == units
