# SPDX-License-Identifier: Apache-2.0
"""Indices and effects from numbers made by hand: estimates, tables, files, what is left out, what SALib is told."""

import csv
import dataclasses
import json
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.distributions import Choice, LogNormal, Normal, Uniform
from lgvi_warp.engine.plan import Plan
from lgvi_warp.sampling.designs import sampling_of
from lgvi_warp.sampling.designs.designs import Morris, Saltelli
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.uncertainty.sensitivity import adaptor, analyses, outputs
from lgvi_warp.uncertainty.sensitivity.estimates import sobol_estimates
from lgvi_warp.uncertainty.sensitivity.indices import Indices, MorrisEffects, SobolIndices

BARE = lw.Scene(lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0)))
VARY = {"start.position[0]": Uniform(low=0.0, high=1.0),
        "start.position[1]": Uniform(low=0.0, high=2.0),
        "vehicle.mass": Uniform(low=1.0, high=3.0)}  # fmt: skip
FIELDS = {"factors": ("a", "bc"), "quantities": ("depth", "energy"), "mean": np.array([1.23456789, np.nan]),
          "std": np.array([0.12345, 2.0]), "samples": 8, "members": 48, "failed": 1, "confidence": 0.9,
          "messages": ("one",), "provenance": {"seed": 3}}  # fmt: skip
TABLE = np.array([[0.5, 0.25], [0.125, np.nan]])


def sobol_indices(second=True, **more):
    pairs = np.array([[[np.nan, 0.3], [0.3, np.nan]], [[np.nan, 0.05], [0.05, np.nan]]])
    both = {"second": pairs, "second_confidence": 0.2 + 0.0 * pairs} if second else dict.fromkeys(
        ("second", "second_confidence"))  # fmt: skip
    return SobolIndices(**FIELDS | more, first=TABLE, first_confidence=0.1 * TABLE, total=2.0 * TABLE,
                        total_confidence=0.2 * TABLE, **both)  # fmt: skip


def effects():
    return MorrisEffects(**FIELDS, mu_star=TABLE, mu_star_confidence=0.1 * TABLE, mu=-TABLE, sigma=3.0 * TABLE)


def test_a_table_in_words():
    assert str(sobol_indices()).splitlines()[:-1] == [
        "Sobol indices: 8 samples, 48 members, 1 failed",
        "note: one",
        "",
        "depth: mean 1.23457, standard deviation 0.123",
        "  factor                  first                  total",
        "  a                 0.5 +- 0.05               1 +- 0.1",
        "  bc              0.25 +- 0.025            0.5 +- 0.05",
        "  a with bc: second 0.3 +- 0.2",
        "",
        "energy: mean nan, standard deviation 2",
        "  factor                  first                  total",
        "  a              0.125 +- 0.013          0.25 +- 0.025",
        "  bc                 nan +- nan             nan +- nan",
        "+- is half the 90% interval",
    ]
    lines = str(effects()).splitlines()
    assert lines[0] == "Morris screening: 8 samples, 48 members, 1 failed"
    assert lines[4].split() == ["factor", "mu_star", "mu", "sigma"]
    assert lines[5].split() == ["a", "0.5", "+-", "0.05", "-0.5", "1.5"]
    assert not any("with" in line for line in str(sobol_indices(second=False)).splitlines()[:-1])


def test_records_of_every_index():
    rows = list(sobol_indices().rows())
    assert len(rows) == 2 * 2 * 2 + 2
    assert rows[0] == {"quantity": "depth", "factor": "a", "other": "", "index": "first", "value": 0.5,
                       "confidence": 0.05}  # fmt: skip
    assert rows[3] == {"quantity": "depth", "factor": "bc", "other": "", "index": "total", "value": 0.5,
                       "confidence": 0.05}  # fmt: skip
    assert rows[8] == {"quantity": "depth", "factor": "a", "other": "bc", "index": "second", "value": 0.3,
                       "confidence": 0.2}  # fmt: skip
    assert [row["quantity"] for row in rows[8:]] == ["depth", "energy"]
    rows = list(effects().rows())
    assert [row["index"] for row in rows[:3]] == ["mu_star", "mu", "sigma"]
    assert (rows[1]["value"], rows[0]["confidence"]) == (-0.5, 0.05)
    assert np.isnan(rows[1]["confidence"])
    assert len(rows) == 12


