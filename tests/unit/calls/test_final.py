# SPDX-License-Identifier: Apache-2.0
"""The end of a run that comes from elsewhere is checked before members go on from it."""

import dataclasses
import json

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.odd_calls import BODY

pytestmark = pytest.mark.kernel
NUMBERS = ("time", "step", "steps", "seed", "settings")
ARGUMENTS = {"h": 0.1, "t1": 0.4}


@pytest.fixture(scope="module")
def fleet():
    scene = lw.Scene(
        lw.Vehicle(**BODY), terms=[lw.terms.Drag(linear=[1.0] * 6)], start=lw.Start(velocity=[1.0, 0.1, 0.0])
    )
    return lw.Ensemble(scene, 4, 1, {"vehicle.buoyancy": lw.distributions.Normal(relative=0.01)})


@pytest.fixture(scope="module")
def result(fleet):
    return lw.solve(fleet, "psi_s", h=0.1, t1=0.2)


def parts_of(final):
    return dict(final.to_arrays()), {name: getattr(final, name) for name in NUMBERS}, dict(final.parameters)


def again(final, arrays=None, **numbers):
    own, known, parameters = parts_of(final)
    return type(final).from_arrays(own | (arrays or {}), known | numbers, parameters)


@pytest.mark.ci
def test_an_end_from_arrays_goes_on_to_the_bit(fleet, result):
    one = lw.solve(fleet, "psi_s", **ARGUMENTS, start=again(result.final))
    np.testing.assert_array_equal(one.position[-1], lw.solve(fleet, "psi_s", **ARGUMENTS).position[-1])


