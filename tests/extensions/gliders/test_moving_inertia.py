# SPDX-License-Identifier: Apache-2.0
"""Inertia that moves with a mass: recoil and spin in closed form, momenta of two bodies, forces between them by SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.notation import hat
from tests.conftest import ROOT
from tests.extensions.gliders.test_moving_mass import GRAVITY, held
from tests.support.tools import difference, last, one

MASS, BATTERY = 40.0, 9.0
VEHICLE = lw.Vehicle(
    MASS, inertia=(1.0, 6.0, 7.0), added_mass=(5.0, 60.0, 70.0), buoyancy=MASS * GRAVITY + 1.0,
    center_of_buoyancy=(0.01, 0.0, -0.02),
)  # fmt: skip
LINEAR = (4.0, 20.0, 20.0, 2.0, 15.0, 15.0)
STATE = dict(
    R=lw.notation.matrix_from_rotation_vector(np.array([0.2, -0.1, 0.4])), nu=(0.6, 0.1, -0.1), Om=(0.1, -0.2, 0.3)
)
# It starts on the way, turns, and stops; all knots are whole steps of the runs below.
PATH = dict(
    mass=BATTERY, times=[-0.4, 0.8, 1.6], reference=[0.02, 0.01, 0.05],
    places=[[0.02, 0.0, 0.06], [0.25, 0.0, 0.06], [0.1, 0.12, 0.12]],
)  # fmt: skip
LIGHT = lw.Vehicle(10.0, inertia=(1.0, 2.0, 2.5), buoyancy=0.0)


def alone(*masses, vehicle=LIGHT):
    """A vehicle on which nothing acts but its masses."""
    return lw.Scene(vehicle, lw.Environment(gravity=0.0), terms=list(masses))


def damped(*masses, vehicle=VEHICLE, **more):
    """The vehicle with linear drag."""
    drag = lw.terms.Drag(linear=LINEAR, quadratic=(0.0,) * 6)
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms=[drag, *masses], **more)


def run(fleet, method="rk4", h=0.05, t1=2.4, **named):
    return lw.solve(fleet, method, h=h, t1=t1, **named)


@pytest.mark.ci
def test_recoil():
    # The center of all mass rests: the vehicle goes back by m dr / M, and at m v / M while the mass is on its way.
    mass = lw.terms.MovingMass(mass=2.0, times=[1.0, 2.0], places=[[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    result = run(alone(mass), t1=3.0, save=lw.SaveAt(every=0.5))
    gone = np.clip(result.time - 1.0, 0.0, 1.0)
    np.testing.assert_allclose(result.position[:, 0, 0], -0.2 * 0.3 * gone, atol=1e-15)
    np.testing.assert_allclose(
        result.velocity[:, 0, 0], np.where((gone > 0.0) & (result.time <= 2.0), -0.06, 0.0), atol=1e-15
    )


@pytest.mark.ci
def test_a_move_within_one_step_recoils_as_far():
    # No step meets the knots: that which has them takes the mean velocity.
    mass = lw.terms.MovingMass(mass=2.0, times=[1.013, 1.028], places=[[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    assert run(alone(mass), t1=3.0).position[-1, 0, 0] == pytest.approx(-0.06, abs=1e-15)


@pytest.mark.slow
def test_a_spinning_pair():
    # Two masses go outward along a radius: J(r) w is kept, J = J0 + 2 m (r^2 - r0^2).
    arms = [
        lw.terms.MovingMass(
            mass=1.5, times=[0.5, 1.5], places=[[0.0, side * 0.1, 0.0], [0.0, side * 0.6, 0.0]], name=name
        )
        for name, side in (("left", -1.0), ("right", 1.0))
    ]
    fleet = one(alone(*arms), Om=(0.0, 0.0, 3.0))
    result = run(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=0.1))
    r = 0.1 + 0.5 * np.clip(result.time - 0.5, 0.0, 1.0)
    np.testing.assert_allclose(result.angular_velocity[:, 0, 2], 3.0 * 2.5 / (2.5 + 3.0 * (r**2 - 0.01)), rtol=1e-13)
    assert np.abs(result.position).max() < 1e-14


def place(path, t):
    """Place and velocity of a path, the velocity that before t."""
    times, places = np.array(path["times"]), np.array(path["places"])
    r = np.array([np.interp(t, times, column) for column in places.T])
    i = np.searchsorted(times, t, side="left")
    inside = 0 < i < len(times)
    return r, (places[i] - places[i - 1]) / (times[i] - times[i - 1]) if inside else np.zeros(3)


@pytest.mark.ci
def test_momenta_of_two_bodies():
    # A shell and a point mass, each by itself: their momenta about the inertial origin are those of the start.
    path = dict(mass=3.0, times=[0.4, 1.2, 2.0], places=[[0.1, 0.0, 0.05], [0.3, -0.2, 0.0], [-0.2, 0.1, 0.2]])
    fleet = one(alone(lw.terms.MovingMass(**path)), nu=(0.2, -0.1, 0.3), Om=(0.5, -0.8, 1.0))
    found = []
    for h in (0.02, 0.01):
        result = run(fleet, h=h, t1=2.4, save=lw.SaveAt(every=0.4))
        sums = []
        home = np.array(path["places"][0])
        shell = np.diag([1.0, 2.0, 2.5]) + 3.0 * hat(home[None])[0] @ hat(home[None])[0]
        for i, t in enumerate(result.time):
            b, R, nu, Om = (
                x[i, 0] for x in (result.position, result.attitude, result.velocity, result.angular_velocity)
            )
            r, v = place(path, t)
            # The shell's first moment is -3 home, since the center of all is the origin at the start.
            p = 7.0 * nu + np.cross(Om, -3.0 * home)
            spin = shell @ Om + np.cross(-3.0 * home, nu)
            point = 3.0 * (nu + np.cross(Om, r) + v)
            P, L = R @ (p + point), R @ (spin + np.cross(r, point))
            sums.append(np.concatenate([P, L + np.cross(b, P)]))
        found.append(np.abs(np.array(sums) - sums[0]).max())
    assert found[1] < 1e-8
    assert found[0] / found[1] == pytest.approx(16.0, rel=0.3)


def constraint(r, I6, path):
    """The inertia without the mass, and J with the velocity J (nu; Om) at r."""
    J, home = (np.hstack([np.eye(3), -hat(np.array(at)[None])[0]]) for at in (r, path["reference"]))
    return I6 - path["mass"] * home.T @ home, J


def force_rates(path, vehicle, linear=LINEAR):
    """y' by Newton's equations of the vehicle without the mass and of the mass, and the force between them."""
    m, I6 = path["mass"], inertia_of(vehicle)
    weight, B = vehicle.mass * GRAVITY, float(vehicle.buoyancy)

    def rates(t, y):
        R, nu, Om = y[3:12].reshape(3, 3), y[12:15], y[15:]
        r, v = place(path, t)
        rest, J = constraint(r, I6, path)
        down = R[2]
        p, pi = np.split(rest @ y[12:], 2)
        force = np.cross(p, Om) + (weight - m * GRAVITY - B) * down
        lever = -m * GRAVITY * np.array(path["reference"]) - B * np.array(vehicle.center_of_buoyancy)
        torque = np.cross(pi, Om) + np.cross(p, nu) + np.cross(lever, down)
        onto = np.concatenate([force, torque]) - np.array(linear) * y[12:]
        relative = np.cross(Om, nu) + np.cross(Om, np.cross(Om, r)) + 2.0 * np.cross(Om, v)
        # rest xi' + J^T f = onto, m (J xi' + relative) = m g + f.
        A = np.block([[rest, J.T], [m * J, -np.eye(3)]])
        change = np.linalg.solve(A, np.concatenate([onto, m * (GRAVITY * down - relative)]))[:6]
        return np.concatenate([R @ nu, np.cross(R, Om).ravel(), change])

    return rates


def inertia_of(vehicle):
    """The inertia (6, 6) of a vehicle in the simple form."""
    return np.block([[vehicle.mass_matrix, np.zeros((3, 3))], [np.zeros((3, 3)), vehicle.inertia]])


def by_forces(path, end, vehicle=VEHICLE, linear=LINEAR):
    """(b, R, nu, Om) by DOP853, with the blow at each knot: the mass gets another velocity in the vehicle at once."""
    I6, times = inertia_of(vehicle), np.array(path["times"])
    y = np.concatenate([np.zeros(3), np.ravel(STATE["R"]), STATE["nu"], STATE["Om"]])
    stops = [0.0, *(t for t in times if 0.0 < t < end), end]
    for begin, stop in zip(stops, stops[1:]):
        r, before = place(path, begin)
        after = place(path, begin + 1e-9)[1]
        rest, J = constraint(r, I6, path)
        total = rest + path["mass"] * J.T @ J
        y[12:] -= np.linalg.solve(total, path["mass"] * J.T @ (after - before))
        # Within the piece, up to its very begin, the velocity is that after it.
        y = solve_ivp(force_rates(piece(path, begin, stop), vehicle, linear), (begin, stop), y, "DOP853", rtol=1e-12,
                      atol=1e-13).y[:, -1]  # fmt: skip
    return y[:3], y[3:12].reshape(3, 3), y[12:15], y[15:]


def piece(path, begin, stop):
    """The straight part of a path between two times, prolonged a little."""
    (a, _), (b, _) = place(path, begin), place(path, stop)
    v = (b - a) / (stop - begin)
    return path | {"times": [begin - 1.0, stop + 1.0], "places": [a - v, b + v]}


KNOWN = by_forces(PATH, 2.4)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("method", "order"), [("rk4", 4.0), ("rkw3", 3.0), pytest.param("rkmk4", 4.0, marks=pytest.mark.slow)]
)
def test_orders_against_constraint_forces(method, order):
    fleet = one(damped(lw.terms.MovingMass(**PATH)), **STATE)
    errors = [difference(last(run(fleet, method, h=h)), KNOWN) for h in (0.025, 0.0125)]
    # By halves: the next term of the error is still a few per cent.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)
    assert errors[1] < {"rk4": 1e-7, "rkw3": 1e-5, "rkmk4": 1e-7}[method]


@pytest.mark.slow
def test_the_same_motion_as_by_constraint_forces():
    fleet = one(damped(lw.terms.MovingMass(**PATH)), **STATE)
    assert difference(last(run(fleet, "rk8", h=0.1)), KNOWN) < 2e-11
    # 9 of 40 kg: without inertia the motion is another.
    without = lw.terms.MovingMass(**PATH | {"inertia": False})
    assert difference(last(run(one(damped(without), **STATE), "rk8", h=0.1)), KNOWN) > 0.05


@pytest.mark.slow
def test_chosen_steps():
    # Steps that are chosen do not know the knots: each costs one that is as long as an error of order 2 allows.
    fleet = one(damped(lw.terms.MovingMass(**PATH)), **STATE)
    method = lw.Method("rk8", rtol=1e-9, atol=1e-9)
    assert difference(last(run(fleet, method, h=0.8)), KNOWN) < 1e-6


def shifted(vehicle, mass, home, present):
    """The vehicle in its 6x6 form whose mass has another place for good."""
    J = [np.hstack([np.eye(3), -hat(np.array(at)[None])[0]]) for at in (present, home)]
    rigid = np.block([[vehicle.mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), vehicle.inertia]])
    rigid = rigid + mass * (J[0].T @ J[0] - J[1].T @ J[1])
    added = np.zeros((6, 6))
    added[:3, :3] = vehicle.added_mass
    center = mass * (np.array(present) - home) / vehicle.mass
    return lw.Vehicle(
        rigid_body_mass_matrix=rigid, added_mass_matrix=added, weight=vehicle.mass * GRAVITY, center_of_gravity=center,
        buoyancy=float(vehicle.buoyancy), center_of_buoyancy=vehicle.center_of_buoyancy,
    )  # fmt: skip


@pytest.mark.slow
def test_a_mass_at_rest_is_a_vehicle_with_it_there():
    home, there = [0.02, 0.01, 0.05], [0.25, -0.1, 0.1]
    resting = lw.terms.MovingMass(mass=BATTERY, places=[there], reference=home)
    other = shifted(VEHICLE, BATTERY, home, there)
    ends = [last(run(one(scene, **STATE), "rk8", h=0.1)) for scene in (damped(resting), damped(vehicle=other))]
    assert difference(*ends) < 1e-9
    # In a vehicle whose inertia couples by itself, on its way back to where the vehicle in the simple form has it.
    back = lw.terms.MovingMass(mass=BATTERY, places=[home], reference=there)
    ends = [last(run(one(scene, **STATE), "rk8", h=0.1)) for scene in (damped(back, vehicle=other), damped())]
    assert difference(*ends) < 1e-9


@pytest.mark.slow
def test_no_motion_changes_nothing():
    still = lw.terms.MovingMass(mass=BATTERY, places=[[0.3, 0.1, 0.0]], times=[0.0])
    assert damped(still).terms[1].carried
    # Matrices in place of quotients: round-off of 48 steps.
    assert difference(last(run(one(damped(still), **STATE))), last(run(one(damped(), **STATE)))) < 1e-13


@pytest.mark.slow
def test_two_halves_are_one_mass():
    halves = [lw.terms.MovingMass(**PATH | {"mass": 0.5 * BATTERY, "inertia": True}, name=name) for name in ("a", "b")]
    ends = [last(run(one(damped(*masses), **STATE))) for masses in (halves, [lw.terms.MovingMass(**PATH)])]
    assert difference(*ends) < 1e-13


@pytest.mark.slow
def test_a_limited_rate_is_a_path():
    # Commanded by 8 cm, at 1 cm/s, to the limit of 6 cm; the velocity before the first tick is that of rest in both.
    mass, controller = held(
        slide_direction=[1.0, 0.0, 0.0], commands={0: 0.08}, rate_limit=0.01, limit=0.06, inertia=True, mass=BATTERY
    )
    table = lw.terms.MovingMass(mass=BATTERY, times=[0.0, 6.0], places=[[0.05, 0.0, 0.06], [0.11, 0.0, 0.06]])
    for h in (0.05, 0.1):
        ends = [
            last(run(one(scene, **STATE), h=h, t1=8.0))
            for scene in (damped(mass, controller=controller), damped(table))
        ]
        assert difference(*ends) < 1e-12


@pytest.mark.slow
def test_a_blow_of_a_mass_without_a_limit():
    # Without a limit of its rate it is there after one step; the vehicle goes back as far as ever.
    mass, controller = held(
        slide_direction=[1.0, 0.0, 0.0], commands={0: 0.3}, inertia=True, mass=2.0, places=[[0.0] * 3]
    )
    scene = lw.Scene(LIGHT, lw.Environment(gravity=0.0), terms=[mass], controller=controller)
    result = run(scene, h=0.05, t1=0.5, save=lw.SaveAt(every=0.05))
    assert result.position[1:, 0, 0] == pytest.approx(-0.06 * np.ones(10), abs=1e-15)
    assert np.abs(result.velocity[2:]).max() < 1e-14


@pytest.mark.slow
def test_numbers_of_each_member():
    scales = np.array([1.0, 0.6, 1.2])
    vary = {"moving_mass.mass": BATTERY * scales, "moving_mass.places": scales[:, None, None] * PATH["places"]}
    fleet = one(damped(lw.terms.MovingMass(**PATH)), **STATE, parameters=vary)
    whole = run(fleet)
    assert whole.status.counts() == {"ok": 3}
    for i in range(3):
        numbers = PATH | {"mass": BATTERY * scales[i], "places": scales[i] * np.array(PATH["places"])}
        alone_there = run(one(damped(lw.terms.MovingMass(**numbers)), **STATE))
        assert difference(last(whole, i), last(alone_there)) < 1e-13
    single = run(fleet, dtype="float32")
    assert difference(last(single, 1), last(whole, 1)) < 1e-4


@pytest.mark.ci
@pytest.mark.parametrize("at", [0.8, pytest.param(1.15, marks=pytest.mark.slow)])
def test_going_on_in_the_middle_of_a_move(at):
    fleet = one(damped(lw.terms.MovingMass(**PATH)), **STATE)
    first = run(fleet, t1=at)
    second = run(fleet, start=first.final)
    assert all(np.array_equal(a, b) for a, b in zip(last(second), last(run(fleet)), strict=True))


def test_refusals():
    with pytest.raises(
        lw.SceneError, match=r"method = 'psi_s' takes one inertia for all times, which moving_mass changes"
    ):
        run(damped(lw.terms.MovingMass(**PATH)), "psi_s")
    with pytest.raises(lw.SceneError, match=r"moving_mass.mass = 45.0 leaves nothing of the vehicle: its 40 kg"):
        damped(lw.terms.MovingMass(**PATH | {"mass": 45.0}))
    with pytest.raises(lw.SceneError, match=r"moving_mass.mass = 9.0 leaves nothing of the vehicle"):
        damped(lw.terms.MovingMass(**PATH | {"reference": [0.0, 0.0, 3.0]}))
    with pytest.raises(lw.SceneError, match=r"moving_mass.mass of member 1 = 45.0 is unphysical \(1 of 2 members\)"):
        run(one(damped(lw.terms.MovingMass(**PATH)), parameters={"moving_mass.mass": np.array([9.0, 45.0])}))
    with pytest.raises(lw.SceneError, match=r"moving_mass.inertia = 'yes' is not known. Known: True, False, auto"):
        lw.terms.MovingMass(**PATH, inertia="yes")


def test_automatic_choice():
    # Above a tenth of the vehicle's mass, whatever members have.
    heavy, light = (damped(lw.terms.MovingMass(**PATH | {"mass": mass})).terms[1] for mass in (4.01, 4.0))
    assert heavy.carried
    assert not light.carried
    for choice in (True, False):
        assert damped(lw.terms.MovingMass(**PATH, inertia=choice)).terms[1].carried is choice
    assert damped(lw.terms.MovingMass(**PATH)).with_numbers({"moving_mass.mass": 1.0}).terms[1].carried is False


@pytest.mark.ci
def test_momenta_and_energy_of_results(tmp_path):
    # In a vacuum momenta stay; the energy of a spinning pair is that of two bodies, by hand.
    path = dict(mass=3.0, times=[0.4, 1.2, 2.0], places=[[0.1, 0.0, 0.05], [0.3, -0.2, 0.0], [-0.2, 0.1, 0.2]])
    fleet = one(alone(lw.terms.MovingMass(**path)), nu=(0.2, -0.1, 0.3), Om=(0.5, -0.8, 1.0))
    result = run(fleet, h=0.01, save=lw.SaveAt(every=0.4))
    for momenta in (invariants.linear_momentum(result), invariants.angular_momentum(result)):
        assert np.abs(momenta - momenta[0]).max() < 1e-8
    slid = lw.terms.MovingMass(mass=2.0, times=[1.0, 2.0], places=[[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    result = run(alone(slid), t1=3.0, save=lw.SaveAt(every=0.5))
    # While it slides at 0.3 m/s: (8 kg) 0.06^2 / 2 + (2 kg) 0.24^2 / 2.
    known = np.where([0, 0, 0, 1, 1, 0, 0], 0.072, 0.0)
    np.testing.assert_allclose(result.energy[:, 0], known, atol=1e-15)
    # The file knows the vehicle, and so that a fifth of its mass counts.
    result.save(tmp_path / "slid.npz")
    np.testing.assert_allclose(lw.Result.load(tmp_path / "slid.npz").energy[:, 0], known, atol=1e-15)


@pytest.mark.ci
def test_energy_of_its_weight():
    # Hung up where it is: 9 kg at 10 cm below its reference place, whatever its inertia.
    for inertia in (True, False):
        low = lw.terms.MovingMass(mass=BATTERY, places=[[0.0, 0.0, 0.1]], reference=[0.0, 0.0, 0.0], inertia=inertia)
        energies = [run(damped(*masses), t1=0.05).energy[0, 0] for masses in ([low], [])]
        assert energies[0] - energies[1] == pytest.approx(-BATTERY * GRAVITY * 0.1, rel=1e-13)


@pytest.mark.ci
def test_a_method_is_chosen():
    result = lw.solve(alone(lw.terms.MovingMass(**PATH | {"mass": 2.0})), h=0.05, t1=0.1)
    assert "rk4" in str(result.provenance["method"])


@pytest.mark.slow
def test_slopes_beside_the_motion():
    scene = damped(
        lw.terms.MovingMass(**PATH), start=lw.Start(velocity=[0.6, 0.1, -0.1], angular_velocity=[0.1, -0.2, 0.3])
    )
    names = ["moving_mass.mass", "moving_mass.places[1,0]"]
    carried = run(scene, tangents=names).jacobian
    for i, (name, by) in enumerate(zip(names, (1e-4, 1e-5))):
        base = scene.parameters()[name.partition("[")[0]]
        ends = []
        for side in (1.0, -1.0):
            value = np.array(base, float)
            value[(1, 0) if "[" in name else ()] += side * by
            ends.append(run(scene.with_numbers({name.partition("[")[0]: value})).position[-1, 0])
        slope_there = (ends[0] - ends[1]) / (2.0 * by)
        # Central differences: their error goes as the square of the step, and round-off as its inverse.
        np.testing.assert_allclose(carried["position"][-1, 0, ..., i], slope_there, rtol=1e-6, atol=1e-8)


def under_autopilot(*masses):
    """The REMUS 100 of the examples with its autopilot, sensors and faults, and these masses."""
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
    return lw.Scene(
        scene.vehicle, scene.environment, [*scene.terms, *masses], scene.start, scene.controller
    )  # fmt: skip


@pytest.mark.slow
def test_under_an_autopilot():
    # 5 of 30 kg, at rest where the vehicle has them: another kernel, the same run, with the same noise.
    still = lw.terms.MovingMass(mass=5.0, places=[[0.1, 0.0, 0.02]])
    assert under_autopilot(still).terms[-1].carried
    ends = [last(run(under_autopilot(*masses), h=0.02, t1=20.0)) for masses in ([still], [])]
    assert difference(*ends) < 1e-9


@pytest.mark.slow
def test_halves_under_an_autopilot():
    path = dict(times=[5.0, 9.0], places=[[0.1, 0.0, 0.02], [0.25, 0.01, 0.02]], inertia=True)
    halves = [lw.terms.MovingMass(mass=2.5, **path, name=name) for name in ("a", "b")]
    ends = [
        run(under_autopilot(*masses), h=0.02, t1=20.0) for masses in (halves, [lw.terms.MovingMass(mass=5.0, **path)])
    ]
    assert difference(*map(last, ends)) < 1e-9
    # The vehicle that does without follows another path by now.
    assert difference(last(ends[0]), last(run(under_autopilot(), h=0.02, t1=20.0))) > 0.01
