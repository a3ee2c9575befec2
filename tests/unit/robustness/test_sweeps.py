# SPDX-License-Identifier: Apache-2.0
"""Sweeps whose members are made by hand: cases and grids, tables, ranks, comparisons, the worst, words and files."""

import csv
import json
from dataclasses import fields, replace
from unittest import mock

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.criteria import success
from lgvi_warp.criteria.memory import key_of
from lgvi_warp.distributions import Normal, Uniform
from lgvi_warp.robustness.sweeps import cases, output, setup, sweep
from lgvi_warp.robustness.sweeps.file import arguments_of_file
from lgvi_warp.robustness.sweeps.record import Record, Records
from lgvi_warp.robustness.sweeps.sweep_table import coordinates
from lgvi_warp.statistics.estimates import paired
from lgvi_warp.statistics.estimates.given_data import explained

N = 40
TABLES = {
    "vehicle": {"mass": 50.0, "inertia": [4.0, 5.0, 6.0], "buoyancy": 490.3325},
    "terms": [
        {"type": "control_wrench", "limit": [0.0] * 5 + [4.0]},
        {"type": "drag", "linear": [0.0, 0.0, 0.0, 2.0, 2.0, 2.0]},
    ],
    "controller": {
        "period": 0.1,
        "delay": 0.02,
        "guidance": [{"type": "set_point", "position": [0.0, 0.0, 0.0], "heading": 1.0}],
        "laws": [{"type": "heading_pid", "kp": 3.0, "ki": 0.1, "kd": 4.0, "integral_limit": 10.0}],
    },
    "run": {"method": "psi_x", "step": 0.02, "duration": 8.0},
}
SCENE = lw.Scene.from_dict(TABLES)
BARE = replace(SCENE, controller=None)
VARY = {"start.position": Normal(std=0.8), "vehicle.mass": Uniform(low=45.0, high=55.0)}
METRICS = ["overshoot heading", "iae heading"]
CASES = [{"name": "soft"}, {"name": "stiff", "set": {"heading_pid.kp": 8.0}},
         {"name": "unknown", "set": {"heading_pid.kq": 1.0}}]  # fmt: skip
MASS = lw.Ensemble(SCENE, N, 3, VARY).parameters(0, N)["vehicle.mass"]
RISING = np.linspace(0.1, 2.05, N)


def record(overshoot=RISING, iae=1.0, ends=None, messages=()):
    """Record of members; `ends` has (status, time) of those that did not reach the end."""
    status, end = np.zeros(N, np.uint8), np.full(N, np.inf)
    for i, (code, time) in (ends or {}).items():
        status[i], end[i] = code, time
    numbers = {"overshoot heading": np.array(overshoot), "iae heading": iae + MASS, "time_to_failure": end}
    return Record(status, numbers, messages)


def half_of_them():
    """Members of even number are better; one fails, one reaches the floor, one has no overshoot."""
    overshoot = np.where(np.arange(N) % 2 == 0, 0.3, RISING)
    overshoot[7] = np.nan
    return record(overshoot, 3.0, {3: (Status.NON_FINITE, 2.5), 5: (Status.FLOOR, 4.0)}, ("slow",))


def swept(records, names=CASES, **more):
    """A sweep whose cells show these records, in order."""
    shown = iter(records)
    arguments = {"success": {"overshoot heading": {"below": 1.5}}} | more
    return swept_by(lambda fleet, **_: next(shown), names, **arguments)


def swept_by(run, names=CASES, *, success=None, baseline=None, confidence=0.95, interval="wilson", out=None, threads=None,
             progress=None, **more):  # fmt: skip
    """A sweep whose cells are run by `run`, from members and what solve is told to a record."""

    class Made(setup.Setup):
        def run(self, fleet, **more):
            return run(fleet, **more)

    asked = {"grid": None, "vary": VARY, "members": N, "seed": 3, "sampling": None, "metrics": METRICS}
    asked |= {name: more.pop(name) for name in asked.keys() & more.keys()}
    one = setup.setup_of(SCENE, names, settings=more, **asked)
    one = Made(**{field.name: getattr(one, field.name) for field in fields(one)})
    execution = {"threads": threads, "executor": "threads", "scheduler": None}
    return sweep.swept(one, success, baseline, confidence, interval, out, progress, execution)


@pytest.fixture(scope="module")
def answer():
    return swept([record(), half_of_them()])


@pytest.fixture(scope="module")
def gridded():
    """Two cases at two delays; the second passes more often at the second one."""
    often = record(np.where(np.arange(N) < 38, 0.1, 2.0))
    return swept([record(), record(iae=2.0), record(), often], CASES[:2], grid={"controller.delay": [0.02, 0.04]})


# Tables


def test_rows_count_and_summarize_members_that_did_not_fail(answer):
    soft, stiff, unknown = answer.rows()
    assert (soft["members"], soft["failed"], soft["stopped"], soft["passed"]) == (N, 0, 0, 28)
    assert (stiff["failed"], stiff["stopped"], stiff["passed"]) == (1, 1, 31)
    ends = stats.binomtest(28, N).proportion_ci(0.95, "wilson")
    assert [soft[name] for name in ("success", "success lower", "success upper")] == pytest.approx([0.7, *ends])
    x = half_of_them().numbers["overshoot heading"][[i for i in range(N) if i not in (3, 7)]]
    named = {name.removeprefix("overshoot heading "): value for name, value in stiff.items() if name.startswith("over")}
    quantiles = np.quantile(x, [0.05, 0.5, 0.95])
    expected = {"mean": x.mean(), "std": x.std(ddof=1), **dict(zip(("q05", "median", "q95"), quantiles, strict=True))}
    assert named == pytest.approx(expected | {"missing": 2})
    end = [stiff[f"time_to_failure {name}"] for name in ("mean", "std", "median", "missing")]
    assert end == pytest.approx([4.0, np.nan, 4.0, N - 1], nan_ok=True)
    assert np.isnan(soft["time_to_failure mean"])
    assert np.isnan(soft["time_to_failure q05"])
    refused = "\"heading_pid.kq\" = 1.0 is not a number of this scene. Did you mean 'heading_pid.kp'?"
    assert unknown == {"case": "unknown", "refused": refused}


def test_two_members_have_a_spread_and_one_has_none():
    pair = np.full(N, np.nan)
    pair[:2] = 1.0, 3.0
    alone = np.where(np.arange(N) == 0, 1.0, np.nan)
    first, second = swept([record(pair), record(alone)], CASES[:2]).rows()
    assert first["overshoot heading std"] == pytest.approx(np.sqrt(2.0))
    assert first["overshoot heading mean"] == 2.0
    assert np.isnan(second["overshoot heading std"])
    assert second["overshoot heading mean"] == 1.0


