# SPDX-License-Identifier: Apache-2.0
"""Copies and pickles of every public object and exception: the same type and content."""

import concurrent.futures
import copy
import inspect
import multiprocessing
import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.common.errors import MissingExtra, NothingToDraw, NotReal
from lgvi_warp.common.identity import UNKNOWN, identity
from lgvi_warp.common.reading import UnreadableError
from lgvi_warp.control.base import SECTIONS
from lgvi_warp.physics.given_draws import Stream
from tests.conftest import ROOT
from tests.support.odd_calls import goods
from tests.support.public import DOORS, NAMED

WAYS = {"copy": copy.copy, "deepcopy": copy.deepcopy} | {
    f"pickle {protocol}": lambda value, protocol=protocol: pickle.loads(pickle.dumps(value, protocol))
    for protocol in (2, pickle.HIGHEST_PROTOCOL)
}


def metric(state, tick):
    """The depth of the last tick."""
    return tick["position"][:, 2]


def demand(t, y, r, members):
    """No demand."""
    return np.zeros((len(members), 6))


def scaled(k):
    """A number that follows from a factor."""
    return 20.0 * k


ERRORS = {
    "SceneError": lambda: lw.SceneError(["mass = -1 is negative. Give more"] * 30, 2),
    "MembersFailed": lambda: lw.MembersFailed("2 of 3 members failed", {"status": np.arange(3)}),
    "Interrupted": lambda: lw.Interrupted("interrupted: the first 2 members", {"status": np.arange(2)}),
    "FailedMembers": lambda: lw.uq.FailedMembers(["1 of 4 members failed"]),
    "MissingExtra": lambda: MissingExtra("plots", "matplotlib", "viz"),
    "NothingToDraw": lambda: NothingToDraw("no samples"),
    "NotReal": lambda: NotReal("is not numeric", "Give numbers"),
    "UnreadableError": lambda: UnreadableError("is a pipe", "Give a file"),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ERRORS)
def test_errors(name, way):
    error = ERRORS[name]()
    error.add_note("in block 3")
    again = WAYS[way](error)
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert again.__notes__ == error.__notes__
    assert repr(vars(again)) == repr(vars(error))
    assert getattr(again, "name", None) == getattr(error, "name", None)


def test_every_public_error_is_among_them():
    public = {*NAMED.values(), *(getattr(lw.uq, name) for name in lw.uq.__all__)}
    errors = {value.__name__ for value in public if inspect.isclass(value) and issubclass(value, BaseException)}
    assert errors <= ERRORS.keys()


def failing(name):
    raise ERRORS[name]()


@pytest.mark.ci
def test_a_worker_of_a_pool_raises_them():
    """A pool that cannot read an error waits for ever. (Interrupted, as KeyboardInterrupt, ends the worker itself.)"""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        for name in sorted(ERRORS.keys() - {"Interrupted"}):
            wanted = ERRORS[name]()
            with pytest.raises(type(wanted)) as caught:
                pool.apply_async(failing, (name,)).get(60.0)
            assert str(caught.value) == str(wanted)


V = (1.0, 1.0, 1.0)
SPHERE = lw.Scene.named("sphere")


# What the defaults and `goods` do not make.
def time_average():
    """A result of a test over all times."""
    from lgvi_warp.extensions.navigation.consistency import TimeAverage

    return TimeAverage(1.0, 1.0, 2.0, 0.5)


