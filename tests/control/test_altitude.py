# SPDX-License-Identifier: Apache-2.0
"""Altimeters and terrain following: readings against twins and geometry, faults, and a REMUS over waves of the floor."""

import functools

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics.terms.noisy import channel
from lgvi_warp.reference.control import NO_WISH, Measurement
from lgvi_warp.reference.control.altimeter import Altimeter, Ground
from lgvi_warp.reference.control.altitude import Altitude
from tests.support.loops import torpedo
from tests.support.tools import one

PERIOD, CELL, EDGE = 0.1, 5.0, -150.0
# What the guidance wants where nothing limits it: where the beam meets the floor.
FREE = dict(altitude=1e-9, shallowest=-1e5, deepest=1e5)
SAVED = ("position", "attitude", "velocity", "angular_velocity", "reference_depth")


@functools.cache
def rough(size):
    """Depths of nodes about 40 m that know nothing of each other."""
    return 40.0 + size * np.random.default_rng(1).normal(size=(60, 60))


def floor_of(depth, **more):
    return lw.events.Floor(depth=depth, origin=[EDGE, EDGE], spacing=[CELL, CELL], **more)


def scene_of(depth, sensor, faults=(), **more):
    """A torpedo that turns about over a floor, whose guidance follows an altimeter."""
    guidance = [lw.control.SetPoint(heading=0.0), lw.control.Altitude(**FREE)]
    controller = lw.Controller(
        period=PERIOD, sensors=[sensor], guidance=guidance, laws=[lw.control.HeadingPID(kp=1.0)], faults=faults
    )
    return lw.Scene(torpedo(196.0, (0.0, 0.0, -0.02)), lw.Environment(9.8), [lw.terms.ControlWrench()],
                    controller=controller, events=[floor_of(depth)], **more)  # fmt: skip


def places(n, tilt, seed=2):
    """Places and attitudes (n, ...) above the floor, the down axis up to 1.4 times `tilt` [rad] from the vertical."""
    rng = np.random.default_rng(seed)
    b = np.column_stack([rng.uniform(-100.0, 100.0, (n, 2)), rng.uniform(0.0, 25.0, n)])
    turn = np.column_stack([rng.uniform(-tilt, tilt, (n, 2)), rng.uniform(-3.0, 3.0, n)])
    return b, lw.notation.matrix_from_rotation_vector(turn)


def readings(result, direction=(0.0, 0.0, 1.0), point=(0.0, 0.0, 0.0)):
    """Readings of an altimeter at each sample (k, n), from the depth that the guidance wanted."""
    beam = np.asarray(direction) / np.linalg.norm(direction, axis=-1, keepdims=True)
    down = result.attitude[..., 2, :]
    level = (
        result.samples["reference_depth"] + FREE["altitude"] - result.position[..., 2] - np.sum(down * point, axis=-1)
    )
    return level / np.sum(down * beam, axis=-1)


@pytest.mark.ci
@pytest.mark.parametrize(("size", "tilt"), [(0.0, 0.7), (1.0, 0.5), (3.0, 0.3)])
def test_a_reading_is_exact_where_the_beam_meets_the_floor_once(size, tilt):
    # Slopes up to 3 m in 5 m. The truth: in each cell that the beam crosses, the root of a quadratic.
    b, R = places(200, tilt)
    ground = Ground(rough(size), (EDGE, EDGE), (CELL, CELL))
    fleet = one(scene_of(rough(size), lw.control.Altimeter(most=120.0)), b=b, R=R)
    seen = readings(lw.solve(fleet, "rk4", h=PERIOD, t1=PERIOD, save=lw.SaveAt(every=PERIOD, fields=SAVED)))[0]
    true = [ground.along(b[i], R[i, :, 2], 120.0) for i in range(len(b))]
    np.testing.assert_allclose(seen, true, atol=1e-11)


