# SPDX-License-Identifier: Apache-2.0
"""The gliders: steady glides and spirals against roots of equations written here, and a spiral against DOP853 on them.

The equations are those of Zhang et al. (2013) for a battery that stays: momenta by a 6x6 inertia about the centre of buoyancy,
forces and moments in the axes of the flow, turned by a matrix. The Slocum's steady glides are those of another code.
"""

from dataclasses import replace
from typing import NamedTuple

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
# Drag, that by attack, side by slip, lift, that by attack, roll by slip, pitch, that by attack, yaw by slip, by rates.
WATER = (7.19, 386.29, -115.65, -0.36, 440.99, -58.27, 0.28, -65.84, 34.10, (-19.83, -205.64, -389.30))
# The steady spiral as published: roll, pitch [deg], turn [rad/s], angles of attack and sideslip [deg], speed [m/s].
PUBLISHED = np.array([-13.703, -35.641, 0.0039, 1.267, -1.283, 0.490])


class Body(NamedTuple):
    """A glider: 6x6 inertia without and of the water, first moment of mass [kg m], net weight [N], coefficients."""

    rigid: np.ndarray
    added: np.ndarray
    first: np.ndarray
    net: float
    water: tuple = WATER


def glider(ahead, turned, net):
    """The Seawing: battery `ahead` [m] and turned [rad], `net` [kg]."""
    at = np.array([ahead, -RADIUS * np.sin(turned), RADIUS * np.cos(turned)])
    c, s = np.cos(turned), np.sin(turned)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    own = np.diag([0.60, 15.27, 15.32]) + turn @ np.diag([0.02, 0.16, 0.17]) @ turn.T
    first = HULL * HULL_AT + BATTERY * at
    second = own - HULL * hat(HULL_AT) @ hat(HULL_AT) - BATTERY * hat(at) @ hat(at)
    rigid = np.block([[(HULL + BATTERY) * np.eye(3), -hat(first)], [hat(first), second]])
    return Body(rigid, ADDED, first, net * GRAVITY)


def hydrodynamics(v, Om, water):
    """Force and moment of the water, from drag, side force, lift and moments along the axes of the flow."""
    V = np.linalg.norm(v)
    a, b = np.arctan2(v[2], v[0]), np.arcsin(v[1] / V)
    ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    axes = np.array([[ca * cb, -ca * sb, -sa], [sb, cb, 0.0], [sa * cb, -sa * sb, ca]])
    drag, by_attack, side, lift, lift_by, roll, pitch, pitch_by, yaw, rates = water
    force = axes @ np.array([-(drag + by_attack * a**2), side * b, -(lift + lift_by * a)])
    k = np.array([roll * b, pitch + pitch_by * a, yaw * b]) + np.array(rates) * Om
    return V**2 * force, V**2 * axes @ k