def test_the_table_has_the_rows_by_case_and_axis(gridded, answer):
    table = gridded.table
    assert list(table["case"].values) == ["soft", "stiff"]
    assert list(table["controller.delay"].values) == [0.02, 0.04]
    assert table["success"].values.tolist() == [[0.7, 0.7], [0.7, 38 / 40]]
    assert table["iae heading mean"].values == pytest.approx(
        np.array([[1.0, 2.0], [1.0, 1.0]]) + MASS.mean(), rel=1e-12)  # fmt: skip
    assert list(answer.table["refused"].values)[:2] == ["", ""]
    assert np.isnan(answer.table["success"].values[2])
    assert coordinates([[{"type": "drag"}], 1.5, 2, "a"]) == ["[{'type': 'drag'}]", 1.5, 2, "a"]


def test_rows_of_a_comparison(answer):
    rows = [row.row() for row in output.against_baseline(answer)]
    passed = [RISING < 1.5, half_of_them().numbers["overshoot heading"] < 1.5]
    passed[1][[3, 5]] = False
    only = int((passed[0] & ~passed[1]).sum()), int((passed[1] & ~passed[0]).sum())
    d = paired.proportions(*only, N, 0.95)
    head = {"first": "soft", "second": "stiff"}
    assert only == (3, 6)
    assert rows[0] == pytest.approx(head | {"of": "success", "value_first": 0.7, "value_second": 31 / 40,
                                            "difference": 3 / 40, "lower": d.lower, "upper": d.upper, "p": d.p,
                                            "p_holm": d.p, "real": False, "pairs": N, "test": "McNemar, exact",
                                            "only_first": 3, "only_second": 6})  # fmt: skip
    good = [i for i in range(N) if i not in (3, 7)]
    x, y = RISING[good], half_of_them().numbers["overshoot heading"][good]
    test = stats.ttest_rel(y, x)
    assert rows[1] == pytest.approx(head | {
        "of": "overshoot heading", "value_first": x.mean(), "value_second": y.mean(), "difference": (y - x).mean(),
        "lower": test.confidence_interval().low, "upper": test.confidence_interval().high, "p": test.pvalue,
        "p_holm": 2.0 * test.pvalue, "real": True, "pairs": 38, "test": "paired t", "only_first": None,
        "only_second": None})  # fmt: skip
    assert [row["of"] for row in rows] == ["success", *METRICS]
    assert rows[2]["difference"] == pytest.approx(2.0)


def test_quantiles_are_compared_by_a_bootstrap_with_the_sweeps_seed(answer):
    rows = answer.compare("soft", "stiff", quantile=0.9)
    good = [i for i in range(N) if i not in (3, 7)]
    x, y = RISING[good], half_of_them().numbers["overshoot heading"][good]
    d = paired.quantiles(x, y, 0.9, 0.95, seed=3)
    assert rows[1].difference == pytest.approx(d, nan_ok=True)
    assert rows[1].test == "bootstrap of members"
    assert rows[1].values == pytest.approx((np.quantile(x, 0.9), np.quantile(y, 0.9)))
    assert np.isnan(rows[1].p)
    # A difference without a test is real where its interval leaves out 0: this one does not, that of the constant does.
    assert d.lower < 0.0 < d.upper
    assert not rows[1].real
    assert rows[2].difference.lower > 0.0
    assert rows[2].real
    back = answer.compare("stiff", "soft", quantile=0.9)[2]
    assert back.difference.upper < 0.0
    assert back.real


def test_metrics_that_nobody_has_are_compared_as_nan():
    none = record(np.full(N, np.nan))
    rows = swept([record(), none], CASES[:2]).compare("soft", "stiff")
    assert all(np.isnan(value) for value in rows[1].values)
    assert rows[1].difference.pairs == 0
    assert not rows[1].real
    quantile = swept([record(), none], CASES[:2]).compare("soft", "stiff", quantile=0.5)[1]
    assert all(np.isnan(value) for value in quantile.values)


def test_points_are_compared_with_the_same_point(gridded, answer):
    rows = gridded.compare("soft", "stiff")
    assert [row.point["controller.delay"] for row in rows if row.of == "success"] == [0.02, 0.04]
    assert len(rows) == 6
    assert [row.values for row in rows if row.of == "success"] == [(0.7, 0.7), (0.7, 0.95)]
    assert rows[0].row()["controller.delay"] == 0.02
    assert len(gridded.compare("soft", "stiff", {"controller.delay": 0.04})) == 3
    assert answer.compare("soft", "unknown") == []


def test_ranks_of_one_cell_are_by_mcnemar_and_of_a_grid_by_shares(answer, gridded):
    ranks = answer.ranking()
    assert [(row["rank"], row["case"], row["better_than"]) for row in ranks] == [(1, "stiff", ""), (2, "soft", "")]
    ends = stats.binomtest(31, N).proportion_ci(0.95, "wilson")
    assert [ranks[0][key] for key in ("value", "lower", "upper")] == pytest.approx([31 / N, *ends])
    shares = np.mean([RISING < 1.5, np.arange(N) < 38], axis=0)
    first, second = gridded.ranking()
    assert (first["case"], second["case"]) == ("stiff", "soft")
    interval = stats.ttest_1samp(shares, 0.0).confidence_interval()
    assert [first[key] for key in ("value", "lower", "upper")] == pytest.approx([shares.mean(), *interval])
    p = stats.ttest_rel(shares, (RISING < 1.5).astype(float)).pvalue
    assert p < 0.05
    assert (first["better_than"], second["better_than"]) == ("soft", "")
    at = {"controller.delay": 0.02}
    assert [row["better_than"] for row in gridded.ranking(at)] == ["", ""]
    strict = replace(gridded, confidence=1.0 - 0.5 * p)
    assert strict.ranking()[0]["better_than"] == ""


def test_shares_of_all_or_none_stay_probabilities():
    few = record(np.where(np.arange(N) < 1, 0.1, 2.0))
    many = record(np.where(np.arange(N) < 39, 0.1, 2.0))
    ranks = swept([many, many, few, few], CASES[:2], grid={"controller.delay": [0.02, 0.04]}).ranking()
    assert ranks[0]["upper"] == 1.0 > ranks[0]["lower"] > 0.9
    assert ranks[1]["lower"] == 0.0 < ranks[1]["upper"] < 0.1


