# SPDX-License-Identifier: Apache-2.0
"""Inertial navigation: IMU, DVL and the error-state filter, against twins, closed forms and what chance allows."""

import dataclasses
import re
import tomllib

import numpy as np
import pytest
from scipy.stats import chi2

import lgvi_warp as lw
from lgvi_warp.extensions.navigation.twin import dvl as twin_dvl
from lgvi_warp.physics.terms.noisy import channel
from lgvi_warp.reference.control.altimeter import Ground
from lgvi_warp.reference.control.readings import attitude
from tests.conftest import ROOT
from tests.control.bench import measured, scene
from tests.extensions.navigation.navigating import (
    BELIEFS,
    LOG,
    ON_BOARD,
    PERIOD,
    UNIT,
    parts,
    remus,
    run_twins,
    through,
    twins,
    voyage,
)
from tests.support.pages import blocks
from tests.support.refusals import refused
from tests.support.tools import one

H = 0.02
SIGMAS = ("position_sigma", "velocity_sigma", "attitude_sigma", "accelerometer_sigma", "gyroscope_sigma")
# A right code misses such a band with a chance of 1e-4.
TAILS = (5e-5, 1.0 - 5e-5)


def fleet(listed, members, seed=0):
    return lw.Ensemble(scene(listed, period=PERIOD), members, seed)


def over(floor, listed, members):
    return lw.Ensemble(scene(listed, period=PERIOD, events=[floor]), members, 0)


def still(ticks, depth=10.0):
    """At rest, level, heading north, (ticks, 1, 21)."""
    truth = np.zeros((ticks, 1, 21))
    truth[..., 2] = depth
    truth[..., 3:12] = np.eye(3).reshape(-1)
    return truth


@pytest.mark.slow
def test_estimates_are_the_twins():
    truth, listed = voyage(300), parts()
    seen = measured(fleet(listed, 2), truth, H)
    for member in range(2):
        wanted, _ = run_twins(listed, truth, member)
        assert np.abs(seen[:, member] - wanted).max() < 1e-9


@pytest.mark.slow
def test_estimates_are_the_twins_over_ten_minutes():
    truth, listed = voyage(6000), parts()
    seen = measured(fleet(listed, 2), truth, H)
    wanted, _ = run_twins(listed, truth, 1)
    assert np.abs(seen[:, 1] - wanted).max() < 1e-9
    # What float32 loses: its eps of 16 m is 2e-6 m; sums of 6,000 ticks are corrected by readings.
    single = measured(fleet(listed, 2), truth, H, "float32")
    assert np.abs(single[:, 1] - wanted)[:, :3].max() < 1e-4


@pytest.mark.ci
def test_a_log_and_a_gyroscope_without_a_filter_are_the_twins():
    rough = {"dropout": 0.3, "burst": 3.0, "outlier": 0.1, "outlier_std": 0.5, "silent_from": 20.0, "silent_to": 25.0}
    listed = [lw.control.DVL(**LOG | rough), lw.control.IMU(**UNIT)]
    truth = voyage(300)
    seen = measured(fleet(listed, 2), truth, H)
    for member in range(2):
        wanted, _ = run_twins(listed, truth, member)
        assert np.abs(seen[:, member] - wanted).max() < 1e-12
    # Silent from 20 s to 25 s: the last velocity stays.
    assert np.array_equal(seen[200:249, :, 12:15], seen[201:250, :, 12:15])


@pytest.mark.ci
@pytest.mark.parametrize(
    "lost",
    [{"silent_from": 0.0, "silent_to": 5.0}, {"dropout": 1.0}, {"floor": "ground", "greatest_range": 2.0}],
    ids=["silent", "lost", "out of range"],
)
def test_a_log_tells_no_velocity_before_its_first_lock(lost):
    listed, truth = [lw.control.DVL(noise=0.01, **lost)], voyage(100)
    scene = over(lw.events.Floor(name="ground", depth=40.0), listed, 2) if "floor" in lost else fleet(listed, 2)
    seen = measured(scene, truth, H)[:, :, 12:15]
    first = min(round(lost.get("silent_to", 1e6) / PERIOD), 100)
    assert np.all(seen[:first] == 0.0)
    assert np.abs(truth[:first, :, 12:15]).max() > 0.1
    assert np.abs(seen[first:] - truth[first:, :, 12:15]).max(initial=0.0) < 0.1


