# SPDX-License-Identifier: Apache-2.0
"""Guidance on time, round circles and into docks: against twins, against a point mass by hand, and by geometry."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.reference.control import docking, loiter, trajectory, waypoints
from tests.support.loops import torpedo, twin_states
from tests.unit.statistics.test_metrics import each, number

H, EVERY = 0.05, 2
T = EVERY * H
POINTS = [(0.0, 0.0, 2.0), (8.0, 0.0, 3.0), (8.0, 6.0, 3.0), (1.0, 9.0, 2.5)]
WAY = dict(points=POINTS, speed=1.0, look_ahead=1.5, radius=0.8)
CIRCLES = WAY | dict(loiter_radius=2.0, loiter_turns=(0.0, 1.25, 0.0, 0.5), loiter_time=(0.0, 0.0, 9.0, 2.0))
DOCK = dict(position=(30.0, 5.0, 3.0), heading=0.4, speed=1.2, contact_speed=0.4, slowing=12.0, look_ahead=2.0, mouth=0.4,
            funnel=0.15, approach=18.0, judged=10.0, offset=4.0, kappa=0.3)  # fmt: skip
STEPS = dict(times=(0.1, 0.2, 0.3), positions=[(0, 0, 3), (2, 1, 4), (5, -2, 6)], headings=(0.3, 2.0, -2.5), speed=(1, 2, 0),
             interpolation="steps")  # fmt: skip
CIRCLE = dict(center=(3.0, 1.0, 4.0), radius=5.0, speed=1.0, look_ahead=2.0, clockwise=False)
LAWS = [
    lw.control.SpeedPID(kp=40.0, ki=4.0, drag=20.0),
    lw.control.HeavePID(kp=30.0, kd=40.0),
    lw.control.HeadingPID(kp=30.0, kd=40.0),
]
DRAG = dict(linear=(3.0, 40.0, 40.0, 3.0, 4.0, 5.0), quadratic=(20.0, 90.0, 90.0, 1.0, 2.0, 3.0))


def scene(guidance, current=(0.0, 0.0, 0.0), laws=LAWS, **more):
    """A body that is pushed where its guidance wants it, in a current."""
    controller = lw.Controller(period=T, guidance=[guidance], laws=laws)
    vehicle = torpedo(20.0 * 9.8, (0.0, 0.0, -0.1))
    terms = [lw.terms.Drag(**DRAG), lw.terms.ControlWrench(limit=(60.0, 60.0, 60.0, 20.0, 20.0, 20.0))]
    terms += [lw.terms.Current(velocity=current)] if np.any(current) else []
    return lw.Scene(vehicle, lw.Environment(gravity=9.8), terms, controller=controller, **more)


def states(n):
    """Position, attitude, velocity and angular velocity of n members, of which one is behind and one far off."""
    position = np.array([(0.0, 0.6, 2.2), (-1.0, -0.5, 2.0), (45.0, 9.0, 2.0)])[:n]
    return position, np.tile(np.eye(3), (n, 1, 1)), np.tile((0.8, 0.1, 0.0), (n, 1)), np.zeros((n, 3))


def array(numbers):
    """Numbers as a twin takes them."""
    return {
        name: np.array(value, float) if isinstance(value, tuple | list) else value for name, value in numbers.items()
    }


@pytest.mark.ci
@pytest.mark.parametrize(("part", "twin"), [
    (lw.control.Waypoints(**CIRCLES, times=(0.05, 3.0, 9.0, 30.0), clockwise=False),
     waypoints.Waypoints(**array(CIRCLES | dict(times=(0.05, 3.0, 9.0, 30.0))), clockwise=False)),
    (lw.control.Loiter(**CIRCLE), loiter.Loiter(**array(CIRCLE))),
    (lw.control.Trajectory(**STEPS), trajectory.Trajectory(**array(STEPS))),
    (lw.control.Docking(**DOCK), docking.Docking(**array(DOCK))),
], ids=lambda part: part.type if hasattr(part, "type") else "")  # fmt: skip
@pytest.mark.kernel
def test_check_controller_finds_nothing(part, twin):
    report = lw.laws.check_controller(part, twin=twin)
    assert report.ok, str(report)


GUIDED = {
    "in time": (lw.control.Waypoints(**WAY, times=(1.0, 12.0, 20.0, 28.0), method="ilos"), 320),
    "circles": (lw.control.Waypoints(**CIRCLES, method="alos", at_end="loiter"), 1200),
    "circles in time": (lw.control.Waypoints(**CIRCLES, times=(0.0, 9.0, 45.0, 70.0), clockwise=False), 1600),
    "loiter": (lw.control.Loiter(**CIRCLE), 600),
    "docking": (lw.control.Docking(**DOCK), 1600),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", GUIDED)
def test_loops_are_those_of_the_twin(name):
    part, steps = GUIDED[name]
    way, given = scene(part), states(3)
    varied = {"docking": "docking.speed", "loiter": "loiter.radius"}.get(name, "waypoints.look_ahead")
    value = float(getattr(part, varied.partition(".")[2]))
    parameters = {varied: np.array([1.0, 1.1, 0.9]) * value}
    result = lw.solve(
        lw.Ensemble.from_states(way, *given, parameters), "psi_s", h=H, t1=steps * H, save=lw.SaveAt(every=T)
    )
    for i in range(3):
        numbers = {key: values[i] for key, values in parameters.items()}
        b, R = twin_states(way, numbers, [x[i] for x in given], EVERY, H, steps)
        # As in test_guidance.py: some hundred ticks of a stable loop, of numbers of size 10.
        assert np.abs(result.position[:, i] - b).max() < 1e-9
        assert np.abs(result.attitude[:, i] - R).max() < 1e-9


def straight(x0, u0, current, pace, t1):
    """North and ground speed at the ticks of a body that only surges, by its law of the speed, written afresh."""
    mass, law, total, error = 25.0, LAWS[0], 0.0, None
    ticks, now = np.arange(round(t1 / T)) * T, np.array([x0, u0])
    found = [now]
    for t in ticks:
        wanted = max(pace(t, now[0]) - current, 0.0)
        if error is not None:
            total += T * error
        error = wanted - (now[1] - current)
        force = float(law.kp * error + law.ki * total + law.drag * wanted * abs(wanted))
        assert abs(force) < 60.0

        def rate(t, x, force=force):
            u = x[1] - current
            return [x[1], (force - 3.0 * u - 20.0 * u * abs(u)) / mass]

        now = solve_ivp(rate, (0.0, T), now, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        found.append(now)
    return np.array(found)


@pytest.mark.ci
@pytest.mark.parametrize("current", [0.0, 0.2])
@pytest.mark.slow_but("0.2")
def test_it_is_at_its_points_in_time(current):
    times, ends = (2.0, 32.0, 72.0), (0.0, 18.0, 50.0)
    way = lw.control.Waypoints(
        points=[(x, 0.0, 2.0) for x in ends], times=times, speed=1.5, look_ahead=2.0, radius=1e-6
    )
    start = lw.Start(position=(0.0, 0.0, 2.0), velocity=(current, 0.0, 0.0))
    r = lw.solve(scene(way, (current, 0.0, 0.0), start=start), "rk8", h=H, t1=80.0, save=lw.SaveAt(every=T))
    leg = 0

    def pace(t, x):
        nonlocal leg
        if t <= times[0] - H / 2:
            return current
        leg += int(x >= ends[leg + 1] and leg < 1)
        return min(max(ends[leg + 1] - x, 0.0) / max(times[leg + 1] - t, T), 1.5)

    true = straight(0.0, current, current, pace, 71.0)
    # The method's error of order 8 and the tolerance of the other integrator.
    assert np.abs(r.position[: len(true), 0, 0] - true[:, 0]).max() < 1e-8
    # A speed that follows with a time constant of 25 kg / 40 N s/m comes as much too late as its pace has changed by then.
    for when, end in zip(times[1:], ends[1:], strict=True):
        assert np.interp(when, r.time, r.position[:, 0, 0]) == pytest.approx(end, abs=0.1)


def turns_about(b, center):
    """The angle that a path (k, 3) has turned about a place, clockwise from above, and its distance."""
    out = b[:, :2] - center[:2]
    return np.unwrap(np.arctan2(out[:, 1], out[:, 0])), np.hypot(*out.T)


@pytest.mark.slow
def test_set_points_are_wanted_from_their_times_on():
    way = lw.control.Trajectory(**STEPS | {"times": (1.0, 2.5, 3.0)})
    fields = ("reference_position", "reference_velocity", "reference_heading", "reference_speed")
    r = lw.solve(scene(way), "psi_s", h=H, t1=4.0, save=lw.SaveAt(every=T, fields=fields))
    which = np.clip(np.searchsorted((1.0, 2.5, 3.0), r.time + 1e-9, side="right") - 1, 0, 2)
    np.testing.assert_array_equal(r.samples["reference_position"][:, 0], np.array(STEPS["positions"], float)[which])
    np.testing.assert_allclose(r.samples["reference_heading"][:, 0], np.array(STEPS["headings"])[which], atol=1e-14)
    np.testing.assert_array_equal(r.samples["reference_speed"][:, 0], np.array(STEPS["speed"], float)[which])
    assert not r.samples["reference_velocity"].any()


@pytest.mark.ci
@pytest.mark.parametrize("clockwise", [True, False])
@pytest.mark.slow_but("False")
def test_a_circle_is_left_after_its_turns(clockwise):
    way = dict(points=[(0, 0, 2), (20, 0, 2), (20, 60, 2)], speed=1.0, look_ahead=2.0, radius=4.0, loiter_radius=4.0,
               clockwise=clockwise)  # fmt: skip
    own = {"waypoints.loiter_turns": np.array([(0, 2.5, 0), (0, 0, 0), (0, 1, 0.0)]),
           "waypoints.loiter_time": np.array([(0, 0, 0), (0, 40.0, 0), (0, 60.0, 0)])}  # fmt: skip
    guided = scene(lw.control.Waypoints(**way, loiter_turns=(0, 1, 0), loiter_time=(0, 0, 0)))
    fleet = lw.Ensemble.from_states(guided, np.tile((0.0, 0.0, 2.0), (3, 1)), np.tile(np.eye(3), (3, 1, 1)),
                                    np.tile((1.0, 0.0, 0.0), (3, 1)), np.zeros((3, 3)), own)  # fmt: skip
    r = lw.solve(fleet, "psi_s", h=H, t1=150.0,
                 save=lw.SaveAt(every=T, fields=("position", "reference_velocity", "reference_angular_velocity")))  # fmt: skip
    # On a circle a rate is wanted.
    circling = r.samples["reference_angular_velocity"][..., 2] != 0.0
    for i in range(3):
        ticks = np.flatnonzero(circling[:, i])
        assert np.all(np.diff(ticks) == 1)
        b = r.position[ticks[0] : ticks[-1] + 2, i]
        angle, distance = turns_about(b, np.array((20.0, 0.0)))
        turned = (angle - angle[0]) * (1.0 if clockwise else -1.0)
        wanted = 2.0 * np.pi * own["waypoints.loiter_turns"][i, 1]
        lasted = (len(ticks)) * T
        enough = turned >= wanted - 1e-9, np.arange(len(b)) * T >= own["waypoints.loiter_time"][i, 1] - 1e-9
        # It goes on at the first tick at which both are reached.
        assert enough[0][-1]
        assert enough[1][-1]
        assert not (enough[0][-2] and enough[1][-2])
        assert lasted >= own["waypoints.loiter_time"][i, 1] - 1e-9
        # On the circle: off it by what the heading is off in a steady turn, which the law has no integral against.
        assert np.abs(distance[200:] - 4.0).max() < 0.5
        assert r.position[-1, i, 1] > 15.0


@pytest.mark.slow
def test_a_steady_circle_is_as_far_off_as_the_heading_and_the_course_tell():
    """d - radius = look_ahead tan(a), a the angle between the wanted heading and the tangent: geometry of the steady turn."""
    circle = CIRCLE | {"clockwise": True}
    start = lw.Start(position=(3.0, 6.0, 4.0), attitude=lw.notation.matrix_from_rotation_vector([0, 0, np.pi]),
                     velocity=(1.0, 0.0, 0.0))  # fmt: skip
    save = lw.SaveAt(every=T, fields=("position", "attitude", "velocity", "reference_attitude", "demand"))
    r = lw.solve(scene(lw.control.Loiter(**circle), start=start), "psi_s", h=H, t1=300.0, save=save)
    b, R = r.position[-200:, 0], r.attitude[-200:, 0]
    angle, distance = turns_about(b, np.array(circle["center"]))
    assert np.ptp(distance) < 1e-6
    over_ground = np.einsum("kij,kj->ki", R, r.velocity[-200:, 0])
    rate = (angle[-1] - angle[0]) / (199 * T)
    # The course is the tangent.
    assert np.abs(np.sum(over_ground[:, :2] * (b - circle["center"])[:, :2], axis=1)).max() < 1e-5
    assert np.hypot(*over_ground[-1, :2]) == pytest.approx(rate * distance[-1], rel=1e-5)
    wanted = np.arctan2(r.samples["reference_attitude"][-1, 0, 1, 0], r.samples["reference_attitude"][-1, 0, 0, 0])
    tangent = angle[-1] + np.pi / 2.0
    inward = (wanted - tangent + np.pi) % (2.0 * np.pi) - np.pi
    assert distance[-1] - circle["radius"] == pytest.approx(circle["look_ahead"] * np.tan(inward), abs=1e-6)
    # The law of the heading: N = kp e + kd (r_d - r).
    heading = np.arctan2(R[-1, 1, 0], R[-1, 0, 0])
    error = (wanted - heading + np.pi) % (2.0 * np.pi) - np.pi
    share = np.cos(np.arctan((distance[-1] - 5.0) / 2.0)) / max(distance[-1], 5.0)
    assert r.samples["demand"][-1, 0, 5] == pytest.approx(30.0 * error + 40.0 * (share - rate), abs=1e-3)


@pytest.mark.slow
def test_a_circle_that_is_too_small_is_gone_round_outside():
    """A REMUS turns in some 10 m: about a circle of 1 m it still counts its turns, and goes on."""
    way = lw.control.Waypoints(points=[(0, 0, 10), (100, 0, 10), (100, 400, 10)], speed=1.5, look_ahead=10.0, radius=5.0,
                               loiter_radius=1.0, loiter_turns=(0, 2, 0))  # fmt: skip
    laws = [lw.control.DepthPID(kp=0.1, kp_pitch=5.0, kd_pitch=2.0), lw.control.HeadingPID(kp=1.0, kd=2.0)]
    fins = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])
    controller = lw.Controller(period=0.1, guidance=[way], laws=laws, allocation=[fins])
    remus = lw.Scene.named(
        "remus_100", start={"position": [0, 0, 10.0], "velocity": [1.5, 0, 0]}, controller=controller
    )
    r = lw.solve(remus, "psi_x", h=0.05, t1=350.0, save=lw.SaveAt(every=0.1))
    assert r.status[0] == lw.Status.OK
    angle, distance = turns_about(r.position[:, 0], np.array((100.0, 0.0)))
    there = distance < 40.0
    assert np.ptp(angle[there]) > 4.0 * np.pi - 0.2
    assert distance[there].min() < 15.0
    assert r.position[-1, 0, 1] > 100.0


def funnels(b, numbers):
    """(left, outside) of a path (k, 3): the way to the dock's plane, and how far it is outside the funnel."""
    c, s = np.cos(numbers["heading"]), np.sin(numbers["heading"])
    d = b - np.array(numbers["position"])
    left = -(c * d[:, 0] + s * d[:, 1])
    off = np.hypot(c * d[:, 1] - s * d[:, 0], d[:, 2])
    return left, off - numbers["mouth"] - np.maximum(left, 0.0) * np.tan(numbers["funnel"])