def momentum_rates(down, v, Om, body):
    """dP/dt, dL/dt in body axes."""
    P = (body.rigid + body.added) @ np.concatenate([v, Om])
    force, moment = hydrodynamics(v, Om, body.water)
    return np.concatenate([
        np.cross(P[:3], Om) + body.net * down + force,
        np.cross(P[3:], Om) + np.cross(P[:3], v) + GRAVITY * np.cross(body.first, down) + moment,
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
    ballast = lw.terms.Ballast(command=[-body.net / (DENSITY * GRAVITY)])
    vehicle = {"rigid_body_mass_matrix": body.rigid, "center_of_gravity": body.first / (HULL + BATTERY)}
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
    level = glider(-HULL * HULL_AT[0] / BATTERY, 0.0, 0.0)
    np.testing.assert_allclose(vehicle.rigid_body_mass_matrix, level.rigid, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(vehicle.added_mass_matrix, ADDED)
    np.testing.assert_allclose(vehicle.center_of_gravity, level.first / (HULL + BATTERY), rtol=0.0, atol=1e-9)


@pytest.mark.ci
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


def against_another_integrator(scene, body, t1):
    """The last velocity and down, of a run that ends where DOP853 ends on the equations above."""
    inverse = np.linalg.inv(body.rigid + body.added)

    def rates(t, y):
        R, v, Om = y[3:12].reshape(3, 3), y[12:15], y[15:]
        return np.concatenate([R @ v, (R @ hat(Om)).ravel(), inverse @ momentum_rates(R[2], v, Om, body)])

    result = lw.solve(scene, "rk4", h=0.05, t1=t1)
    y0 = np.concatenate(
        [result.position[0, 0], result.attitude[0, 0].ravel(), result.velocity[0, 0], result.angular_velocity[0, 0]]
    )
    truth = solve_ivp(rates, (0.0, t1), y0, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(result.position[-1, 0], truth[:3], rtol=0.0, atol=1e-6)
    return result.velocity[-1, 0], result.attitude[-1, 0, 2], result.angular_velocity[-1, 0]


@pytest.mark.ci
@pytest.mark.kernel
def test_a_spiral_of_400_s():
    steady_spiral = steady(SPIRAL, GUESS)
    begun = start_of(steady_spiral * np.array([0.9, 1.1, 1.0, 1.0, 0.0, 1.0]))
    velocity, down, rate = against_another_integrator(scene_of(SPIRAL, begun), SPIRAL, 400.0)
    # Whatever it began with, it turns as the algebra says.
    np.testing.assert_allclose(velocity, steady_spiral[3:], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(down @ rate, steady_spiral[2], rtol=0.0, atol=1e-5)


# The Slocum ---------------------------------------------------------------------------------------------------------

# Pitch [deg], net volume [m3], and what gliderflight 1.2.1 on PyPI gives, the code of Merckelbach et al. (2019), with
# Cd0 = 0.15, 1025 kg/m3 and a hull that does not yield: angle of attack [deg], and speed [m/s]. Of SteadyStateGliderModel:
# model_fun by fsolve to 1e-14 in place of its table of angles, then its formula for the speed; its angles are minus ours.
GLIDES = [
    (-26.0, -2.5e-4, 2.3645196710332486, 0.37257698617229884),
    (26.0, 2.5e-4, -2.3645196710332486, 0.37257698617229884),
    (-20.0, -2.5e-4, 3.2533338718986045, 0.3245629233839068),
    (-35.0, -2.0e-4, 1.620702071033465, 0.3844180349774141),
]
POWER, SLIDER, BELOW = 9.0 * GRAVITY, 9.0, 0.05


def place_for(pitch, attack, speed):
    """Place ahead of its battery of 9 kg that holds it there [m]: the moments of weight, water and added mass are 0."""
    u, w = speed * np.cos(attack), speed * np.sin(attack)
    moment = -50.0 * attack * speed**2 + (70.0 - 5.0) * u * w
    return (moment / POWER - BELOW * np.sin(pitch)) / np.cos(pitch)


def slocum(place, net, **start):
    """The Slocum with its battery at a place [m] and a net volume [m3]."""
    battery = lw.terms.MovingMass(mass=SLIDER, places=[place], times=[0.0], reference=[0.0, 0.0, BELOW])
    return lw.Scene.named("slocum", terms=[battery, lw.terms.Ballast(command=[net])], start=start)


def test_the_slocum_has_the_lift_and_drag_of_its_source():
    # Wings of aspect ratio 7, swept by 43 degrees, 0.1 m2; a hull with slopes 3.8 and 9.7; 0.15 at no attack.
    wing = 2.0 * np.pi * 7.0 / (2.0 + np.sqrt(49.0 * (1.0 + np.tan(np.deg2rad(43.0)) ** 2) + 4.0))
    slopes = np.array([0.15, 9.7 + wing**2 / (np.pi * 0.8 * 7.0), 3.8 + wing])
    polar = lw.Scene.named("slocum").terms[0]
    got = [polar.drag, polar.drag_by_attack, polar.lift_by_attack]
    np.testing.assert_allclose(got, 0.5 * DENSITY * 0.1 * slopes, rtol=1e-14)


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize(("pitch", "net", "attack", "speed"), GLIDES)
def test_the_slocum_glides_as_published(pitch, net, attack, speed):
    pitch, attack = np.deg2rad([pitch, attack])
    place = [place_for(pitch, attack, speed), 0.0, BELOW]
    scene = slocum(place, net, euler_deg=[0.0, np.rad2deg(pitch) + 5.0, 0.0], velocity=[0.3, 0.0, 0.0])
    result = lw.solve(scene, "rk4", h=0.1, t1=900.0)
    (u, _, w), R = result.velocity[-1, 0], result.attitude[-1, 0]
    # The algebra, to 1e-6; the speed's mode of some 35 s has died out.
    np.testing.assert_allclose(np.hypot(u, w), speed, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose([np.arctan2(w, u), np.arctan2(-R[2, 0], R[2, 2])], [attack, pitch], rtol=0.0, atol=1e-6)


@pytest.mark.ci
@pytest.mark.kernel
def test_the_slocum_spirals_as_algebra_and_another_integrator_say():
    turned, x = np.deg2rad(20.0), 0.036
    place = np.array([x, -BELOW * np.sin(turned), BELOW * np.cos(turned)])
    first = SLIDER * place
    about = np.diag([4.0, 12.0, 11.0]) - SLIDER * hat(place) @ hat(place)
    rigid = np.block([[50.0 * np.eye(3), -hat(first)], [hat(first), about]])
    polar = lw.Scene.named("slocum").terms[0]
    drag, lift = (polar.drag, polar.drag_by_attack), (0.0, polar.lift_by_attack)
    water = (*drag, -20.0, *lift, -60.0, 0.0, -50.0, 100.0, (-20.0, -60.0, -20.0))
    body = Body(rigid, np.diag([5.0, 60.0, 70.0, 0.0, 0.0, 0.0]), first, 2.5e-4 * DENSITY * GRAVITY, water)
    spiral = steady(body, [np.deg2rad(-7.0), np.deg2rad(-35.0), 0.0066, 0.44, -0.03, 0.0115])
    assert np.rad2deg(spiral[2]) > 0.3
    begun = start_of(spiral * np.array([0.9, 1.1, 1.0, 1.0, 0.0, 1.0]))
    scene = replace(slocum(place, -2.5e-4), start=begun)
    velocity, down, rate = against_another_integrator(scene, body, 400.0)
    np.testing.assert_allclose(velocity, spiral[3:], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(down @ rate, spiral[2], rtol=0.0, atol=1e-5)