def test_all_pairs_of_three_cases_are_tested_together():
    records = [record(np.where(np.arange(N) < few, 0.1, 2.0)) for few in (10, 22, 16)]
    names = [{"name": "a"}, {"name": "b", "set": {"heading_pid.kp": 8.0}},
             {"name": "c", "set": {"heading_pid.kp": 9.0}}]  # fmt: skip
    ranks = swept(records, names).ranking()
    # 12, 6 and 6 members differ: of McNemar's p, 0.0005 and twice 0.031, the latter are corrected to 0.0625.
    assert [(row["case"], row["better_than"]) for row in ranks] == [("b", "a"), ("c", ""), ("a", "")]
    loose = replace(swept(records, names), confidence=0.9)
    assert [row["better_than"] for row in loose.ranking()] == ["a, c", "a", ""]


def test_the_worst_failed_first_then_by_what_success_limits(answer):
    worst = answer.worst(6)
    assert [(row["case"], row["member"]) for row in worst] == [
        ("stiff", 3), ("stiff", 7), ("soft", 39), ("stiff", 39), ("soft", 38), ("soft", 37)]  # fmt: skip
    drawn = answer.inputs(answer.cells[1])
    inputs = {name: values[3] for name, values in drawn.items()}
    assert list(inputs) == ["start.position[0]", "start.position[1]", "start.position[2]", "vehicle.mass"]
    assert inputs["vehicle.mass"] == MASS[3]
    assert worst[0] == {"case": "stiff", "member": 3, "status": 3, "passed": False, "overshoot heading": RISING[3],
                        "iae heading": 3.0 + MASS[3], "time_to_failure": 2.5, **inputs}  # fmt: skip
    assert [row["passed"] for row in answer.worst(40, case="soft")] == [False] * 12 + [True] * 28
    heavy = answer.worst(2, by="iae heading", case="soft")
    assert [row["member"] for row in heavy] == np.argsort(-MASS)[:2].tolist()
    assert len(answer.worst()) == 20
    # Without a limit from above it is the first metric.
    plain = replace(answer, conditions=success.Success(limits={"iae heading": (0.0, np.inf)}))
    assert plain.worst(3)[2]["member"] == 39
    limited = replace(answer, conditions=success.Success(limits={"iae heading": (0.0, 60.0)}))
    assert limited.worst(2, case="soft")[0]["member"] == int(np.argmax(MASS))


def test_members_that_fail_first_are_worst_first():
    ends = {4: (Status.NON_FINITE, 3.0), 9: (Status.NON_FINITE, 1.0), 2: (Status.NON_FINITE, 3.0)}
    worst = swept([record(ends=ends)], CASES[:1]).worst(3)
    assert [row["member"] for row in worst] == [9, 2, 4]


def test_inputs_are_in_the_users_order():
    turned = swept(
        [record()], CASES[:1], vary={"vehicle.mass": VARY["vehicle.mass"], "start.position": VARY["start.position"]}
    )
    assert list(turned.inputs(turned.cells[0])) == ["vehicle.mass", *(f"start.position[{i}]" for i in range(3))]


def test_causes_are_those_of_the_members_that_did_not_fail(answer):
    inputs = answer.inputs(answer.cells[1])
    rows = answer.causes("stiff", of="iae heading")
    y = np.where(np.arange(N) == 3, np.nan, 3.0 + MASS)
    expected = explained(inputs, y, 0.95)
    p = dict(zip(expected, paired.holm(np.array([one.p for one in expected.values()])), strict=True))
    shares = [row["share"] for row in rows]
    assert rows[0]["input"] == "vehicle.mass"
    assert shares == sorted(shares, reverse=True)
    for row in rows:
        one, passed = expected[row["input"]], answer.passed(answer.cells[1])
        values = inputs[row["input"]]
        assert row == pytest.approx({"input": row["input"], **one._asdict(), "p": p[row["input"]],
                                     "median_passed": np.median(values[passed]),
                                     "median_failed": np.median(values[~passed])})  # fmt: skip
    nobody = swept([record()], CASES[:1], success={})
    row = nobody.causes("soft")[0]
    assert np.isnan(row["median_failed"])
    assert np.isfinite(row["median_passed"])


def test_members_that_pass_and_that_do_not(answer):
    assert answer.members("soft").tolist() == list(range(28, N))
    assert answer.members("soft", False).tolist() == [*range(28)]
    assert answer.values("stiff", "time_to_failure")[[3, 5]].tolist() == [2.5, 4.0]
    ends = [answer.survival("stiff", [time])[0].value for time in (2.0, 2.5, 3.0, 4.0)]
    assert ends == [1.0, 39 / 40, 39 / 40, 38 / 40]
    exact = replace(answer, interval="clopper_pearson", confidence=0.9)
    ends = stats.binomtest(28, N).proportion_ci(0.9, "exact")
    assert exact.success("soft") == pytest.approx((0.7, *ends))
    assert repr(answer) == "Sweep(3 cases, 1 points, 40 members)"
    assert (answer.unit("iae heading"), answer.unit("time_to_failure")) == ("rad s", "s")


@pytest.mark.parametrize(("ask", "words"), [
    (lambda answer: answer.cells_of("sof"), "case = 'sof' is not part of this sweep. Did you mean 'soft'"),
    (lambda answer: answer.cells_of("soft", {"controller.dela": 0.02}),
     "at = 'controller.dela' is not an axis of the grid. Did you mean 'controller.delay'"),
    (lambda answer: answer.cells_of("soft", {"controller.delay": 0.03}),
     'at["controller.delay"] = 0.03 is not a value of this axis. Give one of [0.02, 0.04]'),
    (lambda answer: answer.cell("soft"),
     "at = None leaves 2 cells of 'soft'. Name one point of the grid: at={'controller.delay': 0.02}"),
    (lambda answer: answer.values("soft", "iae", {"controller.delay": 0.02}),
     "metric = 'iae' is not part of this sweep. Did you mean 'iae heading'?"),
    (lambda answer: answer.values("soft", "zzz", {"controller.delay": 0.02}),
     "metric = 'zzz' is not part of this sweep. Known: overshoot heading, iae heading, time_to_failure"),
    (lambda answer: answer.worst(by="iae"), "by = 'iae' is not a metric of this sweep. Did you mean 'iae heading'?"),
])  # fmt: skip
def test_what_a_sweep_has_not_is_refused_with_what_it_has(gridded, ask, words):
    with pytest.raises(lw.SceneError) as caught:
        ask(gridded)
    assert words in str(caught.value)


def test_a_refused_case_is_named_where_it_is_asked_for(answer):
    with pytest.raises(lw.SceneError, match=r"case = 'unknown' was refused: .*. Correct it, or choose another one"):
        answer.cell("unknown")
    with pytest.raises(lw.SceneError, match=r"case = 'unknown' was refused. Run a member of another one"):
        setup.rerun_members_of(answer.setup, answer.cells[2], [0], None, None)
    assert answer.cells[2].fleet is None
    assert [cell.index for cell in answer.cells] == [0, 1, 2]