@pytest.mark.slow
def test_sensors_without_errors_measure_the_truth():
    truth = voyage(100)
    plain = [lw.control.DVL(), lw.control.IMU()]
    seen = measured(fleet(plain, 2), truth, H)
    assert np.abs(seen[:, :, 12:15] - truth[:, :, 12:15]).max() < 1e-12
    wanted, _ = run_twins(plain, truth, 1)
    assert np.abs(seen[:, 1] - wanted).max() < 1e-12
    # A filter of a unit alone, which notes nothing, has the least code of all; it starts at the truth.
    listed = [lw.control.IMU(), lw.control.ErrorStateFilter(report=False, start_error=0.0)]
    seen = measured(fleet(listed, 2), truth, H)
    # Places go on by the mean of two velocities: T^3 / 12 of the jerk a tick, which here is up to 0.03 m/s^3.
    assert np.abs(seen - truth)[..., :3].max() < 100 * 0.1**3 / 12 * 0.03
    assert np.abs(seen - truth)[..., 3:15].max() < 1e-12


def errors_of(listed, truth, members):
    """Errors of the position of filters (ticks, members, 3)."""
    return measured(fleet(listed, members), truth, H)[..., :3] - truth[..., :3]


@pytest.mark.slow
def test_without_a_log_the_position_drifts_as_the_integral_of_the_accelerometers_noise():
    # At rest, all else known: a walk of the velocity of N^2 T a tick, and the position by the mean of two velocities, so its
    # variance after k ticks is N^2 T^3 k (4 k^2 - 1) / 12, which goes to N^2 t^3 / 3. The log is silent from 0 s on.
    density, members, ticks = 0.01, 1000, 200
    unit = dict(place=(0.0, 0.0, 0.0), accelerometer_noise=density)
    listed = parts((), unit=unit, log_numbers=LOG | {"silent_from": 0.0}, **dict.fromkeys(SIGMAS, 1e-9))
    error = errors_of(listed, still(ticks + 1), members)
    for k in (10, 100, ticks):
        variance = density**2 * PERIOD**3 * k * (4 * k**2 - 1) / 12
        low, high = chi2.ppf(TAILS, 3 * members)
        assert low < (error[k] ** 2).sum() / variance < high
        assert abs(variance / (density**2 * (k * PERIOD) ** 3 / 3) - 1.0) < 1 / k**2
    each = run_twin_filter(listed, still(ticks + 1))
    assert abs(each.sigma[0] ** 2 / variance - 1.0) < 1e-6


@pytest.mark.slow
def test_delayed_fixes_are_those_of_a_straight_line():
    # At rest with a unit that does not err, place and velocity of a line are all that is unknown: its posterior is that of a
    # regression on the fixes, each at the time at which it was taken, as soon as they are there.
    place, velocity, noise, members, late, every = 3.0, 0.2, 0.5, 1000, 20, 50
    sigmas = dict.fromkeys(SIGMAS, 1e-9) | {"position_sigma": place, "velocity_sigma": velocity}
    usbl = lw.control.Sensor(name="usbl", of="position", noise=noise, every=every, latency=late)
    listed = [lw.control.IMU(), usbl, lw.control.ErrorStateFilter(delayed_fix="usbl", **sigmas)]
    ticks = 3 * every
    error = errors_of(listed, still(ticks), members)
    low, high = chi2.ppf(TAILS, 3 * members)
    information = np.diag([place**-2, velocity**-2])
    for k in range(ticks):
        if k >= late and (k - late) % every == 0:
            row = np.array([1.0, (k - late) * PERIOD])
            information = information + np.outer(row, row) / noise**2
        if k in (0, 19, 20, 69, 70, 149):
            row = np.array([1.0, k * PERIOD])
            variance = row @ np.linalg.solve(information, row)
            assert low < (error[k] ** 2).sum() / variance < high
            assert run_twin_filter(listed, still(k + 1)).sigma[0] == pytest.approx(np.sqrt(variance), rel=1e-6)


def with_places(listed):
    """The same sensors, those of depth and position at places of their own."""
    at = {"cell": (0.8, 0.1, 0.0), "gps": (-0.5, 0.0, -0.3), "usbl": (0.2, -0.1, 0.4)}
    return [dataclasses.replace(part, place=at[part.key]) if part.key in at else part for part in listed]