@pytest.mark.parametrize("built", [sobol_indices, lambda: sobol_indices(second=False), effects])
def test_an_analysis_comes_back_from_its_files(built, tmp_path):
    found = built()
    paths = found.save(tmp_path / "new")
    assert [path.name for path in paths] == ["sensitivity.txt", "sensitivity.csv", "sensitivity.json"]
    assert paths[0].read_text() == f"{found}\n"
    with paths[1].open() as file:
        assert [row["index"] for row in csv.DictReader(file)] == [row["index"] for row in found.rows()]
    again = Indices.load(paths[2])
    assert type(again) is type(found)
    assert json.loads(paths[2].read_text()) == found.to_dict()
    for field in dataclasses.fields(found):
        one, other = getattr(found, field.name), getattr(again, field.name)
        assert np.array_equal(one, other, equal_nan=True) if isinstance(one, np.ndarray) else one == other, field.name
    content = json.loads(paths[2].read_text())
    assert (content["mean"], content["provenance"]) == ([1.23456789, None], {"seed": 3})
    assert content["name"] == found.name
    (tmp_path / "x.json").write_text(json.dumps(content | {"name": "heat"}))
    with pytest.raises(ValueError, match=r"x\.json .*'heat' is not an analysis"):
        Indices.load(tmp_path / "x.json")


def test_ten_pairs_are_named_those_above_their_interval():
    d = 6
    second = np.full((1, d, d), np.nan)
    for number, (j, k) in enumerate((j, k) for j in range(d) for k in range(j + 1, d)):
        second[0, j, k] = second[0, k, j] = 0.01 * number
    many = sobol_indices(factors=tuple("abcdef"), quantities=("depth",), mean=np.ones(1), std=np.ones(1))
    many = dataclasses.replace(many, second=second, second_confidence=np.full((1, d, d), 0.02), **{
        name: np.zeros((1, d)) for name in ("first", "total", "first_confidence", "total_confidence")})  # fmt: skip
    pairs = [line.split(":")[0].strip() for line in str(many).splitlines() if " with " in line]
    assert len(pairs) == 10
    assert (pairs[0], pairs[-1]) == ("e with f", "b with c")
    few = dataclasses.replace(many, second_confidence=np.full((1, d, d), 0.13))
    assert [line.split(":")[0].strip() for line in str(few).splitlines() if " with " in line] == ["e with f"]


# Estimates


def of_design(design, samples, quantity):
    """An ensemble of a design, and outputs that are a function of its numbers."""
    fleet = analyses.designed(BARE, VARY, 3, design, samples)
    drawn = fleet.select(0, fleet.members)
    values = quantity(drawn.position[:, 0], drawn.position[:, 1], drawn.parameters["vehicle.mass"])
    values = np.stack(values, axis=1)
    lost = np.zeros(fleet.members, bool)
    return fleet, outputs.Outputs(values, ("q", "r")[: values.shape[1]], lost, {"OK": fleet.members}, {"seed": 3})