@pytest.mark.slow
def test_beams_with_errors_are_those_of_the_twin():
    n = 5
    varied = {
        "altimeter.direction": np.array([[0, 0, 1], [1, 0, 2], [0, -1, 3], [0, 0, 0.1], [2, 1, 9.0]]),
        "altimeter.point": np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.2], [-1, 0.1, 0], [0, 0, 0.0]]),
        "altimeter.noise": np.array([0.0, 0.1, 0.2, 0.0, 0.3]),
        "altimeter.latency": np.array([0.0, 2.0, 0.0, 1.0, 3.0]),
        "altimeter.dropout": np.array([0.0, 0.0, 0.5, 0.2, 0.0]),
        "altimeter.most": np.array([100.0, 100.0, 100.0, 25.0, 100.0]),
    }
    sensor = lw.control.Altimeter(noise=0.1, drift=0.05, bias=0.3, quantum=0.02, every=2, latency=1, dropout=0.1)
    b, R = places(n, 0.3)
    rng = np.random.default_rng(4)
    nu = np.column_stack([rng.uniform(1.0, 2.0, n), rng.uniform(-0.3, 0.3, (n, 2))])
    fleet = one(scene_of(rough(1.0), sensor), b=b, R=R, nu=nu, Om=rng.uniform(-0.3, 0.3, (n, 3)), parameters=varied)
    r = lw.solve(fleet, "rk4", h=0.05, t1=4.0, save=lw.SaveAt(every=PERIOD, fields=SAVED))
    for i in range(n):
        own = {name.split(".")[1]: value[i] for name, value in varied.items()}
        own |= {name: int(own[name]) for name in ("latency",)}
        fixed = dict(drift=0.05, bias=0.3, quantum=0.02, every=2, channel=channel("altimeter"))
        twin = Altimeter(ground=Ground(rough(1.0), (EDGE, EDGE), (CELL, CELL)), **fixed, **own)
        guide = Altitude(altimeter=twin, **FREE)
        twin.begin()
        for k in range(len(r.time)):
            y = Measurement(r.position[k, i], r.attitude[k, i], r.velocity[k, i], r.velocity[k, i],
                            r.angular_velocity[k, i], period=PERIOD, h=0.05, step=2 * k, tick=k, member=i)  # fmt: skip
            wanted = guide.guide(NO_WISH, twin.measure(y)).position[2]
            assert r.samples["reference_depth"][k, i] == pytest.approx(wanted, abs=1e-9)


@pytest.mark.ci
def test_without_an_echo_it_reads_its_reach_and_below_the_floor_nothing():
    level = np.array([39.0, 30.0, 5.0])
    b = np.column_stack([np.zeros((3, 2)), level])
    fleet = one(scene_of(rough(0.0), lw.control.Altimeter(most=20.0)), b=b)
    r = lw.solve(fleet, "rk4", h=PERIOD, t1=PERIOD, save=lw.SaveAt(every=PERIOD, fields=SAVED))
    np.testing.assert_allclose(readings(r)[0], [1.0, 10.0, 20.0], atol=1e-12)
    r = lw.solve(one(scene_of(rough(0.0), lw.control.Altimeter(most=20.0)), b=(0.0, 0.0, 43.0)), "rk4", h=PERIOD,
                 t1=PERIOD, save=lw.SaveAt(every=PERIOD, fields=SAVED))  # fmt: skip
    assert r.status[0] == lw.Status.FLOOR
    assert readings(r)[0, 0] == 0.0
    # Upwards there is no floor.
    up = scene_of(rough(0.0), lw.control.Altimeter(direction=[0.0, 0.0, -1.0], most=20.0))
    r = lw.solve(one(up, b=b), "rk4", h=PERIOD, t1=PERIOD, save=lw.SaveAt(every=PERIOD, fields=SAVED))
    np.testing.assert_allclose(readings(r, (0.0, 0.0, -1.0))[0], 20.0, atol=1e-12)


