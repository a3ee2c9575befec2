# SPDX-License-Identifier: Apache-2.0
"""Water that varies in space, on slender and on lopsided bodies: kernel and twin against the pressure on the hull, against
a Lagrangian differentiated by numbers, and against SciPy along waves."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.reference import explicit
from lgvi_warp.reference.submaps import Body, start
from lgvi_warp.reference.terms import Flow, Law
from tests.support.hamel import by_lagrangian, hat, turn
from tests.support.linear_flow import LinearFlow, columns
from tests.support.spheroid import Spheroid
from tests.support.tools import GRAVITY, difference, last, one, slope

DOWN = np.array([0.0, 0.0, 1.0])


# Nine samples determine the derivative at the first one to the eighth power of their distance.
SAMPLES = 9
FIRST = np.linalg.solve(np.vander(np.arange(SAMPLES), increasing=True).T, np.eye(SAMPLES)[1])


def accelerations(fleet, method, h):
    """(dv/dt [m/s2] inertial axes, dOm/dt [rad/s2] body axes), (n, 3) each, at t = 0."""
    result = lw.solve(fleet, method, h=h, t1=(SAMPLES - 1) * h, save=lw.SaveAt(every=h))
    assert result.status.counts() == {"ok": fleet.members}
    v = np.einsum("knij,knj->kni", result.attitude, result.velocity)
    return tuple(np.einsum("k,kni->ni", FIRST / h, x) for x in (v, result.angular_velocity))


class Cases(NamedTuple):
    """Bodies, states and waters of n members."""

    hulls: list
    mass: np.ndarray
    R: np.ndarray
    b: np.ndarray
    v: np.ndarray
    u: np.ndarray
    rate: np.ndarray
    strain: np.ndarray
    growth: np.ndarray


def strained(n=20, seed=11):
    """Random slenderness, mass, attitude, velocity, strain and growth."""
    rng = np.random.default_rng(seed)
    hulls = [
        Spheroid(a, a / ratio) for a, ratio in zip(rng.uniform(0.3, 0.9, n), rng.uniform(1.2, 9.0, n), strict=True)
    ]
    mass = np.array([hull.displaced for hull in hulls]) * rng.uniform(0.7, 1.4, n)
    S = rng.normal(size=(n, 3, 3)) * 0.1
    S = S + np.swapaxes(S, 1, 2)
    S -= np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
    R = np.array([turn(v) for v in rng.normal(size=(n, 3))])
    b, v, u, rate = rng.normal(size=(4, n, 3))
    return Cases(hulls, mass, R, b, v, u, 0.1 * rate, S, rng.uniform(-0.3, 0.3, n))


def fleet_of(cases):
    """The ensemble, one member of each case."""
    added = np.array([np.diag(hull.added_mass()) for hull in cases.hulls])
    displaced = np.array([hull.displaced for hull in cases.hulls])
    numbers = {"velocity": cases.u, "acceleration": cases.rate, "growth": cases.growth, **columns(cases.strain)}
    vary = {"vehicle.mass": cases.mass, "vehicle.added_mass": added, "vehicle.buoyancy": displaced * GRAVITY}
    # So hard to turn that the attitude is held: the error of splittings is then that of the water alone.
    hull = lw.Vehicle(1.0, inertia=(1e4, 1e4, 1e4), added_mass=(1.0, 1.0, 1.0), buoyancy=GRAVITY)
    here = lw.Scene(hull, lw.Environment(GRAVITY), terms=[LinearFlow()])
    nu = np.einsum("nji,nj->ni", cases.R, cases.v)
    return lw.Ensemble.from_states(
        here, cases.b, cases.R, nu, np.zeros_like(nu), vary | {f"linear_flow.{key}": x for key, x in numbers.items()}
    )


def by_pressure(cases):
    """dv/dt (n, 3) of each case, inertial axes."""
    found = []
    for hull, m, R, b, v, u, rate, S, growth in zip(*cases, strict=True):
        a = hull.acceleration(
            m, R.T @ v, R.T @ (u + S @ b), R.T @ (rate + growth * S @ b), R.T @ S @ R, growth * R.T @ S @ R
        )
        fall = (m - hull.displaced) * GRAVITY * (R.T @ DOWN) / (m + hull.added_mass())
        found.append(R @ (a + fall))
    return np.array(found)


@pytest.mark.ci
def test_the_flow_of_these_tests_is_what_it_says():
    strain = np.array([[0.1, -0.05, 0.2], [-0.05, -0.04, 0.08], [0.2, 0.08, -0.06]])
    report = lw.laws.check_law(
        LinearFlow(velocity=(0.2, -0.1, 0.3), acceleration=(0.05, 0.1, -0.08), growth=0.3, **columns(strain))
    )
    assert report.ok, report


def test_the_pressure_gives_added_mass_and_munks_share():
    # Of a sphere half its displacement; of slender ones Lamb's table (art. 115): along 0.059 and 0.021 at 5 and 9.97 to 1.
    assert Spheroid(1.0, 1.0 / 1.0001).added_mass() / Spheroid(1.0, 1.0 / 1.0001).displaced == pytest.approx(
        0.5, abs=1e-4
    )
    for ratio, along, across in ((5.01, 0.059, 0.895), (9.97, 0.021, 0.960)):
        hull = Spheroid(1.0, 1.0 / ratio)
        assert hull.added_mass()[:2] / hull.displaced == pytest.approx((along, across), abs=6e-4)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("method", "h", "allowed"), [("rk8", 2e-3, 1e-9), pytest.param("psi_s", 5e-5, 5e-9, marks=pytest.mark.slow)]
)
def test_a_spheroid_in_strained_water_goes_where_the_pressure_pushes_it(method, h, allowed):
    # The formula is exact where the flow is linear. psi_s is off by h^2, and the nine samples by round-off over h.
    cases = strained()
    got, _ = accelerations(fleet_of(cases), method, h)
    assert np.abs(got - by_pressure(cases)).max() < allowed


# dv/dt by pressure in a strain of 0.05 1/s across the body's axes, of a neutral spheroid at (0.3, 0, -0.7) m.
KNOWN = {
    (1.5, 0.0, 0.0): (0.00142, 0.03438), (1.5, 0.0, 0.3): (-0.01192, 0.03438), (0.0, 0.0, 1.0): (-0.04306, -0.00093),
}  # fmt: skip
SLENDER = Spheroid(0.8, 0.1)


@pytest.mark.slow
def test_a_hull_of_a_small_vehicle_in_a_strain():
    strain = 0.05 * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    n = len(KNOWN)
    same = {"u": (0.0, 0.0, 0.0), "rate": (0.0, 0.0, 0.0), "b": (0.3, 0.0, -0.7), "R": np.eye(3), "strain": strain}
    each = {key: np.broadcast_to(value, (n, *np.shape(value))) for key, value in same.items()}
    cases = Cases([SLENDER] * n, np.full(n, SLENDER.displaced), v=np.array(list(KNOWN)), growth=np.zeros(n), **each)
    got, _ = accelerations(fleet_of(cases), "rk8", 2e-3)
    assert np.abs(got - by_pressure(cases)).max() < 1e-9
    np.testing.assert_allclose(got[:, [0, 2]], list(KNOWN.values()), rtol=0.0, atol=5.01e-6)
    assert np.abs(got[:, 1]).max() < 1e-12


@pytest.mark.slow
def test_a_sphere_in_shear_has_autons_lift():
    # Auton, Hunt & Prud'homme (1988): m dv/dt = rho V ((1 + C) Du/Dt - C dv/dt - C_L (v - u) x curl u), C = C_L = 1/2.
    ball, shear = Spheroid(0.2 * (1.0 + 1e-9), 0.2), 0.4
    displaced, mass, rng = ball.displaced, 0.8 * ball.displaced, np.random.default_rng(4)
    v = rng.normal(size=(1, 3))
    G = np.zeros((3, 3))
    G[0, 2] = shear
    numbers = {"inertia": (1.0,) * 3, "added_mass": (0.5 * displaced,) * 3, "buoyancy": displaced * GRAVITY}
    here = lw.Scene(lw.Vehicle(mass, **numbers), lw.Environment(GRAVITY), terms=[LinearFlow(**columns(G))])
    b, R = np.array([0.1, 0.2, 0.5]), turn([0.3, -0.4, 0.8])
    got, _ = accelerations(one(here, b, R, v @ R), "rk8", 2e-3)
    u = G @ b
    curl = np.array([0.0, shear, 0.0])
    force = displaced * (1.5 * G @ u - 0.5 * np.cross(v - u, curl)) + (mass - displaced) * GRAVITY * DOWN
    np.testing.assert_allclose(got, force / (mass + 0.5 * displaced), rtol=0.0, atol=1e-9)


# A body whose centre of mass is not its origin, with added mass that couples everything.
MASS, CENTER, DISPLACED = 20.0, np.array([0.03, -0.02, 0.06]), 22.0
RIGID = np.block([[MASS * np.eye(3), -MASS * hat(CENTER)], [MASS * hat(CENTER), np.diag([0.5, 2.5, 2.5])]])
ADDED = np.array([
    [1.5, 0.3, -0.2, 0.1, 0.4, 0.5], [0.3, 20.0, 0.5, -0.6, 0.15, 1.4], [-0.2, 0.5, 23.0, -0.5, -1.2, 0.05],
    [0.1, -0.6, -0.5, 0.4, 0.03, -0.06], [0.4, 0.15, -1.2, 0.03, 1.1, 0.07], [0.5, 1.4, 0.05, -0.06, 0.07, 0.9],
])  # fmt: skip
POSE = {"b": np.array([0.4, -0.3, 0.7]), "R": turn([0.3, -0.4, 0.8])}
TWIST = {"v": np.array([1.2, 0.3, -0.2]), "Om": np.array([0.3, -0.4, 0.5])}
STRAIN = np.array([[0.1, -0.05, 0.2], [-0.05, -0.04, 0.08], [0.2, 0.08, -0.06]])
FLOW = {"velocity": np.array([0.2, -0.1, 0.3]), "acceleration": np.array([0.05, 0.1, -0.08]), "growth": 0.3}


def lagrangian(b, R, v, Om, t):
    """Lagrangian of body and water, whose potential is phi = u.x + x.S x / 2; v [m/s] and b in inertial axes.

    The rigid body's energy; that of the fluid which moves with the body, of its velocity through the water; work of the
    undisturbed pressure, rho (dphi/dt + u.u / 2), on the displaced volume; and weight.
    """
    S = (1.0 + FLOW["growth"] * t) * STRAIN
    flow = FLOW["velocity"] + FLOW["acceleration"] * t + S @ b
    rigid, through = (np.concatenate([R.T @ w, Om]) for w in (v, v - flow))
    phi_t = FLOW["acceleration"] @ b + 0.5 * FLOW["growth"] * b @ STRAIN @ b
    depth = MASS * (b + R @ CENTER)[2] - DISPLACED * b[2]
    return (
        0.5 * rigid @ RIGID @ rigid
        + 0.5 * through @ ADDED @ through
        + DISPLACED * (phi_t + 0.5 * flow @ flow)
        + GRAVITY * depth
    )


class LinearWater(Law):
    """The twin's water: that of the Lagrangian."""

    def flow(self, view):
        S = (1.0 + FLOW["growth"] * view.t) * STRAIN
        u = FLOW["velocity"] + FLOW["acceleration"] * view.t + S @ view.b
        return Flow(u, FLOW["acceleration"] + FLOW["growth"] * STRAIN @ view.b, S)


