# SPDX-License-Identifier: Apache-2.0
"""A sequence may be given as a list, tuple, array, column, range, iterator or generator, with the same bits."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.arguments import items_of
from tests.support.odd_calls import BODY
from tests.support.sequences import GOOD, called, sequence_arguments, series_of, state_of, ways_of

CALLED = called()


def read(path, arguments):
    return state_of(CALLED[path](**arguments))


def cases(path):
    """(arguments, name of the one that is a list) of a public name."""
    return [(good, name) for good in GOOD[path] for name, value in good.items() if isinstance(value, list)]


@pytest.mark.parametrize("path", GOOD)
def test_every_way_of_giving_a_sequence_has_the_same_bits(path):
    different = []
    for good, name in cases(path):
        expected = read(path, good)
        for way, give in ways_of(good[name]).items():
            try:
                found = read(path, {**good, name: give(good[name])})
            except Exception as error:
                different.append(f"{path}({name}={way}): {type(error).__name__}: {error}")
                continue
            if found != expected:
                different.append(f"{path}({name}={way})")
    assert different == []


# Read by what other tests try: members, in test_members; lists of what long studies take by `listed`, `items_of` and
# `quantities`, below; arrays of classes that a user makes for the engine, and of records that the library makes.
ELSEWHERE = {
    "assimilate": {"series", "learn"}, "derivatives": {"of", "by"},
    "estimate": {"cheaper"}, "export": {"members", "origin"}, "gym.VectorEnv": {"observe", "outputs", "instead_of"},
    "linear.margins": {"of", "by", "to"}, "linear.OpenLoops": {"messages", "models", "names", "why"},
    "linear.mpc": {"tracked"}, "linear.trim": {"free"}, "merge": {"paths"},
    "open_run": {"members", "statistics"}, "plots.pairs": {"of"}, "plots.phase": {"of"}, "rare_event": {"cheaper"},
    "resume": {"keepers", "statistics"}, "stability_map": {"methods", "points"}, "suggest": {"methods"}, "sweep": {"metrics"},
    "tradeoff": {"methods"}, "tune_gains": {"constraints"}, "uq.morris": {"of"},
    "uq.sobol": {"of", "groups"}, "vehicles.from_sdf": {"center_of_buoyancy"},
    "vehicles.from_yaml": {"table", "ignore"}, "Scene": {"terms", "events"}, "control.Policy": {"inputs", "outputs", "scale"},
    "metrics.Consistency": {"time", "members", "nees", "nees_band", "nis", "nis_band"}, "studies.Growth": {"times", "curve"},
    "statistics.Quantity": {"entries"}, "studies.Line": {"values"}, "studies.Suggestion": {"rivals", "worst", "messages"},
    "studies.Tradeoff": {"measurements", "messages"}, "uq.FailedMembers": {"faults"},
    "uq.Outputs": {"values", "labels", "failed"},
    "control.Altimeter": {"bias", "drift", "noise", "outlier_std", "place", "quantum"}, "control.Trajectory": {"speed"},
    "control.Waypoints": {"loiter_time", "loiter_turns"},
    "terms.MovingMass": {"limit", "rate_limit", "time_constant", "slide_direction", "turn_axis", "turn_center"},
    "notation.repeated": {"arrays"}, "designs.Table": {"ignore"}, "metrics.CustomMetric": {"last"},
    "studies.InnovationTest": {"mean", "mean_band", "ratio_band"},
}  # fmt: skip
RECORDS = {
    "uq.Indices",
    "uq.MorrisEffects",
    "uq.SobolIndices",
    "studies.Footprint",
    "studies.Region",
    "linear.OpenLoops",
}
RUN = {"solve": {"statistics", "keep", "tangents"}, "prepare": {"vary", "of", "statistics"}, "gather": {"statistics"},
       "uq.model": {"vary", "of"}, "uq.evaluate": {"of"}, "uq.given_data": {"of"}}  # fmt: skip


def test_every_argument_that_is_a_sequence_is_tried():
    untried = {}
    for path, thing in CALLED.items():
        tried = {name for good in GOOD.get(path, ()) for name, value in good.items() if isinstance(value, list)}
        missing = sequence_arguments(path, thing) - tried - RUN.get(path, set()) - ELSEWHERE.get(path, set())
        if missing and path not in RECORDS:
            untried[path] = sorted(missing)
    assert untried == {}, "Add good arguments to tests/support/sequences.py"


@pytest.fixture(scope="module")
def runs():
    """{(path, argument): (function of that argument, a list of it)} of what runs members."""
    scene = lw.Scene(
        lw.Vehicle(**BODY), terms=[lw.terms.Drag(linear=[1.0] * 6)], start=lw.Start(position=[0.0, 0.0, 9.0])
    )
    fleet = lw.Ensemble(scene, 16, 1, {"vehicle.buoyancy": lw.distributions.Normal(relative=0.01)})
    how = {"method": "psi_s", "h": 0.1, "t1": 0.2}
    result, means = lw.solve(fleet, **how), [lw.statistics.Mean("depth"), lw.statistics.Mean("speed")]
    two, vary, X = ["depth", "speed"], ["vehicle.buoyancy"], [[196.0], [197.0]]

    def estimates(answer):
        return {name: estimate.value for name, estimate in answer.statistics.items()}

    return {
        ("solve", "statistics"): (lambda v: estimates(lw.solve(fleet, **how, statistics=v)), means),
        ("solve", "keep"): (lambda v: lw.solve(fleet, **how, keep=v).kept_members, [True, False] * 8),
        ("solve", "tangents"): (lambda v: lw.solve(fleet, **how, tangents=v).jacobian["position"], vary),
        ("prepare", "vary"): (lambda v: lw.prepare(scene, vary=v, of="depth", **how)(X), vary),
        ("prepare", "of"): (lambda v: lw.prepare(scene, vary=vary, of=v, **how)(X), two),
        ("prepare", "statistics"): (lambda v: lw.prepare(fleet, **how, statistics=v)().position, means),
        ("gather", "statistics"): (lambda v: {name: e.value for name, e in lw.gather(result, v).items()}, means),
        ("uq.model", "vary"): (lambda v: lw.uq.model(scene, v, "depth", **how)([[196.0]]), vary),
        ("uq.model", "of"): (lambda v: lw.uq.model(scene, vary, v, **how)([[196.0]]), ["depth"]),
        ("uq.evaluate", "of"): (lambda v: lw.uq.evaluate(fleet, v, **how).values, two),
        ("uq.given_data", "of"): (lambda v: lw.uq.given_data(result, v).mean, two),
    }  # fmt: skip


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize(("path", "name"), [(path, name) for path, names in RUN.items() for name in sorted(names)])
def test_runs_take_every_way_of_giving_a_sequence(path, name, runs):
    run, values = runs[path, name]
    expected = state_of(run(values))
    for way, give in ways_of(values).items():
        assert state_of(run(give(values))) == expected, way


def test_readers_of_lists_take_every_way():
    for values in (["depth", "speed"], [1, 2], [0, 1, 2], [lw.statistics.Mean("depth")]):
        for way, give in ways_of(values).items():
            found = items_of(give(values))
            assert [state_of(item) for item in found] == [state_of(item) for item in values], way
            assert type(found[0]) is type(values[0]) or way == "float64", way
    for text in ("depth", b"depth", {"a": 1}, None, 3, 2.5):
        assert items_of(text) is None


def test_columns_of_pandas_are_sequences():
    pytest.importorskip("pandas")
    assert lw.SaveAt(at=series_of([0.5, 1.0])) == lw.SaveAt(at=[0.5, 1.0])
    for path in (
        "terms.Current",
        "control.Trajectory",
        "distributions.Choice",
        "Start",
        "studies.Series",
        "notation.hat",
    ):
        for good, name in cases(path):
            if all(isinstance(value, int | float | str) for value in good[name]):
                assert read(path, {**good, name: series_of(good[name])}) == read(path, good)


def test_numpy_texts_are_texts():
    word = np.str_("depth")
    assert lw.statistics.Mean(word).to_dict() == lw.statistics.Mean("depth").to_dict()
    assert lw.SaveAt(fields=[np.str_("position")]).fields == ("position",)
    assert lw.Method(np.str_("psi_s")) == lw.Method("psi_s")
    assert (
        lw.control.Sensor(of=word, name=np.str_("gauge")).to_dict()
        == lw.control.Sensor(of="depth", name="gauge").to_dict()
    )