@pytest.fixture(scope="module")
def docked():
    """Twelve members that dock from all sides, one of which begins behind the dock, in currents of their own."""
    n = 12
    rng = np.random.default_rng(3)
    position = np.column_stack([rng.uniform(-10.0, 5.0, n), rng.uniform(-15.0, 15.0, n), np.full(n, 3.0)])
    position[0] = (45.0, 12.0, 3.0)
    # In the plane of the dock, and on its line.
    position[1], position[2] = (30.0, 5.0, 3.0), (30.0 - 25.0 * np.cos(0.4), 5.0 - 25.0 * np.sin(0.4), 3.0)
    currents = np.column_stack([rng.uniform(-0.15, 0.15, (n, 2)), np.zeros(n)])
    currents[2] = 0.0
    way = scene(lw.control.Docking(**DOCK), (0.1, 0.1, 0.0))
    given = (position, np.tile(np.eye(3), (n, 1, 1)), np.tile((0.8, 0.0, 0.0), (n, 1)), np.zeros((n, 3)))
    fleet = lw.Ensemble.from_states(way, *given, {"current.velocity": currents})
    fields = ("position", "attitude", "velocity", "reference_attitude", "reference_speed", "reference_velocity")
    contacts = [each(lw.metrics.DockContact, of) for of in ("speed", "offset", "heading_error", "time")]
    return lw.solve(fleet, "psi_s", h=H, t1=400.0, save=lw.SaveAt(every=T, fields=fields), statistics=contacts)


