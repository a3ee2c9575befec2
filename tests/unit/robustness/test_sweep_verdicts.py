# SPDX-License-Identifier: Apache-2.0
"""Whether a difference of two cases matters, cells that are alike, and eighteen cells in ten lines; no run."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from tests.support.verbs import Study, main
from tests.unit.robustness.test_sweeps import CASES, MASS, METRICS, RISING, N, record, swept

OVERSHOOT, IAE = METRICS[0], METRICS[1]
SLOPE = np.linspace(-0.6, -0.2, N)


@pytest.fixture(scope="module")
def answer():
    """The second overshoots by 0.2 to 0.6 rad less and has an error by 2 rad s more."""
    return swept([record(), record(RISING + SLOPE, 3.0)], CASES[:2])


def verdicts(answer, **requested):
    return {row.of: row.verdict for row in answer.compare("soft", "stiff", **requested)}


def test_an_interval_and_what_matters_make_a_verdict(answer):
    low, high = stats.ttest_1samp(SLOPE, 0.0).confidence_interval(0.95)
    assert -0.5 < low < -0.4 < high < -0.3
    for matters, expected in ((0.0, "better"), (0.3, "better"), (-high - 1e-9, "better"), (-high + 1e-9, "undecided"),
                              (0.4, "undecided"), (-low - 1e-9, "undecided"), (-low + 1e-9, "equivalent")):  # fmt: skip
        assert verdicts(answer, matters={OVERSHOOT: matters}) == {"success": "", OVERSHOOT: expected, IAE: ""}
    # All members differ by 2 rad s: the interval has no width, and its edge is within.
    for matters, expected in ((1.9, "worse"), (2.0 + 1e-9, "equivalent")):
        assert verdicts(answer, matters={IAE: matters})[IAE] == expected
    turned = {row.of: row.verdict for row in answer.compare("stiff", "soft", matters={OVERSHOOT: 0.3, IAE: 1.0})}
    assert turned == {"success": "", OVERSHOOT: "worse", IAE: "better"}


def test_success_is_in_points_and_equal_cases_are_equivalent(answer):
    row = answer.compare("soft", "stiff", matters=1.0)[0]
    d, only = row.difference, row.only
    assert (only[0], row.matters) == (0, 0.01)
    assert 0.0 < d.lower < d.upper < 0.5
    for points, expected in ((100.0 * d.lower - 1e-6, "better"), (100.0 * d.lower + 1e-6, "undecided"),
                             (100.0 * d.upper + 1e-6, "equivalent")):  # fmt: skip
        assert verdicts(answer, matters=points)["success"] == expected
    same = swept([record(), record()], CASES[:2])
    # Metrics that are equal to the bit differ by nothing; of success forty members say no more than some points.
    assert verdicts(same, matters={"success": 1.0, OVERSHOOT: 0.0}) == {
        "success": "undecided", OVERSHOOT: "equivalent", IAE: ""}  # fmt: skip


def test_more_of_a_metric_is_better_where_success_limits_it_from_below():
    more = swept([record(), record(iae=3.0)], CASES[:2], success={IAE: {"above": 40.0}})
    assert verdicts(more, matters={IAE: 1.0})[IAE] == "better"
    assert verdicts(more, matters={IAE: 3.0})[IAE] == "equivalent"
    between = swept([record(), record(iae=3.0)], CASES[:2], success={IAE: {"above": 40.0, "below": 90.0}})
    assert verdicts(between, matters={IAE: 1.0})[IAE] == "worse"


def test_what_is_not_real_among_many_is_undecided():
    """A difference whose interval lies beyond what matters, but whose p does not stand the correction for their number."""
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(N)
    noise = (noise - noise.mean()) / noise.std(ddof=1) + 2.2 / np.sqrt(N)
    chance = swept([record(), record(RISING + noise)], CASES[:2], success={IAE: {"below": 1e9}})
    rows = {row.of: row for row in chance.compare("soft", "stiff", matters={OVERSHOOT: 0.0})}
    assert rows[OVERSHOOT].difference.lower > 0.0
    assert rows[OVERSHOOT].p > 0.05
    assert rows[OVERSHOOT].verdict == "undecided"


def test_files_and_words_have_the_verdicts(answer, tmp_path):
    judged = replace(answer, matters={"success": 1.0, OVERSHOOT: 0.3, IAE: 5.0})
    judged.save(tmp_path)
    with (tmp_path / "comparison.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["of"], row["matters"], row["verdict"]) for row in rows] == [
        ("success", "0.01", "better"), (OVERSHOOT, "0.3", "better"), (IAE, "5.0", "equivalent")]  # fmt: skip
    assert json.loads((tmp_path / "sweep.json").read_text())["matters"] == judged.matters
    text = str(judged)
    assert "- stiff: better: success +" in text
    assert "where 1 matter, seen on the same members" in text
    assert f"- stiff: equivalent: {IAE} +2 rad s (+2 to +2), from " in text
    answer.save(tmp_path / "plain")
    assert "verdict" not in (tmp_path / "plain" / "comparison.csv").read_text()
    assert "matters" not in json.loads((tmp_path / "plain" / "sweep.json").read_text())


@pytest.mark.parametrize(("matters", "words"), [
    ({"overshot heading": 1.0}, "matters.\"overshot heading\" = 1.0 is not a metric of this sweep. Did you mean 'overshoot"),
    ({"success": -1.0}, 'matters."success" = -1.0'), ("much", 'matters."success" = \'much\''),
])  # fmt: skip
def test_what_matters_is_a_number_of_what_there_is(matters, words, answer):
    with pytest.raises(lw.SceneError) as caught:
        answer.compare("soft", "stiff", matters=matters)
    assert words in str(caught.value)


def test_a_sweep_file_says_what_matters(tmp_path, capsys):
    path = tmp_path / "sweep.toml"
    path.write_text('scene = "scene.toml"\n[compare]\nmatters = { success = 2.0 }\n')
    vehicle = "[vehicle]\nmass = 50.0\ninertia = [4.0, 5.0, 6.0]\n"
    (tmp_path / "scene.toml").write_text(vehicle)
    study = Study(lw.SceneError(["as far as here"]))
    assert main(["sweep", str(path), "--out", str(tmp_path / "out"), "-q"], study=study) == 2
    assert study.calls[0][1]["matters"] == {"success": 2.0}
    path.write_text('scene = "scene.toml"\n[compare]\nmattters = 1.0\n')
    assert main(["sweep", str(path), "--out", str(tmp_path / "out"), "-q"], study=study) == 2
    assert "Did you mean 'matters'?" in capsys.readouterr().err


def test_cells_that_are_alike_are_told_once():
    shown = [record(), record(), record(iae=2.0), record()]
    text = str(swept(shown, CASES[:2], grid={"controller.delay": [0.02, 0.04]}))
    (line,) = [line for line in text.splitlines() if "passes" in line and "iae" not in line and "soft" in line]
    assert line.startswith("- soft at controller.delay = 0.02 or 0.04, stiff at controller.delay = 0.04: passes ")
    assert text.count(": passes ") == 2


def test_eighteen_cells_in_ten_lines():
    grid = {"controller.delay": [0.02, 0.04, 0.06], "heading_pid.ki": [0.1, 0.2, 0.3]}
    by_mass = record(np.where(MASS > 47.0, 0.1, 2.0))
    never = record(np.full(N, 2.0))
    stiff = [by_mass, record(), never] + [record(np.full(N, 0.1))] * 6
    many = swept([record()] * 9 + stiff, CASES[:2], grid=grid)
    assert len(many.cells) == 18
    lines = [line for line in str(many).splitlines() if line]
    assert lines[0] == "# Sweep"
    assert len(lines) <= 12  # the heading, ten lines, and where the rest is
    assert lines[2].startswith("1. stiff: ")
    assert "; from 0 % at controller.delay = 0.02, heading_pid.ki = 0.3 to 100 %; beside soft: " in lines[2]
    # Six of 100 % for 70 %, one of 0 %; the same, and one whose members pass by their mass.
    assert lines[2].endswith("6 better, 1 worse, 2 not really different")
    assert lines[3].startswith("2. soft: 70 %")
    assert any("vehicle.mass explains success in 1 cells" in line for line in lines)
    # Ten as the first, and six as another: fourteen in all are as one before them.
    assert "- 14 cells are as another one, to the bit: such as soft at controller.delay = 0.02 or 0.04 or 0.06" in str(
        many
    )
    judged = str(replace(many, matters={"success": 100.0}))
    assert "beside soft: 9 equivalent" in judged


GRID = {"controller.delay": [0.02, 0.04, 0.06], "heading_pid.ki": [0.1, 0.2, 0.3]}
ALL_FAIL = record(ends={i: (Status.NON_FINITE, 1.0) for i in range(N)})


def test_eighteen_equal_cells_have_one_list_of_worst_members():
    text = str(swept([record()] * 18, CASES[:2], grid=GRID))
    assert "1. soft: 70 % (55.16 to 84.84); 70 % at each point" in text
    assert "from 70 %" not in text
    (worst,) = [line for line in text.splitlines() if line.startswith("- worst: ")]
    assert [f"member {i} of soft at controller.delay = 0.02, heading_pid.ki = 0.1" in worst for i in (39, 38, 37)] == [
        True
    ] * 3
    assert "- 17 cells are as another one, to the bit" in text
    assert "beside soft: 9 not really different" in text


@pytest.mark.parametrize(("shown", "share"), [(ALL_FAIL, 0.0), (record(np.full(N, 0.1)), 1.0)])
def test_members_that_all_do_the_same_leave_an_interval(shown, share):
    """Wilson's limit for none of forty: that share of all members may do otherwise."""
    unseen = stats.binomtest(0, N).proportion_ci(0.95, "wilson").high
    many = swept([shown] * 18, CASES[:2], grid=GRID)
    for row in many.ranking():
        ends = (0.0, unseen) if share == 0.0 else (1.0 - unseen, 1.0)
        assert (row["value"], row["better_than"]) == (share, "")
        assert (row["lower"], row["upper"]) == pytest.approx(ends)