# Words and files

SUMMARY = """# Sweep

40 members, the same in 3 cells; intervals at 95%.

## Success

- soft: passes 54.57 to 81.93 % (28 of 40, 70 %)
- stiff: passes 62.5 to 87.68 % (31 of 40, 77.5 %)
- unknown: refused: "heading_pid.kq" = 1.0 is not a number of this scene. Did you mean 'heading_pid.kp'?

## Rank

1. stiff: 77.5 % (62.5 to 87.68)
2. soft: 70 % (54.57 to 81.93)

## Against soft

- stiff: overshoot heading -0.3947 rad (-0.5818 to -0.2077), from 1.113
- stiff: iae heading +2 rad s (+2 to +2), from 51.19

comparison.csv has the differences of all metrics.

## What failures go with

- With nothing that varies, as far as seen.

## Worst members

- member 3 of stiff, status non_finite
- member 7 of stiff, status ok
- member 39 of soft, status ok
- member 39 of stiff, status ok
- member 38 of soft, status ok
"""


def test_the_summary_in_words(answer):
    # The numbers are those of the tests above.
    assert str(answer) == f"{SUMMARY}\n{answer.answer}\n"


def test_the_summary_of_a_grid(gridded):
    lines = str(gridded).splitlines()
    low, high = (100.0 * end for end in stats.binomtest(38, N).proportion_ci(0.95, "wilson"))
    assert f"- stiff at controller.delay = 0.04: passes {low:.4g} to {high:.4g} % (38 of 40, 95 %)" in lines
    best = gridded.ranking()[0]
    low, high = (100.0 * best[end] for end in ("lower", "upper"))
    # Of the means of shares of the same members, by their difference.
    shares = [np.mean([gridded.passed(c) for c in gridded.cells_of(name)], axis=0) for name in ("stiff", "soft")]
    least, most = stats.ttest_rel(*shares).confidence_interval(0.95)
    by = f"soft by {100.0 * least:.4g} to {100.0 * most:.4g} points"
    assert 0.0 < least < most
    assert best["better_by"] == by
    assert gridded.ranking()[1]["better_by"] == ""
    assert f"1. stiff: 82.5 % ({low:.4g} to {high:.4g}); better than {by}" in lines
    rows = {row.point["controller.delay"]: row for row in gridded.compare("soft", "stiff") if row.of == "success"}
    d = rows[0.04].difference
    text = f"- stiff at controller.delay = 0.04: better by {100 * d.lower:.4g} to {100 * d.upper:.4g} points, "
    assert text + "seen on the same members (10 pass only there, 0 only with soft)" in lines
    # Metrics differ too, but with a grid they would be too many.
    assert not any("iae heading +" in line for line in lines)
    assert lines[-7] == "- member 39 of soft at controller.delay = 0.02, status ok"


def test_a_summary_where_the_second_is_worse_and_a_cause_is_known():
    by_mass = record(np.where(MASS > 47.0, 0.1, 2.0))
    text = str(swept([record(np.full(N, 0.1)), by_mass], CASES[:2]))
    assert "- soft: passes 91.24 to 100 % (40 of 40, 100 %); none of 40 fails: at most 7.22 % do, at 95%\n" in text
    few = int((MASS <= 47.0).sum())
    assert "- stiff: worse by " in text
    assert f"(0 pass only there, {few} only with soft)" in text
    low, high = np.median(MASS[MASS <= 47.0]), np.median(MASS[MASS > 47.0])
    assert "- stiff: vehicle.mass (explains " in text
    assert f"median {low:.4g} where it fails, {high:.4g} where it passes)" in text
    ends = text[text.index("worse by ") + 9 :].split(" points")[0].split(" to ")
    d = paired.proportions(few, 0, N, 0.95)
    assert ends == [f"{-100.0 * d.upper:.4g}", f"{-100.0 * d.lower:.4g}"]


def test_a_summary_of_one_case_has_no_rank():
    text = str(swept([record()], CASES[:1]))
    assert "Rank" not in text
    assert "Against" not in text
    same = str(swept([record(), record()], CASES[:2]))
    assert "- No difference of success is real." in same
    sobol = str(swept([record()], CASES[:1], sampling="sobol"))
    assert "Intervals are those of independent members, which a sobol does not give: they need not fit." in sobol
    assert "independent" not in text


def test_files_hold_the_tables(answer, tmp_path):
    files = answer.save(tmp_path / "new")
    names = ["table.csv", "comparison.csv", "ranking.csv", "worst.csv", "causes.csv", "sweep.json", "summary.md"]
    assert [path.name for path in files] == names
    assert all(path.parent == tmp_path / "new" for path in files)
    tables = {path.stem: list(csv.DictReader(path.open())) for path in files[:5]}
    assert [row["case"] for row in tables["table"]] == ["soft", "stiff", "unknown"]
    assert [row["of"] for row in tables["comparison"]] == ["success", *METRICS]
    assert [row["case"] for row in tables["ranking"]] == ["stiff", "soft"]
    assert len(tables["worst"]) == 20
    causes = [(row["case"], row["of"]) for row in tables["causes"]]
    assert causes == [(case, of) for case in ("soft", "stiff") for of in ("success", *METRICS) for _ in range(4)]
    assert files[6].read_text() == str(answer)
    content = json.loads(files[5].read_text())
    assert {name: content[name] for name in ("baseline", "confidence", "interval", "settings", "success")} == {
        "baseline": "soft", "confidence": 0.95, "interval": "wilson", "settings": {},
        "success": {"status": "ok", "overshoot heading": {"below": 1.5}}}  # fmt: skip
    assert (content["ensemble"]["members"], content["ensemble"]["seed"]) == (N, 3)
    assert content["scene"]["vehicle"]["mass"] == 50.0
    assert "ensemble" not in content["scene"]
    assert content["metrics"]["iae heading"]["unit"] == "rad s"
    assert list(content["metrics"]) == [*METRICS, "time_to_failure"]
    cells = [
        (cell["case"], cell["at"], cell["fixed"], bool(cell["refused"]), cell["messages"]) for cell in content["cells"]
    ]
    assert cells == [("soft", {}, [], False, []), ("stiff", {}, [], False, ["slow"]), ("unknown", {}, [], True, [])]
    assert [cell["key"] for cell in content["cells"]] == [cell.key for cell in answer.cells]


def test_what_json_cannot_hold_is_written_as_text():
    values = [np.array([1.0, 2.0]), np.float64(3.0), np.inf, 1, "a", True, None, {"type": "drag"}, (1, 2)]
    plain = [[1.0, 2.0], 3.0, "inf", 1, "a", True, None, "{'type': 'drag'}", "(1, 2)"]
    assert [output.as_json(value) for value in values] == plain