@pytest.mark.slow
def test_it_docks_or_goes_round(docked):
    """The way is judged by the path alone: a cone about the centre line, a plane at its end and one at its beginning."""
    went_round = 0
    for i in range(docked.members):
        b, pace = docked.position[:, i], docked.samples["reference_velocity"][:, i]
        left, outside = funnels(b, DOCK)
        on_line, done, expected = left[0] > 0.0, False, []
        for k in range(len(b)):
            if k and not done:
                if on_line:
                    done = left[k] <= 0.0 and outside[k] <= 0.0
                    on_line = not (outside[k] > 0.0 and left[k] <= DOCK["judged"])
                else:
                    on_line = left[k] >= DOCK["approach"]
            share = np.clip(left[k] / DOCK["slowing"], 0.0, 1.0)
            slowed = DOCK["contact_speed"] + share * (DOCK["speed"] - DOCK["contact_speed"])
            expected.append(0.0 if done else slowed if on_line else DOCK["speed"])
            went_round += int(k > 0 and not on_line and not done)
        assert done
        np.testing.assert_allclose(np.linalg.norm(pace[:-1], axis=1), expected[:-1], atol=1e-9)
        # It stays where it is in the dock.
        assert docked.samples["reference_speed"][-1, i] == 0.0
    assert went_round > 200