def test_a_case_that_always_fails_is_worse_by_what_is_sure():
    unseen = stats.binomtest(0, N).proportion_ci(0.95, "wilson").high
    first, second = swept([record(np.full(N, 0.1))] * 9 + [ALL_FAIL] * 9, CASES[:2], grid=GRID).ranking()
    assert (first["case"], second["case"]) == ("soft", "stiff")
    assert first["better_by"] == f"stiff by {100.0 * (1.0 - 2.0 * unseen):.4g} to 100 points"


def test_cells_that_failed_in_all_members_have_no_verdict_on_metrics():
    found = swept([record(), ALL_FAIL], CASES[:2])
    assert verdicts(found, matters={"success": 1.0, OVERSHOOT: 0.1, IAE: 0.5}) == {
        "success": "worse", OVERSHOOT: "undecided", IAE: "undecided"}  # fmt: skip
    both = swept([ALL_FAIL, ALL_FAIL], CASES[:2])
    assert verdicts(both, matters={"success": 9.0, OVERSHOOT: 0.1}) == {
        "success": "equivalent", OVERSHOOT: "undecided", IAE: ""}  # fmt: skip
    assert "soft, stiff: passes 0 to 8.762 % (0 of 40, 0 %)" in str(both)


def test_one_cell_has_no_rank_and_no_comparison():
    text = str(swept([record()], CASES[:1]))
    assert "- soft: passes" in text
    assert "## Rank" not in text
    assert "## Against" not in text