@pytest.mark.slow
def test_other_sensors_do_not_move_where_it_looks_from():
    scene = scene_of(rough(1.0), lw.control.Altimeter())
    depth_cell, controller = lw.control.Sensor(of="position", bias=7.0), scene.controller
    blurred = lw.Controller(period=PERIOD, sensors=[depth_cell, *controller.sensors], guidance=controller.guidance,
                            laws=controller.laws)  # fmt: skip
    wanted = []
    for acted in (controller, blurred):
        fleet = one(lw.Scene(scene.vehicle, scene.environment, [lw.terms.ControlWrench()], controller=acted,
                             events=scene.events), b=(3.0, 2.0, 5.0))  # fmt: skip
        r = lw.solve(fleet, "rk4", h=PERIOD, t1=PERIOD, save=lw.SaveAt(every=PERIOD, fields=SAVED))
        wanted.append(r.samples["reference_depth"][0, 0])
    # The guidance adds the reading to the depth that it believes in.
    assert wanted[1] - wanted[0] == pytest.approx(7.0, abs=1e-12)


@pytest.mark.slow
def test_a_fault_of_an_altimeter_begins_at_its_time():
    stuck = lw.control.Fault(of="altimeter", time=0.3, offset=4.0)
    fleet = one(scene_of(rough(0.0), lw.control.Altimeter(), [stuck]), b=(0.0, 0.0, 10.0))
    r = lw.solve(fleet, "rk4", h=PERIOD, t1=0.6, save=lw.SaveAt(every=PERIOD, fields=SAVED))
    np.testing.assert_allclose(readings(r)[:, 0], 3 * [30.0] + 4 * [4.0], atol=1e-9)


@pytest.mark.ci
@pytest.mark.parametrize("part", [
    lw.control.Altimeter(direction=[1.0, 0.2, 3.0], point=[0.5, 0.0, 0.1], noise=0.1, every=2, dropout=0.2),
    lw.control.Altitude(altitude=3.0),
    lw.control.Altitude(altitude=3.0, source="chart", look_ahead=8.0),
], ids=lambda part: f"{part.key}-{getattr(part, 'source', '')}")  # fmt: skip
def test_check_controller_finds_nothing(part):
    twin = None
    if getattr(part, "source", "") == "chart":
        twin = Altitude(altitude=3.0, look_ahead=8.0, ground=Ground(rough(1.0), (EDGE, EDGE), (CELL, CELL)))
    report = lw.laws.check_controller(part, scene=scene_of(rough(1.0), lw.control.Altimeter()), twin=twin)
    assert report.ok, report


@pytest.mark.ci
def test_limits_and_each_member_has_its_own():
    scene = scene_of(rough(0.0), lw.control.Altimeter(most=50.0))
    fleet = one(scene, b=(0.0, 0.0, 10.0), parameters={
        "altitude.altitude": np.array([5.0, 5.0, 5.0, 60.0]), "altitude.shallowest": np.array([0.0, 0.0, 37.0, 2.0]),
        "altitude.deepest": np.array([100.0, 20.0, 50.0, 50.0]),
    })  # fmt: skip
    r = lw.solve(fleet, "rk4", h=PERIOD, t1=PERIOD, save=lw.SaveAt(every=PERIOD, fields=SAVED))
    np.testing.assert_allclose(r.samples["reference_depth"][0], [35.0, 20.0, 37.0, 2.0], atol=1e-12)


LAWS = [
    lw.control.DepthPID(kp=0.1, ki=0.001, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, integral_limit=[20.0, 20.0]),
    lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
]
FINS = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])
WAVE, HEIGHT, LEVEL = 80.0, 0.2, 25.0


def remus(guidance, sensors=(), **more):
    controller = lw.Controller(
        period=0.1,
        sensors=sensors,
        guidance=[lw.control.SetPoint(heading=0.0), *guidance],
        laws=LAWS,
        allocation=[FINS],
    )
    x = np.arange(-20.0, 701.0, 1.0)
    depth = np.repeat((LEVEL + HEIGHT * np.sin(2.0 * np.pi * x / WAVE))[:, None], 2, axis=1)
    floor = lw.events.Floor(depth=depth, origin=[-20.0, -100.0], spacing=[1.0, 200.0])
    start = {"position": [0.0, 0.0, LEVEL - 5.0], "velocity": [1.5, 0.0, 0.0]}
    return lw.Scene.named("remus_100", start=start, controller=controller, events=[floor], **more)