@pytest.mark.ci
def test_contacts_are_those_of_the_path(docked):
    values = {
        of: docked.statistics[f"each dock_contact {of}"].value[0, 0]
        for of in ("speed", "offset", "heading_error", "time")
    }
    for i in range(docked.members):
        b, R, v = (docked.samples[name][:, i] for name in ("position", "attitude", "velocity"))
        left, outside = funnels(b, DOCK)
        k = next(k for k in range(len(b) - 1) if left[k] > 0.0 >= left[k + 1] and outside[k + 1] < 0.0)
        share = left[k] / (left[k] - left[k + 1])
        c, s = np.cos(0.4), np.sin(0.4)
        ahead = (np.einsum("kij,kj->ki", R[k : k + 2], v[k : k + 2]) @ (c, s, 0.0)).mean()
        heading = np.arctan2(R[k, 1, 0], R[k, 0, 0]) - 0.4
        # Straight between ticks instead of a cubic: accelerations are below 1 m/s^2 and 1 rad/s.
        assert values["time"][i] == pytest.approx((k + share) * T, abs=1.0 * T**2 / 8.0 / 0.3)
        assert values["speed"][i] == pytest.approx(ahead, abs=0.5 * T)
        assert values["heading_error"][i] == pytest.approx(heading, abs=1.0 * T)
        assert values["offset"][i] <= DOCK["mouth"]
    # On the line from the first, in still water: no way off, and the speed is that which was wanted.
    assert values["offset"][2] < 0.05
    assert values["speed"][2] == pytest.approx(DOCK["contact_speed"], abs=0.1)