def test_indices_are_saltellis_of_a_sum_and_a_product():
    """q = x + y, of variances 1/12 and 4/12; r = (x - 1/2) (m - 2), which is all of the pair."""
    fleet, made = of_design(Saltelli(True, 8), 1024, lambda x, y, m: (x + y, (x - 0.5) * (m - 2.0)))
    found = analyses.sobol_of(fleet, made, confidence=0.9)
    assert found.factors == ("start.position[0]", "start.position[1]", "vehicle.mass")
    assert found.quantities == ("q", "r")
    assert found.first[0] == pytest.approx([0.2, 0.8, 0.0], abs=0.03)
    assert found.total[0] == pytest.approx([0.2, 0.8, 0.0], abs=0.03)
    assert found.first[1] == pytest.approx([0.0, 0.0, 0.0], abs=0.1)
    assert found.total[1] == pytest.approx([1.0, 0.0, 1.0], abs=0.1)
    assert found.second[1, 0, 2] == found.second[1, 2, 0] == pytest.approx(1.0, abs=0.1)
    assert np.isnan(found.second[0, 1, 1])
    assert found.second_confidence[1, 2, 0] == found.second_confidence[1, 0, 2] > 0.0
    assert (found.samples, found.members, found.failed, found.confidence) == (1024, 1024 * 8, 0, 0.9)
    assert found.mean == pytest.approx([1.5, 0.0], abs=0.01)
    assert found.std == pytest.approx(made.values.std(axis=0, ddof=1))
    wide = analyses.sobol_of(fleet, made, confidence=0.99)
    # Student's t of 7 degrees of freedom: 3.50 for 99 %, 1.89 for 90 %.
    assert (wide.first_confidence[0, :2] > 1.8 * found.first_confidence[0, :2]).all()
    assert np.array_equal(wide.first, found.first)
    alone, few = of_design(Saltelli(False), 64, lambda x, y, m: (x + y,))
    without = analyses.sobol_of(alone, few)
    assert np.isnan(without.first_confidence).all()
    assert "there are no intervals" in without.messages[0]
    assert without.second is None
    assert without.second_confidence is None
    assert without.members == 64 * 5


def test_estimates_are_those_of_salib():
    from SALib.analyze import sobol

    fleet, made = of_design(Saltelli(True, 4), 64, lambda x, y, m: (np.exp(x) * y + m,))
    found = analyses.sobol_of(fleet, made)
    problem = {"num_vars": 3, "names": list("xym"), "bounds": [[0.0, 1.0]] * 3}
    told = sobol.analyze(problem, made.values[:, 0].copy(), calc_second_order=True, num_resamples=2, seed=1)
    np.testing.assert_allclose(found.first[0], told["S1"], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found.total[0], told["ST"], rtol=1e-12, atol=1e-14)
    above = np.triu_indices(3, 1)
    np.testing.assert_allclose(found.second[0][above], told["S2"][above], rtol=1e-11, atol=1e-14)


def linear(u):
    """A sum of three normal numbers, of which 0.794, 0.198 and 0.008 of the variance are."""
    return stats.norm.ppf(u) @ SLOPES


def ishigami(u):
    """Ishigami & Homma (1990): sin x + 7 sin^2 y + 0.1 z^4 sin x."""
    x, y, z = (2.0 * np.pi * u - np.pi).T
    return np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)


SLOPES = np.array([2.0, 1.0, 0.2])
PARTS = SLOPES**2 / np.sum(SLOPES**2)
V1, V2, V13 = 0.5 * (1.0 + 0.02 * np.pi**4) ** 2, 49.0 / 8.0, 0.01 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
EXACT = {linear: (PARTS, PARTS),
         ishigami: tuple(np.array(parts) / (V1 + V2 + V13) for parts in ((V1, V2, 0.0), (V1 + V13, V2, V13)))}  # fmt: skip