@pytest.mark.slow
def test_sensors_with_places_of_their_own_are_the_twins():
    truth, listed = voyage(150), with_places(parts())
    seen = measured(fleet(listed, 2), truth, H)
    wanted, belief = run_twins(listed, truth, 1)
    assert np.abs(seen[:, 1] - wanted).max() < 1e-9
    assert belief[:, 2].max() == 4 + 3 + 1 + 1
    # Without noise, and a filter that knows nothing, a fix of a place is one of the origin: by geometry alone.
    sharp = {"fix": dataclasses.replace(listed[4], noise=1e-6), "attitude_sigma": 1e-9, "position_sigma": 50.0}
    gps = [lw.control.IMU(), sharp.pop("fix"), lw.control.ErrorStateFilter(fix="gps", **sharp)]
    far = still(2, 8.0)
    far[:, 0, 3:12] = attitude(0.2, -0.4, 1.0).reshape(-1)
    error = measured(fleet(gps, 2), far, H)[0, :, :3] - far[0, :, :3]
    assert np.abs(error).max() < 1e-5
    # Without a filter what they read is taken for the body's; an antenna above 9 m has a fix, though the origin has none.
    plain = [part for part in listed if part.key in ("cell", "gps")]
    seen = measured(fleet(plain, 2), truth, H)
    wanted, _ = run_twins(plain, truth, 1)
    assert np.abs(seen[:, 1] - wanted).max() < 1e-12
    deep = [dataclasses.replace(listed[4], noise=0.0, every=1.0, place=(0.0, 0.0, -1.0), deepest=9.5)]
    sinking = still(3)
    sinking[:, 0, 2] = [10.0, 10.2, 10.8]
    assert measured(fleet(deep, 2), sinking, H)[:, 0, 2] == pytest.approx([9.0, 9.2, 9.2])


@pytest.mark.slow
def test_a_fix_that_comes_after_the_run_changes_nothing():
    truth, plain = voyage(100), parts(("depth",))
    usbl = lw.control.Sensor(name="usbl", of="position", noise=0.5, every=1000, latency=900)
    filtered = dataclasses.replace(plain[-1], delayed_fix="usbl")
    seen = [measured(fleet(listed, 2), truth, H) for listed in (plain, [*plain[:-1], usbl, filtered])]
    assert np.abs(seen[0] - seen[1]).max() < 1e-12


@pytest.mark.slow
def test_lost_beams_are_no_log():
    truth = voyage(300)
    without = parts(("depth",), log=False)
    seen = measured(fleet(without, 2), truth, H)
    wanted, belief = run_twins(without, truth, 1)
    assert np.abs(seen[:, 1] - wanted).max() < 1e-9
    assert belief[:, 2].max() == 1.0
    lost = measured(fleet(parts(("depth",), log_numbers=LOG | {"dropout": 1.0}), 2), truth, H)
    assert np.abs(lost - seen).max() < 1e-12


@pytest.mark.slow
def test_a_bow_that_points_at_the_surface_has_no_heading():
    # In 10 s upright, and 5 s there: a compass tells nothing, and divides by nothing.
    angles, rate = np.minimum(np.linspace(0.0, 0.75 * np.pi, 151), 0.5 * np.pi), 0.005 * np.pi / PERIOD
    truth = still(len(angles))
    truth[:, 0, 3:12] = [attitude(0.0, pitch, 0.3).reshape(-1) for pitch in angles]
    truth[:, 0, 19] = np.where(np.arange(len(angles)) < 100, rate, 0.0)
    listed = parts(("depth", "heading", "fix"))
    seen = measured(fleet(listed, 2), truth, H)
    wanted, _ = run_twins(listed, truth, 1)
    assert np.isfinite(seen).all()
    assert np.abs(seen[:, 1] - wanted).max() < 1e-9
    # The third row of the attitude is known to some of its sigma, 0.02 rad.
    assert np.abs(seen[:, :, 9:12] - truth[:, :, 9:12]).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.04, 0.2])
def test_estimates_are_the_twins_at_other_periods(period):
    truth, listed = voyage(150, period), parts()
    seen = measured(lw.Ensemble(scene(listed, period=period), 2, 0), truth, H)
    wanted, _ = run_twins(listed, truth, 1, period=period)
    assert np.abs(seen[:, 1] - wanted).max() < 1e-9


@pytest.mark.slow
def test_a_unit_without_noise_is_taken_at_its_word():
    truth, unit = voyage(1200), dict(place=UNIT["place"])
    listed = parts(("depth",), unit=unit, **dict.fromkeys(SIGMAS[2:], 1e-6))
    seen = measured(fleet(listed, 2), truth, H)
    wanted, _ = run_twins(listed, truth, 1)
    assert np.abs(seen[:, 1] - wanted).max() < 1e-9
    # By what the log says the velocity is known ever better.
    assert np.abs(seen[-1] - truth[-1])[:, 12:15].max() < 0.01