def test_a_contact_of_a_cubic_path_is_exact():
    """left(t) = 1 - t^3 / 8 m meets the plane at 2 s; ticks of 0.3 s see only pieces of it."""
    t = np.arange(0.0, 3.1, 0.3)
    aside, below, turn = 0.3 - 0.1 * t, 0.05 * t, 0.2 + 0.1 * t
    x = np.stack(
        [1.0 - t**3 / 8.0, aside, below, -3.0 * t**2 / 8.0, -0.1 + 0 * t, 0.05 + 0 * t, turn, 0.5 + 0 * t], axis=1
    )
    # A second member misses the mouth, a third meets the plane twice, a fourth never.
    missed, twice, never = x.copy(), x.copy(), x.copy()
    missed[:, 1] += 1.0
    twice[-2:, 0] = (1.0, -1.0)
    never[:, 0] += 9.0
    x = np.stack([x, missed, twice, never], axis=2)
    # The speed lies on the line between those at the ticks, 1.8 and 2.1 s.
    speed = 3.0 / 8.0 * (1.8**2 + (2.1**2 - 1.8**2) * 2.0 / 3.0)
    for of, wanted in (("time", 2.0), ("speed", speed), ("offset", np.hypot(0.1, 0.1)), ("heading_error", 0.4)):
        got = number(each(lw.metrics.DockContact, of), x, t)
        np.testing.assert_allclose(got, [wanted, np.nan, wanted, np.nan], atol=1e-12)