@pytest.mark.ci
@pytest.mark.slow_but("*-64-8")
@pytest.mark.parametrize(("samples", "replicates"), [(64, 8), (512, 8), (256, 16)])
@pytest.mark.parametrize("function", EXACT)
def test_intervals_of_indices_hold_and_are_no_wider_than_they_need(function, samples, replicates):
    """The design and the estimates, over 300 seeds: without a scene, and without a kernel."""
    design, found, group = Saltelli(False, replicates), [], np.arange(samples)
    for seed in range(300):
        cube = Space(seed, tuple("xyz"), (1, 1, 1), tuple((name, (i,)) for i, name in enumerate("xyz")))
        levels = design.draw(cube, np.arange(samples * design.group_size(cube)))
        Y = function(np.concatenate([levels[name] for name in "xyz"], axis=1)).reshape(samples, -1)
        found.append(sobol_estimates(Y, design.replicate_of(group), False, 0.95))
    held, ratios = [], []
    for index, exact in enumerate(EXACT[function]):
        values, half = (np.array([getattr(one[index], name) for one in found]) for name in ("value", "half"))
        held.append(np.abs(values - exact) <= half)
        ratios.append(np.median(half, axis=0) / (1.96 * values.std(axis=0)))
    # Of 1,800 intervals, those of one seed depending on each other: 0.5 % to 1.3 % is one standard deviation.
    assert 0.91 <= np.mean(held) <= 0.975
    # Student's t of 7 degrees of freedom is 1.2 times the normal's; its median spread is 0.95 of the true one.
    assert 0.8 <= np.median(ratios) <= 1.2
    assert np.max(ratios) < 1.4


def test_factors_are_in_the_users_order_and_in_groups():
    vary = {"vehicle.mass": Uniform(low=1.0, high=3.0),
            "start.position": Uniform(low=[0.0] * 3, high=[1.0, 2.0, 1.0]),
            "environment.gravity": Uniform(low=9.0, high=10.0)}  # fmt: skip
    labels = ("vehicle.mass", *(f"start.position[{i}]" for i in range(3)), "environment.gravity")

    def of(design, quantity):
        fleet = analyses.designed(BARE, vary, 3, design, 64)
        drawn = fleet.select(0, fleet.members)
        y = quantity(drawn.position.T, drawn.parameters["vehicle.mass"])[:, None]
        return fleet, outputs.Outputs(y, ("q",), np.zeros(len(y), bool), {}, {})

    alone = analyses.sobol_of(*of(Saltelli(True, 8), lambda x, m: 4.0 * m + 3.0 * x[1]))
    assert alone.factors == labels
    assert alone.total[0] == pytest.approx(np.array([16.0, 0.0, 9.0, 0.0, 0.0]) / 25.0, abs=0.05)
    screened = analyses.morris_of(*of(Morris(4), lambda x, m: 4.0 * m + 3.0 * x[1]), resamples=5)
    assert screened.factors == labels
    assert screened.mu_star[0] == pytest.approx([8.0, 0.0, 6.0, 0.0, 0.0])
    # The interaction of two entries of a group is the group's own.
    design = Saltelli(True, 8, {"start": ["start.position"], "rest": ["environment.gravity"]})
    grouped = analyses.sobol_of(*of(design, lambda x, m: 10.0 * (x[0] - 0.5) * (x[1] - 1.0) + m))
    assert grouped.factors == ("vehicle.mass", "start", "rest")
    assert grouped.members == 64 * 8
    # Variances: 100 / 12 / 3 and 1 / 3.
    assert grouped.first[0] == pytest.approx([3.0 / 28.0, 25.0 / 28.0, 0.0], abs=0.1)
    assert grouped.total[0] == pytest.approx(grouped.first[0], abs=0.1)
    again = lw.Ensemble(BARE, 64 * 8, 3, vary, sampling_of(design.to_dict()))
    assert again.sampling == design
    assert again.to_dict()["sampling"] == {
        "saltelli": {"replicates": 8, "groups": {"start": ["start.position"], "rest": ["environment.gravity"]}}
    }