def run_twin_filter(listed, truth):
    """The twin of a filter after the last tick."""
    each = twins(listed, 0)
    through(each, truth)
    return each[-1]


def allan(rates, m):
    """The overlapping Allan variance of mean rates (ticks, axes) over m ticks."""
    sums = np.concatenate([np.zeros_like(rates[:1]), np.cumsum(rates, axis=0)])
    second = sums[2 * m :] - 2.0 * sums[m:-m] + sums[: -2 * m]
    return (second**2).mean() / (2.0 * m**2)


def allan_of(noise, walk, m):
    """Allan variance of white noise of a density, and of a bias that walks from tick to tick (IEEE Std 952-1997, annex C)."""
    return noise**2 / (m * PERIOD) + walk**2 * PERIOD * (2 * m**2 + 1) / (6 * m)


@pytest.mark.ci
@pytest.mark.parametrize("which", ["gyroscope", "accelerometer"])
def test_the_allan_deviation_is_as_set(which):
    noise, walk, ticks, members = 1e-3, 2e-3, 1200, 60
    truth = still(ticks + 1)
    if which == "gyroscope":
        listed = [lw.control.IMU(gyroscope_noise=noise, gyroscope_walk=walk, gyroscope_bias=0.1)]
        rates = measured(fleet(listed, members), truth, H)[1:, :, 18:21]
    else:
        # A filter that knows all else and reads nothing adds up what the accelerometers say.
        unit = dict(place=(0.0, 0.0, 0.0), accelerometer_noise=noise, accelerometer_walk=walk)
        listed = parts((), log=False, unit=unit, **dict.fromkeys(SIGMAS, 1e-9))
        rates = np.diff(measured(fleet(listed, members), truth, H)[:, :, 12:15], axis=0) / PERIOD
    rates = rates.reshape(ticks, -1)
    for m in (1, 3, 10, 30, 60):
        # Windows of 2 m ticks that do not overlap are the least that count: so many squares of 3 axes.
        windows = rates.shape[1] * (ticks // (2 * m))
        assert abs(allan(rates, m) / allan_of(noise, walk, m) - 1.0) < 4.0 * np.sqrt(2.0 / windows)


@pytest.mark.ci
def test_the_twins_errors_are_as_large_as_it_believes():
    truth, listed, members = voyage(120), parts(attitude_sigma=0.005, velocity_sigma=0.02), 8
    belief = np.stack([run_twins(listed, truth, member)[1] for member in range(members)], axis=1)
    low, high = chi2.ppf(TAILS, 15 * members)
    for k in (0, 60, 119):
        assert low < belief[k, :, 0].sum() < high
    low, high = chi2.ppf(TAILS, belief[..., 2].sum())
    assert low < belief[..., 1].sum() < high


@pytest.mark.slow
def test_a_beam_whose_way_to_the_floor_is_beyond_its_range_has_no_echo():
    # 10 m above the floor: 11.55 m along each beam where the vehicle is level; rolled by 0.1 rad, 11.15 m and 12.10 m.
    level, rolled, c, s = slice(0, 200), slice(200, 400), np.cos(0.1), np.sin(0.1)
    truth = np.repeat(still(2), 400, axis=1)
    truth[:, rolled, 3:12] = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]).reshape(-1)
    log = lw.control.DVL(noise=0.01, floor="ground", greatest_range=11.3)
    listed = [lw.control.IMU(), log, lw.control.ErrorStateFilter(dvl="dvl")]
    seen = measured(over(lw.events.Floor(name="ground", depth=20.0), listed, 400), truth, H)[0, :, 12:15]
    # The first estimate has errors of 0.1 m/s. Two beams leave them in one direction.
    known = [(np.linalg.eigvalsh(np.cov(seen[which].T)) < 0.03**2).sum() for which in (level, rolled)]
    assert known == [0, 2]


