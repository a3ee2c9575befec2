# SPDX-License-Identifier: Apache-2.0
"""Fins, control fins, cross-flow drag and body lift against what is known exactly, and what they refuse."""

import dataclasses
import tomllib

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.engine.packets import Packets
from lgvi_warp.physics import terms
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.cross_flow import CrossFlow
from lgvi_warp.reference.terms.fins import Fins
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.vehicles import fossen as coefficients
from tests.laws.cases_lift import CASES, DENSITY, FINS, HULL, LIFT, arrays
from tests.laws.test_parity import STATE, VEHICLE
from tests.support.tools import difference, last, one, random_states, slope

WING = dict(position=[[0.0, 0.0, 0.0]], chord=[[1.0, 0.0, 0.0]], normal=[[0.0, 0.0, -1.0]], area=0.01, lift_slope=3.0)
HEAVY = lw.Vehicle(
    1000.0, inertia=(900.0, 900.0, 900.0), added_mass=(0.0, 0.0, 0.0), buoyancy=9800.0,
    center_of_buoyancy=(0.0, 0.0, 0.0),
)  # fmt: skip


def scene(*inputs, vehicle=HEAVY):
    return lw.Scene(vehicle, lw.Environment(gravity=9.8, water_density=DENSITY), terms=list(inputs))


def view(velocity, **named):
    return View(np.eye(3), np.zeros(3), np.array(velocity[:3]), np.array(velocity[3:]), **named)


def velocities(n=200):
    """Velocities of all sizes, and in special directions."""
    rng = np.random.default_rng(3)
    return np.concatenate([rng.normal(size=(n, 6)) * 10.0 ** rng.uniform(-12, 1, (n, 1)), np.eye(6), -np.eye(6)])


# Beside fins, without effect: the tests of this file share two kernels.
UNFELT = (
    terms.CrossFlow(**HULL | {"drag_coefficient": (1e-30,) * len(HULL["stations"])}),
    terms.BodyLift(matrix=1e-30 * LIFT),
)


@pytest.mark.ci
@pytest.mark.parametrize(("angle", "incidence"), [(0.0, 1e-3), (1e-3, 0.0), (2e-3, -1e-3)])
def test_a_small_angle_is_a_thin_wing(angle, incidence):
    # Lift rho/2 A V^2 slope (deflection + incidence) along the normal, here up: to 2/3 angle^2 = 1e-6, and the step's
    # h times the rate at which the fin slows the vehicle, 1e-3 of 15/1000 1/s.
    fins = terms.ControlFins(**WING, drag=0.0, rate_limit=0.5, command=[angle])
    start = {"nu": (2.0, 0.0, 2.0 * incidence)}
    found = last(lw.solve(one(scene(fins), **start), "psi_s", h=1e-3, t1=1e-3))[2]
    lift = 0.5 * DENSITY * 0.01 * 3.0 * 2.0**2 * (angle + incidence)
    assert found[2] - 2.0 * incidence == pytest.approx(-lift * 1e-3 / 1000.0, rel=1e-4)


@pytest.mark.ci
def test_a_fin_across_the_flow_stops_as_a_plate():
    # m v' = -rho/2 A (drag + drag_normal) v^2: v = v0 / (1 + k v0 t); order 2 in h k v0 = 0.01.
    fins = terms.Fins(**(WING | {"area": 1.0}), drag=0.1, drag_normal=1.1)
    found = last(lw.solve(one(scene(fins, *UNFELT), nu=(0.0, 0.0, 2.0)), "psi_s", h=0.01, t1=2.0))[2]
    rate = 0.5 * DENSITY * 1.2 / 1000.0
    np.testing.assert_allclose(found, [0.0, 0.0, 2.0 / (1.0 + rate * 2.0 * 2.0)], rtol=1e-4, atol=1e-15)


@pytest.mark.ci
def test_lift_does_no_work():
    # The law itself, to round-off; and a run of lift alone, with inertia that keeps its energy in every other map.
    law = Fins(**vars(CASES["fins"].laws[0]) | {"drag": np.zeros(3), "drag_normal": np.zeros(3)})
    for velocity in velocities():
        D = law.damping(view(velocity))
        assert abs(velocity @ D @ velocity) <= 1e-14 * np.abs(D).max() * (velocity @ velocity)
    fins = terms.Fins(**(FINS | {"drag": 0.0, "drag_normal": 0.0}))
    ball = lw.Vehicle(
        20.0, inertia=(2.0, 2.0, 2.0), added_mass=(0.0, 0.0, 0.0), buoyancy=20.0 * 9.8,
        center_of_buoyancy=(0.0, 0.0, 0.0),
    )  # fmt: skip
    fleet = one(scene(fins, *UNFELT, vehicle=ball), *random_states(4, 8))
    result = lw.solve(fleet, "psi_s", h=0.01, t1=5.0, save=lw.SaveAt(at=list(np.linspace(0.0, 5.0, 51))))
    energy = 10.0 * np.sum(result.velocity**2, axis=2) + np.sum(result.angular_velocity**2, axis=2)
    # The linearly implicit step loses (h w)^4 of it, w the rate at which lift turns the velocity, about 5 1/s.
    assert np.all(np.diff(energy, axis=0) <= 1e-12 * energy[0])
    assert np.abs(energy[-1] / energy[0] - 1.0).max() < 1e-2