class Weighed(Law):
    """The twin's weight and buoyancy."""

    def wrench(self, view):
        down = GRAVITY * view.down
        return (MASS - DISPLACED) * down, MASS * np.cross(CENTER, down)


def lopsided(*inputs, center=CENTER, added=ADDED):
    """A scene with the body above."""
    rigid = np.block([[MASS * np.eye(3), -MASS * hat(center)], [MASS * hat(center), RIGID[3:, 3:]]])
    body = lw.Vehicle(rigid_body_mass_matrix=rigid, added_mass_matrix=added, buoyancy=DISPLACED * GRAVITY)
    return lw.Scene(body, lw.Environment(GRAVITY), terms=list(inputs))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("method", "h", "allowed"),
    [("psi_x", 1e-5, 1e-8), pytest.param("psi_w", 1e-5, 1e-8, marks=pytest.mark.slow), ("rk8", 2e-3, 1e-10)],
)
def test_a_lopsided_body_moves_as_its_lagrangian_says(method, h, allowed):
    water = LinearFlow(**FLOW, **columns(STRAIN))
    fleet = one(lopsided(water), POSE["b"], POSE["R"], POSE["R"].T @ TWIST["v"], TWIST["Om"])
    for got, right in zip(accelerations(fleet, method, h), by_lagrangian(lagrangian, **POSE, **TWIST), strict=True):
        # Of splittings, h^2 and the round-off of nine samples over h: each about 2e-9.
        np.testing.assert_allclose(got[0], right, rtol=0.0, atol=allowed)