def answer(phase, error):
    """Size and phase of the answer at a frequency, from the samples of whole waves."""
    basis = np.column_stack([np.sin(phase), np.cos(phase), np.ones_like(phase)])
    (s, c, _), *_ = np.linalg.lstsq(basis, error, rcond=None)
    return complex(s, c)


def ran(scene):
    r = lw.solve(scene, "psi_x", h=0.05, t1=300.0, save=lw.SaveAt(every=0.5))
    assert r.status[0] == lw.Status.OK
    return r.time[240:], r.position[240:, 0]


@pytest.mark.slow
def test_terrain_following_errs_as_the_loop_errs_on_a_wanted_wave():
    """The error of the altitude on waves of the floor is that of the depth on a wave of time, which knows no floor."""
    time, b = ran(remus([lw.control.Altitude(altitude=5.0, source="chart")]))
    floor = LEVEL + HEIGHT * np.sin(2.0 * np.pi * b[:, 0] / WAVE)
    over_floor = answer(2.0 * np.pi * b[:, 0] / WAVE, floor - 5.0 - b[:, 2])
    speed = (b[-1, 0] - b[0, 0]) / (time[-1] - time[0])
    t = np.arange(0.0, 301.0, 0.1)
    wave = 2.0 * np.pi * speed / WAVE
    wanted = np.column_stack([0.0 * t, 0.0 * t, LEVEL - 5.0 + HEIGHT * np.sin(wave * t)])
    time, b = ran(remus([lw.control.Trajectory(times=t, positions=wanted), lw.control.SetPoint(name="n", heading=0.0)]))
    in_time = answer(wave * time, LEVEL - 5.0 + HEIGHT * np.sin(wave * time) - b[:, 2])
    # Both are the loop's |1 - T| at this frequency; what is left is the speed along the way, which pitching changes.
    assert 0.1 * HEIGHT < abs(in_time) < HEIGHT
    assert abs(over_floor - in_time) < 0.005 * abs(in_time)


@pytest.mark.slow
def test_an_altimeter_follows_as_the_chart_does_and_looking_ahead_stays_higher():
    clearances = {}
    for name, guidance, sensors in (
        ("chart", lw.control.Altitude(altitude=5.0, source="chart"), []),
        ("altimeter", lw.control.Altitude(altitude=5.0), [lw.control.Altimeter()]),
        ("ahead", lw.control.Altitude(altitude=5.0, source="chart", look_ahead=10.0), []),
    ):
        _, b = ran(remus([guidance], sensors))
        clearances[name] = np.min(LEVEL + HEIGHT * np.sin(2.0 * np.pi * b[:, 0] / WAVE) - b[:, 2])
    # The beam of a pitched vehicle meets the floor a little beside the place below it.
    assert clearances["altimeter"] == pytest.approx(clearances["chart"], abs=0.1 * HEIGHT)
    assert clearances["ahead"] > clearances["chart"] + 0.1 * HEIGHT


@pytest.mark.parametrize(("guidance", "sensors", "events", "words"), [
    ([lw.control.Altitude(altitude=5.0)], [], ["floor"], r"altitude.altimeter = '' needs an altimeter"),
    ([], [lw.control.Altimeter()], [], r"altimeter.floor = '' needs a floor. Give the scene one"),
    ([lw.control.Altitude(altitude=5.0, source="chart")], [], ["a", "b"], r"does not say which of 2 floors. Name one: a, b"),
    ([], [lw.control.Altimeter(floor="c")], ["a"], r"altimeter.floor = 'c' is not a floor of the scene"),
])  # fmt: skip
def test_what_is_missing_in_the_scene_is_said(guidance, sensors, events, words):
    controller = lw.Controller(period=0.1, sensors=sensors, guidance=[lw.control.SetPoint(heading=0.0), *guidance],
                               laws=[lw.control.HeadingPID(kp=1.0)])  # fmt: skip
    with pytest.raises(lw.SceneError, match=words):
        lw.Scene(torpedo(196.0, (0.0, 0.0, -0.02)), lw.Environment(9.8), [lw.terms.ControlWrench()],
                 controller=controller, events=[lw.events.Floor(depth=9.0, name=name) for name in events])  # fmt: skip