@pytest.mark.ci
@pytest.mark.parametrize("reach", [9.0, np.inf])
def test_beams_over_a_grid_are_those_of_the_twin(reach):
    # A slope of 0.2 to the east below a vehicle that rolls: some beams meet it within 6 m to 9 m and others do not.
    depth = np.tile(20.0 + np.arange(-10.0, 11.0), (21, 1))
    floor = dict(depth=depth, origin=[-50.0, -50.0], spacing=[5.0, 5.0])
    log = LOG | {"greatest_range": reach, "least_range": 6.0}
    truth = voyage(300)
    truth[..., 2] += 3.0
    ground = lw.events.Floor(name="ground", **floor)
    seen = measured(over(ground, [lw.control.DVL(**log, floor="ground")], 2), truth, H)
    each = [twin_dvl.DVL(**log, ground=Ground(depth, *list(floor.values())[1:]), channel=channel("dvl"))]
    wanted = through(each, truth)
    assert np.abs(seen[:, 0] - wanted).max() < 1e-12
    # Not all ticks have three beams.
    held = np.all(wanted[1:, 12:15] == wanted[:-1, 12:15], axis=1)
    assert 0.1 < held[1::2].mean() < 0.9


@pytest.mark.slow
def test_a_flat_floor_on_a_grid_is_a_flat_floor():
    truth, log = voyage(100), lw.control.DVL(noise=0.01, floor="ground", least_range=1.0, greatest_range=11.0)
    flat = lw.events.Floor(name="ground", depth=20.0)
    grid = lw.events.Floor(name="ground", depth=np.full((3, 3), 20.0), spacing=[10.0, 10.0])
    seen = [measured(over(floor, [log], 2), truth, H) for floor in (flat, grid)]
    assert np.array_equal(*seen)
    free = measured(fleet([lw.control.DVL(noise=0.01)], 2), truth, H)
    assert 0.05 < np.any(seen[0] != free, axis=2).mean() < 0.95


@pytest.mark.slow
def test_a_fix_below_the_surface_does_not_count():
    listed = [lw.control.IMU(), lw.control.Sensor(name="gps", of="position", noise=0.1, deepest=9.0)]
    listed.append(lw.control.ErrorStateFilter(fix="gps", position_sigma=100.0))
    for depth, least, most in ((10.0, 50.0, 200.0), (5.0, 0.05, 0.2)):
        error = errors_of(listed, still(2, depth), 200)[0]
        assert least < error.std() < most


@pytest.mark.ci
def test_readings_of_members_that_vary():
    truth, listed = voyage(60), parts(("depth",), position_sigma=1.0)
    varied = {"cell.noise": np.array([0.02, 0.0, 0.5]), "error_state_filter.start_error": np.array([0.0, 1.0, 5.0])}
    base = measured(fleet(listed, 3), truth, H)
    seen = measured(one(scene(listed, period=PERIOD), parameters=varied), truth, H)
    assert np.abs(seen[0, 0, :2] - truth[0, 0, :2]).max() < 0.05
    assert not np.array_equal(seen[:, 2], base[:, 2])


FAULTS = {
    "imu": ([lw.control.ErrorStateFilter()], "Give the scene a part of type imu"),
    "kind": ([lw.control.Sensor(name="imu", of="depth"), lw.control.ErrorStateFilter()], "is not a part of type imu"),
    "noise": ([lw.control.IMU(), lw.control.DVL(), lw.control.ErrorStateFilter(dvl="dvl")], "dvl.noise"),
    "before": ([lw.control.IMU(), lw.control.Sensor(of="depth"), lw.control.ErrorStateFilter()], "sensors = 'sensor'"),
    "late": (
        [lw.control.IMU(), lw.control.Sensor(name="cell", of="depth", noise=0.1, latency=1),
         lw.control.ErrorStateFilter(depth="cell")],
        "cell.latency",
    ),
    "many on their way": (
        [lw.control.IMU(), lw.control.Sensor(name="usbl", of="position", noise=0.1, latency=40, every=5),
         lw.control.ErrorStateFilter(delayed_fix="usbl")],
        "usbl.latency",
    ),
    "after": ([lw.control.ErrorStateFilter(), lw.control.IMU()], "stands before the filter"),
    "range": ([lw.control.DVL(least_range=1.0, greatest_range=20.0, floor="ground")], "Give the scene one"),
    "no floor": ([lw.control.DVL(floor="ground")], "dvl.floor = 'ground'"),
}  # fmt: skip


