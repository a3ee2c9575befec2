# SPDX-License-Identifier: Apache-2.0
"""The weight of a mass that moves: steady pitch and roll by algebra, SciPy on its own equations, orders, limits, a loop.

Its inertia has tests of its own, test_moving_inertia.py; here it stays.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.extensions.gliders.twin.moving_mass import MovingMass
from lgvi_warp.reference.control.depth_pid import DepthPID
from lgvi_warp.reference.control.loop import Fault, Loop
from lgvi_warp.reference.control.matrix import AllocationMatrix
from lgvi_warp.reference.control.set_point import SetPoint
from lgvi_warp.reference.terms.drag import Drag
from tests.support.loops import twin_body, twin_run
from tests.support.tools import difference, last, one, slope

pytestmark = pytest.mark.ci

GRAVITY, MASS, BATTERY = 9.8, 50.0, 9.0
# Neutral, its center of buoyancy 2 cm above that of gravity.
VEHICLE = lw.Vehicle(
    MASS, inertia=(1.0, 6.0, 7.0), added_mass=(5.0, 60.0, 70.0), buoyancy=MASS * GRAVITY,
    center_of_buoyancy=(0.0, 0.0, -0.02),
)  # fmt: skip
DRAG = dict(linear=(4.0, 20.0, 20.0, 2.0, 15.0, 15.0), quadratic=(20.0, 90.0, 90.0, 1.0, 30.0, 30.0))
# Of which no derivative jumps where a velocity changes its sign.
LINEAR = dict(quadratic=(0.0,) * 6)
STATE = dict(
    R=lw.notation.matrix_from_rotation_vector(np.array([0.2, -0.1, 0.4])), nu=(0.6, 0.1, -0.1), Om=(0.1, -0.2, 0.1)
)
# Forward, then aside and down.
PATH = dict(
    times=[0.4, 1.2, 2.0], places=[[0.02, 0.0, 0.06], [0.1, 0.0, 0.06], [0.06, 0.05, 0.09]], mass=BATTERY, inertia=False
)


def scene(*masses, controller=None, vehicle=VEHICLE, **drag):
    """The vehicle with drag and these masses."""
    terms = [lw.terms.Drag(**DRAG | drag), *masses]
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms=terms, controller=controller)


def held(**numbers):
    """A mass that a controller moves, whose commands are set from the start on: channel -> command."""
    commands = numbers.pop("commands")
    mass = lw.terms.MovingMass(**{"mass": BATTERY, "places": [[0.05, 0.0, 0.06]], "inertia": False} | numbers)
    faults = [lw.control.Fault(of=mass.key, channel=i, time=0.0, gain=0.0, offset=to) for i, to in commands.items()]
    controller = lw.Controller(
        period=0.1,
        guidance=[lw.control.SetPoint(depth=0.0)],
        laws=[lw.control.DepthPID(kp=0.0, kp_pitch=0.0)],
        allocation=[lw.control.AllocationMatrix(to=mass.key, matrix=np.ones((mass.channels, 6)))],
        faults=faults,
    )
    return mass, controller


def settled(vehicle_scene):
    """The vertical in body axes, where the vehicle has come to rest."""
    result = lw.solve(vehicle_scene, "rk4", h=0.05, t1=400.0, save=lw.SaveAt(every=400.0))
    assert np.abs(result.angular_velocity[-1, 0]).max() < 1e-12
    return result.attitude[-1, 0, 2]


def test_steady_pitch():
    # m d cos(theta) against M z sin(theta): tan(theta) = -m d / (M z), with the mass d ahead of its reference place.
    forward = lw.terms.MovingMass(
        mass=BATTERY, inertia=False, times=[0.0, 5.0], places=[[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]]
    )
    down = settled(scene(forward))
    assert down[0] / down[2] == pytest.approx(BATTERY * 0.03 / (MASS * 0.02), rel=1e-10)
    assert abs(down[1]) < 1e-12


@pytest.mark.slow
def test_steady_roll_of_a_turned_mass():
    # Turned by phi about x, 6 cm below the axis: it is at 6 cm (-sin phi, cos phi), and the weight hangs below the buoyancy.
    mass, controller = held(turn_axis=[2.0, 0.0, 0.0], commands={0: 0.7}, rate_limit=0.05)
    down = settled(scene(mass, controller=controller))
    across = BATTERY * 0.06 * -np.sin(0.7)
    below = MASS * 0.02 + BATTERY * 0.06 * (np.cos(0.7) - 1.0)
    assert down[1] / down[2] == pytest.approx(across / below, rel=1e-10)


def weight_torque(t):
    """Torque by down of the path above, body axes, by NumPy's interpolation."""
    places = np.array(PATH["places"])
    r = [np.interp(t, PATH["times"], column) for column in places.T]
    return BATTERY * GRAVITY * (r - places[0])


def static_rates(t, y):
    """b', R', nu', Om' of the vehicle whose mass has weight alone; R by rows."""
    R, nu, Om = y[3:12].reshape(3, 3), y[12:15], y[15:]
    M, J = np.diag(VEHICLE.mass_matrix), np.diag(VEHICLE.inertia)
    torque = np.cross(weight_torque(t), R[2]) - np.cross(MASS * GRAVITY * VEHICLE.center_of_buoyancy, R[2])
    v = np.concatenate([nu, Om])
    drag = np.array(DRAG["linear"]) * v
    acceleration = (np.cross(M * nu, Om) - drag[:3]) / M
    spin = (np.cross(J * Om, Om) + np.cross(M * nu, nu) + torque - drag[3:]) / J
    return np.concatenate([R @ nu, np.cross(R, Om).ravel(), acceleration, spin])