@pytest.mark.parametrize(("groups", "words"), [
    ({"a": ["start.positon"]}, "does not vary by itself. Did you mean"), (3, "is not a mapping of names"),
    ({"a": ["vehicle.mass"], "b": ["vehicle.mass"]}, "is in 'a' as well"), ({"a": []}, "is not a list of names"),
    ({"a": "vehicle.mass"}, "is not a list of names"), ({"vehicle.mass": ["start.position[0]"]}, "is the name of a factor"),
])  # fmt: skip
def test_groups_that_are_none(groups, words):
    with pytest.raises(lw.SceneError) as caught:
        analyses.sobol(BARE, "depth", samples=8, vary=VARY, groups=groups)
    assert words in str(caught.value)


def test_samples_are_shared_among_replicates():
    for samples, words in (
        (20, "not a multiple of replicates = 8. Give 16 or 24"),
        (4, "not a multiple of replicates = 8. Give 8"),
    ):
        with pytest.raises(lw.SceneError, match=words):
            analyses.sobol(BARE, "depth", samples=samples, vary=VARY)
    with pytest.raises(lw.SceneError, match=r"replicates = 3 is not a power of two"):
        analyses.sobol(BARE, "depth", samples=6, replicates=3, vary=VARY)


@pytest.mark.parametrize(("entry", "arguments", "words"), [
    (lw.uq.sobol, {"store": "a"}, r"lw\.uq\.sobol\(\) has no argument 'store'"),
    (lw.uq.sobol, {"sample": 8}, "Did you mean 'samples'"), (lw.uq.sobol, {"resamples": 100}, "give replicates=8"),
    (lw.uq.morris, {"groups": {}}, r"lw\.uq\.morris\(\) has no argument 'groups'"),
    (lw.uq.evaluate, {"fields": ()}, r"lw\.uq\.evaluate\(\) has no argument 'fields'"),
    (lw.uq.model, {"survey_all": True}, r"lw\.uq\.model\(\) has no argument 'survey_all'"),
    (lw.uq.model, {"level": True}, "Did you mean 'levels'"),
])  # fmt: skip
def test_an_argument_that_does_not_exist_is_told_as_such(entry, arguments, words):
    given = (lw.Ensemble(BARE, 4, 0, VARY), "depth") if entry is lw.uq.evaluate else (BARE, VARY, "depth")
    with pytest.raises(TypeError, match=words):
        entry(*(given if entry in (lw.uq.model, lw.uq.evaluate) else (BARE, "depth")), **arguments)


def test_effects_of_a_linear_quantity_are_its_slopes():
    """Per side of the cube: 1 of x, 2 of y, and -3 times 2 of the mass."""
    for levels in (4, 6):
        fleet, made = of_design(Morris(levels), 16, lambda x, y, m: (x + y - 3.0 * m,))
        found = analyses.morris_of(fleet, made, resamples=10)
        assert found.mu[0] == pytest.approx([1.0, 2.0, -6.0])
        assert found.mu_star[0] == pytest.approx([1.0, 2.0, 6.0])
        assert found.sigma[0] == pytest.approx([0.0] * 3, abs=1e-9)
        assert (found.samples, found.members) == (16, 64)


def test_a_quantity_that_does_not_vary_has_no_indices():
    fleet, made = of_design(Saltelli(False, 8), 16, lambda x, y, m: (x, 1e6 + 1e-9 * y))
    found = analyses.sobol_of(fleet, made)
    assert np.isnan(found.first[1]).all()
    assert np.isfinite(found.first[0]).all()
    assert found.messages == ("r does not vary: it has no indices",)
    messages = []
    assert analyses.varying(np.array([[0.0, 1.0, 1.0], [0.0, 1.0 + 2e-14, 1.0 + 5e-15]]), "abc", messages) == [1]
    assert messages == ["a does not vary: it has no indices", "c does not vary: it has no indices"]