# Cases


def test_cases_are_read_from_lists_and_tables():
    case = cases.Case("own", {"run.step": 0.01})
    assert cases.cases_of(None) == (cases.Case("scene"),)
    assert cases.cases_of([case, {"name": "b", "set": {"vehicle.mass": 2.0}}])[1].set == {"vehicle.mass": 2.0}
    by_name = cases.cases_of({"a": {"heading_pid.kp": 2.0}, "b": {"replace": {"events": []}}, "c": {}})
    assert [(one.name, one.set, one.replace) for one in by_name] == [
        ("a", {"heading_pid.kp": 2.0}, {}), ("b", {}, {"events": []}), ("c", {}, {})]  # fmt: skip


@pytest.mark.parametrize(("supplied", "faults"), [
    ("pid", ["cases = 'pid' is not a list of cases"]), ([], ["cases = [] is not a list of cases"]),
    ({}, ["cases = {} is not a list of cases"]),
    (3, ["cases = 3 is not a list of cases"]),
    ([{"set": {}}, "b"], ["cases[0] = {'set': {}} has no name", "cases[1] = 'b' has no name"]),
    ([{"name": "a", "sets": {}}, {"name": "b", "set": 3}],
     ["Did you mean 'set'", "case 'b': set = 3 is not a table. Write set = { \"heading_pid.kp\" = 2.0 }"]),
    ([{"name": ""}], ["case '': name = '' is not a name. Give name = \"pid\""]),
    ([{"name": 3}], ["cases: name = 3 is not a name"]),
    ([{"name": "a", "replace": []}], ["case 'a': replace = [] is not a table. Write replace = { laws = [...] }"]),
    ([{"name": "a", "scene": "x.toml"}], ["case 'a': scene = 'x.toml' is not a Scene. Give lw.Scene.load(path)"]),
    ([{"name": "a"}, {"name": "b"}, {"name": "a"}, {"name": "a"}], ["cases = 'a' is the name of 3 cases"]),
])  # fmt: skip
def test_cases_that_are_none_are_refused_all_at_once(supplied, faults):
    with pytest.raises(lw.SceneError) as caught:
        cases.cases_of(supplied)
    assert all(fault in str(caught.value) for fault in faults)


def test_a_case_changes_numbers_lists_vehicle_and_scene():
    other = lw.Vehicle(60.0, inertia=[4.0, 5.0, 6.0], buoyancy=588.0)
    assert cases.Case("a", vehicle={"mass": 51.0}).of(SCENE).vehicle.mass == 51.0
    assert cases.Case("a", vehicle=other).of(SCENE).vehicle is other
    assert cases.Case("a", scene=BARE).of(SCENE).controller is None
    assert cases.Case("a").of(SCENE).controller is not None
    numbers = {"heading_pid.kp": 8.0, "controller.period": 0.2, "run.step": 0.01, "start.position[2]": 4.0,
               "drag.quadratic[5]": 3.0, "drag.quadratic[0]": 1.0, "environment.gravity": 9.7}  # fmt: skip
    changed = cases.Case("a", numbers).of(SCENE)
    assert (changed.controller.laws[0].kp, changed.controller.laws[0].kd) == (8.0, 4.0)
    assert (changed.controller.period, changed.controller.delay, changed.run.step) == (0.2, 0.02, 0.01)
    assert (changed.run.duration, changed.environment.gravity) == (8.0, 9.7)
    assert list(changed.start.position) == [0.0, 0.0, 4.0]
    drag = {term.key: term for term in changed.terms}["drag"]
    assert (list(drag.quadratic), list(drag.linear)) == ([1.0, 0, 0, 0, 0, 3.0], [0, 0, 0, 2.0, 2.0, 2.0])
    assert SCENE.with_numbers({}) is SCENE
    with pytest.raises(lw.SceneError, match=r"vehicle = 3 is not a Vehicle. Give"):
        cases.Case("a", vehicle=3).of(SCENE)


def test_lists_replace_and_terms_join():
    lists = {"terms": [{"type": "drag", "linear": [1.0] * 6}, {"type": "wrench", "force": [1.0, 0.0, 0.0]}]}
    joined = cases.with_lists(SCENE, lists)
    assert [term.key for term in joined.terms] == ["control_wrench", "drag", "wrench"]
    assert list(joined.terms[1].linear) == [1.0] * 6
    assert joined.controller.laws[0].kp == 3.0
    floor = cases.with_lists(SCENE, {"events": [{"type": "floor", "depth": 9.0}]})
    assert floor.events[0].depth == 9.0
    assert len(floor.terms) == 2
    laws = cases.with_lists(SCENE, {"laws": [{"type": "heading_pid", "kp": 1.0}]})
    assert laws.controller.laws[0].kp == 1.0
    assert laws.controller.guidance[0].heading == 1.0
    whole = cases.with_lists(BARE, {"controller": TABLES["controller"], "laws": [{"type": "heading_pid", "kp": 2.0}]})
    assert whole.controller.laws[0].kp == 2.0
    assert cases.with_lists(SCENE, {}) is SCENE


@pytest.mark.parametrize(("scene", "change", "words"), [
    (SCENE, {"replace": {"law": []}}, "replace.law = '...' is not a list of a scene. Did you mean 'laws'"),
    (BARE, {"replace": {"laws": []}},
     "replace.laws = '...' is a list of a controller, which this scene has not. Give the whole controller"),
    (SCENE, {"set": {"heading_pid.kq": 1.0}}, "\"heading_pid.kq\" = 1.0 is not a number of this scene. Did you mean"),
    (SCENE, {"set": {"drag.linear[9]": 1.0}},
     '"drag.linear[9]" = 1.0 is not a number of drag.linear, of shape (6,). Give an existing one'),
    (SCENE, {"set": {"drag.linear[0]": "a"}}, '"drag.linear[0]" = \'a\' is not a number of drag.linear, of shape (6,)'),
])  # fmt: skip
def test_what_does_not_fit_a_scene_is_refused(scene, change, words):
    with pytest.raises(lw.SceneError) as caught:
        cases.Case("a", **change).of(scene)
    assert words in str(caught.value)


@pytest.mark.parametrize(("supplied", "words"), [
    ([1.0], "grid = [1.0] is not a table"),
    ({"a": "bc"}, "grid.\"a\" = 'bc' is not a list of values. Give [0.0, 0.1, 0.2]"),
    ({"a": []}, 'grid."a" = [] is not a list of values'), ({"a": 3.0}, 'grid."a" = 3.0 is not a list of values'),
    ({"a": [1.0, 2.0, 1.0]}, 'grid."a" = [1.0, 2.0, 1.0] has a value twice. Keep one of them'),
])  # fmt: skip
def test_grids_that_are_none_are_refused(supplied, words):
    with pytest.raises(lw.SceneError) as caught:
        cases.grid_of(supplied)
    assert words in str(caught.value)