@pytest.mark.parametrize(("part", "numbers", "words"), [
    ("Waypoints", WAY | {"times": (0, 2, 1, 4)}, r"waypoints.times.*not rising"),
    ("Waypoints", WAY | {"times": (0, 2, 3)}, r"waypoints.times.*Give 4 numbers"),
    ("Waypoints", WAY | {"loiter_turns": (0, 1, 0, 0)}, r"waypoints.loiter_radius = None is missing. Give the radius"),
    ("Waypoints", WAY | {"at_end": "loiter"}, r"waypoints.loiter_radius = None is missing"),
    ("Waypoints", WAY | {"loiter_radius": 3.0}, r"waypoints.loiter_radius = 3.0 is given, and nothing is circled"),
    ("Waypoints", CIRCLES | {"loiter_turns": (1, 1, 0, 0)}, r"waypoints.loiter_turns\[0\] = 1.0 is of the first point"),
    ("Waypoints", CIRCLES | {"at_end": "go_on"}, r"waypoints.loiter_turns\[3\] = 0.5 is of the last point"),
    ("Waypoints", CIRCLES | {"loiter_turns": (0, -1, 0, 0)}, r"waypoints.loiter_turns.*out of bounds"),
    ("Waypoints", CIRCLES | {"clockwise": 1}, r"waypoints.clockwise = 1 is neither true nor false"),
    ("Loiter", CIRCLE | {"radius": 0.0}, r"loiter.radius = 0.0 is not positive"),
    ("Docking", DOCK | {"judged": 19.0}, r"docking.judged = 19.0 is above approach. Give at most approach = 18"),
    ("Docking", DOCK | {"contact_speed": 2.0}, r"docking.contact_speed = 2.0 is above speed. Give at most speed = 1.2"),
    ("Docking", DOCK | {"funnel": 1.6}, r"docking.funnel = 1.6"),
])  # fmt: skip
def test_bad_input(part, numbers, words):
    with pytest.raises(lw.SceneError, match=words):
        getattr(lw.control, part)(**numbers)