@pytest.mark.parametrize("name", ["fins", "control fins", "control fins with rates", "cross-flow"])
def test_dissipation(name):
    # The symmetric part of D has no negative eigenvalue, at any velocity.
    law = CASES[name].laws[0]
    for velocity in velocities():
        D = law.damping(view(velocity, t=0.3, memory=law.start()))
        assert np.all(np.isfinite(D))
        assert np.linalg.eigvalsh(D + D.T)[0] >= -1e-12 * np.abs(D).max()


@pytest.mark.slow
def test_at_rest_fins_do_nothing():
    result = lw.solve(
        one(scene(*(CASES[name].terms[0] for name in ("fins", "cross-flow", "body lift")))), h=0.01, t1=0.1
    )
    assert result.status.counts() == {"ok": 1}
    assert not np.any(result.velocity)
    assert not np.any(result.angular_velocity)


def deflections(fins, h, steps):
    """Deflection of the first fin after each step [rad]."""
    plan = make_plan(one(scene(fins), nu=(2.0, 0.0, 0.0)), "psi_s", h=h, t1=h * steps)
    packets = Packets(plan, plan.ensemble.select(0, 1))
    found = []
    for k in range(steps):
        packets.advance(k, k + 1)
        found.append(packets.memory.numpy()[0, 0, 0])
    return np.array(found)


@pytest.mark.ci
@pytest.mark.parametrize(("command", "reached"), [(0.2, 0.2), (-0.9, -0.35)])
def test_the_rate_limit_is_exact(command, reached):
    # The command jumps at t = 0.1: the deflection follows at 0.5 rad/s, to the command or its limit and not beyond.
    schedule = dict(times=[0.0, 0.1, 0.1 + 1e-6], command_schedule=[[0.0], [0.0], [command]])
    found = deflections(terms.ControlFins(**WING, drag=0.0, rate_limit=0.5, **schedule), 0.01, 100)
    t = 0.01 * np.arange(1, 101)
    expected = np.sign(reached) * np.clip(0.5 * (t - 0.1), 0.0, abs(reached))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-14)


def test_without_a_rate_limit_nothing_is_kept():
    moved = {"times": [0.0, 1.0], "command_schedule": [[0.0], [0.1]]}
    assert not terms.ControlFins(**WING, drag=0.0, **moved).memory
    assert terms.ControlFins(**WING, drag=0.0, **moved, rate_limit=2.0).memory
    assert not terms.ControlFins(**WING, drag=0.0, rate_limit=2.0).memory


@pytest.mark.slow
def test_a_cylinder_falls_at_its_terminal_speed():
    # sqrt(2 W / (rho Cd D L)); kick and drag in turn settle a little off it, of order 2 in the step.
    hull = terms.CrossFlow(stations=[-0.8, 0.1, 0.7], diameters=[0.2, 0.2, 0.2], drag_coefficient=1.1)
    body = lw.Vehicle(
        30.0, inertia=(1.0, 5.0, 5.0), added_mass=(5.0, 30.0, 30.0), buoyancy=30.0 * 9.8 - 40.0,
        center_of_buoyancy=(0.0, 0.0, 0.0),
    )  # fmt: skip
    # The hull's middle is 0.05 m off the origin, which would turn it: its reflection is added.
    other = terms.CrossFlow(name="b", stations=[-0.7, 0.8], diameters=[0.2, 0.2], drag_coefficient=1.1)
    terminal = np.sqrt(2.0 * 40.0 / (2.0 * DENSITY * 1.1 * 0.2 * 1.5))
    steps, errors = np.array([0.04, 0.02, 0.01]), []
    for h in steps:
        _, _, nu, Om = last(lw.solve(one(scene(hull, other, vehicle=body)), "psi_s", h=h, t1=20.0))
        assert np.abs(nu[:2]).max() < 1e-12
        assert np.abs(Om).max() < 1e-12
        errors.append(abs(nu[2] / terminal - 1.0))
    assert errors[-1] < 1e-3
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.2)


def strips(velocity, hull, count=20001):
    """The same force and torque by count points a segment, Simpson's rule."""
    total = np.zeros(6)
    strength = hull["drag_coefficient"] * hull["diameters"]
    for i in range(len(strength) - 1):
        x = np.linspace(hull["stations"][i], hull["stations"][i + 1], count)
        weights = np.where(np.arange(count) % 2 == 1, 4.0, 2.0) * (x[1] - x[0]) / 3.0
        weights[[0, -1]] /= 2.0
        v, w = velocity[1] + x * velocity[5], velocity[2] - x * velocity[4]
        line = -0.5 * DENSITY * np.interp(x, hull["stations"], strength) * np.hypot(v, w) * weights
        Y, Z = line * v, line * w
        total += np.array([0.0, Y.sum(), Z.sum(), 0.0, -(x * Z).sum(), (x * Y).sum()])
    return total