BAD_NUMBERS = {
    "density": (lambda: lw.control.IMU(gyroscope_noise=-1e-4), "imu.gyroscope_noise"),
    "arm": (lambda: lw.control.DVL(place=(1.0, 2.0)), "(3,) [m]"),
    "range": (lambda: lw.control.DVL(least_range=50.0, greatest_range=10.0), "is not above least_range = 50"),
    "silence": (lambda: lw.control.DVL(silent_from=5.0, silent_to=2.0), "is not above silent_from = 5"),
    "place": (
        lambda: lw.control.Sensor(of="velocity", place=(1.0, 0.0, 0.0)),
        "has no meaning for a sensor of velocity",
    ),
    "point": (lambda: lw.control.Altimeter(place=(1.0, 0.0, 0.0)), "Give point"),
    "sigma": (lambda: lw.control.ErrorStateFilter(attitude_sigma=0.0), "Give numbers above 0 [rad]"),
}


@pytest.mark.parametrize("name", BAD_NUMBERS)
def test_bad_numbers_are_told_in_one_line(name):
    make, text = BAD_NUMBERS[name]
    with pytest.raises(lw.SceneError, match=re.escape(text)) as found:
        make()
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("name", FAULTS)
def test_what_does_not_fit_is_said(name):
    sensors, text = FAULTS[name]
    with pytest.raises(lw.SceneError, match=text):
        scene(sensors, period=PERIOD)


@pytest.mark.slow
def test_faults_of_a_filters_sensors_are_their_own_numbers():
    """A log that loses contact is one that is silent, to the bit; a cell with an offset from the start has that bias."""
    truth, faulty = voyage(80), parts(("depth",))
    faults = [
        lw.control.Fault(name="contact", of="dvl", channel="all", kind="intermittent", duty=1.0, time=2.0, until=5.0),
        lw.control.Fault(name="shifted", of="cell", kind="offset", offset=0.3),
    ]
    seen = measured(lw.Ensemble(scene(faulty, faults, PERIOD), 2), truth, H)
    silent = parts(("depth",), log_numbers=LOG | {"silent_from": 2.0, "silent_to": 5.0})
    silent[2] = dataclasses.replace(silent[2], bias=0.3)
    assert np.abs(seen - measured(lw.Ensemble(scene(silent, (), PERIOD), 2), truth, H)).max() < 1e-12
    well = measured(fleet(parts(("depth",)), 2), truth, H)
    assert np.abs(seen - well)[:, :, 2].max() > 0.1


def test_a_channel_beyond_those_of_a_sensor_of_a_filter_is_refused():
    for of, count in (("dvl", 4), ("imu", 6), ("cell", 1)):
        with pytest.raises(lw.SceneError, match=f"is beyond the {count} of {of}"):
            scene(parts(("depth",)), [lw.control.Fault(of=of, channel=count, time=1.0)], PERIOD)
    with pytest.raises(lw.SceneError, match="is not an actuator and no sensor"):
        scene(parts(("depth",)), [lw.control.Fault(of="error_state_filter", time=1.0)], PERIOD)


def test_what_a_filter_believes_is_not_there_without_one():
    with pytest.raises(lw.SceneError, match="error_state_filter"):
        lw.solve(scene([lw.control.IMU()]), "psi_s", h=H, t1=0.1, save=lw.SaveAt(every=0.1, fields=("nees",)))


MOTION = ("position", "attitude", "velocity", "angular_velocity")
SETTINGS = dict(method="psi_x", h=0.05, threads=1)


def sailed(members, t1, every, **settings):
    """REMUS 100 by IMU, log and depth cell."""
    ensemble = lw.Ensemble(remus(parts(("depth",), **ON_BOARD)), members, seed=1)
    saved = (*MOTION, *BELIEFS, "measured_position", "measured_velocity")
    return lw.solve(ensemble, t1=t1, save=lw.SaveAt(every=every, fields=saved, final=True), **SETTINGS | settings)


@pytest.fixture(scope="module")
def voyages():
    return sailed(200, 20.0, 0.5)


@pytest.mark.ci
def test_filters_of_an_ensemble_are_consistent(voyages):
    judged = lw.metrics.consistency(voyages, level=0.999)
    assert judged.nees_share == 1.0
    assert judged.nis_share > 0.95
    assert "200 filters at 41 times, 99.9 % bands" in repr(judged)
    # NEES by the truth that the run saved, from the sigmas alone, is that of each state apart.
    error = (voyages.measured_position - voyages.position)[-1]
    size = (error**2 / voyages.estimate_sigma[-1, :, :3] ** 2).mean(axis=0)
    low, high = chi2.ppf(TAILS, 200) / 200
    assert np.all((low < size) & (size < high))