def test_groups_with_failures_are_refused_or_left_out():
    values = np.arange(12.0)[:, None]
    lost = np.zeros(12, bool)
    lost[5] = True
    made = outputs.Outputs(values, ("q",), lost, {"OK": 9, "NON_FINITE": 1, "SURFACE": 2}, {})
    with pytest.raises(outputs.FailedMembers) as caught:
        analyses.whole_groups(made, 4, "refuse")
    assert (
        'Fix the failing members (see result.status of lw.solve), or use the whole groups alone: failed="drop"'
        in str(caught.value)
    )
    whole, messages = analyses.whole_groups(made, 4, "drop")
    assert whole.tolist() == [True, False, True]
    assert "The 1 of 3 groups that they are in were left out, and what remains may not be typical" in messages[0]
    assert messages[1] == "2 of 12 members were stopped by events: their numbers are those at the stop"
    assert len(messages) == 2
    with pytest.raises(outputs.FailedMembers, match="1 groups of the design are whole, too few for an estimate"):
        analyses.whole_groups(outputs.Outputs(values, ("q",), lost, {}, {}), 6, "drop")
    good = outputs.Outputs(values, ("q",), np.zeros(12, bool), {"OK": 12}, {})
    assert analyses.whole_groups(good, 4, "refuse")[1] == []


@pytest.mark.parametrize(("arguments", "words"), [
    ((1, 0.9, "drop", 10), "samples = 1 is not a whole number from 2. Give 2 or more"),
    ((True, 0.9, "drop", 10), "samples = True is not a whole number from 2"),
    ((2, 0.9, "drop", 1.5), "resamples = 1.5 is not a whole number from 2"),
    ((2, 0.0, "drop", 2), "confidence = 0.0 is not between 0 and 1. Give a level, such as 0.95"),
    ((2, 1.0, "drop", 2), "confidence = 1.0 is not between 0 and 1"), ((2, 0.9, "keep", 2), "failed = 'keep'"),
])  # fmt: skip
def test_settings_of_an_analysis_that_are_none(arguments, words):
    analyses.check_settings(2, 0.5, "refuse", np.int64(2))
    with pytest.raises(lw.SceneError) as caught:
        analyses.check_settings(*arguments)
    assert words in str(caught.value)


def test_a_design_takes_what_varies_and_the_seed_unless_given(scene):
    fleet = lw.Ensemble(BARE, 5, 7, VARY)
    own = analyses.designed(fleet, None, None, Saltelli(True), 4)
    assert (own.seed, own.members, set(own.vary)) == (7, 4 * 8, set(VARY))
    assert own.scene is fleet.scene
    other = analyses.designed(fleet, {"vehicle.mass": VARY["vehicle.mass"]}, 9, Saltelli(False), 4)
    assert (other.seed, other.members, list(other.vary)) == (9, 4 * 3, ["vehicle.mass"])
    paper = analyses.designed(scene, None, None, Morris(4), 3)
    assert paper.seed == scene.ensemble_settings.seed
    assert set(paper.vary) == set(scene.ensemble_settings.vary)
    with pytest.raises(lw.SceneError, match=r"scene = 3 is neither an Ensemble nor a Scene. Give lw\.Scene"):
        analyses.designed(3, None, None, Saltelli(True), 4)


def test_what_an_analysis_asks_for_reaches_its_runs():
    asked = []

    def evaluate(fleet, of, **settings):
        asked.append((fleet, of, settings))
        x = fleet.select(0, fleet.members).position[:, :1]
        return outputs.Outputs(x, ("q",), np.zeros(fleet.members, bool), {}, {})

    with mock.patch.object(analyses, "evaluate", evaluate):
        sobol = analyses.sobol(
            BARE, "depth", samples=4, vary=VARY, seed=5, second_order=False, confidence=0.8, replicates=4, h=0.1
        )
        morris = analyses.morris(
            BARE, "depth", samples=6, levels=6, vary=VARY, seed=5, confidence=0.8, resamples=7, t1=2.0
        )
        pairs = analyses.sobol(BARE, "depth", samples=8, vary=VARY)
        screened = analyses.morris(BARE, "depth", vary=VARY)
    (first, of, settings), (second, *_, more), (third, *_), (fourth, *_) = asked
    assert (of, settings, more) == ("depth", {"h": 0.1}, {"t1": 2.0})
    assert (first.seed, second.seed) == (5, 5)
    assert not first.sampling.second_order
    assert third.sampling.second_order
    assert second.sampling.levels == 6
    assert (first.sampling.replicates, third.sampling.replicates) == (4, 8)
    assert (sobol.confidence, morris.confidence, pairs.confidence, screened.confidence) == (0.8, 0.8, 0.95, 0.95)
    assert (sobol.members, morris.members, fourth.members, fourth.sampling.levels) == (4 * 5, 6 * 4, 64 * 4, 4)


