# SPDX-License-Identifier: Apache-2.0
"""REMUS 100: its speed at a held thrust and its steady turns, against equations of motion written here once more.

In the plane (centre of gravity at the origin, no propeller torque) nothing pushes pitch or roll, and turns are steady;
with all six degrees of freedom the vehicle is unstable in pitch, and runs start at their equilibrium.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import lgvi_warp as lw
from tests.support.tools import last, one, slope

METHOD = "psi_x"
THRUST, TORQUE = 3.86, -0.543  # N, N m
WEIGHT, LEVER = 299.0, 0.0196  # N, m: the centre of gravity below that of buoyancy, which is the origin
MASS, ROLL, PITCH = 30.48, 0.177, 3.45  # kg, kg m2
AHEAD, ACROSS, TURNING, COUPLING, ROLLING = 0.93, 35.5, 4.88, 1.93, 0.0704  # added mass: kg, kg, kg m2, kg m, kg m2
FIN, TAIL = 9.64, -0.638  # kg/m, m: lift of a pair of fins by angle, and where it acts
CRUISE = np.sqrt(THRUST / 1.62)  # m/s
RUDDERS = np.radians([4.0, 10.0, 20.0])


def fin_force(ahead, across, deflection):
    """(ahead, across) [N]: lift FIN V^2 sin a cos a across the flow, a the deflection less the angle of the flow."""
    flow = np.arctan2(across, ahead)
    angle = deflection - flow
    lift = FIN * (ahead**2 + across**2) * np.sin(angle) * np.cos(angle)
    return -lift * np.sin(flow), lift * np.cos(flow)


def momentum(velocity, lever):
    """Momentum (3,) [kg m/s] and angular momentum (3,) [kg m2/s] of body and water, Kirchhoff's, about the origin."""
    return np.split(mass_matrix(lever) @ velocity, 2)


def mass_matrix(lever):
    """(6, 6) of body and water about the origin, linear first."""
    M = np.diag([MASS + AHEAD, MASS + ACROSS, MASS + ACROSS, ROLL + ROLLING, PITCH + TURNING, PITCH + TURNING])
    M[0, 4] = M[4, 0] = MASS * lever
    M[1, 3] = M[3, 1] = -MASS * lever
    M[2, 4] = M[4, 2] = COUPLING
    M[1, 5] = M[5, 1] = -COUPLING
    return M


def forces(velocity, down, rudder, lever, torque):
    """(6,) [N, N m] of hull, fins, propeller and weight; velocity (u, v, w, p, q, r), down (3,) in body axes."""
    u, v, w, p, q, r = velocity
    X = THRUST - 1.62 * abs(u) * u
    Y = -1310.0 * abs(v) * v + 0.632 * abs(r) * r - 18.96 * u * v
    Z = -131.0 * abs(w) * w - 0.632 * abs(q) * q - 18.96 * u * w
    K = torque - 0.13 * abs(p) * p
    M = 3.18 * abs(w) * w - 188.0 * abs(q) * q - 4.47 * u * w
    N = -3.18 * abs(v) * v - 94.0 * abs(r) * r + 4.47 * u * v
    rudder_x, rudder_y = fin_force(u, v + TAIL * r, rudder)
    stern_x, stern_z = fin_force(u, w - TAIL * q, 0.0)
    hull = np.array([X + rudder_x + stern_x, Y + rudder_y, Z + stern_z, K, M - TAIL * stern_z, N + TAIL * rudder_y])
    hull[3:] += np.cross([0.0, 0.0, lever], WEIGHT * np.asarray(down))
    return hull


def acceleration(velocity, down, rudder, lever=0.0, torque=0.0):
    """(6,): Kirchhoff's equations, P' = F - Om x P, L' = T - Om x L - nu x P."""
    P, L = momentum(velocity, lever)
    nu, Om = np.split(np.asarray(velocity), 2)
    turning = np.concatenate([np.cross(Om, P), np.cross(Om, L) + np.cross(nu, P)])
    rate = forces(velocity, down, rudder, lever, torque) - turning
    return np.linalg.solve(mass_matrix(lever), rate)


def plane_acceleration(state, rudder):
    """(u, v, r)' in the plane."""
    u, v, r = state
    return acceleration([u, v, 0.0, 0.0, 0.0, r], [0.0, 0.0, 1.0], rudder)[[0, 1, 5]]