def test_the_twin_of_a_lopsided_body_moves_as_its_lagrangian_says():
    I6 = RIGID + ADDED
    body = Body(I6[:3, :3], I6[3:, 3:], (LinearWater(), Weighed()), DISPLACED - MASS, -MASS * CENTER,
                MASS, MASS * CENTER, C=I6[:3, 3:])  # fmt: skip
    R, b = POSE["R"], POSE["b"]
    u = FLOW["velocity"] + STRAIN @ b
    momenta = I6 @ np.concatenate([R.T @ (TWIST["v"] - u), TWIST["Om"]])
    _, _, *change = explicit.derivatives(start(body, b, R, momenta[:3], momenta[3:]), body, 0.0)
    dnu, dOm = np.split(np.linalg.solve(I6, np.concatenate(change)), 2)
    nu = R.T @ (TWIST["v"] - u)
    dv = (
        R @ (dnu + np.cross(TWIST["Om"], nu)) + FLOW["acceleration"] + FLOW["growth"] * STRAIN @ b + STRAIN @ TWIST["v"]
    )
    np.testing.assert_allclose(
        np.concatenate([dv, dOm]), np.concatenate(by_lagrangian(lagrangian, **POSE, **TWIST)), rtol=0.0, atol=1e-9
    )


class Wave(NamedTuple):
    """One linear wave in deep water (Faltinsen 1990, table 2.1)."""

    amplitude: float
    period: float
    heading: float

    def at(self, b, t):
        """u, du/dt and du/db where the vehicle is."""
        omega = 2.0 * np.pi / self.period
        k = omega**2 / GRAVITY
        along = np.array([np.cos(self.heading), np.sin(self.heading), 0.0])
        theta = k * along @ b - omega * t
        size = self.amplitude * omega * np.exp(-k * b[2])
        u = size * (np.cos(theta) * along - np.sin(theta) * DOWN)
        by_theta = -size * (np.sin(theta) * along + np.cos(theta) * DOWN)
        return u, -omega * by_theta, k * (np.outer(by_theta, along) - np.outer(u, DOWN))

    def term(self):
        numbers = {"amplitudes": [self.amplitude], "periods": [self.period], "phases": [0.0]}
        return lw.terms.Waves(**numbers, headings_deg=[float(np.degrees(self.heading))])


