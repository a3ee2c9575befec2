# SPDX-License-Identifier: Apache-2.0
"""Environment, Start, RunSettings, EnsembleSettings, Scene: what is resolved and what is refused."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import notation
from lgvi_warp.robustness.sweeps.cases import Case
from tests.support.refusals import faults, says

VEHICLE = lw.Vehicle(mass=10.0, inertia=(1.0, 2.0, 2.5))


def resolved(**start):
    """Position, attitude, velocity and angular velocity that a Start comes to."""
    m = lw.Ensemble(lw.Scene(VEHICLE, start=lw.Start(**start))).select(0, 1)
    return m.position[0], m.attitude[0], m.velocity[0], m.angular_velocity[0]


def test_a_start_left_out_is_at_rest():
    b, R, nu, Om = resolved()
    assert not b.any()
    assert not nu.any()
    assert not Om.any()
    np.testing.assert_array_equal(R, np.eye(3))


def test_attitude_in_four_ways():
    angles = np.array([10.0, -20.0, 30.0])
    R = notation.matrix_from_euler_deg(angles)
    f = np.array([1.0, 2.0, 3.0])
    q = 3.0 * notation.quaternion_from_matrix(R)
    # A few roundings of numbers up to 1: 1e-15.
    np.testing.assert_allclose(resolved(euler_deg=angles)[1], R, rtol=0, atol=1e-15)
    np.testing.assert_allclose(resolved(attitude=R)[1], R, rtol=0, atol=1e-15)
    np.testing.assert_allclose(resolved(quaternion_wxyz=q)[1], R, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(resolved(rotation_vector=f)[1], notation.matrix_from_rotation_vector(f))


def test_inertial_velocity_is_turned_into_the_body():
    R = notation.matrix_from_rotation_vector(np.array([1.0, 2.0, 3.0]))
    v = np.array([0.1, 0.2, 1.0])
    nu = resolved(attitude=R, velocity_inertial=v)[2]
    np.testing.assert_allclose(nu, R.T @ v, rtol=0, atol=1e-15)  # nu = R^T v
    np.testing.assert_array_equal(resolved(attitude=R, velocity=v)[2], v)


def test_an_attitude_must_be_a_rotation():
    R = np.eye(3)
    R[0, 1] = 2e-9
    for bad in (R, -np.eye(3), 1.001 * np.eye(3), np.zeros((3, 3)), np.full((3, 3), 1e200)):
        (fault,) = faults(lw.Start, attitude=bad)
        says(fault, "start.attitude", "rotation", "quaternion_wxyz")
    R[0, 1] = 5e-10
    lw.Start(attitude=R)  # the round-off of printing it


def test_all_faults_of_a_start_come_at_once():
    found = faults(lw.Start, position="here", attitude=np.zeros((3, 3)), euler_deg=(0, 0, 0), velocity=(1.0,))
    assert len(found) == 4


def test_gravity_may_be_zero():
    assert lw.Environment(gravity=0.0).gravity == 0.0
    assert lw.Environment().gravity == 9.80665  # standard gravity (CGPM 1901)


def test_other_laws_are_refused_with_the_reason():
    (fault,) = faults(lw.Scene, VEHICLE, terms=["drag"])
    says(fault, "terms[0]", "drag", "lw.terms.Drag")
    (fault,) = faults(lw.Scene, VEHICLE, terms=[{"type": "buoyancy"}])
    assert "follows from the vehicle" in fault
    assert "controller" in faults(lw.Scene, VEHICLE, controller="pid")[0]
    lw.Scene(VEHICLE, terms=[])


def test_parts_of_the_wrong_kind_are_refused():
    found = faults(lw.Scene, {"mass": 1.0}, environment=9.8, start=None)
    assert [fault.split(" = ")[0] for fault in found] == ["vehicle", "environment", "start"]


def test_the_remedy_for_settings_of_a_run_names_what_is_public():
    (fault,) = faults(lw.Scene, VEHICLE, run={"step": 0.02})
    assert "lw.solve(scene, h=..., t1=..., ...)" in fault
    assert "lw.RunSettings" not in fault
    table = lw.Scene(VEHICLE).to_dict() | {"run": {"step": 0.02}}
    assert lw.Scene.from_dict(table).run.step == 0.02


def fins_of(scene):
    return next(table for table in scene.to_dict()["terms"] if table["type"] == "control_fins")


def test_with_numbers_sets_what_a_scene_may_vary():
    scene = lw.Scene.named("remus_100")
    turned = scene.with_numbers({"control_fins.command": [0.1, 0.2]})
    assert fins_of(turned)["command"] == [0.1, 0.2]
    assert "times" not in fins_of(turned)
    assert turned.parameters()["control_fins.command_schedule"].tolist() == [[0.1, 0.2]]
    assert fins_of(lw.Scene.from_dict(turned.to_dict()))["command"] == [0.1, 0.2]
    assert fins_of(scene.with_numbers({"control_fins.command[1]": 0.3}))["command"] == [0.0, 0.3]
    limited = turned.with_numbers(
        {"control_fins.limit": [0.5, 0.6], "start.velocity": [1.5, 0.0, 0.0], "run.step": 0.02}
    )
    assert (fins_of(limited)["command"], fins_of(limited)["limit"]) == ([0.1, 0.2], [0.5, 0.6])
    assert (limited.start.velocity.tolist(), limited.run.step) == ([1.5, 0.0, 0.0], 0.02)
    assert scene.with_numbers({}) is scene
    assert fins_of(scene)["command"] == [0.0, 0.0]
    assert fins_of(Case("hard over", set={"control_fins.command[0]": 0.3}).of(scene))["command"] == [0.3, 0.0]
    copied = fins_of(scene) | {"command": [0.1, 0.2]}
    assert lw.Scene.named("remus_100", terms=[copied]).parameters()["control_fins.command"].tolist() == [0.1, 0.2]


def test_a_schedule_takes_the_place_of_a_held_command_and_is_kept():
    scene = lw.Scene.named("bluerov2_heavy")
    rows = {"thrusters.times": [0.0, 5.0], "thrusters.command_schedule": [[0.1] * 8, [0.2] * 8]}
    driven = scene.with_numbers(rows)
    table = next(table for table in driven.to_dict()["terms"] if table["type"] == "thrusters")
    assert "command" not in table
    assert table["times"] == [0.0, 5.0]
    assert driven.parameters()["thrusters.command"].tolist() == [0.1] * 8
    later = driven.with_numbers({"thrusters.command_schedule": [[0.3] * 8, [0.2] * 8], "thrusters.limit[2]": 0.9})
    assert later.parameters()["thrusters.command"].tolist() == [0.3] * 8
    assert later.parameters()["thrusters.limit"][2] == 0.9
    with pytest.raises(lw.SceneError, match=r"thrusters\.command = .*command_schedule. Keep one"):
        driven.with_numbers({"thrusters.command": [0.5] * 8})


def test_a_start_that_is_set_takes_the_place_of_another_form():
    scene = lw.Scene.named("sphere", start={"euler_deg": [0.0, 0.0, 90.0], "velocity": [1.0, 0.0, 0.0]})
    turned = scene.with_numbers({"start.rotation_vector": [0.0, 0.0, 1.0], "start.velocity_inertial": [0.0, 2.0, 0.0]})
    assert turned.start.to_dict() == {"rotation_vector": [0.0, 0.0, 1.0], "velocity_inertial": [0.0, 2.0, 0.0]}


@pytest.mark.parametrize(("vehicle", "term"), [("remus_100", "control_fins"), ("bluerov2_heavy", "thrusters")])
@pytest.mark.parametrize("value", [[1.0, 2.0, 3.0], [float("nan")] * 2, [[0.1]], "much"])
def test_a_command_that_is_wrong_is_told_by_the_key_of_the_user(vehicle, term, value):
    scene = lw.Scene.named(vehicle)
    table = next(table for table in scene.to_dict()["terms"] if table["type"] == term)
    for give in (
        lambda: scene.with_numbers({f"{term}.command": value}),
        lambda: lw.Scene.named(vehicle, terms=[table | {"command": value}]),
    ):
        with pytest.raises(lw.SceneError, match=rf"^{term}\.command = ") as caught:
            give()
        assert "schedule" not in str(caught.value)