OTHERS = {
    "Callback": lambda: lw.control.Callback(demand, version="1"), "CustomMetric": lambda: lw.metrics.CustomMetric(metric),
    "Quantity": lambda: lw.statistics.Quantity("depth", metric), "Case": lambda: lw.studies.Case("one", {"a.b": 1.0}),
    "Grid": lambda: lw.designs.Grid({"vehicle.mass": [1.0, 2.0]}),
    "Table": lambda: lw.designs.Table(values={"vehicle.mass": [1.0, 2.0]}),
    "UnitCubePoints": lambda: lw.designs.UnitCubePoints([[0.5]]), "LatinHypercube": lambda: lw.designs.LatinHypercube(4),
    "Fins": lambda: lw.terms.Fins(position=[V], chord=[(1, 0, 0)], normal=[(0, 0, 1)], area=0.1, drag=0.1, lift_slope=3.0),
    "Altitude": lambda: lw.control.Altitude(altitude=5.0),
    "Docking": lambda: lw.control.Docking(position=V, heading=0.0, speed=1.0, contact_speed=0.5, slowing=9.0, look_ahead=3.0,
                                          mouth=0.5, funnel=0.2, approach=20.0, judged=5.0),
    "LinearMPC": lambda: lw.control.LinearMPC(states=["velocity[2]"], inputs=["Z"], A=[[0.9]], B=[[0.1]], Q=[1.0], R=[1.0],
                                              limit=[9.0]),
    "Loiter": lambda: lw.control.Loiter(center=V, radius=4.0, speed=1.0, look_ahead=2.0),
    "DockContact": lambda: lw.metrics.DockContact("speed"),
    "Battery": lambda: lw.events.Battery(capacity=3.6e6),
    "PositionUncertain": lambda: lw.events.PositionUncertain(sigma=20.0),
    "Factor": lambda: lw.distributions.Factor(lw.distributions.Uniform(low=0.8, high=1.2)),
    "Consistency": lambda: lw.metrics.Consistency(*[np.ones(2)] * 3, np.ones((2, 2)), np.ones(2), np.ones((2, 2)), 0.95,
                                                         *[time_average()] * 2),
    "CurrentField": lambda: lw.terms.CurrentField(velocities=np.ones((2, 2, 2, 3)), spacing=V),
    "LowPass": lambda: lw.control.LowPass(of="depth", time_constant=1.0), "Packed": lambda: lw.laws.Packed({"a": np.ones(2)}),
    "PoseSMC": lambda: lw.control.PoseSMC(lambda_=V, boundary=V, lambda_r=V, boundary_r=V, k_sigma=V, k_d=V,
                                          k_sigma_r=V, k_d_r=V),
    "MovingMass": lambda: lw.terms.MovingMass(mass=1.0, places=[V]),
    "PhysicalInertia": lambda: lw.distributions.PhysicalInertia(sigma=0.1),
    "PositiveDefinite": lambda: lw.distributions.PositiveDefinite(sigma=0.1),
    "QuadraticForm": lambda: lw.terms.QuadraticForm(products=["X_u|u|"], values=[-1.0]),
    "SurfaceBuoyancy": lambda: lw.terms.SurfaceBuoyancy(heights=0.3),
    "OpenLoops": lambda: lw.linear.OpenLoops("N", (None,), ("N",), 0.1, np.array(["is lost"])),
    "SeaState": lambda: lw.terms.SeaState(significant_height=1.0, peak_period=6.0, heading_deg=30.0),
    "Tide": lambda: lw.terms.Tide(mean=1.0), "BottomContact": lambda: lw.terms.BottomContact(points=[V]),
    "DensityProfile": lambda: lw.terms.DensityProfile(depths=[0.0, 1.0], densities=[1000.0, 1010.0]),
    "RotationNormal": lambda: lw.distributions.RotationNormal(std=0.1),
    "Histogram": lambda: lw.statistics.Histogram("depth", edges=[0.0, 1.0]),
    "Derived": lambda: lw.distributions.Derived({"vehicle.mass": scaled}, k=lw.distributions.Normal(std=0.1)),
    "CorrelatedNormal": lambda: lw.distributions.CorrelatedNormal(covariance=np.eye(2)),
    "ScipyDistribution": lambda: lw.distributions.ScipyDistribution(stats.norm()),
    "Ticks": lambda: lw.control.CallbackInput(np.ones((1, 3)), np.eye(3)[None], np.ones((1, 3)), np.ones((1, 3)), np.ones(1)),
    "Status": lambda: lw.Status.OK, "Warnings": lambda: lw.Warnings(3), "Store": lambda: lw.Store("run.zarr"),
    "PackingContext": lambda: lw.laws.PackingContext({"a.b": np.ones(2)}, None, np.arange(2), 1, 0.1),
    "Prediction": lambda: lw.studies.Prediction(8, 20, 1, 2, 0.0, 0.1, 0.2, 0.0, 10**6, 10**4, None, None),
    "Candidate": lambda: lw.studies.Candidate("psi_s", 0.1), "Axis": lambda: lw.studies.Axis("h", 0.1, 1.0),
    "Line": lambda: lw.studies.Line("h", "step h", "s", True, np.ones(2)), "Cell": lambda: lw.studies.Cell.SILENT,
    "Growth": lambda: lw.studies.Growth(1.0, 0.7, None, 2.7, {"float64": 30.0}, np.arange(2.0), np.ones(2)),
    "NoiseDraws": lambda: lw.uq.NoiseDraws("gusts", "force", 0.0, 0.1, 10, 3, 0, Stream("force")),
    "Measurement": lambda: lw.studies.Measurement(lw.studies.Candidate("psi_s", 0.1), 1.0, 2.0, {}, 0.0, {}, 2, {}),
}  # fmt: skip