class Driven(NamedTuple):
    """A body in a wave: rigid and added mass (6, 6), centre of mass, displacement and its centre, thrust, drag along axes."""

    rigid: np.ndarray
    added: np.ndarray
    center: np.ndarray
    displaced: float
    buoyancy_center: np.ndarray
    thrust: np.ndarray
    torque: np.ndarray
    linear: np.ndarray
    wave: Wave

    def rates(self, t, y):
        """d(b, R, nu, Om)/dt, nu the velocity through the water: Kirchhoff's equations in weakly non-uniform flow."""
        b, R, nu, Om = y[:3], y[3:12].reshape(3, 3), y[12:15], y[15:]
        u, rate, G = self.wave.at(b, t)
        m, down, X = self.rigid[0, 0], R.T @ DOWN, R.T @ G @ R
        I6, twist = self.rigid + self.added, np.concatenate([nu, Om])
        p, pi = np.split(I6 @ twist, 2)
        a = R.T @ (rate + G @ u)
        force = (
            np.cross(p, Om) + (self.displaced - m) * (a - GRAVITY * down) - m * X @ nu - X.T @ (self.added @ twist)[:3]
        )
        torque = np.cross(pi, Om) + np.cross(p, nu) - np.cross(self.center, m * (X @ nu + a - GRAVITY * down))
        torque = torque + np.cross(self.buoyancy_center, self.displaced * (a - GRAVITY * down))
        wrench = np.concatenate([force + self.thrust, torque + self.torque]) - self.linear * twist
        return np.concatenate([R @ nu + u, (R @ hat(Om)).ravel(), np.linalg.solve(I6, wrench)])

    def solve(self, b, R, v, Om, times):
        """(b (k, 3), v (k, 3) inertial axes, at the times; R, Om at the last one); v over ground."""
        u, _, _ = self.wave.at(b, 0.0)
        start = np.concatenate([b, R.ravel(), R.T @ (v - u), Om])
        path = solve_ivp(self.rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-13).y.T
        y = path[-1]
        R = y[3:12].reshape(3, 3)
        return path[:, :3], (y[:3], R, y[12:15] + R.T @ self.wave.at(y[:3], times[-1])[0], y[15:])

    def scene(self):
        """The same as a scene."""
        hull = lw.Vehicle(rigid_body_mass_matrix=self.rigid, added_mass_matrix=self.added, weight=self.rigid[0, 0] * GRAVITY,
                          center_of_gravity=self.center, buoyancy=self.displaced * GRAVITY,
                          center_of_buoyancy=self.buoyancy_center)  # fmt: skip
        acting = [
            self.wave.term(),
            lw.terms.Wrench(force=self.thrust, torque=self.torque),
            lw.terms.Drag(linear=self.linear),
        ]
        return lw.Scene(hull, lw.Environment(GRAVITY), terms=acting)


