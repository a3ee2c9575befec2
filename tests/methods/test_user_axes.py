# SPDX-License-Identifier: Apache-2.0
"""Explicit methods of damped vehicles work in the user's axes: whatever these are, and for members that differ."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.physics.inertia import motion_from
from lgvi_warp.physics.notation import hat, matrix_from_rotation_vector
from lgvi_warp.runs.settle import make_plan
from tests.methods import test_coupled
from tests.methods.test_coupled import BUOYANCY, CENTER, GRAVITY, INERTIA, LIFT, RIGID, STATE, WEIGHT
from tests.support.tools import last, one

DRAG = np.diag([9.0, 30.0, 28.0, 0.6, 2.0, 2.2]) + 0.3 * np.outer(
    (1.0, 2.0, -1.0, 0.2, 0.3, -0.4), (0.5, 1.0, 2.0, 0.3, -0.2, 0.1)
)
WRENCH = np.array((12.0, 1.0, -2.0, 0.05, 0.3, -0.2))
SECONDS = 1.0


def described(Q, origin):
    """The general body with linear drag and a wrench, in axes Q and about an origin of the body: its scene and its start."""
    X = motion_from(origin[None], Q[None])[0]
    vehicle = lw.Vehicle(
        rigid_body_mass_matrix=X.T @ RIGID @ X, added_mass_matrix=X.T @ (INERTIA - RIGID) @ X,
        weight=WEIGHT, buoyancy=BUOYANCY,
        center_of_gravity=Q.T @ (CENTER - origin), center_of_buoyancy=Q.T @ (LIFT - origin),
    )  # fmt: skip
    wrench = X.T @ WRENCH
    terms = [lw.terms.DragMatrix(linear=X.T @ DRAG @ X), lw.terms.Wrench(force=wrench[:3], torque=wrench[3:])]
    b, R, nu, Om = (np.array(value) for value in STATE.values())
    twist = np.linalg.solve(X, np.concatenate([nu, Om]))
    at = {"b": b + R @ origin, "R": R @ Q, "nu": twist[:3], "Om": twist[3:]}
    return one(lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms=terms), **at)


def moved_back(state, Q, origin):
    """b, R, nu, Om of the first description."""
    b, R, nu, Om = state
    twist = motion_from(origin[None], Q[None])[0] @ np.concatenate([nu, Om])
    return b - R @ Q.T @ origin, R @ Q.T, twist[:3], twist[3:]


def truth():
    """The same by SciPy: the Kirchhoff equations with attitude as a matrix, to 1e-12."""
    b, R, nu, Om = (np.array(value) for value in STATE.values())
    inverse = np.linalg.inv(INERTIA)

    def slope(t, y):
        R, twist = y[3:12].reshape(3, 3), y[12:]
        P = INERTIA @ twist
        nu, Om = twist[:3], twist[3:]
        down = R.T @ (0.0, 0.0, 1.0)
        gravity = np.concatenate([(WEIGHT - BUOYANCY) * down, np.cross(CENTER * WEIGHT - LIFT * BUOYANCY, down)])
        free = np.concatenate([np.cross(P[:3], Om), np.cross(P[3:], Om) + np.cross(P[:3], nu)])
        change = inverse @ (free + gravity - DRAG @ twist + WRENCH)
        return np.concatenate([R @ nu, (R @ hat(Om[None])[0]).reshape(9), change])

    start = np.concatenate([b, R.reshape(9), nu, Om])
    y = solve_ivp(slope, (0.0, SECONDS), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return y[:3], y[3:12].reshape(3, 3), y[12:15], y[15:]


AXES = {
    "as given": (np.eye(3), np.zeros(3)),
    "about another point": (np.eye(3), np.array((0.2, -0.1, 0.3))),
    "turned": (matrix_from_rotation_vector(np.array([[0.4, -0.7, 1.1]]))[0], np.array((-0.1, 0.05, 0.2))),
}


@pytest.mark.ci
@pytest.mark.slow_but("rk8-turned")
@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("method", ["rk8", "rkmk4"])
def test_the_motion_does_not_depend_on_how_the_body_is_described(method, axes):
    scene = described(*AXES[axes])
    assert make_plan(scene, method, h=0.01, t1=1.0).kernel_choice.user_axes
    state = moved_back(last(lw.solve(scene, method, h=0.01, t1=SECONDS)), *AXES[axes])
    # The error of rkmk4 at this step is of order h^4 of motions of some rad/s.
    limit = 1e-11 if method == "rk8" else 1e-6
    for value, wanted in zip(state, truth(), strict=True):
        np.testing.assert_allclose(value, wanted, rtol=0.0, atol=limit)


@pytest.mark.slow
def test_splittings_and_explicit_methods_agree_in_turned_axes():
    scene = described(*AXES["turned"])
    ends = [last(lw.solve(scene, method, h=h, t1=SECONDS)) for method, h in (("rk4", 0.01), ("psi_x", 0.002))]
    # psi_x has order 2: 1e-5 is 0.002 squared times accelerations of the motion.
    for value, wanted in zip(*ends, strict=True):
        np.testing.assert_allclose(value, wanted, rtol=0.0, atol=3e-5)


@pytest.mark.slow
def test_members_with_other_zeros_share_a_kernel():
    # An entry of one member's matrix, which the others do not have.
    base = lw.Scene.named("torpedo", start={"velocity": [1.5, 0.1, -0.2], "angular_velocity": [0.1, 0.2, -0.1]})
    matrices = np.repeat(np.diag([5.0, 20.0, 20.0, 0.5, 4.0, 4.0])[None], 4, axis=0)
    matrices[:, 0, 4] = (0.0, 0.7, 0.0, -0.4)
    base = replace(base, terms=(lw.terms.DragMatrix(linear=matrices[0]),))
    fleet = lw.Ensemble(base, sampling=lw.designs.Table({"drag_matrix.linear": matrices}))
    together = lw.solve(fleet, "rk8", h=0.02, t1=1.0)
    for i, linear in enumerate(matrices):
        alone = lw.solve(replace(base, terms=(lw.terms.DragMatrix(linear=linear),)), "rk8", h=0.02, t1=1.0)
        # Another kernel, without products of zero: 50 steps of round-off.
        np.testing.assert_allclose(together.velocity[-1, i], alone.velocity[-1, 0], rtol=0.0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [[0.5, 2.5, 2.5], [[0.5, 0.1, 0.0], [0.1, 2.5, -0.2], [0.0, -0.2, 2.4]]])
def test_a_varied_mass_is_that_of_each_member(inertia):
    masses = (20.0, 25.0, 31.0)
    vehicle = {
        "inertia": inertia,
        "added_mass": [2.0, 20.0, 22.0],
        "buoyancy": 200.0,
        "center_of_buoyancy": [0.0, 0.0, -0.02],
    }
    drag = lw.terms.Drag(quadratic=[2.0, 50.0, 50.0, 0.5, 20.0, 20.0])
    start = lw.Start(velocity=[1.0, 0.2, -0.1], angular_velocity=[0.2, -0.1, 0.3])

    def scene(mass):
        return lw.Scene(lw.Vehicle(mass, **vehicle), terms=[drag], start=start)

    fleet = lw.Ensemble(scene(20.0), sampling=lw.designs.Table({"vehicle.mass": np.array(masses)}))
    together = lw.solve(fleet, "rk4", h=0.02, t1=1.0)
    for i, mass in enumerate(masses):
        alone = lw.solve(scene(mass), "rk4", h=0.02, t1=1.0)
        np.testing.assert_array_equal(together.velocity[-1, i], alone.velocity[-1, 0])


@pytest.mark.slow
def test_fins_that_stand_are_the_fins_of_their_schedule():
    place = {
        "position": [[-0.6, 0.0, 0.0], [-0.6, 0.0, 0.1]], "chord": [[1.0, 0.0, 0.0], [1.0, 0.1, 0.0]],
        "normal": [[0.0, 1.0, 0.0], [0.0, 0.2, -1.0]], "area": 0.02, "lift_slope": 3.0, "drag": 0.02, "drag_normal": 0.3,
        "limit": 0.25,
    }  # fmt: skip
    held = lw.terms.ControlFins(**place, command=[0.1, -0.4])
    scheduled = lw.terms.ControlFins(**place, times=[0.0, 9.0], command_schedule=[[0.1, -0.4], [0.1, -0.4]])
    assert not held.memory
    base = test_coupled.scene_of([])
    start = lw.Start(velocity=[1.5, 0.1, -0.2], angular_velocity=[0.1, 0.2, -0.1])
    for method, h in (("rk4", 0.02), ("psi_x", 0.02)):
        ends = [
            last(lw.solve(replace(base, terms=(term,), start=start), method, h=h, t1=1.0)) for term in (held, scheduled)
        ]
        # Sines of the same angles by two libraries: 50 steps of round-off.
        for value, wanted in zip(*ends, strict=True):
            np.testing.assert_allclose(value, wanted, rtol=0.0, atol=1e-13)