def plane_scene(rudder):
    """The vehicle of the package, held in the plane by its symmetry."""
    inertia = np.diag([MASS, MASS, MASS, ROLL, PITCH, PITCH])
    vehicle = {"buoyancy": WEIGHT, "center_of_gravity": [0.0] * 3, "rigid_body_mass_matrix": inertia}
    return turned_rudder(vehicle, rudder, [{"type": "wrench", "force": [THRUST, 0.0, 0.0]}])


def turned_rudder(vehicle, rudder, terms=()):
    """A scene of the vehicle with its rudder at an angle [rad]."""
    content = lw.Scene.named("remus_100", vehicle=vehicle).to_dict()["terms"]
    (fins,) = (term for term in content if term["type"] == "control_fins")
    fins = {key: value for key, value in fins.items() if key not in ("times", "command_schedule")}
    return lw.Scene.named("remus_100", vehicle=vehicle, terms=[*terms, fins | {"command": [rudder, 0.0]}])


def run(scene, h, t1, velocity, R=None):
    """Attitude and velocity (6,) at the end."""
    result = lw.solve(one(scene, R=R, nu=velocity[:3], Om=velocity[3:]), METHOD, h=h, t1=t1)
    assert result.status.counts() == {"ok": 1}
    _, R, nu, Om = last(result)
    return R, np.concatenate([nu, Om])