def test_points_go_through_the_last_axis_first():
    axes = cases.grid_of({"a": np.array([1.0, 2.0]), "b": ("x", "y")})
    assert axes == {"a": [1.0, 2.0], "b": ["x", "y"]}
    assert cases.grid_of(None) == {}
    assert [tuple(point.values()) for point in cases.points_of(axes)] == [
        (1.0, "x"), (1.0, "y"), (2.0, "x"), (2.0, "y")]  # fmt: skip
    assert cases.points_of({}) == [{}]


def test_what_a_case_sets_does_not_vary_in_it():
    vary = VARY | {"heading_pid.kp": Uniform(low=1.0, high=2.0)}
    like = lw.Ensemble(SCENE, 5, 3, vary)
    fleet, dropped = cases.ensemble_of(SCENE, {"heading_pid.kp": 2.0}, vary, like)
    assert dropped == ["heading_pid.kp"]
    assert set(fleet.vary) == set(VARY)
    assert (fleet.members, fleet.seed) == (5, 3)
    fleet, dropped = cases.ensemble_of(SCENE, {"start.position[0]": 1.0}, vary, like)
    assert dropped == ["start.position"]
    assert cases.ensemble_of(BARE, {}, vary, like)[1] == ["heading_pid.kp"]
    assert cases.ensemble_of(SCENE, {}, vary, like)[1] == []
    other = lw.Ensemble(SCENE, 8, 3, vary, "sobol")
    assert cases.ensemble_of(SCENE, {}, vary, other)[0].sampling.kind == "sobol"
    with pytest.raises(lw.SceneError, match=r"vary = 'heading_pid\.kp' does not vary here, and with sampling 'sobol'"):
        cases.ensemble_of(BARE, {}, vary, other)


def test_numbers_that_only_a_case_has_vary_in_it():
    law = {"type": "heave_pid", "kp": 2.0}
    names = [{"name": "plain"},
             {"name": "deep", "replace": {"laws": [law], "guidance": [{"type": "set_point", "depth": 1.0}]}}]  # fmt: skip
    found = swept([record(), record()], names, vary=VARY | {"heave_pid.kp": Uniform(low=1.0, high=3.0)},
                  metrics=METRICS)  # fmt: skip
    assert [cell.fixed for cell in found.cells] == [("heave_pid.kp",), ()]
    assert "heave_pid.kp" in found.inputs(found.cells[1])
    assert "heave_pid.kp" not in found.setup.members.vary
    with pytest.raises(lw.SceneError, match=r"heave_pid\.kq"):
        swept([], names, vary={"heave_pid.kq": Uniform(low=1.0, high=3.0)})


# Success


def test_success_by_status_and_limits():
    status = np.array([Status.OK, Status.FLOOR, Status.SURFACE, Status.NON_FINITE], np.uint8)
    numbers = {"x": np.array([1.0, 2.0, np.nan, 1.5])}
    passed = {words: success.Success(words).passed(status, numbers).tolist()
              for words in (("ok",), ("not_failed",), ("floor",), ("ok", "surface"), ("non_finite",))}  # fmt: skip
    assert passed == {("ok",): [True, False, False, False], ("not_failed",): [True, True, True, False],
                      ("floor",): [False, True, False, False], ("ok", "surface"): [True, False, True, False],
                      ("non_finite",): [False] * 4}  # fmt: skip
    within = success.Success(("not_failed",), {"x": (1.0, 2.5)})
    assert within.passed(status, numbers).tolist() == [False, True, False, False]
    assert success.Success(("not_failed",), {"x": (0.0, 2.0)}).passed(status, numbers).tolist() == [True] + [False] * 3


def test_conditions_are_read_and_written():
    table = {"status": ["ok", "floor"], "x": {"above": 0.0, "below": 1.0}, "y": {"below": 2}}
    read = success.success_of(table, ("x", "y"))
    assert read.status == ("ok", "floor")
    assert read.limits == {"x": (0.0, 1.0), "y": (-np.inf, 2.0)}
    assert read.to_dict() == table
    assert success.success_of(read, ("x", "y")) == read
    assert success.success_of(None, ()) == success.Success()
    assert success.Success().to_dict() == {"status": "ok"}
    with pytest.raises(lw.SceneError) as caught:
        success.success_of({"status": 3, "z": {}, "x": {}, "y": {"below": "a"}}, ("x", "y"))
    for words in ("success.status = 3",
                  'success."z" = \'...\' is not a metric of this sweep', 'success."x" = {} is not a condition',
                  'success."y".below'):  # fmt: skip
        assert words in str(caught.value)
    with pytest.raises(lw.SceneError, match=r"Give metrics=\[...\]"):
        success.success_of({"z": {"below": 1.0}}, ())
    with pytest.raises(lw.SceneError, match="success = 3 is not a table"):
        success.success_of(3, ())


def test_probabilities_of_none_and_of_some():
    assert np.isnan(success.probability(0, 0, 0.95, "wilson").value)
    assert success.probability(0, 0, 0.95, "wilson")[1:] == (0.0, 1.0)
    for kind, name in (("wilson", "wilson"), ("clopper_pearson", "exact")):
        ends = stats.binomtest(3, 10).proportion_ci(0.9, name)
        assert success.probability(3, 10, 0.9, kind) == pytest.approx((0.3, *ends))
    limit = 100.0 * (1.0 - 0.1 ** (1.0 / 2000))
    assert success.none_text(2000, 2000, 0.9) == f"none of 2,000 fails: at most {limit:.3g} % do, at 90%"
    assert success.none_text(0, 2000, 0.9) == f"none of 2,000 passes: at most {limit:.3g} % do, at 90%"
    assert success.none_text(1, 2, 0.9) == success.none_text(0, 0, 0.9) == ""


# Settings and records