@pytest.mark.parametrize(("part", "numbers", "words"), [
    ("Altimeter", {"direction": [0.0, 0.0, 0.0]}, "is not a direction"),
    ("Altimeter", {"most": 0.0}, "most = 0.0 is not positive"),
    ("Altitude", {"altitude": 0.0}, "altitude = 0.0 is not positive"),
    ("Altitude", {"altitude": 1.0, "look_ahead": 3.0}, "is given beside an altimeter"),
    ("Altitude", {"altitude": 1.0, "shallowest": 3.0, "deepest": 2.0}, "is below deepest. Give at most deepest = 2"),
    ("Altitude", {"altitude": 1.0, "source": "map"}, "source = 'map'"),
])  # fmt: skip
def test_bad_input(part, numbers, words):
    with pytest.raises(lw.SceneError, match=words):
        getattr(lw.control, part)(**numbers)


@pytest.mark.slow
def test_a_loop_with_an_altimeter_goes_on_where_it_was():
    sensor = lw.control.Altimeter(noise=0.1, drift=0.02, latency=2, every=3, dropout=0.1)
    scene = remus([lw.control.Altitude(altitude=5.0)], [sensor])
    fleet = lw.Ensemble(scene, 6, 3, {"altimeter.bias": lw.distributions.Normal(std=0.2)})
    saved = {"fields": ("position", "attitude", "velocity", "angular_velocity")}
    whole = lw.solve(fleet, "psi_x", h=0.05, t1=20.0, save=lw.SaveAt(every=10.0, **saved))
    first = lw.solve(fleet, "psi_x", h=0.05, t1=10.0, save=lw.SaveAt(**saved))
    second = lw.solve(fleet, "psi_x", h=0.05, t1=20.0, save=lw.SaveAt(**saved), start=first.final)
    for name in saved["fields"]:
        assert whole.samples[name][-1].tobytes() == second.samples[name][-1].tobytes(), name
    assert np.ptp(whole.position[-1, :, 2]) > 0.05


@pytest.mark.slow
def test_the_linear_loop_knows_the_slope_of_the_floor():
    """Ahead by 1 m the floor is deeper by 0.1 m: the closed model feels it as a wanted depth that is deeper by 0.1 m."""
    slope = np.repeat((LEVEL + 0.1 * np.arange(-20.0, 701.0))[:, None], 2, axis=1)
    models = {}
    for name, depth in (("slope", slope), ("level", np.full_like(slope, LEVEL))):
        scene = remus([lw.control.Altitude(altitude=5.0, source="chart")])
        floor = lw.events.Floor(depth=depth, origin=[-20.0, -100.0], spacing=[1.0, 200.0])
        scene = lw.Scene(scene.vehicle, scene.environment, scene.terms, scene.start, scene.controller, events=[floor])
        models[name] = lw.linear.linearize(scene, 0.0, closed=True, method="psi_x", h=0.05)
    difference = models["slope"].A - models["level"].A
    states = list(models["slope"].states)
    x, z = states.index("position[0]"), states.index("position[2]")
    felt = np.flatnonzero(np.abs(difference[:, x]) > 1e-9)
    assert len(felt) > 0
    # e = D(x) - altitude - z: what the loop makes of z, with the other sign and 0.1 times, but for z itself.
    for row in felt:
        own = 1.0 if row == z else 0.0
        assert difference[row, x] == pytest.approx(-0.1 * (models["level"].A[row, z] - own), rel=1e-3, abs=1e-9)
