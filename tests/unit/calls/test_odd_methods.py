# SPDX-License-Identifier: Apache-2.0
"""Methods of good objects, and functions of results and stores, with one odd argument each: refusals name the argument."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.arguments import explained
from tests.studies.test_saved_answers import tuned
from tests.support import odd_calls
from tests.unit.calls.test_odd_calls import raw_of
from tests.unit.cli.test_study_verbs import loops, slopes, steady, worst
from tests.unit.cli.test_terminal import region, sobol
from tests.unit.measuring.test_cost import found as tradeoff_of

pytestmark = pytest.mark.kernel


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A scene, members, their result, a folder, and one good object of each kind."""
    folder = tmp_path_factory.mktemp("odd")
    start = lw.Start(position=[0.0, 0.0, 10.0], velocity=[1.0, 0.0, 0.0])
    scene = lw.Scene(lw.Vehicle(**odd_calls.BODY), terms=[lw.terms.Drag(linear=[1.0] * 6)], start=start)
    fleet = lw.Ensemble(scene, 4, 1, {"vehicle.buoyancy": lw.distributions.Normal(relative=0.01)})
    arguments = {"method": "psi_s", "h": 0.1, "t1": 0.4}
    result = lw.solve(fleet, **arguments, statistics=[lw.statistics.Mean("depth")])
    grid = np.zeros((1, 1, 2, 2, 2, 3))
    things = {
        "Result": result, "Final": result.final, "Ensemble": fleet, "Scene": scene, "Vehicle": scene.vehicle,
        "Prepared": lw.prepare(scene, method="psi_s", vary=["vehicle.buoyancy"], of="depth", h=0.1, t1=0.2),
        "Stored": lw.solve(fleet, **arguments, store=folder / "run.zarr"), "Start": start, "Method": lw.Method("psi_s"),
        "StatusArray": result.status, "WarningArray": result.warnings, "SceneError": lw.SceneError(["a"]),
        "Status": lw.Status.OK, "Environment": lw.Environment(origin=[63.0, 10.0]), "Drag": scene.terms[0],
        "Normal": lw.distributions.Normal(std=1.0), "Grid": lw.designs.Grid({"vehicle.mass": [20.0, 21.0]}),
        "Table": lw.designs.Table({"vehicle.mass": [20.0, 21.0]}), "Estimates": result.statistics,
        "Estimate": result.statistics["mean depth"], "SetPoint": lw.control.SetPoint(depth=5.0),
        "Floor": lw.events.Floor(depth=10.0), "Mean": lw.statistics.Mean("depth"), "SaveAt": lw.SaveAt(every=1.0),
        "Field": lw.terms.CurrentField(velocities=grid, origin=[0.0] * 3, spacing=[1.0] * 3), "Store": lw.Store("a.zarr"),
        "Series": lw.studies.Series("depth", [0.1], [0.0], 0.1), "Axis": lw.studies.Axis("start.velocity[0]", 1.0, 2.0),
        "Margins": loops("", "", "failed"), "Trim": steady(), "WorstCase": worst(), "Derivatives": slopes(), "Tuned": tuned(),
        "Sweep": lw.sweep(fleet, cases=[lw.studies.Case("a")], metrics=["max(depth)"], **arguments),
        "Tradeoff": tradeoff_of(4.0), "SobolIndices": sobol(), "StabilityMap": region(), "Until": lw.Until("mean depth", 1.0),
    }  # fmt: skip
    return scene, fleet, result, folder, things


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def calls_of(built):
    scene, fleet, result, folder, things = built
    by_name, _ = odd_calls.goods(scene, fleet, result, folder)
    return list(odd_calls.odd_calls_of_objects(things, by_name))


def functions_of(built):
    """Functions that take results, stores and ends, and long ones whose odd arguments are refused before they begin."""
    scene, fleet, result, folder, _ = built
    end, within = result.final, {"vehicle.buoyancy": (190.0, 200.0)}
    numbers = {name: getattr(end, name) for name in ("time", "step", "steps", "seed", "settings")}
    run, run2 = folder / "run.zarr", {"h": 0.1, "t1": 0.2, "method": "psi_s"}
    notation = {
        name: (getattr(lw.notation, name), {}) for name in lw.notation.__all__ if name not in ("repeated", "cross")
    }
    for name, given in {
        "to_momenta": {"M": np.eye(3)[None], "J": np.eye(3)[None], "nu": np.ones((1, 3)), "Om": np.ones((1, 3))},
        "rotate_into": {"Q": np.eye(3), "vectors": np.ones(3)}, "rotate_out": {"Q": np.eye(3), "vectors": np.ones(3)},
        "rotations": {"R": np.eye(3)},
    }.items():  # fmt: skip
        notation[name] = getattr(lw.notation, name), given
    small = {"budget": 2, "restarts": 1, **run2}
    return notation | {
        "cross": (lw.notation.cross, {"a": np.ones(3), "b": np.ones(3)}),
        "from_arrays": (type(end).from_arrays, {"arrays": end.to_arrays(), "numbers": numbers, "parameters": {}}),
        "merge": (lw.merge, {"paths": [run], "out": folder / "merged.zarr"}), "open_run": (lw.open_run, {"path": run}),
        "export": (lw.export, {"run": result, "to": "a.csv"}), "resume": (lw.resume, {"path": run}),
        "worst_case": (lw.worst_case, {"fleet": scene, "within": within, "of": "depth", **small}),
        "tune_gains": (lw.tune_gains, {"fleet": fleet, "over": within, "minimise": "depth", **small}),
        "gather": (lw.gather, {"result": result, "statistics": [lw.statistics.Mean("depth")]}),
        "select_members": (lw.select_members, {"result": result}), "predict": (lw.predict, {"fleet": fleet, **run2}),
    }  # fmt: skip


@pytest.mark.ci
def test_some_odd_calls_of_methods_end_in_refusals(built):
    calls = calls_of(built)
    some = np.random.default_rng(3).choice(len(calls), 800, replace=False)
    assert raw_of(calls[i] for i in some) == []


@pytest.mark.slow
def test_every_odd_call_of_a_method_ends_in_a_refusal(built):
    assert raw_of(calls_of(built)) == []


LONG = {"worst_case", "tune_gains", "predict", "resume", "merge", "export"}


def test_odd_calls_of_functions_end_in_refusals(built):
    calls = [
        call for call in odd_calls.odd_calls_of_functions(functions_of(built)) if call[0].split("(")[0] not in LONG
    ]
    some = np.random.default_rng(4).choice(len(calls), 300, replace=False)
    assert raw_of(calls[i] for i in some) == []


@pytest.mark.slow
def test_every_odd_call_of_a_function_ends_in_a_refusal(built):
    assert raw_of(odd_calls.odd_calls_of_functions(functions_of(built))) == []


@explained
class Taker:
    """Outcome of an argument of another kind."""

    def longer(self, values: np.ndarray, by: int = 2) -> float:
        return float(values[0]) * by

    def broken(self, by: int) -> int:
        raise KeyError("own")


def test_an_error_names_the_argument_and_those_of_the_code_stay_as_they_are():
    assert Taker().longer(np.ones(1)) == 2.0
    with pytest.raises(
        lw.SceneError, match=r"^values = None is not an array of numbers. Give what Taker.longer takes\.$"
    ):
        Taker().longer(None)
    with pytest.raises(lw.SceneError, match="by = None is not a whole number"):
        Taker().longer(np.ones(1), by=None)
    with pytest.raises(KeyError, match="own"):
        Taker().broken(3)
    with pytest.raises(TypeError, match="unexpected keyword"):
        Taker().longer(np.ones(1), of=3)