def test_a_sweep_asks_solve_for_its_metrics_alone():
    """The result is made up; what solve is asked for and what a record keeps of it is not."""
    asked = {}

    def solve(fleet, **arguments):
        asked.update(arguments)
        each = {name: mock.Mock(value=np.full((1, 1, N), i)) for i, name in enumerate([*METRICS, "time_to_failure"])}
        return mock.Mock(status=np.zeros(N, np.uint8), messages=("slow",),
                         statistics={f"each {name}": one for name, one in each.items()})  # fmt: skip

    one = setup.setup_of(SCENE, None, None, VARY, N, 3, None, METRICS, {"h": 0.01})
    fleet, _ = one.fleet(one.cases[0], {})
    record = one.run(fleet, simulate=solve, threads=2, executor="processes", scheduler="steal")
    assert [values.tolist() for values in record.numbers.values()] == [[i] * N for i in range(3)]
    assert list(record.numbers) == [*METRICS, "time_to_failure"]
    assert record.messages == ("slow",)
    assert not record.refused
    assert {name: asked[name] for name in ("threads", "executor", "scheduler", "h", "keep", "until")} == {
        "threads": 2, "executor": "processes", "scheduler": "steal", "h": 0.01, "keep": "none", "until": False}  # fmt: skip
    assert asked["save"] == lw.SaveAt(fields=())
    assert [one.key for one in asked["statistics"]] == list(record.numbers)
    # Of an expression over the path there is a sample at each tick; without a controller, as the scene says.
    by_samples = setup.metrics_of(["max(depth)"])
    assert replace(one, metrics=by_samples).kept(fleet)["save"] == lw.SaveAt(every=0.1, fields=())
    bare = lw.Ensemble(BARE, N, 3)
    assert replace(one, metrics=by_samples).kept(bare)["save"] == lw.SaveAt(fields=())


def test_keys_are_of_all_that_decides_the_numbers(answer):
    one = answer.setup
    fleet = answer.cells[0].fleet
    key = one.key(fleet)
    named = replace(SCENE, ensemble_settings=None)
    assert len(key) == 32
    assert one.key(lw.Ensemble(named, N, 3, VARY)) == key
    others = [one.key(lw.Ensemble(SCENE, N, 4, VARY)), one.key(lw.Ensemble(SCENE, N + 1, 3, VARY)),
              one.key(answer.cells[1].fleet), replace(one, settings={"h": 0.01}).key(fleet),
              replace(one, metrics=setup.metrics_of(["iae heading"])).key(fleet)]  # fmt: skip
    assert len({key, *others}) == 6
    twice, thrice = (lambda state, tick: 2.0 * tick["depth"]), (lambda state, tick: 3.0 * tick["depth"])
    metrics = [lw.metrics.CustomMetric(function, name="own", fields=("position",), **more) for function, more in (
        (twice, {}), (thrice, {}), (twice, {"last": np.sin}), (twice, {"last": np.cos}), (twice, {"version": 1}))]  # fmt: skip
    keys = [replace(one, metrics=setup.metrics_of([metric])).key(fleet) for metric in (*metrics, metrics[0])]
    assert keys[0] == keys[-1]
    assert len(set(keys)) == 5
    arrays = [key_of({"x": values}) for values in (np.array([1.0, 2.0]), [1.0, 2.0], np.array([1.0, 3.0]))]
    assert arrays[0] == arrays[1] != arrays[2]
    assert key_of({"a": 1, "b": 2}) == key_of({"b": 2, "a": 1})
    assert key_of({"x": np.float64(1.0)}) == key_of({"x": 1.0})