def test_outputs_are_of_all_groups_of_members(monkeypatch):
    """Three runs of at most four members; one member fails, one is not finite."""
    runs, shares = [], []

    class Runner(outputs.Runner):
        def __init__(self, fleet, statistics, **settings):
            runs.append((fleet, settings))

        def run(self, group, progress, warned):
            runs.append(group)
            progress(0.5)
            status = np.zeros(group.members, np.uint8)
            status[group.indices == 5] = lw.Status.NON_FINITE
            return SimpleNamespace(group=group, members=group.members, status=status, provenance={"run": len(runs)})

    def quantity(result):
        place = result.group.indices.astype(float)
        return np.stack([place, np.where(place == 9.0, np.inf, -place)], axis=1)

    monkeypatch.setattr(outputs, "Runner", Runner)
    monkeypatch.setattr(outputs, "PATHS_AT_ONCE", 4)
    fleet = lw.Ensemble(BARE, 10, 3, VARY)
    found = outputs.evaluate(fleet, quantity, progress=shares.append, threads=2, h=0.1, executor="processes")
    assert runs[0][0] is fleet
    assert {"threads": 2, "executor": "processes", "h": 0.1}.items() <= runs[0][1].items()
    assert [list(group.indices) for group in runs[1:]] == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]
    np.testing.assert_array_equal(found.values[:, 0], [0, 1, 2, 3, 4, np.nan, 6, 7, 8, 9])
    np.testing.assert_array_equal(found.values[[5, 9], 1], np.nan)
    assert found.labels == ("quantity[0]", "quantity[1]")
    assert np.flatnonzero(found.failed).tolist() == [5, 9]
    assert found.provenance["run"] == 4
    assert found.provenance["ensemble"] == fleet.to_dict()
    assert shares == pytest.approx([0.2, 0.6, 0.9])
    assert "Again" in found.text("again")
    runs.clear()
    outputs.evaluate(
        fleet, lambda result: np.zeros((result.group.members, 1)), common_noise=True, progress=lambda part: None
    )
    assert all((group.indices == 0).all() for group in runs[1:])
    assert [group.members for group in runs[1:]] == [4, 4, 2]


# Adaptors


def test_distributions_in_salibs_words():
    def told(distribution, base=2.0):
        one = SimpleNamespace(bases=(np.array(base),), distribution=distribution)
        return [adaptor.salib_distribution(*each) for each in adaptor.entries_of(one)]

    assert told(Normal(std=0.5)) == [("norm", [2.0, 0.5])]
    assert told(Normal(mean=1.0, std=0.5)) == [("norm", [1.0, 0.5])]
    assert told(Normal(relative=0.1), -2.0) == [("norm", [-2.0, 0.2])]
    assert told(Uniform(low=1.0, high=3.0)) == [("unif", [1.0, 3.0])]
    assert told(Uniform(half_width=0.5)) == [("unif", [1.5, 2.5])]
    assert told(Uniform(half_width=[0.5, 1.0]), [0.0, 2.0]) == [("unif", [-0.5, 0.5]), ("unif", [1.0, 3.0])]
    assert told(Uniform(relative=[0.5, 0.25]), [-2.0, 4.0]) == [("unif", [-3.0, -1.0]), ("unif", [3.0, 5.0])]
    assert told(Uniform(low=[1.0, 2.0], high=[3.0, 5.0]), [0.0, 0.0]) == [("unif", [1.0, 3.0]), ("unif", [2.0, 5.0])]
    ((name, (log, sigma)),) = told(LogNormal(median=3.0, sigma=0.2))
    assert (name, sigma) == ("lognorm", 0.2)
    assert log == pytest.approx(np.log(3.0))
    assert told(LogNormal(sigma=0.2))[0][1][0] == pytest.approx(np.log(2.0))
    assert (told(LogNormal(sigma=0.2), -2.0), told(Choice([1.0, 2.0]))) == ([None], [None])