def test_bands_are_those_of_chi_square(voyages):
    judged = lw.metrics.consistency(voyages)
    # The normal approximation of Wilson & Hilferty (1931) of the chi-square distribution.
    for degrees, band in ((15 * 200, 200 * judged.nees_band[0]), (voyages.nis_count[0].sum(), None)):
        spread = 2.0 / (9.0 * degrees)
        ends = degrees * (1.0 - spread + np.array([-1.959964, 1.959964]) * np.sqrt(spread)) ** 3
        mine = voyages.nis_count[0].sum() * judged.nis_band[0] if band is None else band
        assert np.abs(mine / ends - 1.0).max() < 1e-4
    with pytest.raises(lw.SceneError, match="level = 95"):
        lw.metrics.consistency(voyages, level=95)


@pytest.mark.ci
def test_what_a_filter_believes_is_a_quantity_of_statistics(voyages):
    ensemble = lw.Ensemble(remus(parts(("depth",), **ON_BOARD)), 200, seed=1)
    run = lw.solve(ensemble, t1=2.0, save=lw.SaveAt(every=0.5, fields=("nees",)), **SETTINGS,
                   statistics=[lw.statistics.Mean("nees"), lw.statistics.Mean("estimate_sigma")])  # fmt: skip
    assert np.array_equal(run.nees, voyages.nees[:5])
    assert abs(run.statistics["mean nees"].value[-1, 0] - voyages.nees[4].mean()) < 1e-9


@pytest.mark.ci
def test_nees_and_nis_are_metrics_of_members(voyages):
    asked = [lw.metrics.NEES(then=[lw.statistics.MemberValues()]), lw.metrics.NIS(then=[lw.statistics.MemberValues()])]
    ensemble = lw.Ensemble(remus(parts(("depth",), **ON_BOARD)), 200, seed=1)
    saved = lw.SaveAt(every=PERIOD, fields=("nees", "nis", "nis_count"))
    run = lw.solve(ensemble, t1=2.0, save=saved, statistics=asked, **SETTINGS)
    assert np.array_equal(run.nees[::5], voyages.nees[:5])
    nees, nis = (run.statistics[f"each {name}"].value[0, 0] for name in ("nees", "nis"))
    assert nees == pytest.approx(run.nees.mean(axis=0), rel=1e-12)
    assert nis == pytest.approx(run.nis.sum(axis=0) / run.nis_count.sum(axis=0), rel=1e-12)
    # A right filter: 21 ticks of one member are like one look at the errors, so the mean over members is as free as theirs.
    low, high = chi2.ppf(TAILS, 15 * 200) / 200
    assert low < nees.mean() < high
    with pytest.raises(lw.SceneError, match=r"nis\.of = 'depth'"):
        lw.metrics.NIS("depth")


@pytest.mark.ci
def test_a_filter_goes_on_where_a_run_ended(voyages):
    first = sailed(200, 10.0, 0.5)
    on = lw.solve(lw.Ensemble(remus(parts(("depth",), **ON_BOARD)), 200, seed=1), start=first.final, t1=20.0,
                  save=lw.SaveAt(every=0.5, fields=("position", "nees")), **SETTINGS)  # fmt: skip
    assert np.array_equal(on.nees[-1], voyages.nees[-1])
    assert np.array_equal(on.position[-1], voyages.position[-1])


@pytest.mark.slow
def test_a_filter_goes_on_with_a_fix_on_its_way():
    listed = parts(**ON_BOARD)
    ensemble = lw.Ensemble(remus(listed), 8, seed=1)
    save = lw.SaveAt(every=0.5, fields=("position", "nees", "measured_position"), final=True)
    # The fix of 5 s comes at 7 s.
    whole, first = (lw.solve(ensemble, t1=t1, save=save, **SETTINGS) for t1 in (9.0, 6.0))
    on = lw.solve(ensemble, start=first.final, t1=9.0, save=save, **SETTINGS)
    for name in ("position", "nees", "measured_position"):
        assert np.array_equal(on.samples[name][-1], whole.samples[name][-1])