def held(wave):
    """The slender hull, neutral, whose attitude nothing turns in the time of a run."""
    none, M = np.zeros(3), SLENDER.displaced * np.eye(3)
    rigid, added = (np.kron(np.diag(e), np.eye(3)) for e in ((1.0, 0.0), (0.0, 0.0)))
    rigid[:3, :3], rigid[3:, 3:], added[:3, :3] = M, 1e13 * np.eye(3), np.diag(SLENDER.added_mass())
    return Driven(rigid, added, none, SLENDER.displaced, none, none, none, np.zeros(6), wave)


# Amplitude [m], period [s], where it travels to, and speed along north [m/s]: against it, with it, across it, and fast.
PASSES = {
    "against a swell": (Wave(0.05, 8.0, np.pi), 1.5),
    "with a swell": (Wave(0.05, 8.0, 0.0), 1.5),
    "with a chop": (Wave(0.02, 5.0, 0.0), 1.5),
    "across a chop": (Wave(0.02, 5.0, 0.5 * np.pi), 1.5),
    "fast against a chop": (Wave(0.02, 4.0, np.pi), 2.0),
}


def heave_and_drift(times, depth, wave, speed):
    """Amplitude of the depth at the frequency of encounter [m], and its change over the run [m], by least squares."""
    omega = 2.0 * np.pi / wave.period
    angle = (omega - omega**2 / GRAVITY * speed * np.cos(wave.heading)) * times
    columns = np.stack([np.ones_like(times), times, np.cos(angle), np.sin(angle)], axis=1)
    fit = np.linalg.lstsq(columns, depth)[0]
    return np.hypot(*fit[2:]), fit[1] * times[-1]


