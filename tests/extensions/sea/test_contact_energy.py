# SPDX-License-Identifier: Apache-2.0
"""Landers gain no energy in the kernel: bounces, tumbles, an edge that lands first, and the cone of friction."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.physics.terms.base import own
from tests.extensions.sea.test_bottom_contact import ADDED, FEET, GRAVITY, INERTIA, LANDER, MASS, NET, lander

ROUNDING = {"float64": 1e-9, "float32": 2e-3}
METHODS = ["psi_s", "psi_x", "rk4"]


def still(angle=0.0, points=FEET, **numbers):
    """The lander over its slope in still water."""
    scene = lander(points, angle, **numbers)
    return lw.Scene(LANDER, lw.Environment(gravity=GRAVITY), terms=scene.terms[:1], events=list(scene.events))


def landed(scene, start, method, h, steps, dtype="float64"):
    """A run from (position, attitude, velocity, angular velocity), with all its steps; kinetic energy and weight (k, n)
    [J]; depths (k, n, feet) [m] in the floor; stiffness [N/m]."""
    fleet = lw.Ensemble.from_states(scene, *start)
    result = lw.solve(fleet, method, h=h, t1=steps * h, dtype=dtype, save=lw.SaveAt(every=h))
    term, floor, p = scene.terms[0], scene.events[0], fleet.parameters(0, fleet.members)
    moving = (MASS + ADDED) * np.sum(result.velocity.astype(float) ** 2, axis=-1)
    turning = np.sum(INERTIA * result.angular_velocity.astype(float) ** 2, axis=-1)
    energy = 0.5 * (moving + turning) - NET * result.position[..., 2].astype(float)
    # All floors here are planes: the depth of a place follows from those of two.
    slope = (floor.depth_at(1.0, 0.0) - floor.depth_at(0.0, 0.0)) * np.array([1.0, 0.0, 0.0])
    feet = result.position[..., None, :] + np.einsum("knij,fj->knfi", result.attitude, np.array(term.points))
    sunk = (feet[..., 2] - floor.depth_at(0.0, 0.0) - feet @ slope) / np.sqrt(1.0 + slope @ slope)
    return result, energy, np.maximum(sunk, 0.0), term.stiffest(own(term, p), p, h)[0]


def gain_between_flights(energy, sunk):
    """Largest gain (n,) [J] of energy from one time at which all feet are off the floor to any later one."""
    flights = np.where(sunk.max(axis=-1) == 0.0, energy, np.nan)
    least = np.fmin.accumulate(flights)
    return np.nanmax(flights - least, axis=0)


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("method", METHODS)
def test_no_bounce_is_higher_than_the_last(method, dtype):
    # One foot, no damping asked for: heights from 0.5 to 1.5 m touch at any part of a step.
    n = 64
    place = np.zeros((n, 3))
    place[:, 2] = 10.0 - np.linspace(0.5, 1.5, n)
    start = place, np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    for stiffness in (1e12, 300.0):
        for h in (0.01, 0.1, 1.0):
            scene = still(points=((0.0, 0.0, 0.0),), damping=0.0, stiffness=stiffness)
            result, energy, sunk, _ = landed(scene, start, method, h, 500, dtype)
            assert result.status.counts() == {"ok": n}
            assert gain_between_flights(energy, sunk).max() < ROUNDING[dtype] * NET


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("method", METHODS)
def test_energy_never_grows(method, dtype):
    # Landers that tumble and spin onto a floor and a slope as hard as the steps allow. Free turns keep the energy of motion
    # by psi_s, to the bounded (h Om)^2 / 12 of a splitting by psi_x, and to (h Om)^5 / 60 in each step by rk4.
    rng, n = np.random.default_rng(5), 48
    R = lw.notation.matrix_from_rotation_vector(rng.normal(0.0, 0.4, (n, 3)))
    start = np.tile([0.0, 0.0, 8.8], (n, 1)), R, rng.normal(0.0, 0.5, (n, 3)), rng.normal(0.0, 0.7, (n, 3))
    for angle in (0.0, np.radians(20.0)):
        for h, steps in ((0.01, 1500), (0.1, 400), (0.2, 400)):
            scene = still(angle, friction=0.6, stiffness=1e12)
            result, energy, sunk, k = landed(scene, start, method, h, steps, dtype)
            assert result.status.counts() == {"ok": n}
            moving = energy + NET * result.position[..., 2]
            turn, rounding = h * np.linalg.norm(result.angular_velocity, axis=-1), ROUNDING[dtype] * NET
            turns = {
                "psi_s": 0.0,
                "psi_x": np.max(turn**2 * moving, axis=0) / 12.0,
                "rk4": np.sum(turn**5 * moving, axis=0) / 60.0,
            }
            assert np.all(gain_between_flights(energy, sunk) < turns[method] + rounding)
            # In contact a step holds the springs' energy of another instant, up to a quarter of it.
            springs = 0.5 * k * np.sum(sunk**2, axis=-1)
            assert np.all(energy + springs < energy[0] + 0.25 * springs.max(axis=0) + rounding)
            assert np.abs(result.velocity[-1]).max() < 1e-3


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("method", METHODS)
def test_an_edge_lands_first(method):
    # Two feet of a side touch together, without friction: M z'' = W - sum N, J phi'' = -sum y N by SciPy, y from the
    # body's middle to a foot. A contact has order 1: half the step has half the error.
    k, c, (J, M), phi = 2000.0, 100.0, (INERTIA[0], MASS + ADDED), 0.4
    sides = np.array([0.4, -0.4])

    def rates(_, x):
        z, w, angle, p = x
        y, down = np.cos(angle) * sides - 0.3 * np.sin(angle), np.sin(angle) * sides + 0.3 * np.cos(angle)
        sunk, into = z + down - 10.0, w + p * y
        N = 2.0 * np.where(sunk > 0.0, np.maximum(k * sunk + c * into, 0.0), 0.0)
        return [w, (NET - N.sum()) / M, p, -(y @ N) / J]

    time = np.linspace(0.0, 2.0, 41)
    wanted = solve_ivp(rates, (0.0, 2.0), [9.2, 0.5, phi, 0.0], t_eval=time, rtol=1e-9, atol=1e-11, max_step=1e-3).y
    R = lw.notation.matrix_from_rotation_vector(np.array([phi, 0.0, 0.0]))
    scene = still(friction=0.0, stiffness=k, damping=c)
    velocity = R.T @ [0.0, 0.0, 0.5]
    fleet = lw.Ensemble.from_states(scene, [[0.0, 0.0, 9.2]], R[None], velocity[None], np.zeros((1, 3)))
    errors = []
    for h in (0.002, 0.001):
        result = lw.solve(fleet, method, h=h, t1=2.0, save=lw.SaveAt(every=0.05))
        angle = np.arctan2(result.attitude[:, 0, 2, 1], result.attitude[:, 0, 2, 2])
        # Neither along the edge nor about another axis; rk4 leaves the rotations where the push sets in, by its order 1 there.
        still_there = 1e-5 if method == "rk4" else 1e-12
        assert np.abs(result.position[:, 0, :2]).max() < still_there
        assert np.abs(result.attitude[:, 0, 0] - [1.0, 0.0, 0.0]).max() < still_there
        errors.append(max(np.abs(result.position[:, 0, 2] - wanted[0]).max(), np.abs(angle - wanted[2]).max()))
    assert errors[0] < 2e-3
    assert errors[1] < 0.7 * errors[0]
    assert wanted[2].min() < 0.0


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("method", METHODS)
def test_the_cone_of_friction_at_30_degrees(method):
    # tan 30 deg: 0.5 % more friction holds, without creep, and 0.5 % less slides with W (sin a - mu cos a) / M, whichever way
    # the lander faces.
    a, n = np.radians(30.0), 4
    friction = np.tan(a) * np.array([1.005, 0.995, 1.005, 0.995])
    down = np.array([[np.cos(a), 0.0, -np.sin(a)], [0.0, 1.0, 0.0], [np.sin(a), 0.0, np.cos(a)]])
    turned = lw.notation.matrix_from_rotation_vector(np.array([[0.0, 0.0, 0.0]] * 2 + [[0.0, 0.0, 2.0]] * 2))
    place = np.tile([0.0, 0.0, 10.0 - 0.301 / np.cos(a)], (n, 1))
    numbers = {"bottom_contact.friction": friction}
    fleet = lw.Ensemble.from_states(still(a), place, down @ turned, np.zeros((n, 3)), np.zeros((n, 3)), numbers)
    result = lw.solve(fleet, method, h=0.02, t1=24.0, save=lw.SaveAt(every=1.0))
    assert result.status.counts() == {"ok": n}
    ground = np.einsum("knij,knj->kni", result.attitude, result.velocity)
    assert np.abs(ground[-1, ::2]).max() < 1e-9
    wanted = NET * (np.sin(a) - friction[1] * np.cos(a)) / (MASS + ADDED)
    np.testing.assert_allclose((ground[-1] - ground[14])[1::2] @ down[:, 0] / 10.0, wanted, rtol=1e-5)
    # The impact leaves a drift aside of order 1 in h.
    assert np.abs(ground[-1, 1::2, 1]).max() < 5e-3 * np.abs(ground[-1, 1::2]).max()
