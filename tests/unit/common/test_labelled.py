# SPDX-License-Identifier: Apache-2.0
"""Columns that come with names are read by them: every door for tables, and what each refuses."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import lgvi_warp as lw
from lgvi_warp import uq
from lgvi_warp.calls.runner import Runner
from lgvi_warp.designs import Table, UnitCubePoints
from lgvi_warp.distributions import CorrelatedNormal, Normal, Uniform, UniformRotation
from tests.support.refusals import refused, says

MASS, BUOYANCY, DENSITY = "vehicle.mass", "vehicle.buoyancy", "environment.water_density"
VARY = {MASS: Normal(std=0.1), BUOYANCY: Normal(std=1.0), "current.velocity": Uniform(half_width=0.5)}
NAMES = (MASS, BUOYANCY, "current.velocity[0]", "current.velocity[1]", "current.velocity[2]")
ROWS = np.array([[123.0, 1215.0, 0.3, -0.2, 0.01], [124.0, 1216.0, 0.1, 0.2, 0.0], [125.0, 1217.0, 0.0, 0.4, 0.05]])


class Polars:
    """A frame as polars has them: columns a list of names, table[name] a series with __array__."""

    def __init__(self, columns):
        self._columns = columns

    @property
    def columns(self):
        return list(self._columns)

    def __getitem__(self, name):
        return Series(self._columns[name])


class Series:
    def __init__(self, values):
        self._values = np.asarray(values)

    def __array__(self, dtype=None, copy=None):
        return np.array(self._values, dtype=dtype)


@pytest.fixture(scope="module")
def drifting(scene):
    return lw.Scene(scene.vehicle, scene.environment, [lw.terms.Current(velocity=[0.2, 0.0, 0.0])], scene.start)


@pytest.fixture
def observed(monkeypatch):
    """Ensembles that a model would run, recorded in place of runs: their numbers by name."""
    found = {}

    def answer(prepared, fleet, progress):
        found.clear()
        found.update(fleet._values(0, fleet.members))
        return np.zeros(fleet.members)

    monkeypatch.setattr(Runner, "plan", lambda runner, fleet: None)
    monkeypatch.setattr(lw.Prepared, "_answer", answer)
    return found


def columns(rows=ROWS, names=NAMES):
    return dict(zip(names, np.asarray(rows).T))


def structured():
    array = np.zeros(len(ROWS), [("current.velocity", float, 3), (BUOYANCY, float), (MASS, np.float32)])
    array["current.velocity"], array[BUOYANCY], array[MASS] = ROWS[:, 2:], ROWS[:, 1], ROWS[:, 0]
    return array


def dataset():
    return xr.Dataset(
        {
            "current.velocity": (("axis", "run"), ROWS[:, 2:].T),
            MASS: ("run", ROWS[:, 0]),
            BUOYANCY: ("run", ROWS[:, 1]),
        },
        {"run": [7, 8, 9]},
    )


FORMS = {
    "array": lambda: ROWS,
    "lists": lambda: ROWS.tolist(),
    "mask that hides nothing": lambda: np.ma.masked_invalid(ROWS),
    "mapping": columns,
    "mapping, turned": lambda: dict(reversed(columns().items())),
    "mapping of a vector": lambda: {"current.velocity": ROWS[:, 2:], MASS: list(ROWS[:, 0]), BUOYANCY: ROWS[:, 1]},
    "spaces in a name": lambda: {key.replace("[", "[ "): value for key, value in columns().items()},
    "frame": lambda: pd.DataFrame(columns()),
    "frame, sorted": lambda: pd.DataFrame(columns())[sorted(NAMES)],
    "frame with an index of names": lambda: pd.DataFrame(columns(), index=["a", "b", "c"])[sorted(NAMES)],
    "polars": lambda: Polars(dict(reversed(columns().items()))),
    "structured": structured,
    "record array": lambda: structured().view(np.recarray),
    "dataset": dataset,
    "data array": lambda: xr.DataArray(
        ROWS[:, ::-1], dims=("run", "name"), coords={"name": list(NAMES[::-1])}
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("vary", [VARY, list(NAMES)], ids=["laws", "names"])
def test_a_model_reads_columns_by_their_names(drifting, observed, form, vary):
    model = uq.model(drifting, vary, "position[2]", h=0.01, t1=0.02)
    assert model.names == NAMES
    model(FORMS[form]())
    np.testing.assert_array_equal(observed[MASS], ROWS[:, 0])
    np.testing.assert_array_equal(observed[BUOYANCY], ROWS[:, 1])
    np.testing.assert_array_equal(observed["current.velocity"], ROWS[:, 2:])
    given = FORMS[form]()
    model.scipy(np.asarray(ROWS).T if form in ("array", "lists") or form.startswith("mask") else given)
    np.testing.assert_array_equal(observed["current.velocity"], ROWS[:, 2:])


def test_levels_are_read_in_the_order_of_the_laws(drifting, observed):
    u = np.array([[0.1, 0.2, 0.3, 0.4, 0.6], [0.9, 0.7, 0.8, 0.5, 0.45]])
    model = uq.model(drifting, VARY, "position[2]", levels=True, h=0.01, t1=0.02)
    assert model.names == NAMES
    assert model.problem["names"] == list(NAMES)
    exact = lw.uq.model(drifting, VARY, "position[2]", h=0.01, t1=0.02).distributions
    for given in (u, pd.DataFrame(columns(u))[sorted(NAMES)]):
        model(given)
        for j, name in enumerate(NAMES):
            base, _, index = name.partition("[")
            values = observed[base][:, int(index[:-1])] if index else observed[base]
            np.testing.assert_allclose(values, exact[j].ppf(u[:, j]), rtol=1e-15)
    assert "is not a level between 0 and 1" in refused(model, ROWS)


def test_a_joint_law_keeps_its_place_among_levels(drifting, observed):
    gravity = {"environment.gravity": Normal(std=0.1)}
    vary = {"vehicle.mass": Normal(std=0.1), "start.attitude": UniformRotation(), **gravity}
    model = uq.model(drifting, vary, "position[2]", levels=True, h=0.01, t1=0.02)
    joint = [f"start.attitude {i}" for i in range(3)]
    assert model.names == ("vehicle.mass", *joint, "environment.gravity")
    assert model.problem["groups"] == ["vehicle.mass", *["start.attitude"] * 3, "environment.gravity"]
    model([[0.9, 0.1, 0.2, 0.3, 0.1]])
    assert observed["vehicle.mass"][0] > 123.8
    assert observed["environment.gravity"][0] < 9.8


def test_problem_and_distributions_have_the_order_of_the_names(drifting, observed):
    vary = {MASS: Normal(std=0.1), BUOYANCY: Uniform(half_width=2.0)}
    for order in (list(vary), list(vary)[::-1]):
        model = uq.model(drifting, {name: vary[name] for name in order}, "depth", h=0.01, t1=0.02)
        assert model.names == tuple(order) == tuple(model.problem["names"])
        kinds = {MASS: ("norm", [123.8, 0.1]), BUOYANCY: ("unif", [1213.8, 1217.8])}
        assert model.problem["dists"] == [kinds[name][0] for name in order]
        np.testing.assert_allclose(model.problem["bounds"], [kinds[name][1] for name in order])
        middles = [float(law.ppf(0.5)) for law in model.distributions]
        np.testing.assert_allclose(middles, [{MASS: 123.8, BUOYANCY: 1215.8}[name] for name in order], rtol=1e-14)


FRAME = pd.DataFrame(columns())
BAD = {
    "missing": (lambda: FRAME.drop(columns=MASS), ['X["vehicle.mass"]', "is missing", "vehicle.buoyancy"]),
    "extra": (lambda: FRAME.assign(id=1.0), ['X["id"]', "is not one of its columns"]),
    "misspelt": (lambda: FRAME.rename(columns={MASS: "vehicle.masss"}), ["vehicle.masss", "Did you mean 'vehicle.mass'"]),
    "doubled": (lambda: pd.concat([FRAME, FRAME[[MASS]]], axis=1), ["columns of one name (vehicle.mass)"]),
    "without names": (lambda: pd.DataFrame(ROWS), ["no names of columns: they are called 0, 1, 2, 3, 4", "to_numpy()"]),
    "vector and entry": (lambda: columns() | {"current.velocity": ROWS[:, 2:]}, ["current.velocity[0]", "is given twice"]),
    "vector of another shape": (lambda: {MASS: ROWS[:, 0], BUOYANCY: ROWS[:, 1], "current.velocity": ROWS[:, :2]},
                                ["has shape (3, 2)", "(n, 3)"]),
    "other lengths": (lambda: columns() | {MASS: [1.0, 2.0]}, ["vehicle.mass (2,)", "one number for each member"]),
    "texts": (lambda: FRAME.astype(str), ['X["vehicle.mass"]', "is not numeric"]),
    "masked": (lambda: np.ma.masked_greater(ROWS, 1216.5), ["hides 1 of 15 numbers", "[2, 1]"]),
    "masked column": (lambda: columns() | {MASS: np.ma.masked_equal(ROWS[:, 0], 124.0)},
                      ["hides 1 of 3", 'X["vehicle.mass"]']),
    "truth values": (lambda: ROWS > 1.0, ["X = ", "is not numeric"]),
    "complex": (lambda: ROWS + 0j, ["is not numeric"]),
    "dates": (lambda: FRAME.assign(**{MASS: pd.Timestamp("2026-01-01")}), ["is not numeric"]),
    "another width": (lambda: ROWS[:, :4], ["has shape (3, 4)", "(n, 5)", "vehicle.mass, vehicle.buoyancy"]),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_model_refuses_what_does_not_fit(drifting, observed, case):
    make, words = BAD[case]
    message = refused(uq.model(drifting, VARY, "position[2]", h=0.01, t1=0.02), make())
    assert all(word in message for word in words), message
    assert not observed


def test_entries_that_do_not_vary_stay_the_scenes(drifting, observed):
    vary = {"current.velocity[1]": Normal(std=0.1), "vehicle.inertia": Uniform(relative=0.01)}
    model = uq.model(drifting, vary, "position[2]", h=0.01, t1=0.02)
    assert model.names == ("current.velocity[1]", *(f"vehicle.inertia[{i},{i}]" for i in range(3)))
    velocity, inertia = np.array([[0.2, 0.1, 0.0]] * 2), np.array([np.diag([5.4, 5.3, 5.8])] * 2)
    model({"current.velocity": velocity, "vehicle.inertia": inertia})
    np.testing.assert_array_equal(observed["current.velocity"], velocity)
    np.testing.assert_array_equal(observed["vehicle.inertia"], inertia)
    message = refused(model, {"current.velocity": velocity + 0.1, "vehicle.inertia": inertia})
    says(message, "changes entries that do not vary", "current.velocity[0]")
    skew = inertia + np.eye(3, k=1)
    assert "not symmetric" in refused(model, {"current.velocity": velocity, "vehicle.inertia": skew})


@pytest.mark.parametrize(
    ("vary", "words"),
    [([MASS, MASS], ["is named twice"]), ({MASS, BUOYANCY}, ["neither a list of names"]), ([], ["is neither a list of names"]),
     (["start.position[2]", "start.position[ 2 ]"], ["start.position[2]", "named twice"]), (3, ["is neither a list of names"]),
     (["vehicle.inertia[0,1]", "vehicle.inertia[1,0]"], ["is varied by"]), ([MASS, 3], ["is neither a list of names"])],
)  # fmt: skip
def test_names_that_are_no_list(drifting, vary, words):
    message = refused(uq.model, drifting, vary, "position[2]", h=0.01, t1=0.02)
    assert all(word in message for word in words), message


def test_one_name_may_stand_alone(drifting, observed):
    assert uq.model(drifting, MASS, "depth", h=0.01, t1=0.02).names == (MASS,)


# Other doors ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", [form for form in FORMS if form not in ("array", "lists", "mask that hides nothing")])
def test_a_table_reads_columns_by_their_names(drifting, form):
    fleet = lw.Ensemble(drifting, sampling=Table(FORMS[form]()))
    assert fleet.members == 3
    values = fleet._values(0, 3)
    np.testing.assert_array_equal(values[MASS], ROWS[:, 0])
    np.testing.assert_array_equal(values["current.velocity"], ROWS[:, 2:])


@pytest.mark.parametrize("form", [form for form in FORMS if form not in ("array", "lists", "mask that hides nothing")])
def test_given_parameters_are_read_by_their_names(drifting, form):
    R, zero = np.array([np.eye(3)] * 3), np.zeros((3, 3))
    fleet = lw.Ensemble.from_states(drifting, zero, R, zero, zero, FORMS[form]())
    values = fleet.parameters(0, 3)
    np.testing.assert_array_equal(values[MASS], ROWS[:, 0])
    np.testing.assert_array_equal(values["current.velocity"], ROWS[:, 2:])
    assert fleet.varied() == [name for name in drifting.parameters() if name in (MASS, BUOYANCY, "current.velocity")]


def test_given_parameters_that_do_not_fit(drifting):
    R, zero = np.array([np.eye(3)] * 3), np.zeros((3, 3))

    def message(parameters):
        return refused(lw.Ensemble.from_states, drifting, zero, R, zero, zero, parameters)

    assert "Did you mean 'vehicle.mass'" in message(pd.DataFrame({"vehicle.masss": ROWS[:, 0]}))
    assert "columns of one name" in message(pd.concat([FRAME, FRAME], axis=1))
    assert "is not an entry" in message({"current.velocity[3]": ROWS[:, 0]})
    assert "is varied by" in message({"current.velocity[1]": ROWS[:, 0], "current.velocity": ROWS[:, 2:]})
    assert "hides 1 of 3" in message({MASS: np.ma.masked_equal(ROWS[:, 0], 124.0)})
    assert "has no names" in message(ROWS)
    assert "(2,)" in message({MASS: [1.0, 2.0]})


def test_states_with_names_are_read_by_them(drifting):
    R, zero = np.array([np.eye(3)] * 3), np.zeros((3, 3))
    p = np.arange(9.0).reshape(3, 3)
    names = [f"position[{i}]" for i in range(3)]
    for frame in (pd.DataFrame(p), pd.DataFrame(p, columns=names), pd.DataFrame(p, columns=names)[names[::-1]]):
        fleet = lw.Ensemble.from_states(drifting, frame, R, zero, zero)
        np.testing.assert_array_equal(fleet.select(0, 3).position, p)
    message = refused(lw.Ensemble.from_states, drifting, pd.DataFrame(p, columns=["z", "y", "x"]), R, zero, zero)
    says(message, "position[0]", "is missing")


def test_levels_with_names(drifting):
    u = np.array([[0.1, 0.2], [0.9, 0.7]])
    vary = {MASS: Normal(std=0.1), BUOYANCY: Normal(std=1.0)}
    by_order = lw.Ensemble(drifting, None, 0, vary, UnitCubePoints(u)).parameters(0, 2)  # buoyancy, mass
    for points in (pd.DataFrame({MASS: u[:, 1], BUOYANCY: u[:, 0]}), {BUOYANCY: u[:, 0], MASS: u[:, 1]}):
        fleet = lw.Ensemble(drifting, None, 0, vary, UnitCubePoints(points))
        back = lw.Ensemble.from_scene(lw.Scene.from_dict(drifting.to_dict() | {"ensemble": fleet.to_dict()}))
        for one in (fleet, back):
            np.testing.assert_array_equal(one.parameters(0, 2)[MASS], by_order[MASS])
            np.testing.assert_array_equal(one.parameters(0, 2)[BUOYANCY], by_order[BUOYANCY])
    message = refused(lw.Ensemble, drifting, None, 0, vary, UnitCubePoints({"mass": u[:, 0], BUOYANCY: u[:, 1]}))
    assert "Did you mean 'vehicle.mass'" in message
    assert "do not name 2 columns" in refused(UnitCubePoints, u, [MASS])


def test_labels_that_no_door_reads_are_refused():
    frame = pd.DataFrame(np.eye(2), index=["a", "b"], columns=["a", "b"])
    message = refused(CorrelatedNormal, covariance=frame)
    says(message, "names of columns (a, b), which are not read here", "to_numpy()")
    assert CorrelatedNormal(covariance=frame.to_numpy()).kind == "correlated_normal"