@pytest.mark.ci
@pytest.mark.parametrize("name", PASSES)
def test_heave_and_drift_of_a_slender_hull_under_waves(name):
    wave, speed = PASSES[name]
    body, times = held(wave), np.arange(401) * 0.2
    start = np.array([0.0, 0.0, 3.0]), np.eye(3), np.array([speed, 0.0, 0.0]), np.zeros(3)
    truth, _ = body.solve(*start, times)
    right = np.array(heave_and_drift(times, truth[:, 2], wave, speed))
    paths, found = [], []
    for h in (0.1, 0.05):
        result = lw.solve(one(body.scene(), *start), "psi_s", h=h, t1=times[-1], save=lw.SaveAt(every=0.2))
        paths.append(np.abs(result.position[:, 0] - truth).max())
        found.append(np.abs(heave_and_drift(times, result.position[:, 0, 2], wave, speed) - right))
    # Of order 2 to a tenth: the next power of h is that small. What is left is below 1 % of heave and of drift.
    assert np.log2(paths[0] / paths[1]) == pytest.approx(2.0, abs=0.1)
    assert (found[1] < 0.01 * np.abs(right)).all(), (found[1], right)


# A body with thrust and drag that turns in waves: each method by its order.
OBLIQUE = Wave(0.3, 5.0, np.radians(150.0))
SIMPLE = Driven(
    np.diag([20.0, 20.0, 20.0, 0.5, 2.5, 2.5]), np.diag([1.5, 18.0, 23.0, 0.0, 0.0, 0.0]), np.zeros(3), 20.5,
    np.array([0.01, 0.0, -0.05]), np.array([9.0, 0.0, 0.5]), np.array([0.02, -0.05, 0.04]),
    np.array([6.0, 30.0, 35.0, 0.8, 8.0, 7.0]), OBLIQUE,
)  # fmt: skip
LOPSIDED = SIMPLE._replace(rigid=RIGID, added=ADDED, center=CENTER)
START = np.array([0.2, -0.1, 2.5]), turn([0.1, -0.2, 0.4]), np.array([0.9, 0.3, -0.1]), np.array([0.1, -0.2, 0.15])

# order, and the longer of two steps; the error of rk8 at the shorter one is that of the truth's tolerance over 10.
ORDERS = {
    ("psi_s", "SIMPLE"): (2, 0.02), ("psi", "SIMPLE"): (2, 0.02), ("psi_x", "LOPSIDED"): (2, 0.01),
    ("psi_w", "LOPSIDED"): (2, 0.02), ("rkw3", "LOPSIDED"): (3, 0.02), ("rk4", "LOPSIDED"): (4, 0.02),
    ("rkmk4", "SIMPLE"): (4, 0.04), ("rk8", "LOPSIDED"): (8, 0.2),
}  # fmt: skip


@pytest.mark.ci
@pytest.mark.slow_but("rk4-LOPSIDED")
@pytest.mark.parametrize(("method", "body"), ORDERS)
def test_methods_keep_their_order_in_waves(method, body):
    order, h = ORDERS[method, body]
    driven, t1 = {"SIMPLE": SIMPLE, "LOPSIDED": LOPSIDED}[body], 8.0
    _, truth = driven.solve(*START, np.array([0.0, t1]))
    b, R, v, Om = START
    fleet = one(driven.scene(), b, R, R.T @ v, Om)
    steps = np.array([h, 0.5 * h])
    errors = [difference(last(lw.solve(fleet, method, h=step, t1=t1)), truth) for step in steps]
    assert slope(steps, errors) == pytest.approx(order, abs=0.06 * order), errors


@pytest.mark.slow
def test_float32_in_waves():
    # Rounding of 6e-8 in 400 steps of a damped body, and the method's own error.
    _, truth = LOPSIDED.solve(*START, np.array([0.0, 8.0]))
    b, R, v, Om = START
    got = last(lw.solve(one(LOPSIDED.scene(), b, R, R.T @ v, Om), "rk4", h=0.02, t1=8.0, dtype="float32"))
    assert difference(got, truth) < 1e-4
