# SPDX-License-Identifier: Apache-2.0
"""Loads of water that varies along a slender hull: against a Lagrangian of its strips that is differentiated by numbers,
against the pressure on spheroids, and against closed forms of waves much longer than the hull and of drag in a shear."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.laws.test_water_gradients import accelerations
from tests.support.hamel import by_lagrangian, hat, turn
from tests.support.linear_flow import LinearFlow, columns
from tests.support.spheroid import Spheroid
from tests.support.tools import GRAVITY, one

DENSITY, ACROSS = 1025.0, np.diag([0.0, 1.0, 1.0])


def gauss(stations, *tables):
    """Places and weights of two Gauss points a segment, and tables there, linear between stations."""
    x, middle, half = (np.asarray(y) for y in (stations, 0.5 * (stations[1:] + stations[:-1]), 0.5 * np.diff(stations)))
    at = np.concatenate([middle - half / np.sqrt(3.0), middle + half / np.sqrt(3.0)])
    return at, np.tile(half, 2), *(np.interp(at, x, table) for table in tables)


# A round bar with other added mass than its own displacement, whose origin is near its bow.
STATIONS = np.linspace(-1.4, 0.4, 9)
BREADTH = 0.2
ADDED = 30.0 + 25.0 * np.sin(2.0 * STATIONS) ** 2
X, WEIGHT, PER_LENGTH = gauss(STATIONS, ADDED)
SECTION = np.full(len(X), np.pi * BREADTH**2 / 4.0)
DISPLACED = DENSITY * SECTION @ WEIGHT
CENTER_OF_BUOYANCY = np.array([(X * SECTION) @ WEIGHT / (SECTION @ WEIGHT), 0.0, 0.0])
MASS, CENTER = 1.1 * DISPLACED, np.array([-0.4, 0.03, 0.05])
RIGID = np.block([[MASS * np.eye(3), -MASS * hat(CENTER)], [MASS * hat(CENTER), np.diag([3.0, 40.0, 42.0])]])
POSE = {"b": np.array([0.7, -0.4, 1.3]), "R": turn([0.3, -0.5, 0.8])}
TWIST = {"v": np.array([1.1, 0.4, -0.3]), "Om": np.array([0.3, -0.5, 0.4])}
# Waves as long as the hull, and twice as long.
WAVES = dict(amplitudes=(0.1, 0.15), periods=(1.1, 1.6), headings_deg=(20.0, 130.0), phases=(0.5, -0.9))


def arm_of(x):
    return np.array([x, 0.0, 0.0])


# The velocity of a strip across the hull, from (nu, Om).
ARMS = [np.hstack([ACROSS, -ACROSS @ hat(arm_of(x))]) for x in X]
ADDED_MATRIX = sum(w * a * A.T @ A for w, a, A in zip(WEIGHT, PER_LENGTH, ARMS, strict=True))


def potential(b, t):
    """Velocity of the water, and dphi/dt, of the waves."""
    u, rate = np.zeros(3, b.dtype), 0.0
    for a, T, heading, phase in zip(*WAVES.values(), strict=True):
        omega = 2.0 * np.pi / T
        k, beta = omega**2 / GRAVITY, np.deg2rad(heading)
        along = np.array([np.cos(beta), np.sin(beta)])
        theta, decay = k * along @ b[:2] - omega * t + phase, np.exp(-k * b[2])
        u = u + a * omega * decay * np.array([*(np.cos(theta) * along), -np.sin(theta)])
        rate = rate - a * omega**2 / k * decay * np.cos(theta)
    return u, rate


def lagrangian(b, R, v, Om, t):
    """The rigid body's energy; that of the water which each strip carries across the hull; work of the undisturbed pressure,
    rho (dphi/dt + u.u / 2), on the strips; and weight."""
    twist = np.concatenate([R.T @ v, Om])
    L = 0.5 * twist @ RIGID @ twist + GRAVITY * MASS * (b + R @ CENTER)[2]
    for x, weight, a, S in zip(X, WEIGHT, PER_LENGTH, SECTION, strict=True):
        place = b + R @ arm_of(x)
        u, rate = potential(place, t)
        w = ACROSS @ (R.T @ (v - u) + np.cross(Om, arm_of(x)))
        L = L + weight * (0.5 * a * w @ w + DENSITY * S * (rate + 0.5 * u @ u - GRAVITY * place[2]))
    return L


def bar(*more):
    """The scene of the Lagrangian."""
    body = lw.Vehicle(rigid_body_mass_matrix=RIGID, added_mass_matrix=ADDED_MATRIX, buoyancy=DISPLACED * GRAVITY,
                      center_of_buoyancy=CENTER_OF_BUOYANCY)  # fmt: skip
    hull = lw.terms.HullLoads(stations=STATIONS, diameters=np.full(len(STATIONS), BREADTH), added_mass=ADDED)
    water = lw.Environment(GRAVITY, water_density=DENSITY)
    return lw.Scene(body, water, terms=[hull, lw.terms.Waves(**WAVES), *more])


@pytest.mark.slow
@pytest.mark.parametrize(("method", "h", "allowed"), [("rk8", 2e-3, 1e-8), ("psi_x", 5e-5, 1e-6)])
def test_strips_move_as_their_lagrangian_says(method, h, allowed):
    nu = POSE["R"].T @ TWIST["v"]
    fleet = one(bar(), **POSE, nu=nu, Om=TWIST["Om"])
    got, want = accelerations(fleet, method, h), by_lagrangian(lagrangian, **POSE, **TWIST)
    without = bar()
    still = lw.Scene(without.vehicle, without.environment, terms=list(without.terms[1:]))
    coarse = accelerations(one(still, **POSE, nu=nu, Om=TWIST["Om"]), method, h)
    for one_of, far, exact in zip(got, coarse, want, strict=True):
        assert np.abs(one_of[0] - exact).max() < allowed
        # What the strips are there for: without them it is another motion.
        assert np.abs(far[0] - exact).max() > 0.05


J = 10.0


def spheroid_in(hull, share=1.0, **flow):
    """The scene of a neutral spheroid that is hard to turn, in a linear flow; share: of the water that its strips displace,
    what they carry."""
    stations = hull.a * np.sin(0.5 * np.pi * np.linspace(-1.0, 1.0, 257))
    breadth = 2.0 * hull.c * np.sqrt(1.0 - (stations / hull.a).clip(-1.0, 1.0) ** 2)
    added = share * 1000.0 * np.pi * breadth**2 / 4.0
    body = lw.Vehicle(hull.displaced, inertia=(J,) * 3, added_mass=hull.added_mass(), buoyancy=hull.displaced * GRAVITY)
    strips = lw.terms.HullLoads(stations=stations, diameters=breadth, added_mass=added)
    return lw.Scene(body, lw.Environment(GRAVITY, water_density=1000.0), terms=[strips, LinearFlow(**flow)])


def moment_of(scene, **state):
    """Torque [N m] on a body of inertia J that does not turn yet."""
    return J * accelerations(one(scene, **state), "rk8", 2e-3)[1][0]


@pytest.mark.ci
def test_a_growing_strain_turns_a_spheroid_as_its_pressure_does():
    # k = rho V (a^2 - c^2) / 5 + J_A (a^2 + c^2) / (a^2 - c^2) = 8.20 N m s^2 in water of 1025 kg/m3; by pressure 8.195.
    hull = Spheroid(0.8, 0.1)
    E = np.array([[0.0, 0.0, 0.01], [0.0, 0.0, 0.0], [0.01, 0.0, 0.0]])
    still = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((3, 3))
    k = -hull.moment(*still, E)[1] / 0.01
    assert 1.025 * k == pytest.approx(8.195, abs=5e-4)
    of_pressure = hull.displaced * (hull.a**2 - hull.c**2) / 5.0
    share = (k - of_pressure) / (hull.displaced * hull.a**2 / 5.0)
    got = moment_of(spheroid_in(hull, share, growth=1.0, **columns(E)))
    # Between 257 stations the hull is straight, and its sections are too small by the square of the distance.
    np.testing.assert_allclose(got, [0.0, -0.01 * k, 0.0], atol=(np.pi / 256.0) ** 2 * 0.01 * k)


@pytest.mark.ci
def test_strips_meet_the_pressure_on_spheroids_as_these_grow_slender():
    rng = np.random.default_rng(3)
    S = rng.normal(size=(3, 3)) * 0.1
    S = S + S.T - 2.0 * np.trace(S) * np.eye(3) / 3.0
    v, u, rate = rng.normal(size=(3, 3))
    apart = []
    for ratio in (8.0, 16.0, 32.0):
        hull = Spheroid(0.8, 0.8 / ratio)
        flow = {"velocity": u, "acceleration": rate, "growth": 1.5, **columns(S)}
        got = moment_of(spheroid_in(hull, **flow), nu=v)
        exact = hull.moment(v, np.zeros(3), u, rate, S, 1.5 * S)
        alone = hull.moment(v, np.zeros(3), u, rate, np.zeros((3, 3)), np.zeros((3, 3)))
        # Munk's moment is there without strips.
        apart.append(np.linalg.norm(got - exact) / np.linalg.norm(exact - alone))
    # Added mass differs from that of slender bodies by (c / a)^2 log(a / c).
    expected = np.array([(1.0 / r) ** 2 * np.log(r) for r in (8.0, 16.0, 32.0)])
    assert np.all(np.array(apart) < 6.0 * expected), apart
    assert apart[2] < 0.4 * apart[1] < 0.16 * apart[0] * 1.2


@pytest.mark.slow
def test_a_long_wave_is_a_growing_strain():
    apart = []
    for period in (6.0, 12.0):
        wave = lw.terms.Waves(amplitudes=[1e-4], periods=[period], headings_deg=[0.0], phases=[0.0])
        body = lw.Vehicle(DISPLACED, inertia=(J,) * 3, added_mass=(0.0,) * 3, buoyancy=DISPLACED * GRAVITY)
        middle = STATIONS - STATIONS.mean()
        hull = lw.terms.HullLoads(stations=middle, diameters=np.full(len(middle), BREADTH), added_mass=np.full(9, 40.0))
        at, weight = gauss(middle)
        k_hull = np.sum(weight * at**2 * (DENSITY * np.pi * BREADTH**2 / 4.0 + 40.0))
        scene = lw.Scene(body, lw.Environment(GRAVITY, water_density=DENSITY), terms=[hull, wave])
        omega = 2.0 * np.pi / period
        k = omega**2 / GRAVITY
        # Down the water moves at -a omega exp(-k z) sin(k x - omega t), whose strain grows most a quarter of a wave on.
        place = np.array([0.5 * np.pi / k, 0.0, 2.0])
        growth = -1e-4 * omega**2 * k * np.exp(-2.0 * k)
        got = moment_of(scene, b=place)[1]
        apart.append(got / (-k_hull * growth) - 1.0)
    assert abs(apart[0]) < 0.1
    # The square of the wavenumber, which is a fourth power of the period.
    assert apart[0] / apart[1] == pytest.approx(16.0, rel=0.1)


@pytest.mark.slow
def test_the_moment_is_newmans_in_a_wave_as_long_as_the_hull():
    """Newman (1977), 7.4: a slender body at rest in a stream feels rho S Dw/Dt + (d/dt + u d/dx)(a w) per length.

    The hull is pointed, so that the last part is -u times the sum of a w in the moment's lever, and no force.
    """
    stream, period, depth, phase = -1.5, 1.1, 0.8, 0.4
    stations = np.linspace(-0.7, 0.9, 41)
    carried = 40.0 * (1.0 - ((stations - 0.1) / 0.8) ** 2)
    breadth = 0.05
    x, weight, a = gauss(stations, carried)
    displaced = DENSITY * np.pi * breadth**2 / 4.0
    added = sum(w * one * A.T @ A for w, one, A in zip(
        weight, a, [np.hstack([ACROSS, -ACROSS @ hat(arm_of(at))]) for at in x], strict=True))  # fmt: skip
    middle = np.array([(x @ weight) / weight.sum(), 0.0, 0.0])
    mass = displaced * weight.sum()
    rigid = np.block([[mass * np.eye(3), -mass * hat(middle)], [mass * hat(middle), np.diag([J, J, J])]])
    found = []
    for height in (1e-3, -1e-3):
        body = lw.Vehicle(rigid_body_mass_matrix=rigid, added_mass_matrix=added, buoyancy=mass * GRAVITY,
                          center_of_buoyancy=middle)  # fmt: skip
        hull = lw.terms.HullLoads(stations=stations, diameters=np.full(len(stations), breadth), added_mass=carried)
        wave = lw.terms.Waves(amplitudes=[abs(height)], periods=[period], headings_deg=[0.0],
                              phases=[phase if height > 0.0 else phase + np.pi])  # fmt: skip
        water = [hull, wave, lw.terms.Current(velocity=[stream, 0.0, 0.0])]
        fleet = one(lw.Scene(body, lw.Environment(GRAVITY, water_density=DENSITY), terms=water), b=(0.0, 0.0, depth))
        got = accelerations(fleet, "rk8", 2e-3)
        found.append((rigid + added) @ np.concatenate([got[0][0], got[1][0]]))
    # Waves of half the height one way and the other: what is of second order falls out.
    load = 0.5 * (found[0] - found[1])
    omega = 2.0 * np.pi / period
    k = omega**2 / GRAVITY
    assert 0.5 < k * np.ptp(stations) / (2.0 * np.pi) < 2.0
    size = 1e-3 * omega * np.exp(-k * depth)
    w, rate, slope = (
        -size * f for f in (np.sin(k * x + phase), -omega * np.cos(k * x + phase), k * np.cos(k * x + phase))
    )
    rise = rate + stream * slope
    force = weight @ (displaced * rise + a * rate)
    moment = weight @ (-x * (displaced * rise + a * rate) + stream * a * w)
    # The third order of the steepness, 2e-5 here, and the differences by which accelerations are found.
    np.testing.assert_allclose(load[[2, 4]], [force, moment], rtol=1e-4)
    # A hull that feels the water at its origin alone has another moment.
    assert abs(weight @ (-x * (displaced + a)) * rise[len(x) // 4] / moment - 1.0) > 0.1


@pytest.mark.ci
def test_drag_is_that_of_the_flow_at_each_strip():
    # Water that rises with x across a bar at rest: its moment is rho / 2 Cd D g^2 times the integral of |x|^3.
    length, slope, Cd = 1.6, 0.7, 1.1
    body = lw.Vehicle(50.0, inertia=(J,) * 3, added_mass=(0.0,) * 3, buoyancy=50.0 * GRAVITY)
    shear = np.zeros((3, 3))
    shear[2, 0] = slope
    found = []
    for coefficient in (0.0, Cd):
        hull = lw.terms.HullLoads(
            stations=np.linspace(-0.8, 0.8, 41),
            diameters=[0.2] * 41,
            added_mass=[0.0] * 41,
            drag_coefficient=coefficient,
        )
        water = lw.Environment(GRAVITY, water_density=DENSITY)
        found.append(moment_of(lw.Scene(body, water, terms=[hull, LinearFlow(**columns(shear))])))
    exact = -0.5 * DENSITY * Cd * 0.2 * slope**2 * 2.0 * (0.5 * length) ** 4 / 4.0
    np.testing.assert_allclose(found[1] - found[0], [0.0, exact, 0.0], atol=1e-6 * abs(exact))