def ahead(u):
    """(6,) of a straight run."""
    return np.array([u, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_the_vehicle_s_inertia_is_the_one_here():
    vehicle = lw.Scene.named("remus_100").vehicle
    given = np.asarray(vehicle.rigid_body_mass_matrix) + np.asarray(vehicle.added_mass_matrix)
    np.testing.assert_allclose(given, mass_matrix(LEVER), rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_speed_from_rest():
    # (m + added mass) u' = T - k u^2: u = CRUISE tanh(t / tau), tau = 12.56 s, at t = tau. The step's error is of order 2
    # in h / tau: at the shortest 0.1 / 12.56 that is 6e-5, times a constant below 1.
    tau = (MASS + AHEAD) / np.sqrt(THRUST * 1.62)
    steps, errors = np.array([0.4, 0.2, 0.1]), []
    t1 = 12.0
    for h in steps:
        R, velocity = run(plane_scene(0.0), h, t1, ahead(0.0))
        assert not np.any(velocity[1:])
        assert np.array_equal(R, np.eye(3))
        errors.append(abs(velocity[0] / (CRUISE * np.tanh(t1 / tau)) - 1.0))
    assert errors[-1] < 6e-5
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


@pytest.mark.ci
def test_steady_speed():
    # After 160 s the transient is 2 exp(-2 t / tau) = 2e-11. What is left is the shift of the balance by a step in which
    # thrust and drag act in turn: (rate h)^2 / 12 or less, the rate 2 k u / m = 0.16 1/s.
    steps, errors = np.array([0.4, 0.2, 0.1]), []
    for h in steps:
        _, velocity = run(plane_scene(0.0), h, 160.0, ahead(0.0))
        errors.append(abs(velocity[0] / CRUISE - 1.0))
    assert errors[-1] < (0.16 * 0.1) ** 2 / 12.0
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


def steady_turn(rudder):
    """(u, v, r) [m/s, m/s, rad/s] where the accelerations in the plane vanish."""
    found = root(plane_acceleration, (1.3, 0.06, -0.17), args=(rudder,), tol=1e-13)
    assert found.success
    return found.x


@pytest.mark.ci
@pytest.mark.parametrize("rudder", RUDDERS)
def test_steady_turn(rudder):
    # 100 s after cruising nothing is left of the transient, exp(-0.17 t). The step shifts the balance as it does the
    # speed's, now with the fastest rate of sway and yaw, 6 1/s.
    expected = steady_turn(rudder)
    fastest = np.abs(np.linalg.eigvals(jacobian(plane_acceleration, expected, rudder))).max()
    steps, errors = np.array([0.04, 0.02, 0.01]), []
    for h in steps:
        R, velocity = run(plane_scene(rudder), h, 100.0, ahead(CRUISE))
        assert np.abs(velocity[[2, 3, 4]]).max() < 1e-12
        assert np.abs(R[2, :2]).max() < 1e-12
        errors.append(np.abs(velocity[[0, 1, 5]] / expected - 1.0).max())
    assert errors[-1] < (fastest * 0.01) ** 2 / 12.0
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


def jacobian(f, x, *args):
    """Jacobian of f at x, by central differences."""
    columns = [(f(x + d, *args) - f(x - d, *args)) / 2e-6 for d in 1e-6 * np.eye(len(x))]
    return np.array(columns).T


@pytest.mark.ci
def test_the_way_into_a_turn():
    # Against an integration to 1e-11 of the equations here, 3 s after the rudder is put over; (6 h)^2 / 12 as above.
    rudder, t1 = RUDDERS[1], 3.0
    exact = solve_ivp(
        lambda t, x: plane_acceleration(x, rudder), (0.0, t1), [CRUISE, 0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-12
    )
    steps, errors = np.array([0.04, 0.02, 0.01]), []
    for h in steps:
        _, velocity = run(plane_scene(rudder), h, t1, ahead(CRUISE))
        errors.append(np.abs(velocity[[0, 1, 5]] - exact.y[:, -1]).max())
    assert errors[-1] < (6.0 * 0.01) ** 2 / 12.0
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


@pytest.mark.ci
def test_the_straight_course_is_unstable():
    # The hull's Munk moment is larger than what its fins hold: a disturbance of yaw grows at the fastest root's rate.
    fastest = np.linalg.eigvals(jacobian(plane_acceleration, np.array([CRUISE, 0.0, 0.0]), 0.0)).real.max()
    assert fastest == pytest.approx(1.02, abs=0.01)
    start = ahead(CRUISE)
    start[5] = 1e-9
    yaw = [run(plane_scene(0.0), 0.01, t1, start)[1][5] for t1 in (6.0, 8.0)]
    # (h rate)^2 and what is left of the other root, exp(-3.4 t) of it, are below 1e-4.
    assert np.log(yaw[1] / yaw[0]) / 2.0 == pytest.approx(fastest, rel=1e-4)


def turn_with_roll(rudder):
    """Velocity (6,) and attitude of the steady turn of all six degrees of freedom: level path, heel and trim constant."""

    def state(x):
        u, v, w, roll, trim, rate = x
        down = np.array([-np.sin(trim), np.sin(roll) * np.cos(trim), np.cos(roll) * np.cos(trim)])
        return np.array([u, v, w, *(rate * down)]), down, (roll, trim)

    def residual(x):
        velocity, down, _ = state(x)
        return acceleration(velocity, down, rudder, LEVER, TORQUE)

    guess = (*steady_turn(rudder)[:2], 0.0, -0.1, 0.0, steady_turn(rudder)[2])
    found = root(residual, guess, tol=1e-12)
    assert found.success
    velocity, _, (roll, trim) = state(found.x)
    return velocity, lw.notation.matrix_from_euler_deg(np.degrees([[roll, trim, 0.0]]))[0]


@pytest.mark.slow
@pytest.mark.parametrize("rudder", RUDDERS)
def test_a_turn_with_roll_stays_steady(rudder):
    # The turn is unstable in pitch, slowly: over 2 s the deviation grows little. Yaw and roll are fastest, 5 to 6 1/s.
    velocity, R = turn_with_roll(rudder)
    steps, errors = np.array([0.02, 0.01, 0.005]), []
    for h in steps:
        turned, reached = run(turned_rudder({"buoyancy": WEIGHT}, rudder), h, 2.0, velocity, R)
        errors.append(max(np.abs(reached - velocity).max(), np.abs(turned[2] - R[2]).max()))
    assert errors[-1] < (6.0 * 0.005) ** 2 / 12.0
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


@pytest.mark.slow
def test_the_torque_heels_the_hull():
    # asin(torque / (weight lever)) = -5.32 degrees holds it, and the balance of thrust its speed: neither moves in 2 s,
    # but for the step's shift of the speed, as in test_steady_speed, and what it adds to the pitch.
    heel = np.degrees(np.arcsin(TORQUE / (WEIGHT * LEVER)))
    R = lw.notation.matrix_from_euler_deg(np.array([[heel, 0.0, 0.0]]))[0]
    turned, reached = run(turned_rudder({"buoyancy": WEIGHT}, 0.0), 0.01, 2.0, ahead(CRUISE), R)
    assert heel == pytest.approx(-5.32, abs=0.005)
    assert np.abs(reached - ahead(CRUISE)).max() < (0.16 * 0.01) ** 2
    assert np.abs(turned - R).max() < (0.16 * 0.01) ** 2