# What the two kinds of indices and all studies have in common, and what has a test of its own.
APART = {"Indices", "Saved", "Policy"}
# Classes of which a run makes one, and a study.
OF_RUNS = {"Result", "Final", "Prepared", "Sweep", "Outputs", "ScalarModel"}
OF_STUDIES = {"Trim", "LinearModel", "Regulator", "Margins", "WorstCase", "Tuned", "StabilityMap", "SobolIndices",
              "MorrisEffects", "GivenDataIndices", "Suggestion", "Tradeoff", "RareEvent", "Assimilated", "InnovationTest",
              "Estimated", "Derivatives", "Footprint", "Region"}  # fmt: skip


def classes():
    """The public classes by name, but for errors."""
    public = NAMED | {name: getattr(lw.uq, name) for name in lw.uq.__all__}
    return {
        name: value for name, value in public.items() if inspect.isclass(value) and not issubclass(value, BaseException)
    }


def made():
    """One of each class that needs no run, with what named scenes and those of the examples hold."""
    found = {}

    def note(*values):
        for value in values:
            found.setdefault(type(value).__name__, value)

    def parts(scene):
        note(scene, scene.vehicle, scene.environment, scene.start, *scene.terms, *scene.events, *scene.run.statistics)
        if scene.controller is not None:
            note(scene.controller, *(part for name in SECTIONS for part in getattr(scene.controller, name)))
        fleet = lw.Ensemble.from_scene(scene)
        note(fleet, fleet.sampling, *fleet.vary.values())

    for maker in OTHERS.values():
        try:
            note(maker())
        except ModuleNotFoundError as error:  # in a copy of the tree without extensions (tests/support/core_alone.py)
            if not str(error.name).startswith("lgvi_warp.extensions"):
                raise
    for name in ("sphere", "remus_100", "bluerov2_heavy"):
        parts(lw.Scene.named(name))
    for path in sorted((ROOT / "examples" / "scenes").glob("*.toml")):
        parts(lw.Scene.load(path))
    by_name, own = goods(SPHERE, None, None, ROOT)
    for name in sorted(classes().keys() - found.keys() - OF_RUNS - OF_STUDIES - APART):
        needed = [p.name for p in inspect.signature(NAMED[name]).parameters.values() if p.default is p.empty]
        note(NAMED[name](**({key: by_name[key] for key in needed if key in by_name} | own.get(name, {}))))
    return found


MADE = made()


def content(value):
    """Content of an object."""
    return value.to_dict() if hasattr(value, "to_dict") else repr(value)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", MADE)
def test_objects(name, way):
    value = MADE[name]
    again = WAYS[way](value)
    assert type(again) is type(value)
    assert repr(content(again)) == repr(content(value))
    if UNKNOWN not in (told := (identity(again), identity(value))):
        assert told[0] == told[1]


def test_every_public_class_is_among_them():
    assert classes().keys() - APART <= MADE.keys() | OF_RUNS | OF_STUDIES


@pytest.mark.parametrize("way", WAYS)
def test_a_policy_without_its_file(way, tmp_path):
    np.savez(tmp_path / "policy.npz", weights_0=np.ones((1, 1)), biases_0=np.zeros(1))
    one = lw.control.Policy(file=tmp_path / "policy.npz", inputs=["depth_error"], outputs=["Z"])
    (tmp_path / "policy.npz").unlink()
    again = WAYS[way](one)
    assert type(again) is lw.control.Policy
    assert again.to_dict() == one.to_dict()


def test_public_functions_and_classes_are_themselves():
    for module in (lw, *DOORS.values()):
        for name in module.__all__:
            value = getattr(module, name)
            if callable(value):
                assert all(way(value) is value for way in WAYS.values()), name


@pytest.fixture(scope="module")
def ran():
    """Results of runs."""
    vary = {"start.velocity[0]": lw.distributions.Normal(std=0.1)}
    fleet = lw.Ensemble(SPHERE, 4, 0, vary)
    settings = dict(method="psi_s", h=0.1, t1=0.5)
    found = lw.solve(fleet, **settings, statistics=[lw.statistics.Mean("position")])
    run = lw.prepare(SPHERE, list(vary), of="depth", **settings)
    made = {"Result": found, "Final": found.final, "Prepared": run,
            "Estimates": found.statistics, "Estimate": found.statistics["mean position"],
            "ScalarModel": lw.uq.model(SPHERE, vary, "depth", **settings),
            "Outputs": lw.uq.evaluate(fleet, "depth", **settings),
            "status": found.status, "warnings": found.warnings, "prediction": lw.predict(fleet, **settings),
            "Sweep": lw.sweep(fleet, [{"name": "one"}], **settings)}  # fmt: skip
    assert made.keys() >= OF_RUNS
    return made


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("way", WAYS)
def test_what_runs_give(ran, way):
    for name, value in ran.items():
        again = WAYS[way](value)
        assert type(again) is type(value), name
        if name == "Result":
            np.testing.assert_array_equal(again.position, value.position)
            assert again.provenance == value.provenance
        elif name in ("Prepared", "ScalarModel"):
            np.testing.assert_array_equal(again(np.ones((2, 1))), value(np.ones((2, 1))))
        elif isinstance(value, np.ndarray):
            np.testing.assert_array_equal(again, value)
        else:
            assert repr(again) == repr(value), name


