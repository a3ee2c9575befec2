# SPDX-License-Identifier: Apache-2.0
"""The Seawing glider: steady glides and spirals against roots of equations written here, and a spiral against DOP853 on them.

The equations are those of Zhang et al. (2013) for a battery that stays: momenta by a 6x6 inertia about the centre of buoyancy,
forces and moments in the axes of the flow, turned by a matrix.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import lgvi_warp as lw
from tests.support.hamel import hat

GRAVITY, DENSITY = 9.81, 1025.0
HULL, HULL_AT = 54.28, np.array([-0.0814, 0.0, 0.0032])
BATTERY, RADIUS = 11.0, 0.014
ADDED = np.diag([1.48, 49.58, 65.92, 0.53, 7.88, 10.18])
ADDED[1, 5] = ADDED[5, 1] = 3.61
ADDED[2, 4] = ADDED[4, 2] = 2.57
# The steady spiral as published: roll, pitch [deg], turn [rad/s], angles of attack and sideslip [deg], speed [m/s].
PUBLISHED = np.array([-13.703, -35.641, 0.0039, 1.267, -1.283, 0.490])


def glider(ahead, turned, net):
    """(6x6 inertia, first moment of mass [kg m], net weight [N]): battery `ahead` [m] and turned [rad], `net` [kg]."""
    at = np.array([ahead, -RADIUS * np.sin(turned), RADIUS * np.cos(turned)])
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    own = np.diag([0.60, 15.27, 15.32]) + turn @ np.diag([0.02, 0.16, 0.17]) @ turn.T
    first = HULL * HULL_AT + BATTERY * at
    second = own - HULL * hat(HULL_AT) @ hat(HULL_AT) - BATTERY * hat(at) @ hat(at)
    rigid = np.block([[(HULL + BATTERY) * np.eye(3), -hat(first)], [hat(first), second]])
    return rigid, first, net * GRAVITY


def hydrodynamics(v, Om):
    """Force and moment of the water, from drag, side force, lift and moments along the axes of the flow."""
    V = np.linalg.norm(v)
    a, b = np.arctan2(v[2], v[0]), np.arcsin(v[1] / V)
    ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    axes = np.array([[ca * cb, -ca * sb, -sa], [sb, cb, 0.0], [sa * cb, -sa * sb, ca]])
    force = axes @ np.array([-(7.19 + 386.29 * a**2), -115.65 * b, 0.36 - 440.99 * a])
    k = np.array([-58.27 * b - 19.83 * Om[0], 0.28 - 65.84 * a - 205.64 * Om[1], 34.10 * b - 389.30 * Om[2]])
    return V**2 * force, V**2 * axes @ k


def momentum_rates(down, v, Om, body):
    """dP/dt, dL/dt in body axes."""
    rigid, first, net = body
    P = (rigid + ADDED) @ np.concatenate([v, Om])
    force, moment = hydrodynamics(v, Om)
    return np.concatenate([
        np.cross(P[:3], Om) + net * down + force,
        np.cross(P[3:], Om) + np.cross(P[:3], v) + GRAVITY * np.cross(first, down) + moment,
    ])  # fmt: skip


def down_of(roll, pitch):
    return np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])


def steady(body, guess):
    """(roll, pitch, rate of turn, v (3,)) of steady motion: all momenta stay, and it turns about the vertical."""

    def rates(x):
        down = down_of(x[0], x[1])
        return momentum_rates(down, x[3:], x[2] * down, body)

    found = root(rates, guess, tol=1e-13)
    assert np.abs(rates(found.x)).max() < 1e-11
    return found.x


def scene_of(body, start=None):
    """The same for the package."""
    rigid, first, net = body
    ballast = lw.terms.Ballast(command=[-net / (DENSITY * GRAVITY)])
    vehicle = {"rigid_body_mass_matrix": rigid, "center_of_gravity": first / (HULL + BATTERY)}
    return lw.Scene.named("seawing", vehicle=vehicle, terms=[ballast], start=start)


def as_published(x):
    v, V = x[3:], np.linalg.norm(x[3:])
    angles = np.rad2deg([np.arctan2(v[2], v[0]), np.arcsin(v[1] / V)])
    return np.array([*np.rad2deg(x[:2]), x[2], *angles, V])


SPIRAL = glider(0.4216, np.deg2rad(45.0), 0.3)
GUESS = [np.deg2rad(-13.7), np.deg2rad(-35.6), 0.0039, 0.49, -0.011, 0.0108]


def test_the_spiral_is_the_published_one():
    # The print has three or four digits; a tenth of a degree, and two in the last digit of the turn's rate.
    spiral = as_published(steady(SPIRAL, GUESS))
    assert np.all(np.abs(spiral - PUBLISHED) < np.array([0.1, 0.1, 1e-4, 0.01, 0.01, 0.001]))


def start_of(x):
    """lw.Start of a steady motion."""
    attitude = np.array([np.rad2deg(x[0]), np.rad2deg(x[1]), 0.0])
    return lw.Start(euler_deg=attitude, velocity=x[3:], angular_velocity=x[2] * down_of(x[0], x[1]))


def test_the_named_vehicle_has_its_battery_where_it_is_level():
    vehicle = lw.Scene.named("seawing").vehicle
    rigid, first, _ = glider(-HULL * HULL_AT[0] / BATTERY, 0.0, 0.0)
    np.testing.assert_allclose(vehicle.rigid_body_mass_matrix, rigid, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(vehicle.added_mass_matrix, ADDED)
    np.testing.assert_allclose(vehicle.center_of_gravity, first / (HULL + BATTERY), rtol=0.0, atol=1e-9)


@pytest.mark.kernel
@pytest.mark.parametrize(("ahead", "net"), [(0.4216, 0.3), (0.38, -0.3)], ids=["dive", "climb"])
def test_a_steady_glide_follows_from_algebra(ahead, net):
    body = glider(ahead, 0.0, net)
    side = np.sign(net)
    level = steady(body, [0.0, -0.6 * side, 0.0, 0.47, 0.0, 0.01 * side])
    begun = lw.Start(euler_deg=[0.0, np.rad2deg(level[1]) + 5.0, 0.0], velocity=[0.3, 0.0, 0.0])
    result = lw.solve(scene_of(body, begun), "rk4", h=0.1, t1=600.0)
    v = result.velocity[-1, 0]
    np.testing.assert_allclose(v, level[3:], rtol=0.0, atol=1e-6)
    pitch = np.arctan2(-result.attitude[-1, 0, 2, 0], result.attitude[-1, 0, 2, 2])
    np.testing.assert_allclose(pitch, level[1], rtol=0.0, atol=1e-6)


@pytest.mark.kernel
def test_a_spiral_of_400_s():
    steady_spiral = steady(SPIRAL, GUESS)
    begun = start_of(steady_spiral * np.array([0.9, 1.1, 1.0, 1.0, 0.0, 1.0]))
    inverse = np.linalg.inv(SPIRAL[0] + ADDED)

    def rates(t, y):
        R, v, Om = y[3:12].reshape(3, 3), y[12:15], y[15:]
        return np.concatenate([R @ v, (R @ hat(Om)).ravel(), inverse @ momentum_rates(R[2], v, Om, SPIRAL)])

    scene = scene_of(SPIRAL, begun)
    result = lw.solve(scene, "rk4", h=0.05, t1=400.0)
    y0 = np.concatenate(
        [np.zeros(3), result.attitude[0, 0].ravel(), result.velocity[0, 0], result.angular_velocity[0, 0]]
    )
    truth = solve_ivp(rates, (0.0, 400.0), y0, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(result.position[-1, 0], truth[:3], rtol=0.0, atol=1e-6)
    # Whatever it began with, it turns as the algebra says.
    down = result.attitude[-1, 0, 2]
    np.testing.assert_allclose(result.velocity[-1, 0], steady_spiral[3:], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(down @ result.angular_velocity[-1, 0], steady_spiral[2], rtol=0.0, atol=1e-5)