def test_a_contact_needs_a_dock():
    with pytest.raises(lw.SceneError, match=r"dock_contact\.of = 'depth' is nothing that is known at a dock"):
        lw.metrics.DockContact("depth")
    with pytest.raises(lw.SceneError, match="needs a guidance docking of the name 'docking'"):
        lw.solve(scene(lw.control.Loiter(**CIRCLE)), h=H, t1=1.0, statistics=[lw.metrics.DockContact("speed")])


@pytest.mark.slow
@pytest.mark.parametrize("part", [
    lw.control.Waypoints(**CIRCLES, times=(0.0, 9.0, 45.0, 70.0), method="ilos"), lw.control.Docking(**DOCK)
], ids=lambda part: part.type)  # fmt: skip
def test_a_run_goes_on_in_the_middle_of_it(part):
    given = states(3)
    fleet = lw.Ensemble.from_states(scene(part), *given)
    saved = {"fields": ("position", "attitude", "velocity", "angular_velocity")}
    whole = lw.solve(fleet, "psi_s", h=H, t1=50.0, save=lw.SaveAt(every=25.0, **saved))
    first = lw.solve(fleet, "psi_s", h=H, t1=25.0, save=lw.SaveAt(**saved))
    second = lw.solve(fleet, "psi_s", h=H, t1=50.0, save=lw.SaveAt(**saved), start=first.final)
    for name in saved["fields"]:
        assert whole.samples[name][-1].tobytes() == second.samples[name][-1].tobytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("part", [
    lw.control.Waypoints(**CIRCLES, times=(0.0, 9.0, 45.0, 70.0)), lw.control.Docking(**DOCK), lw.control.Loiter(**CIRCLE)
], ids=lambda part: part.type)  # fmt: skip
def test_one_many_and_float32(part):
    n = 4096
    rng = np.random.default_rng(5)
    position = np.column_stack([rng.uniform(-3.0, 3.0, (n, 2)), rng.uniform(1.0, 4.0, n)])
    given = (position, np.tile(np.eye(3), (n, 1, 1)), np.tile((0.8, 0.0, 0.0), (n, 1)), np.zeros((n, 3)))
    fleet = lw.Ensemble.from_states(scene(part), *given)
    many = lw.solve(fleet, "psi_s", h=H, t1=12.0, save=lw.SaveAt(every=4.0))
    one = lw.solve(lw.Ensemble.from_states(scene(part), *(x[-1:] for x in given)), "psi_s", h=H, t1=12.0,
                   save=lw.SaveAt(every=4.0))  # fmt: skip
    assert np.all(many.status == lw.Status.OK)
    np.testing.assert_allclose(one.position[:, 0], many.position[:, -1], atol=1e-9)
    short = lw.solve(fleet, "psi_s", h=H, t1=12.0, save=lw.SaveAt(every=4.0), dtype="float32")
    apart = np.abs(short.position - many.position).max(axis=(0, 2))
    # Round-off of float32 but for members that change their leg a tick apart, some 0.1 m of way.
    assert np.mean(apart < 1e-3) > 0.95
    assert apart.max() < 0.5