@pytest.mark.slow
@pytest.mark.kernel
def test_what_studies_give():
    drag, run = lw.terms.Drag(linear=(4.0, 9.0, 12.0, 1.0, 2.0, 3.0)), dict(method="psi_s", h=0.1)
    body = lw.Scene(lw.Vehicle(20.0, inertia=(5.0, 8.0, 11.0)), terms=[lw.terms.ControlWrench(limit=1e3), drag])
    turn = lw.Controller(
        period=0.1, guidance=[lw.control.SetPoint(heading=0.1)], laws=[lw.control.HeadingPID(kp=5.0, kd=5.0)]
    )
    loop, vary, short = (
        replace(body, controller=turn),
        {"start.position[2]": lw.distributions.Normal(std=1.0)},
        run | {"t1": 0.2},
    )
    steady = lw.linear.trim(body, 1.0, **run)
    model = lw.linear.linearize(replace(body, start=steady.start), **run)
    both = vary | {"start.velocity[1]": lw.distributions.Normal(std=0.1)}
    found = {
        "Trim": steady, "LinearModel": model, "Margins": lw.linear.margins(loop, "heading_pid", "gain", about=5.0, **run),
        "Regulator": lw.linear.lqr(model, np.ones(len(model.states)), np.ones(len(model.inputs))),
        "WorstCase": lw.worst_case(loop, {"start.position[2]": (1.0, 2.0)}, "depth", budget=32, **short),
        "Tuned": lw.tune_gains(lw.Ensemble(loop, 4, 1, vary), {"heading_pid.kp": (1.0, 5.0)}, "depth", budget=64, **short),
        "StabilityMap": lw.stability_map(SPHERE, ("h", 0.1, 0.2), ("angular_velocity", 0.5, 1.0), ["psi_s"], points=2,
                                         directions=1, t1=1.0, error_time=0.5, h=0.1),
        "SobolIndices": lw.uq.sobol(SPHERE, "depth", vary=both, samples=16, **short),
        "GivenDataIndices": lw.uq.given_data(lw.solve(lw.Ensemble(SPHERE, 64, 0, both), **short), "depth"),
        "MorrisEffects": lw.uq.morris(SPHERE, "depth", vary=both, samples=4, **short),
        "Suggestion": lw.suggest(lw.Ensemble(SPHERE, 16, 0, vary), 1e-2, t1=1.0),
        "Assimilated": lw.assimilate(lw.Ensemble(SPHERE, 16, 0, vary), lw.studies.Series("depth", [0.2], [0.1], 0.5), **run),
        "Estimated": lw.estimate(lw.Ensemble(SPHERE, 1, 0, vary), "mean depth", 0.1, **short),
        "Derivatives": lw.derivatives(SPHERE, "depth", "start.position[2]", **short),
        "RareEvent": lw.rare_event(lw.Ensemble(SPHERE, 1, 0, vary), "depth - 3.0", **short),
        "Tradeoff": lw.tradeoff(lw.Ensemble(SPHERE, 16, 0, vary), t1=1.0, methods=["psi_s"], members=16, seconds=2.0),
    }  # fmt: skip
    where = lw.Ensemble(SPHERE, 8, 0, {"start.position": lw.distributions.Normal(std=[1.0, 2.0, 0.0])})
    found["Footprint"] = lw.studies.footprint(lw.solve(where, **short))
    found["Region"] = found["Footprint"].main
    found["InnovationTest"] = found["Assimilated"].consistency()["depth"]
    assert found.keys() >= OF_STUDIES
    for name, value in found.items():
        for way in WAYS.values():
            again = way(value)
            assert type(again) is type(value)
            assert type(value).__name__ == name
            assert repr(again) == repr(value)


def all_fail():
    """A run of which a member fails, in a worker."""
    still = np.zeros((2, 3))
    states = np.full((2, 3), np.nan), np.repeat(np.eye(3)[None], 2, axis=0), still, still
    fleet = lw.Ensemble.from_states(lw.Scene.named("sphere"), *states)
    return lw.solve(fleet, "psi_s", h=0.1, t1=0.5, on_failure="raise")


@pytest.mark.ci
@pytest.mark.kernel
def test_a_pool_hears_of_members_that_failed():
    pool = concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
    with pool, pytest.raises(lw.MembersFailed) as caught:
        pool.submit(all_fail).result(120.0)
    assert caught.value.result.members == 2