@pytest.mark.slow
def test_without_a_log_a_good_gyroscope_keeps_filters_consistent_and_a_poor_one_does_not():
    # An error theta of the vertical looks like a bias g theta^2 / 2, which no linear filter knows.
    sigmas = {name: value for name, value in ON_BOARD.items() if name.endswith("sigma")}
    judged = {}
    for drift in (5e-5, 1e-3):
        unit = ON_BOARD["unit"] | {"gyroscope_turn_on": drift}
        listed = parts(("depth",), log=False, unit=unit, **sigmas, gyroscope_sigma=drift)
        save = lw.SaveAt(every=1.0, fields=("nees", "nis", "nis_count"))
        run = lw.solve(lw.Ensemble(remus(listed), 400, seed=1), t1=40.0, save=save, **SETTINGS)
        judged[drift] = lw.metrics.consistency(run, level=0.999)
    assert judged[5e-5].nees_share == 1.0
    assert judged[1e-3].nees[-1] > 2.0 * 15.0


def test_consistency_of_filters_that_read_nothing_or_have_lost_their_covariance(voyages):
    quiet = {"nis": 0.0 * voyages.nis, "nis_count": 0.0 * voyages.nis_count}
    judged = lw.metrics.consistency(dataclasses.replace(voyages, samples=dict(voyages.samples) | quiet))
    assert np.isnan(judged.nis).all()
    assert np.isnan(judged.nis_share)
    assert "no innovation" in repr(judged)
    lost = voyages.nees.copy()
    lost[20:, 3] = np.nan
    judged = lw.metrics.consistency(dataclasses.replace(voyages, samples=dict(voyages.samples) | {"nees": lost}))
    assert judged.nees_share <= 20 / 41


@pytest.mark.slow
def test_ten_thousand_filters_are_consistent():
    judged = lw.metrics.consistency(sailed(10_000, 60.0, 1.0))
    assert judged.nees_share >= 0.9
    assert judged.nis_share >= 0.85


@pytest.mark.slow
def test_in_float32_filters_stay_consistent():
    judged = lw.metrics.consistency(sailed(2000, 60.0, 1.0, dtype="float32"), level=0.999)
    assert judged.nees_share == 1.0
    assert judged.nis_share > 0.95


@pytest.mark.slow
def test_check_controller_covers_the_parts():
    # As large as the random ticks that it makes: else their errors are a million sigmas, and NEES loses as many digits.
    loud = dict.fromkeys(("accelerometer_noise", "gyroscope_noise", "accelerometer_walk", "gyroscope_walk"), 3.0)
    spread = dict.fromkeys(("position", "velocity", "attitude", "accelerometer", "gyroscope"), 3.0)
    listed = parts(
        unit=UNIT | loud, log_numbers=LOG | {"noise": 3.0}, **{f"{name}_sigma": s for name, s in spread.items()}
    )
    base = scene(listed, period=PERIOD)
    for part in (listed[-1], listed[0], listed[1], listed[4]):
        report = lw.laws.check_controller(part, scene=base)
        assert report.ok, report
    for part in (lw.control.IMU(**UNIT), lw.control.DVL(**LOG)):
        assert lw.laws.check_controller(part).ok


@pytest.mark.ci
def test_the_page_has_all_keys_and_its_blocks_run(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    page = "docs/controllers/navigation.md"
    text = (ROOT / page).read_text()
    for kind in (lw.control.IMU, lw.control.DVL, lw.control.ErrorStateFilter):
        assert {item.name for item in dataclasses.fields(kind)} - {"name"} <= set(re.findall(r"`(\w+)`", text))
    listed = tomllib.loads("\n".join(blocks(page, "toml")))["controller"]["sensors"]
    base = remus(listed)
    assert base.parameters()["gps.deepest"] == 0.3
    assert base.controller.sensors[-1].uses["delayed_fix"] == "usbl"
    first, gated = (
        code.replace("t1=60.0", 't1=1.0, method="psi_x", h=0.02, threads=1')
        for name in ("docs/controllers/filter_consistency.md", page)
        for code in blocks(name, "python")
    )
    names: dict[str, object] = {}
    exec(first, names)
    assert "Consistency of 200 filters at 2 times" in capsys.readouterr().out
    exec(gated, names)
    # Of 35 readings of a member 5 % are outliers, of which the gate lets one in four pass.
    told, count = capsys.readouterr().out.splitlines()
    assert told.startswith("The filters are ")
    assert re.fullmatch("[12] readings of a member are rejected on average", count)


@pytest.mark.parametrize(
    "study", [lambda a: lw.linear.margins(a), lambda a: lw.linear.linearize(a, 1.0, closed=True, h=H)]
)
def test_a_filter_has_no_linear_model(study):
    told = refused(study, scene(parts(), period=PERIOD))
    assert "Leave it out of this scene" in told
    assert "error_state_filter" in told