def test_records_are_kept_in_files_and_refusals_in_memory(tmp_path):
    shown = record(ends={3: (Status.NON_FINITE, 2.5)}, messages=("slow", "late"))
    records = Records(tmp_path, list(shown.numbers), len(shown.status))
    records.put("a", shown)
    records.put("b", Record.of_refusal("no"))
    assert [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.npz")] == ["cells/a.npz"]
    again = Records(tmp_path, list(shown.numbers), len(shown.status))
    again.check()
    read = again["a"]
    assert (read.messages, read.refused) == (("slow", "late"), "")
    assert list(read.numbers) == list(shown.numbers)
    np.testing.assert_array_equal(read.status, shown.status)
    for name, values in shown.numbers.items():
        np.testing.assert_array_equal(read.numbers[name], values)
    assert again.get("b") is None
    assert records["b"].refused == "no"
    assert len(records["b"].status) == 0
    assert again.get("c") is None
    with pytest.raises(AssertionError):
        again["c"]
    kept = Records()
    kept.put("a", shown)
    assert kept["a"] is shown
    assert kept.get("b") is None


def test_progress_is_that_of_all_cells():
    shares, runs = [], []

    def run(fleet, progress, **more):
        runs.append(more)
        progress(0.5)
        return record()

    swept_by(run, progress=shares.append, threads=2)
    assert shares == pytest.approx([1 / 6, 1 / 3, 1 / 2, 2 / 3, 1.0])
    assert runs == [{"threads": 2, "executor": "threads", "scheduler": None}] * 2


def test_the_sweep_keeps_what_the_ensemble_says_unless_it_is_asked():
    base = lw.Ensemble(SCENE, 6, 7, VARY, "sobol")
    one = setup.setup_of(base, None, None, {"vehicle.mass": Uniform(low=1.0, high=2.0)}, None, None, None, [], {})
    assert (one.members.members, one.members.seed, one.members.sampling.kind) == (6, 7, "sobol")
    assert set(one.vary) == set(VARY)
    assert one.members.vary["vehicle.mass"].high == 2.0
    assert list(one.metrics) == [setup.END]
    other = setup.setup_of(base, None, None, None, 8, 9, "random", ["max(depth)"], {"h": 0.01})
    assert (other.members.members, other.members.seed, other.members.sampling.kind) == (8, 9, "random")
    assert other.settings == {"h": 0.01}
    assert list(other.metrics) == ["max(depth)", "time_to_failure"]


@pytest.mark.parametrize(("arguments", "words"), [
    ({"scene": 3}, "scene = 3 is neither a scene nor an ensemble. Give lw.Scene.load(path)"),
    ({"scene": lw.Ensemble(SCENE, 6, 7).subset([1, 2])}, "has members that were given or chosen one by one"),
    ({"vary": [1]}, "vary = [1] does not map names to distributions"),
    ({"metrics": "iae heading"}, "metrics = 'iae heading' is not a list"),
    ({"metrics": {"type": "iae"}}, "is not a list. Give [\"overshoot depth\", lw.metrics.IAE(\"heading\")]"),
    ({"metrics": ["depth"]}, "metrics[0] = 'depth' is not one number of each member. Give \"overshoot depth\""),
    ({"metrics": ["iae heading", {"type": "settling_time", "of": "depth", "within": -1.0}]},
     "metrics[1]: settling_time.within = -1.0 is not positive. Give a number above 0"),
    ({"metrics": ["iae heading", lw.statistics.Mean("depth")]}, "metrics[1] = 'mean' is not a metric: it is not one number"),
    ({"metrics": ["iae heading", lw.metrics.IAE("heading")]}, "metrics[1] = 'iae heading' is the name of another metric"),
    ({"confidence": 0.0}, "confidence = 0.0 is not between 0 and 1. Give 0.95"),
    ({"confidence": 1.0}, "confidence = 1.0 is not between 0 and 1"),
])  # fmt: skip
def test_what_a_sweep_is_asked_wrongly_is_refused(arguments, words):
    arguments = {"scene": SCENE, "members": N, "metrics": METRICS} | arguments
    with pytest.raises(lw.SceneError) as caught:
        lw.sweep(arguments.pop("scene"), **arguments)
    assert words in str(caught.value)


def test_ten_thousand_cells_are_not_too_many():
    grid = {"run.step": [0.01 * i for i in range(1, 101)], "run.duration": list(range(1, 103))}
    refused = mock.Mock(side_effect=lw.SceneError(["no"]))
    told = r"10,200 cells' are 40 members each. Give at most 10,000 cells, or vary a number"
    with pytest.raises(lw.SceneError, match=told):
        setup.setup_of(SCENE, None, grid, None, N, None, None, [], {}, predict=refused)
    grid["run.duration"] = list(range(1, 101))
    assert len(setup.setup_of(SCENE, None, grid, None, 1, None, None, [], {}).cells) == 10_000


def test_a_plan_in_words():
    one = setup.setup_of(
        SCENE, CASES[:2], {"controller.delay": [0.02, 0.04, 0.06]}, VARY, 2000, 3, None, METRICS, {"h": 0.01}
    )
    prediction = mock.Mock(advance=4.0, set_up=1.0, compile=2.5, memory=3e6)
    predict = mock.Mock(return_value=prediction)
    text = setup.plan_text(one, 2, predict=predict)
    lines = text.splitlines()
    assert lines == ["cells       6: 2 cases at 3 points of the grid", "members     2,000 of each, the same in all",
                     "time        about 30 s, and 2.5 s for each kernel", "memory      3 MB",
                     "disk        0.3 MB"]  # fmt: skip
    (fleet,), asked = predict.call_args
    assert (asked["threads"], asked["h"], asked["keep"]) == (2, 0.01, "none")
    assert (fleet.scene.controller.delay, fleet.members) == (0.02, 2000)
    durations = [setup.duration_text(seconds) for seconds in (119.0, 120.0, 7200.0, 3 * 86400.0, 6.3e7, 6.2e7)]
    assert durations == ["1.2e+02 s", "2 minutes", "2 hours", "3 days", "2 years", "7.2e+02 days"]
    assert (
        setup.too_many_text(one, 45, predict=predict)
        == "are 2,000 members each and would take 3 minutes on this machine"
    )


# Files of sweeps


def test_a_sweep_file_is_read_whole(tmp_path):
    scene = '[vehicle]\nmass = 50.0\ninertia = [4.0, 5.0, 6.0]\n[run]\nmethod = "psi_x"\nstep = 0.02\nduration = 8.0\n'
    (tmp_path / "scene.toml").write_text(scene)
    (tmp_path / "other.toml").write_text(scene.replace("mass = 50.0", "mass = 60.0"))
    (tmp_path / "sweep.toml").write_text("""
scene = "scene.toml"
members = 5
seed = 4
sampling = "sobol"
confidence = 0.9
interval = "clopper_pearson"
metrics = ["max(depth)"]
success = { "max(depth)" = { below = 1.0 } }
[run]
method = "rk4"
step = 0.01
duration = 3.0
dtype = "float32"
[vary]
"vehicle.mass" = { uniform = { low = 45.0, high = 55.0 } }
[compare]
baseline = "b"
[grid]
"environment.gravity" = [9.7, 9.8]
[[cases]]
name = "a"
set = { "vehicle.mass" = 51.0 }
[[cases]]
name = "b"
scene = "other.toml"
[[cases]]
name = "c"
vehicle = { name = "sphere" }
[[cases]]
name = "d"
vehicle = { mass = 52.0 }
""")
    read = arguments_of_file(tmp_path / "sweep.toml")
    assert {name: read[name] for name in ("members", "seed", "sampling", "confidence", "interval", "metrics", "baseline")} == {
        "members": 5, "seed": 4, "sampling": "sobol", "confidence": 0.9, "interval": "clopper_pearson",
        "metrics": ["max(depth)"], "baseline": "b"}  # fmt: skip
    assert (read["method"], read["h"], read["t1"], read["dtype"]) == ("rk4", 0.01, 3.0, "float32")
    assert read["success"] == {"max(depth)": {"below": 1.0}}
    assert read["grid"] == {"environment.gravity": [9.7, 9.8]}
    assert (read["vary"]["vehicle.mass"].high, read["scene"].vehicle.mass) == (55.0, 50.0)
    a, b, c, d = read["cases"]
    assert a == {"name": "a", "set": {"vehicle.mass": 51.0}}
    assert b["scene"].vehicle.mass == 60.0
    assert "vehicle" not in c
    assert c["scene"].vehicle.mass == lw.Scene.named("sphere").vehicle.mass
    assert c["scene"].run.duration == 8.0
    assert d == {"name": "d", "vehicle": {"mass": 52.0}}
    (tmp_path / "short.toml").write_text('scene = "scene.toml"\n')
    assert set(arguments_of_file(tmp_path / "short.toml")) == {"scene"}


@pytest.mark.parametrize(("text", "words"), [
    ("members = 3", ["scene = '' is not a path of a scene file. Write scene = \"remus_autopilot.toml\""]),
    ("scene = 3\nvary = 4\ncases = {}\nmetrics = 'a'\nbig = 1",
     ["scene = 3 is not a path", "vary = 4 is not a table. See docs/guide/is_my_controller_robust.md", "cases = {} is not",
      "metrics = 'a' is not a list", "big"]),
    ("scene = 's.toml'\ncompare = { base = 1 }\nrun = { steps = 1 }\ncases = [3, { name = 'a', scene = 4 }]",
     ["compare.base", "run.steps", "cases = 3 is not a table", "cases.scene = 4 is not a path of a scene file"]),
    ("scene = 's.toml'\nvary = { a = 3, b = { normal = { st = 1.0 } } }", ['vary."a"', 'vary."b"']),
    ("scene = 's.toml'\ncases = [{ name = 'a', vehicle = { name = 'spher' } }, { name = 'b', scene = 'none.toml' }]",
     ["case 'a': ", "Did you mean 'sphere'", "case 'b': ", "none.toml"]),
])  # fmt: skip
def test_sweep_files_at_fault_are_refused_with_every_fault(tmp_path, text, words):
    (tmp_path / "s.toml").write_text("[vehicle]\nmass = 50.0\ninertia = [4.0, 5.0, 6.0]\n")
    (tmp_path / "sweep.toml").write_text(text)
    with pytest.raises(lw.SceneError) as caught:
        arguments_of_file(tmp_path / "sweep.toml")
    assert [word for word in words if word not in str(caught.value)] == []