MIRROR = np.broadcast_to(np.diag([1.0, 1.0, -1.0]), (4, 3, 3))
ODD_ARRAYS = [
    ("states.attitude", np.zeros((4, 3, 3)), "not a rotation"), ("states.attitude", MIRROR.copy(), "not a rotation"),
    ("states.attitude", np.broadcast_to(1.001 * np.eye(3), (4, 3, 3)).copy(), "not a rotation"),
    ("states.attitude", np.zeros((3, 3, 3)), "shape"), ("states.position", np.zeros((4, 2)), "shape"),
    ("states.velocity", np.array([["a"] * 3] * 4), "shape"), ("states.speed", np.zeros((4, 3)), "not known"),
    ("status", np.array([0, 0, 0, 250]), "none that a member"), ("status", np.array([0, -1, 0, 0]), "none that a member"),
    ("status", np.zeros(4), "whole numbers"), ("status", np.zeros((4, 1), int), "whole numbers"), ("status", None, "whole"),
    ("indices", np.array([0, 1, 2, -3]), "whole numbers"), ("indices", np.array([0, 1, 2]), "whole numbers"),
    ("indices", np.array([0, 1, 2, 2**40]), "whole numbers"), ("indices", np.array([0.0, 1.0, 2.0, 3.0]), "whole numbers"),
    ("indices", "x", "whole numbers"), ("lanes.state", np.zeros((4, 18)), "not a rotation"),
    ("lanes.state", np.zeros(4), "rows"), ("lanes.still", np.zeros((3, 1)), "rows"),
    ("lanes.state", np.eye(3).reshape(1, 9)[[0] * 4, :5], "lanes.state"),
    ("states.position", np.full((4, 3), np.nan), "finite"),
]  # fmt: skip
ODD_NUMBERS = [
    ("seed", -1), ("seed", 1.5), ("seed", "x"), ("seed", True), ("steps", -2), ("steps", 2.5), ("steps", 3), ("time", np.nan),
    ("time", -1.0), ("time", "x"), ("time", None), ("step", 0.0), ("step", np.inf), ("step", 0.2), ("settings", None),
    ("settings", 3),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value", "text"), ODD_ARRAYS)
def test_arrays_that_no_run_ends_with_are_refused(name, value, text, result):
    with pytest.raises(lw.SceneError, match=text):
        again(result.final, {f"final.{name}": value})


@pytest.mark.parametrize(("name", "value"), ODD_NUMBERS)
def test_numbers_that_no_run_ends_with_are_refused(name, value, result):
    with pytest.raises(lw.SceneError, match=r"final\."):
        again(result.final, **{name: value})


@pytest.mark.parametrize(
    "value", [None, "x", np.zeros(3), np.zeros((2, 1)), np.array([{}] * 4), np.array(1.0), [[1.0], [1.0, 2.0]]]
)
def test_parameters_that_no_members_have_are_refused(value, result):
    arrays, numbers, parameters = parts_of(result.final)
    with pytest.raises(lw.SceneError, match=r"final.parameters.vehicle.mass.*Give") as told:
        type(result.final).from_arrays(arrays, numbers, parameters | {"vehicle.mass": value})
    assert str(told.value).count("final.") == 1


@pytest.mark.ci
def test_parameters_of_another_shape_are_others(fleet, result):
    """A run of another scene goes on with its own numbers; one that takes the end's refuses them."""
    arrays, numbers, parameters = parts_of(result.final)
    end = type(result.final).from_arrays(arrays, numbers, parameters | {"vehicle.inertia": np.ones((4, 5))})
    assert lw.solve(fleet, "psi_s", **ARGUMENTS, start=end).status.failed.sum() == 0
    with pytest.raises(lw.SceneError, match=r"vehicle.inertia.*shape"):
        lw.prepare(fleet.scene, method="psi_s", of="depth", **ARGUMENTS).states(end)


@pytest.mark.ci
@pytest.mark.parametrize(("name", "change"), [("position", [100.0, 0.0, 0.0]), ("velocity", [0.0, 0.1, 0.0]),
                                              ("angular_velocity", [0.0, 0.0, 0.1])])  # fmt: skip
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_states_that_are_not_those_of_the_lanes_are_refused(name, change, dtype, fleet):
    """A run that goes on exactly takes the lanes, and so the states would have no effect."""
    settings = {"dtype": dtype, **ARGUMENTS}
    final = lw.solve(fleet, "psi_s", **settings | {"t1": 0.2}).final
    whole = lw.solve(fleet, "psi_s", **settings).position[-1]
    np.testing.assert_array_equal(lw.solve(fleet, "psi_s", **settings, start=again(final)).position[-1], whole)
    with pytest.raises(lw.SceneError, match=rf"final.states.{name}.*final.changed"):
        again(final, {f"final.states.{name}": final.states[name] + np.array(change, final.states[name].dtype)})
    moved = final.changed(**{name: final.states[name] + np.array(change)})
    assert not np.array_equal(lw.solve(fleet, "psi_s", **settings, start=again(moved)).position[-1], whole)


@pytest.mark.ci
def test_an_attitude_that_is_not_that_of_the_lanes_is_refused(fleet):
    final = lw.solve(fleet, "rk4", **ARGUMENTS | {"t1": 0.2}).final
    assert lw.solve(fleet, "rk4", **ARGUMENTS, start=again(final)).status.failed.sum() == 0
    with pytest.raises(lw.SceneError, match=r"final.states.attitude.*final.changed"):
        again(final, {"final.states.attitude": 1.001 * final.attitude})
    with pytest.raises(lw.SceneError, match=r"final.lanes.state.*final.changed"):
        again(final, {"final.lanes.state": final.lanes["state"] + 1e-3})


@pytest.mark.ci
@pytest.mark.parametrize("name", ["remus_100", "bluerov2_heavy", "rexrov"])
def test_states_of_vehicles_in_other_axes_and_moving_water_are_those_of_their_lanes(name):
    water = [
        lw.terms.Current(velocity=[0.1, 0.2, 0.0]),
        lw.terms.Waves(amplitudes=[0.2], periods=[4.0], headings_deg=[30.0]),
    ]
    scene = lw.Scene.named(name, start={"position": [0.0, 0.0, 9.0], "velocity": [1.0, 0.1, 0.0]})
    for terms in (scene.terms, [*scene.terms, *water]):
        moved = dataclasses.replace(scene, terms=list(terms))
        end = again(lw.solve(moved, h=0.05, t1=0.2).final)
        whole = lw.solve(moved, h=0.05, t1=0.4).position[-1]
        np.testing.assert_array_equal(lw.solve(moved, h=0.05, t1=0.4, start=end).position[-1], whole)


def test_lanes_that_are_missing_are_told(result):
    arrays, numbers, parameters = parts_of(result.final)
    del arrays["final.lanes.state"]
    with pytest.raises(lw.SceneError, match=r"final.lanes.state.*missing.*final.changed"):
        type(result.final).from_arrays(arrays, numbers, parameters)
    assert again(result.final.changed()).settings == {}


def test_what_is_missing_is_told(result):
    arrays, numbers, parameters = parts_of(result.final)
    for odd in ({}, 3, None, "x"):
        with pytest.raises(lw.SceneError):
            type(result.final).from_arrays(odd, numbers, parameters)
        with pytest.raises(lw.SceneError):
            type(result.final).from_arrays(arrays, odd, parameters)
    with pytest.raises(lw.SceneError, match="parameters"):
        type(result.final).from_arrays(arrays, numbers, 3)


@pytest.mark.parametrize("tampered", ["attitude", "final.status", "final.indices", "final"])
def test_a_tampered_file_is_refused(tampered, result, tmp_path):
    path = result.save(tmp_path / "run.npz")
    content = dict(np.load(path))
    if tampered == "attitude":
        content["attitude"][-1] = -content["attitude"][-1]
    elif tampered == "final":
        content["final"] = np.array(json.dumps(json.loads(str(content["final"])) | {"seed": -5}))
    else:
        content[tampered][0] = -7
    np.savez(path, **content)
    with pytest.raises(lw.SceneError, match=r"final\."):
        lw.Result.load(path)


@pytest.mark.ci
def test_members_that_failed_and_drifted_attitudes_are_taken(fleet, result, tmp_path):
    final = result.final
    states = dict(final.states)
    states["attitude"] = np.where(np.arange(4)[:, None, None] == 2, np.nan, states["attitude"])
    failed = dataclasses.replace(final, states=states, status=np.array([0, 0, lw.Status.NON_FINITE, 0]))
    assert failed.checked() is failed
    for method, dtype in (("rk4", "float64"), ("psi_s", "float32")):
        other = lw.solve(fleet, method, h=0.1, t1=0.2, dtype=dtype)
        lw.Result.load(other.save(tmp_path / "run.npz")).final.checked()


@pytest.mark.ci
def test_members_in_another_order_are_told(fleet, result):
    told = [text for text in lw.solve(fleet, "psi_s", **ARGUMENTS, start=result.final).messages if "start is" in text]
    assert told == []
    turned = lw.solve(fleet, "psi_s", **ARGUMENTS, start=result.final.part([3, 2, 1, 0])).messages
    assert (
        sum("the same members in another order: member 3 goes on in the place of member 0" in text for text in turned)
        == 1
    )
    others = lw.solve(fleet.subset([0, 1]), "psi_s", **ARGUMENTS, start=result.final.part([2, 3])).messages
    assert any("is the end of other members" in text for text in others)
    right = lw.solve(fleet.subset([3, 1]), "psi_s", **ARGUMENTS, start=result.final.part([3, 1])).messages
    assert not any("start is the end" in text for text in right)