@pytest.mark.parametrize(("velocity", "bound"), [
    # The force per length is a polynomial of degree 3 where the flow keeps its direction: exact; its moment, of degree
    # 4, is not, unless the flow is the same everywhere.
    ((1.0, 0.0, 1.0, 0.3, 0.5, 0.0), 1e-3),
    ((1.0, 0.7, -0.2, 0.3, 0.0, 0.0), 1e-11),
    ((0.0, 0.3, 1.0, 0.0, 0.5, -0.4), 2e-3),
    # The flow turns round within the hull.
    ((0.0, 0.0, 0.1, 0.0, 1.0, 0.0), 1e-2),
    ((0.0, 0.2, 0.1, 0.0, 1.0, 0.7), 1e-2),
])  # fmt: skip
def test_two_points_a_segment_are_enough(velocity, bound):
    hull, velocity = arrays(HULL), np.array(velocity)
    law = CrossFlow(**hull, density=DENSITY)
    exact = strips(velocity, hull)
    error = np.abs(-law.damping(view(velocity)) @ velocity - exact) / np.abs(exact).max()
    assert error.max() < bound
    if not np.any(velocity[[1, 5]]) and velocity[2] > abs(velocity[4]):
        assert error[2] < 1e-11


MEMBERS = {
    "fins": (terms.Fins(**FINS), {"area": 0.01, "drag": 0.1, "chord": 0.1, "position": 0.1}),
    "control_fins": (terms.ControlFins(**FINS, command=[0.1, -0.2, 0.3]), {"command": 0.05, "limit": 0.1}),
    "cross_flow": (terms.CrossFlow(**HULL), {"diameters": 0.01, "drag_coefficient": 0.2}),
    "body_lift": (terms.BodyLift(matrix=LIFT), {"matrix": 0.5}),
}


@pytest.mark.slow
@pytest.mark.parametrize("key", MEMBERS)
@pytest.mark.parametrize("varied", ["term", "inertia", "both"])
def test_members_that_differ(key, varied):
    """Each member of an ensemble moves as alone."""
    term, spread = MEMBERS[key]
    rng, n = np.random.default_rng(8), 3
    numbers, inertia = {}, np.broadcast_to(VEHICLE.inertia, (n, 3, 3))
    if varied != "inertia":
        for name, size in spread.items():
            value = np.asarray(getattr(term, name))
            numbers[f"{key}.{name}"] = value + size * rng.random((n, *value.shape))
    if varied != "term":
        A = 0.1 * rng.normal(size=(n, 3, 3))
        inertia = inertia + A + np.swapaxes(A, 1, 2)
        numbers["vehicle.inertia"] = inertia
    fleet = one(scene(term, vehicle=VEHICLE), **STATE, parameters=numbers)
    result = lw.solve(fleet, "psi_s", h=0.01, t1=0.2)
    for i in range(n):
        own = {name: numbers[f"{key}.{name}"][i] for name in spread if f"{key}.{name}" in numbers}
        if "command" in own:
            own |= {"command_schedule": own["command"][None]}
        here = scene(dataclasses.replace(term, **own), vehicle=dataclasses.replace(VEHICLE, inertia=inertia[i]))
        alone = lw.solve(one(here, **STATE), "psi_s", h=0.01, t1=0.2)
        assert difference(last(result, i), last(alone)) < 1e-14


def test_the_remus_lift_is_prestero_s():
    content = tomllib.loads(coefficients.vehicle_file("remus_100").read_text(encoding="utf-8"))
    (lift,) = [term for term in terms.from_list(content["terms"]) if isinstance(term, terms.BodyLift)]
    # Y_uvl, Z_uwl, M_uwl, N_uvl of table C.4 and table B.1.
    for i, j, printed in ((1, 1, -18.96), (2, 2, -18.96), (4, 2, -4.47), (5, 1, 4.47)):
        assert -lift.matrix[i, j] == printed
    assert np.count_nonzero(lift.matrix) == 4


FIN = WING | {"drag": 0.1}


@pytest.mark.parametrize(("term", "name", "values"), [
    (terms.Fins(**WING, drag=0.1), "fins.normal", [[[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]]),
    (terms.Fins(**WING, drag=0.1), "fins.chord", [[[1.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]]]),
    (terms.ControlFins(**WING, drag=0.1), "control_fins.rate_limit", [[1e6], [0.5]]),
    (terms.CrossFlow(**HULL), "cross_flow.stations", [HULL["stations"], [0.0] * 5]),
])  # fmt: skip
def test_members_that_are_refused(term, name, values):
    with pytest.raises(lw.SceneError, match=f"{name} of member 1"):
        one(scene(term), **STATE, parameters={name: np.array(values)})
