# SPDX-License-Identifier: Apache-2.0
"""Gain tables and fins at the measured speed: beside a simulator written by hand, the twin, and formulas of the fins."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from lgvi_warp.control import (
    Altimeter,
    BoundedLeastSquares,
    HeadingPID,
    HeavePID,
    PosePID,
    PseudoInverse,
    SetPoint,
    SpeedPID,
    StateFeedback,
)
from lgvi_warp.reference.control.altimeter import Altimeter as AltimeterTwin
from lgvi_warp.reference.control.altimeter import Ground
from lgvi_warp.reference.control.gain_tables import GainTables, MeasuredSpeed
from lgvi_warp.reference.control.pseudo_inverse import PseudoInverse as PseudoInverseTwin
from tests.support.loops import twin_loop, twin_run
from tests.support.tools import one

MASS, YAW, PERIOD, FLOOR = 50.0, 6.0, 0.1, 12.0
DRAG = (20.0, 30.0, 40.0, 4.0, 5.0, 8.0)
NUMBERS = {
    ("heading_pid", "kp"): ("speed", (0.3, 0.8, 1.5), (12.0, 5.0, 2.0)),
    ("heading_pid", "kd"): ("speed", (0.5, 1.0), (9.0, 3.0)),
    ("speed_pid", "kp"): ("depth", (1.0, 4.0), (15.0, 60.0)),
    ("heave_pid", "kp"): ("altitude", (6.0, 8.0, 10.0), (60.0, 30.0, 10.0)),
    ("heave_pid", "kd"): ("altitude", (6.0, 10.0), (50.0, 20.0)),
    ("pose_pid", "kd"): ("speed", (0.2, 1.0), ((1.0, 5.0, 2.0), (3.0, 40.0, 9.0))),
}
WISH = {"heading": 1.2, "speed": 1.1, "depth": 5.0}
REST = (0.0, 0.0, 0.0)


def table(part, name):
    return dict(zip(("over", "at", "values"), NUMBERS[part, name], strict=True))


def scene():
    """A body that turns, moves ahead and dives, level where it starts level; numbers over speed, depth and altitude."""
    laws = [
        HeadingPID(kp=table("heading_pid", "kp"), ki=0.4, kd=table("heading_pid", "kd")),
        SpeedPID(kp=table("speed_pid", "kp")),
        HeavePID(kp=table("heave_pid", "kp"), kd=table("heave_pid", "kd")),
        PosePID(kp=REST, kd=table("pose_pid", "kd"), kr=REST, kw=REST),
    ]
    guidance = [SetPoint(position=[0.0, 0.0, WISH["depth"]], heading=WISH["heading"], speed=WISH["speed"])]
    sensors = [Altimeter(point=[0.3, 0.0, 0.1])]
    controller = lw.Controller(period=PERIOD, sensors=sensors, guidance=guidance, laws=laws)
    vehicle = lw.Vehicle(MASS, inertia=[4.0, 5.0, YAW], added_mass=(0.0, 0.0, 0.0), buoyancy=MASS * 9.8)
    terms = [lw.terms.ControlWrench(), lw.terms.Drag(linear=DRAG)]
    floor = lw.events.Floor(depth=FLOOR, clearance=-1e3)
    return lw.Scene(vehicle, lw.Environment(9.8), terms, controller=controller, events=[floor])


def held(name, x):
    """A number by its table."""
    _, at, values = NUMBERS[name]
    return np.array([np.interp(x, at, column) for column in np.reshape(values, (len(at), -1)).T])


def by_hand(start, seconds):
    """u, v, w, r, heading, depth at the ticks, of the equations between them at a tolerance of 1e-12."""

    def rates(t, s, X, Y, Z, N):
        u, v, w, r = s[:4]
        X, Y, Z, N = X - DRAG[0] * u, Y - DRAG[1] * v, Z - DRAG[2] * w, N - DRAG[5] * r
        return [X / MASS + v * r, Y / MASS - u * r, Z / MASS, N / YAW, r, w]

    states, total, error = [np.array(start, float)], 0.0, 0.0
    for _ in range(round(seconds / PERIOD)):
        u, v, w, r, heading, depth = states[-1]
        # The altimeter is 0.1 m below the origin, and looks down.
        altitude = 0.1 + (FLOOR - depth - 0.1)
        kp, kd = (held(("heading_pid", name), u)[0] for name in ("kp", "kd"))
        total, error = total + PERIOD * error, WISH["heading"] - heading
        damping = held(("pose_pid", "kd"), u)
        X = held(("speed_pid", "kp"), depth)[0] * (WISH["speed"] - u) - damping[0] * u
        Z = held(("heave_pid", "kp"), altitude)[0] * (WISH["depth"] - depth)
        Z -= held(("heave_pid", "kd"), altitude)[0] * w + damping[2] * w
        wrench = X, -damping[1] * v, Z, kp * error + 0.4 * total - kd * r
        end = solve_ivp(rates, (0.0, PERIOD), states[-1], "DOP853", rtol=1e-12, atol=1e-13, args=wrench)
        states.append(end.y[:, -1])
    return np.array(states)


STARTS = ((0.2, 0.1, 0.0, 0.05, 0.0, 1.5), (1.6, -0.2, 0.1, 0.0, 2.0, 3.0), (-0.3, 0.0, 0.2, -0.1, 0.4, 7.0))


@pytest.mark.ci
@pytest.mark.kernel
def test_the_loop_is_that_of_a_simulator_by_hand_to_the_order_of_the_step():
    s = np.array(STARTS)
    zero = np.zeros(len(s))
    attitude = Rotation.from_euler("z", s[:, 4:5]).as_matrix()
    given = np.column_stack([zero, zero, s[:, 5]]), attitude, s[:, :3], np.column_stack([zero, zero, s[:, 3]])
    fleet = lw.Ensemble.from_states(scene(), *given)
    true = np.stack([by_hand(start, 12.0) for start in s], axis=1)
    errors = []
    for h in (PERIOD, PERIOD / 2.0):
        result = lw.solve(fleet, "rk4", h=h, t1=12.0, save=lw.SaveAt(every=PERIOD))
        R = result.attitude
        turn = np.unwrap(np.arctan2(R[..., 1, 0], R[..., 0, 0]), axis=0)
        got = [*np.moveaxis(result.velocity, -1, 0), result.angular_velocity[..., 2], turn, result.position[..., 2]]
        errors.append(np.abs(np.stack(got, axis=-1) - true).max())
    # A stage of rk4 errs by (h d / m)^5 / 120, of the fastest rate (d + kd) / m = 2.8: 1e-5; the fourth order gains 16.
    assert errors[0] < 1e-5
    assert 10.0 < errors[0] / errors[1] < 24.0


@pytest.mark.ci
@pytest.mark.kernel
def test_the_loop_is_its_twins_in_any_attitude():
    rng = np.random.default_rng(4)
    here, steps = scene(), 60
    b, R = np.array([0.3, -0.2, 3.0]), Rotation.from_rotvec(0.4 * rng.normal(size=3)).as_matrix()
    state = b, R, np.array([0.7, 0.2, -0.1]), 0.2 * rng.normal(size=3)
    result = lw.solve(one(here, b=b, R=R, nu=state[2], Om=state[3]), "rk4", h=PERIOD / 2.0, t1=steps * PERIOD / 2.0,
                      save=lw.SaveAt(every=PERIOD))  # fmt: skip
    body, loop = twin_loop(here, {}, 2, PERIOD / 2.0)
    sounder = AltimeterTwin(point=np.array([0.3, 0.0, 0.1]), ground=Ground(np.full((1, 1), FLOOR), (0, 0), (1, 1)))
    loop.parts = [sounder, *loop.parts]
    for part in loop.parts:
        if isinstance(part, GainTables):
            part.altimeter = sounder
    position, attitude = twin_run(body, loop, "rk4", PERIOD / 2.0, steps, *state)
    # Round-off of 60 steps in numbers of size 10.
    np.testing.assert_allclose(result.position[:, 0], position[::2], atol=1e-11)
    np.testing.assert_allclose(result.attitude[:, 0], attitude[::2], atol=1e-11)


# A demand of fins is the place and the rates.
SHIFTED = StateFeedback(K=-np.eye(12)[[0, 1, 2, 9, 10, 11]])
FINS = {
    "position": [[-1.0, 0.0, 0.0], [-0.9, 0.0, 0.1], [-1.0, 0.0, 0.0]], "chord": [[1.0, 0.0, 0.0]] * 3,
    "drag": [0.01] * 3, "area": [0.02, 0.015, 0.02],
    "normal": [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0]], "lift_slope": [3.0, 2.5, 3.0], "limit": [0.4, 0.4, 0.4],
}  # fmt: skip


def of_fins(allocation, demands, speeds):
    """Commands and what is told back (n, ...) at the first tick, of demands (n, 6) at speeds ahead (n,)."""
    controller = lw.Controller(
        period=0.1, guidance=[SetPoint(position=REST, heading=0.0)], laws=[SHIFTED], allocation=[allocation]
    )
    vehicle = lw.Vehicle(MASS, inertia=[4.0, 5.0, YAW], buoyancy=MASS * 9.8)
    here = lw.Scene(vehicle, lw.Environment(9.8, water_density=1000.0), [lw.terms.ControlFins(**FINS)],
                    controller=controller)  # fmt: skip
    n = len(demands)
    ahead = np.column_stack([speeds, np.zeros((n, 2))])
    fleet = lw.Ensemble.from_states(here, demands[:, :3], np.tile(np.eye(3), (n, 1, 1)), ahead, demands[:, 3:])
    result = lw.solve(fleet, "rk4", h=0.1, t1=0.1, save=lw.SaveAt(every=0.1, fields=("command", "unmet", "demand")))
    return result.command[0], result.unmet[0], result.demand[0]


LEAST = 0.4


@pytest.mark.ci
@pytest.mark.parametrize(
    "kind",
    [pytest.param(PseudoInverse, marks=pytest.mark.kernel), pytest.param(BoundedLeastSquares, marks=pytest.mark.slow)],
)
def test_fins_at_the_measured_speed_make_what_their_lift_at_it_can(kind):
    rng = np.random.default_rng(6)
    speeds = np.array([0.1, -0.2, 0.4, 0.7, 1.0, 1.6, 2.5, -1.3])
    u = np.maximum(np.abs(speeds), LEAST)
    demands = rng.normal(size=(8, 6)) * [0.0, 1.0, 1.0, 0.0, 1.0, 1.0] * (u**2)[:, None]
    demands[5:] *= 40.0  # beyond their limits
    command, unmet, demand = of_fins(kind(to="control_fins", speed="measured", least_speed=LEAST), demands, speeds)
    normal = np.array(FINS["normal"]) / np.linalg.norm(FINS["normal"], axis=1, keepdims=True)
    lift = 500.0 * (np.array(FINS["area"]) * FINS["lift_slope"])[:, None] * normal
    effect = np.concatenate([lift, np.cross(FINS["position"], lift)], axis=1).T
    if kind is PseudoInverse:
        # Astern the lift of a deflection turns round.
        square = np.sign(speeds) * u**2
        wanted = np.stack([np.linalg.pinv(effect * square[i], rcond=1e-10) @ demand[i] for i in range(8)])
        np.testing.assert_allclose(command, np.clip(wanted, -0.4, 0.4), atol=1e-13)
    assert np.any(np.abs(command) >= 0.4 - 1e-12)
    left = demand - np.einsum("ij,nj->ni", effect, command) * (np.sign(speeds) * u**2)[:, None]
    np.testing.assert_allclose(unmet, left, atol=1e-7 * np.abs(demands).max())
    # The twin, of which the allocation knows no speed.
    if kind is PseudoInverse:

        class Fins:
            limit, command = np.full(3, 0.4), np.zeros(3)
            command_for = effort = staticmethod(np.asarray)

        fins, at_one = Fins(), PseudoInverseTwin(to="control_fins", effect=effect)
        for i in range(8):
            twin = MeasuredSpeed(allocation=at_one, least_speed=LEAST, square=np.sign(speeds[i]) * u[i] ** 2)
            rest = twin.allocate(demand[i], {"control_fins": fins})
            np.testing.assert_allclose(command[i], fins.command, atol=1e-13)
            np.testing.assert_allclose(unmet[i], rest, atol=1e-10 * np.abs(demands).max())


@pytest.mark.ci
@pytest.mark.parametrize("flow_angle", [True, False])
def test_fins_make_the_demanded_moment_ahead_and_astern(flow_angle):
    """The moment that acts on the vehicle, as the run accounts it, is the demanded one at either sign of the speed."""
    fins = lw.terms.ControlFins(position=[[-0.6, 0.0, 0.0]], chord=[[1.0, 0.0, 0.0]], normal=[[0.0, 1.0, 0.0]], area=0.02,
                                lift_slope=3.0, drag=0.0, limit=0.3, flow_angle=flow_angle)  # fmt: skip
    controller = lw.Controller(
        period=0.1, guidance=[SetPoint(heading=1.0)], laws=[HeadingPID(kp=0.2)],
        allocation=[PseudoInverse(to="control_fins", speed="measured", least_speed=LEAST)],
    )  # fmt: skip
    vehicle = lw.Vehicle(MASS, inertia=[4.0, 5.0, YAW], buoyancy=MASS * 9.8)
    here = lw.Scene(vehicle, lw.Environment(9.8, water_density=1000.0), [fins], controller=controller)
    ahead = np.array([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [0.7, 0.0, 0.0], [-0.7, 0.0, 0.0]])
    fleet = lw.Ensemble.from_states(here, np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)), ahead, np.zeros((4, 3)))
    result = lw.solve(fleet, "rk4", h=0.1, t1=0.1, save=lw.SaveAt(every=0.1, fields=("demand", "exerted")))
    np.testing.assert_allclose(result.demand[0, :, 5], 0.2, rtol=1e-12)
    # The lift of a fin that is turned by d, with the angle of the flow, is that of a small angle to a part of d^2.
    deflection = 0.2 / (0.6 * 500.0 * 0.02 * 3.0 * ahead[:, 0] ** 2)
    assert np.all(np.abs(result.exerted[0, :, 5] / 0.2 - 1.0) <= deflection**2 * flow_angle + 1e-12)