@pytest.mark.kernel
def test_a_model_describes_its_columns(monkeypatch):
    monkeypatch.setattr(Plan, "compile", lambda plan: 0.0)
    settings = {"method": "psi_s", "h": 0.1, "t1": 1.0}
    vary = {"vehicle.mass": Normal(std=0.1), "start.position": Uniform(half_width=[1.0, 2.0, 3.0])}
    model = adaptor.model(BARE, vary, "depth", **settings)
    names = ["vehicle.mass", "start.position[0]", "start.position[1]", "start.position[2]"]
    assert list(model.names) == names
    assert model.problem == {"num_vars": 4, "names": names,
                             "bounds": [[1.0, 0.1], [-1.0, 1.0], [-2.0, 2.0], [-3.0, 3.0]],
                             "dists": ["norm", "unif", "unif", "unif"]}  # fmt: skip
    u = np.array([[0.25, 0.5], [0.75, 1.0]])
    ends = [distribution.ppf(u) for distribution in model.distributions]
    assert (ends[0].shape, ends[0][0, 1]) == ((2, 2), 1.0)
    assert np.isfinite(ends[0]).all()
    for i, width in enumerate((1.0, 2.0, 3.0)):
        np.testing.assert_allclose(ends[i + 1], width * (2.0 * u - 1.0), atol=1e-12)
    levels = adaptor.model(BARE, vary, "depth", levels=True, **settings)
    np.testing.assert_array_equal(levels.distributions[0].ppf([0.1, 0.2]), [0.1, 0.2])
    problem = levels.problem
    assert problem["num_vars"] == 4
    assert problem["bounds"] == [[0.0, 1.0]] * 4
    assert problem["names"] == names
    bare = adaptor.model(BARE, ["vehicle.mass"], "depth", **settings)
    with pytest.raises(lw.SceneError, match=r"vary\.names = .* have no distributions. Map names to distributions"):
        _ = bare.problem
    with pytest.raises(lw.SceneError, match=r"vary: names alone have no distributions. Map names to distributions"):
        _ = bare.distributions
    odd = adaptor.model(BARE, {"vehicle.mass": Choice([1.0, 2.0])}, "depth", **settings)
    with pytest.raises(lw.SceneError, match=r"is unknown to SALib. Use levels=True"):
        _ = odd.problem


@pytest.mark.kernel
def test_a_model_is_called_in_two_shapes(monkeypatch):
    monkeypatch.setattr(Plan, "compile", lambda plan: 0.0)
    model = adaptor.model(BARE, {"vehicle.mass": Normal(std=0.1)}, "depth", method="psi_s", h=0.1, t1=1.0, progress="p")
    asked = []

    def prepared(X, progress, **noise):
        asked.append((X, progress))
        return np.arange(6).reshape(3, 2)

    model._prepared = prepared
    X = np.ones((3, 1))
    assert model(X).shape == (3, 2)
    assert asked[-1] == (X, "p")
    np.testing.assert_array_equal(model.scipy(X.T), np.arange(6).reshape(3, 2).T)
    np.testing.assert_array_equal(asked[-1][0], X)
    table = {"vehicle.mass": np.ones(3)}
    assert model.scipy(table).shape == (2, 3)
    assert asked[-1][0] is table
