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
from lgvi_warp.physics.control.base import SECTIONS
from tests.conftest import ROOT

WAYS = {"copy": copy.copy, "deepcopy": copy.deepcopy} | {
    f"pickle {protocol}": lambda value, protocol=protocol: pickle.loads(pickle.dumps(value, protocol))
    for protocol in (2, pickle.HIGHEST_PROTOCOL)
}


def metric(state, look):
    """The depth of the last look."""
    return look["position"][:, 2]


def demand(t, y, r, members):
    """No demand."""
    return np.zeros((len(members), 6))


ERRORS = {
    "SceneError": lambda: lw.SceneError(["mass = -1: is negative; give more"] * 30, 2),
    "MembersFailed": lambda: lw.MembersFailed("2 of 3 members failed", {"status": np.arange(3)}),
    "Interrupted": lambda: lw.Interrupted("interrupted: the first 2 members", {"status": np.arange(2)}),
    "FailedMembers": lambda: lw.uq.FailedMembers(["1 of 4 members failed"]),
    "MissingExtra": lambda: MissingExtra("plots", "matplotlib", "viz"),
    "NothingToDraw": lambda: NothingToDraw("no samples"),
    "NotReal": lambda: NotReal("is not numeric", "give numbers"),
    "UnreadableError": lambda: UnreadableError("is a pipe", "give a file"),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ERRORS)
def test_errors(name, way):
    error = ERRORS[name]()
    error.add_note("in block 3")
    again = WAYS[way](error)
    assert type(again) is type(error) and str(again) == str(error) and again.__notes__ == error.__notes__
    assert repr(vars(again)) == repr(vars(error)) and getattr(again, "name", None) == getattr(error, "name", None)


def test_every_public_error_is_among_them():
    public = {value for module in (lw, lw.uq) for value in (getattr(module, name) for name in module.__all__)}
    errors = {value.__name__ for value in public if inspect.isclass(value) and issubclass(value, BaseException)}
    assert errors <= ERRORS.keys()


def failing(name):
    raise ERRORS[name]()


def test_a_worker_of_a_pool_raises_them():
    """A pool that cannot read an error waits for ever. (Interrupted, as KeyboardInterrupt, ends the worker itself.)"""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        for name in ERRORS.keys() - {"Interrupted"}:
            wanted = ERRORS[name]()
            with pytest.raises(type(wanted)) as caught:
                pool.apply_async(failing, (name,)).get(60.0)
            assert str(caught.value) == str(wanted)


def made():
    """One of each public class that users make, or get from what they make."""
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

    for name in ("sphere", "remus_100", "bluerov2_heavy"):
        parts(lw.Scene.named(name))
    for path in sorted((ROOT / "examples" / "scenes").glob("*.toml")):
        parts(lw.Scene.load(path))
    sphere = lw.Scene.named("sphere")
    for name in lw.__all__:
        if inspect.isclass(getattr(lw, name)) and name not in found:
            try:
                note(getattr(lw, name)())
            except (TypeError, ValueError):
                continue
    eye = np.eye(3)
    note(
        lw.Callback(demand, version="1"), lw.OwnMetric(metric), lw.Quantity("depth", metric), lw.Case("one", {"a.b": 1.0}),
        lw.Floor(depth=20.0), lw.Box(lower=(-1.0,) * 3, upper=(1.0,) * 3), lw.Until("mean position[0]", 0.1),
        lw.Choice([1.0, 2.0]), lw.CorrelatedNormal(std=(1.0, 2.0), correlation=np.eye(2)), lw.LogNormal(sigma=0.1),
        lw.TruncatedNormal(std=1.0, low=-1.0, high=1.0), lw.RotationNormal(std=0.1), lw.ScipyDistribution(stats.norm()),
        lw.Histogram("depth", edges=[0.0, 1.0]), lw.Table(values={"vehicle.mass": [1.0, 2.0]}), lw.UnitCubePoints([[0.5]]),
        lw.LatinHypercube(4), lw.Store("run.zarr"), lw.Packed({"a": np.ones(2)}),
        lw.Waypoints(points=[[0.0, 0.0, 1.0], [9.0, 0.0, 1.0]], speed=1.0, look_ahead=2.0, radius=1.0),
        lw.WrenchSchedule(times=[0.0, 1.0], force=np.zeros((2, 3))), lw.Status.OK, lw.Warnings(0),
        replace(sphere, ensemble_settings=None), lw.Vehicle(mass=1.0, inertia=eye),
    )  # fmt: skip
    return found


MADE = made()


def content(value):
    """What an object says of itself."""
    return value.to_dict() if hasattr(value, "to_dict") else repr(value)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", MADE)
def test_objects(name, way):
    value = MADE[name]
    again = WAYS[way](value)
    assert type(again) is type(value) and repr(content(again)) == repr(content(value))
    if UNKNOWN not in (told := (identity(again), identity(value))):
        assert told[0] == told[1]


@pytest.fixture(scope="module")
def ran():
    """What runs and studies give."""
    scene = lw.Scene.named("sphere")
    vary = {"start.velocity[0]": lw.Normal(std=0.1)}
    fleet = lw.Ensemble(scene, 4, 0, vary)
    settings = dict(method="psi_s", h=0.1, t1=0.5)
    found = lw.solve(fleet, **settings, statistics=[lw.Mean("position")])
    run = lw.prepare(scene, list(vary), of="depth", **settings)
    return {"Result": found, "Estimates": found.statistics, "Estimate": found.statistics["mean position"], "Prepared": run,
            "model": lw.uq.model(scene, vary, "depth", **settings), "status": found.status, "warnings": found.warnings,
            "Sweep": lw.sweep(fleet, [{"name": "one"}], **settings)}  # fmt: skip


@pytest.mark.kernel
@pytest.mark.parametrize("way", WAYS)
def test_what_runs_give(ran, way):
    for name, value in ran.items():
        again = WAYS[way](value)
        assert type(again) is type(value), name
        if name == "Result":
            np.testing.assert_array_equal(again.position, value.position)
            assert again.provenance == value.provenance
        elif name in ("Prepared", "model"):
            np.testing.assert_array_equal(again(np.ones((2, 1))), value(np.ones((2, 1))))
        elif isinstance(value, np.ndarray):
            np.testing.assert_array_equal(again, value)


def all_fail():
    """A run of which a member fails, in a worker."""
    still = np.zeros((2, 3))
    states = np.full((2, 3), np.nan), np.repeat(np.eye(3)[None], 2, axis=0), still, still
    fleet = lw.Ensemble.from_states(lw.Scene.named("sphere"), *states)
    return lw.solve(fleet, "psi_s", h=0.1, t1=0.5, on_failure="raise")


@pytest.mark.kernel
def test_a_pool_hears_of_members_that_failed():
    pool = concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
    with pool, pytest.raises(lw.MembersFailed) as caught:
        pool.submit(all_fail).result(120.0)
    assert caught.value.result.members == 2