def truth(rates, end, knots, state=STATE):
    """(b, R, nu, Om) at the end by DOP853, begun anew at each knot of a path."""
    y = np.concatenate([np.zeros(3), np.ravel(state["R"]), state["nu"], state["Om"]])
    stops = [0.0, *(t for t in knots if 0.0 < t < end), end]
    for begin, stop in zip(stops, stops[1:]):
        y = solve_ivp(rates, (begin, stop), y, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return y[:3], y[3:12].reshape(3, 3), y[12:15], y[15:]


# Steps that meet the knots, so that a path that is linear between them costs no order.
@pytest.mark.parametrize(("method", "order", "longest"), [("rk4", 4.0, 0.05), ("psi_s", 2.0, 0.1)])
def test_orders_with_a_schedule(method, order, longest):
    steps = longest / np.array([1.0, 2.0, 4.0])
    fleet = one(scene(lw.terms.MovingMass(**PATH), **LINEAR), **STATE)
    known = truth(static_rates, 2.4, PATH["times"])
    errors = [difference(last(lw.solve(fleet, method, h=h, t1=2.4)), known) for h in steps]
    # Over a factor 4 in the step the next term of the error shows.
    assert slope(steps, errors) == pytest.approx(order, abs=0.2)


@pytest.mark.slow
def test_a_limited_rate():
    # Commanded by 8 cm at 1 cm/s: after 5 s it is 5 cm ahead, whatever the command; after 8 s it stays.
    mass, controller = held(slide_direction=[1.0, 0.0, 0.0], commands={0: 0.08}, rate_limit=0.01, limit=0.06)
    driven = lw.solve(scene(mass, controller=controller), "rk4", h=0.05, t1=10.0, save=lw.SaveAt(every=1.0))
    table = lw.terms.MovingMass(
        mass=BATTERY, inertia=False, times=[0.0, 6.0], places=[[0.05, 0.0, 0.06], [0.11, 0.0, 0.06]]
    )
    planned = lw.solve(scene(table), "rk4", h=0.05, t1=10.0, save=lw.SaveAt(every=1.0))
    # The places are sums of 120 steps in one, and a product in the other.
    assert np.abs(driven.attitude - planned.attitude).max() < 1e-12


@pytest.mark.slow
def test_two_masses_and_none():
    fleet = one(scene(lw.terms.MovingMass(**PATH)), **STATE)
    halves = [lw.terms.MovingMass(**PATH | {"mass": 0.5 * BATTERY}, name=name) for name in ("port", "starboard")]
    both = one(scene(*halves), **STATE)
    assert difference(*(last(lw.solve(f, "rk4", h=0.05, t1=2.0)) for f in (fleet, both))) < 1e-13
    still = lw.terms.MovingMass(mass=BATTERY, places=[[0.3, 0.1, 0.0]], inertia=False)
    alone = last(lw.solve(one(scene(), **STATE), "rk4", h=0.05, t1=2.0))
    assert difference(last(lw.solve(one(scene(still), **STATE), "rk4", h=0.05, t1=2.0)), alone) < 1e-13


# Depth by the battery: demand M -> metres, and a little roll from the demand N.
MATRIX = np.zeros((2, 6))
MATRIX[0, 4], MATRIX[1, 5] = -1.0 / (BATTERY * GRAVITY), 0.3
DRIVEN = dict(
    slide_direction=(1.0, 0.1, 0.0), turn_axis=(1.0, 0.0, 0.05), turn_center=(0.0, 0.01, 0.0), limit=(0.05, 0.4),
    rate_limit=(0.02, 1e6), time_constant=(0.1, 0.3),
)  # fmt: skip


@pytest.mark.parametrize(
    ("method", "inertia"), [("rk4", True), pytest.param("rk4", False, marks=pytest.mark.slow),
                            pytest.param("psi_s", False, marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_loop_against_its_twin(method, inertia):
    gains = dict(kp=0.15, kp_pitch=40.0, kd_pitch=20.0)
    mass = lw.terms.MovingMass(**PATH | {"inertia": inertia}, **DRIVEN)
    controller = lw.Controller(
        period=0.1,
        guidance=[lw.control.SetPoint(depth=3.0)],
        laws=[lw.control.DepthPID(**gains)],
        allocation=[lw.control.AllocationMatrix(to="moving_mass", matrix=MATRIX)],
        faults=[lw.control.Fault(of="moving_mass", channel=1, time=0.5, gain=0.0, offset=0.3)],
    )
    fleet = one(scene(mass, controller=controller), **STATE)
    result = lw.solve(fleet, method, h=0.05, t1=4.0, save=lw.SaveAt(every=4.0))
    numbers = {key: np.array(value) for key, value in (PATH | DRIVEN).items()} | {"inertia": inertia}
    numbers |= {"rate_limit": np.array((0.02, np.inf)), "reference": np.array(PATH["places"][0])}
    twin = MovingMass(**numbers, gravity=GRAVITY)
    twin.driven = True
    parts = [SetPoint(depth=3.0), DepthPID(**gains), AllocationMatrix(to="moving_mass", matrix=MATRIX)]
    loop = Loop(parts, {"moving_mass": twin}, 2, 0, [Fault("moving_mass", 1, 0.5, 0.0, 0.3)])
    body = twin_body(VEHICLE, GRAVITY, [twin, Drag(**{key: np.array(value) for key, value in DRAG.items()})])
    b, R = twin_run(body, loop, method, 0.05, 80, R=STATE["R"], nu=np.array(STATE["nu"]), Om=np.array(STATE["Om"]))
    # 80 steps of round-off.
    assert np.abs(result.position[-1, 0] - b[-1]).max() < 1e-11
    assert np.abs(result.attitude[-1, 0] - R[-1]).max() < 1e-11
