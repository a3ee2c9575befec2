# SPDX-License-Identifier: Apache-2.0
"""Sensors, estimators and faults of sensors: the device against twins, against what is known, and alone in their lanes."""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics.terms.noisy import channel
from lgvi_warp.reference.control import Measurement
from lgvi_warp.reference.control.complementary_filter import ComplementaryFilter
from lgvi_warp.reference.control.dead_reckoning import DeadReckoning
from lgvi_warp.reference.control.fault import SensorFault
from lgvi_warp.reference.control.low_pass import LowPass
from lgvi_warp.reference.control.sensor import Sensor
from lgvi_warp.reference.rotation import exp
from tests.control.bench import measured, scene
from tests.support.tools import one

MEMBERS, TICKS, PERIOD, H = 6, 60, 0.1, 0.02
# Columns of a measurement that a sensor reads.
FIELDS_OF = {
    "depth": slice(2, 3), "position": slice(0, 3), "velocity": slice(12, 15), "water_velocity": slice(15, 18),
    "angular_velocity": slice(18, 21),
}  # fmt: skip
EPS = {"float64": 2.0**-52, "float32": 2.0**-23}

# Chains of parts, so that few kernels are compiled. No part hides what another does.
SENSORS = {
    "all": [
        dict(
            name="cell", of="depth", noise=0.02, bias=0.01, drift=0.03, quantum=0.005, every=2, latency=3, dropout=0.3
        ),
        dict(name="ahrs", of="attitude", noise=0.02, bias=(0.01, 0.0, -0.02), drift=0.01, latency=2),
        dict(name="compass", of="heading", noise=0.05, quantum=0.1, drift=0.02, every=3),
        dict(name="log", of="velocity", noise=(0.1, 0.0, 0.2), dropout=0.4),
        dict(name="flow", of="water_velocity", quantum=(0.1, 0.0, 0.2), bias=0.1),
        dict(name="gyro", of="angular_velocity", noise=0.01, bias=0.02, drift=0.03),
    ],
    "plain": [
        dict(
            name="fix",
            of="position",
            noise=0.5,
            every=4,
            dropout=0.5,
            burst=3.0,
            outlier=0.3,
            outlier_std=(5.0, 0.0, 2.0),
        ),
        dict(name="cell", of="depth", noise=0.02, outlier=0.2, outlier_std=0.5),
        dict(name="ahrs", of="attitude", quantum=(0.1, 0.0, 0.2)),
        dict(name="log", of="velocity", bias=0.3),
        dict(name="gyro", of="angular_velocity", noise=0.01),
    ],
    "reckoned": [dict(name="flow", of="water_velocity", bias=(0.1, 0.0, -0.1))],
}
FAULTS = {
    "all": [
        dict(name="weak", of="log", channel=1, time=2.0, gain=0.5, offset=0.1),
        dict(name="lost", of="compass", time=3.0, offset=-1.0),
        dict(name="tilted", of="ahrs", channel=1, time=1.0, gain=1.0, offset=0.2),
    ],
    "plain": [
        dict(of="cell", time=1.55, until=4.0, kind="slow", time_constant=0.3),
        dict(name="late", of="gyro", channel="all", kind="delay", delay=0.3, time=1.0, until=4.5),
        dict(name="loose", of="fix", channel=1, kind="intermittent", time=2.0, until=5.0, duty=0.3, period=0.7),
        dict(name="jammed", of="ahrs", channel=1, kind="stuck", time=3.0, until=3.5),
    ],
    "reckoned": [],
}
ESTIMATORS = {
    "all": [
        ("ComplementaryFilter", dict(time_constant=2.0)),
        ("DeadReckoning", dict(depth="measured", start_error=(1.0, -2.0, 0.5))),
        ("LowPass", dict(name="calm", of="heading", time_constant=0.4)),
    ],
    "plain": [
        ("LowPass", dict(name="calm", of="attitude", time_constant=0.3)),
        ("LowPass", dict(name="slow", of="velocity", time_constant=1.0)),
    ],
    "reckoned": [("DeadReckoning", dict(rule="euler", velocity="water_velocity"))],
}
TWINS = {"ComplementaryFilter": ComplementaryFilter, "DeadReckoning": DeadReckoning, "LowPass": LowPass}
# What differs from member to member.
VARIED = {
    "all": {
        "cell.noise": 0.02 * np.arange(MEMBERS),
        "cell.latency": np.array([0.0, 1.0, 3.0, 5.0, 2.0, 0.0]),
        "cell.every": np.array([1.0, 2.0, 3.0, 1.0, 5.0, 2.0]),
        "cell.quantum": 0.01 * np.arange(MEMBERS),
        "log.dropout": np.linspace(0.0, 1.0, MEMBERS),
        "gyro.drift": 0.01 * np.arange(3 * MEMBERS).reshape(MEMBERS, 3),
        "weak.time": np.array([0.0, 1.0, 2.0, 2.04, np.inf, 5.9]),
        "complementary_filter.time_constant": np.array([0.0, 0.1, 1.0, 10.0, 2.0, 1e9]),
    },
    "reckoned": {"flow.bias": 0.01 * np.arange(3 * MEMBERS).reshape(MEMBERS, 3)},
    "plain": {
        "cell.noise": 0.01 * np.arange(MEMBERS),
        "cell.outlier": np.linspace(0.0, 1.0, MEMBERS),
        "fix.burst": np.array([0.0, 1.0, 1.5, 3.0, 8.0, 50.0]),
        "late.delay": np.array([0.0, 0.1, 0.2, 0.5, 1.0, 0.3]),
        "calm.time_constant": np.array([0.0, 0.1, 0.3, 1.0, 2.0, 50.0]),
    },
}


def motion(ticks=TICKS, members=MEMBERS, period=PERIOD):
    """Turns and turns about of each member, (ticks, members, FIELDS): the heading goes round, roll and pitch swing."""
    rng = np.random.default_rng(3)
    t = period * np.arange(ticks)
    rows = np.zeros((ticks, members, 21))
    for m in range(members):
        a = rng.normal(size=12)
        for k in range(ticks):
            rates = np.array([0.3 * np.sin(t[k] + a[0]), 0.2 * np.cos(1.3 * t[k] + a[1]), 1.5 + 0.3 * a[2]])
            turn = exp(np.array([0.0, 0.0, 1.5 * t[k] + a[5]])) @ exp(
                0.5 * np.array([np.sin(t[k] + a[3]), np.cos(t[k]), 0.0])
            )
            position = np.array([3.0 * t[k], a[6] * t[k], 10.0 + a[7] * np.sin(t[k])])
            velocity = np.array([1.5 + a[8] * np.sin(t[k]), 0.3 * np.cos(2.0 * t[k]), 0.1 * a[9]])
            rows[k, m] = np.concatenate([position, turn.reshape(-1), velocity, velocity - 0.2, rates])
    return rows


def chain(case):
    parts = [lw.control.Sensor(**numbers) for numbers in SENSORS[case]]
    parts += [getattr(lw.control, kind)(**numbers) for kind, numbers in ESTIMATORS[case]]
    return scene(parts, [lw.control.Fault(**numbers) for numbers in FAULTS[case]], PERIOD)


def twins(case, m):
    """The twin's parts of member m."""

    def own(kind, numbers):
        key = numbers.get("name", kind)
        varied = {name.split(".")[1]: v[m] for name, v in VARIED[case].items() if name.split(".")[0] == key}
        return {name: np.array(v) if isinstance(v, tuple) else v for name, v in (numbers | varied).items()}

    of, parts = {}, []
    for numbers in SENSORS[case]:
        of[numbers["name"]] = numbers["of"]
        key = dict(channel=channel(numbers["name"]))
        numbers = own("sensor", numbers)
        numbers |= {name: round(float(numbers[name])) for name in ("every", "latency") if name in numbers}
        parts.append(Sensor(**numbers, **key))
        faults = [fault for fault in FAULTS[case] if fault["of"] == numbers["name"]]
        parts += [SensorFault(**{"channel": 0} | own("fault", fault) | {"of": of[fault["of"]]}) for fault in faults]
    snake = {"ComplementaryFilter": "complementary_filter", "DeadReckoning": "dead_reckoning", "LowPass": "low_pass"}
    return parts + [TWINS[kind](**own(snake[kind], numbers)) for kind, numbers in ESTIMATORS[case]]


def of_twin(case, truth):
    """Measurements of the twin, (ticks, members, FIELDS)."""
    seen = np.zeros_like(truth)
    for m in range(truth.shape[1]):
        parts = twins(case, m)
        for part in parts:
            part.begin()
        for k, row in enumerate(truth[:, m]):
            vectors = row[:3], row[3:12].reshape(3, 3), row[12:15], row[15:18], row[18:21]
            y = Measurement(*vectors, t=k * 5 * H, period=PERIOD, h=H, step=5 * k, tick=k, member=m)
            for part in parts:
                y = part.measure(y)
            numbers = y.position, y.R.reshape(-1), y.velocity, y.water_velocity, y.angular_velocity
            seen[k, m] = np.concatenate(numbers)
    return seen


def members_of(case):
    return one(chain(case), parameters=VARIED[case])


@pytest.mark.ci
@pytest.mark.slow_for("all-float32", "plain-float32", "reckoned-float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", list(SENSORS))
def test_what_is_measured_is_the_twins(case, dtype):
    truth = motion()
    seen, wanted = measured(members_of(case), truth, H, dtype), of_twin(case, truth)
    # Some ten operations a tick on numbers up to 40; estimators add those of all ticks up.
    assert np.abs(seen - wanted).max() < 10 * TICKS * 40 * EPS[dtype]


@pytest.mark.ci
def test_the_first_reading_stands_until_another_arrives():
    """Lost from the start, late by more than the run, and always too deep: the reading of before the run is all there is."""
    lost = [
        lw.control.Sensor(name="gps", of="position", deepest=-1e3),
        lw.control.Sensor(name="log", of="velocity", dropout=1.0),
        lw.control.Sensor(name="gyro", of="angular_velocity", latency=1000),
    ]
    truth = motion()
    seen = measured(one(scene(lost, period=PERIOD), np.zeros((MEMBERS, 3))), truth, H)
    for columns in (slice(0, 3), slice(12, 15), slice(18, 21)):
        assert np.array_equal(seen[:, :, columns], np.broadcast_to(truth[:1, :, columns], truth[:, :, columns].shape))
        assert np.abs(truth[-1, :, columns] - truth[0, :, columns]).max() > 1e-3
    assert np.array_equal(seen[:, :, 3:12], truth[:, :, 3:12])


# Statistics: the chain "all" with other numbers, so with its kernel. A chance of 6e-7 for a right code; the seed is fixed.
ERRORS = 5.0
MANY = 2000


@pytest.fixture(scope="module")
def readings():
    """Errors of the readings of many members at rest, (ticks, members, FIELDS): gyro walks, log is noisy and lossy."""
    # The estimators do not touch velocities and rates.
    varied = {
        "gyro.noise": np.full((MANY, 3), 1e-30), "gyro.bias": np.full((MANY, 3), 1e-30),
        "gyro.drift": np.full((MANY, 3), 0.3), "log.noise": np.full((MANY, 3), 0.2),
        "log.dropout": np.full(MANY, 0.3), "weak.time": np.full(MANY, np.inf),
    }  # fmt: skip
    truth = np.zeros((TICKS, 1, 21))
    truth[..., 3:12] = np.eye(3).reshape(-1)
    return measured(one(chain("all"), parameters=varied), truth, H)


@pytest.mark.ci
def test_the_variance_of_a_walk_grows_with_time(readings):
    walk = readings[..., 18:21]
    for k in (1, 20, 59):
        variance = 0.3**2 * k * PERIOD
        assert np.abs(walk[0]).max() < 1e-29
        assert abs(walk[k].var() / variance - 1.0) < ERRORS * np.sqrt(2.0 / (3 * MANY))
    # What comes after tick 20 does not depend on what was before.
    after = ((walk[59] - walk[20]) * walk[20]).mean() / np.sqrt(0.3**4 * 39 * 20 * PERIOD**2)
    assert abs(after) < ERRORS / np.sqrt(3 * MANY)


def test_noise_is_white_with_its_deviation(readings):
    fresh = readings[0, :, 12:15]
    assert abs(fresh.std() / 0.2 - 1.0) < ERRORS * np.sqrt(0.5 / (3 * MANY))
    assert abs(fresh.mean()) < ERRORS * 0.2 / np.sqrt(3 * MANY)
    # Axes, and ticks whose reading is not the last one's, are independent.
    pairs = [(fresh[:, 0], fresh[:, 1]), (fresh[:, 1], fresh[:, 2])]
    new = readings[1, :, 12] != readings[0, :, 12]
    pairs.append((readings[0, new, 12], readings[1, new, 12]))
    for a, b in pairs:
        assert abs(np.mean(a * b)) / 0.2**2 < ERRORS / np.sqrt(len(a))


def test_the_share_of_lost_readings_is_the_dropout(readings):
    lost = np.all(readings[1:, :, 12:15] == readings[:-1, :, 12:15], axis=-1)
    count = lost.size
    assert abs(lost.mean() - 0.3) < ERRORS * np.sqrt(0.3 * 0.7 / count)
    again = (lost[1:] & lost[:-1]).mean()
    assert abs(again - 0.09) < ERRORS * np.sqrt(0.09 * 0.91 / count) * np.sqrt(2.0)


@pytest.mark.ci
def test_numbers_that_are_the_same_for_all_designs():
    truth = motion()
    base = measured(members_of("all"), truth, H)
    gains = scene(chain("all").controller.sensors, chain("all").controller.faults, PERIOD, kp=9.0)
    other_gains = one(gains, parameters=VARIED["all"])
    assert np.array_equal(measured(other_gains, truth, H), base)
    # Another step, with the same ticks: the faults begin at the first tick at or after their times.
    assert np.array_equal(measured(members_of("all"), truth, 0.1), base)
    # Fewer members, and only some.
    some = {name: values[:3] for name, values in VARIED["all"].items()}
    few = measured(one(chain("all"), parameters=some), truth[:, :3], H)
    assert np.array_equal(few, base[:, :3])


@pytest.mark.ci
def test_each_sensor_and_seed_has_numbers_of_its_own():
    truth = motion(members=1)
    base = chain("plain").controller
    other = [*base.sensors[:4], replace(base.sensors[4], name="second"), *base.sensors[5:]]
    faults = [fault for fault in base.faults if fault.of != "gyro"]
    errors = []
    for sensors in (base.sensors, other):
        members = scene(sensors, faults, PERIOD)
        errors += [
            measured(lw.Ensemble(members, 1, seed), truth, H)[:, 0, 18] - truth[:, 0, 18] for seed in (0, 1, 2**40)
        ]
    for i, a in enumerate(errors):
        assert all(abs(np.corrcoef(a, b)[0, 1]) < ERRORS / np.sqrt(TICKS) for b in errors[:i])


@pytest.mark.ci
@pytest.mark.parametrize("extreme", [np.nan, 1e200])
def test_one_members_extreme_changes_no_other_bit(extreme):
    truth = motion()
    base = measured(members_of("all"), truth, H)
    spoiled = truth.copy()
    spoiled[7:, 2] = extreme
    seen = measured(members_of("all"), spoiled, H)
    others = np.arange(MEMBERS) != 2
    assert np.array_equal(seen[:, others], base[:, others])
    assert not np.array_equal(seen[:, 2], base[:, 2])
    bias = VARIED["all"] | {"cell.bias": np.where(others, 0.01, 1e200), "gyro.bias": np.full((MEMBERS, 3), 0.02)}
    seen = measured(one(chain("all"), parameters=bias), truth, H)
    assert np.array_equal(seen[:, others], base[:, others])


def test_what_no_member_has_is_no_code():
    from lgvi_kernels import built_in
    from lgvi_warp.runs.settle import make_plan

    def modules(sensors, vary=None):
        plan = make_plan(lw.Ensemble(scene(sensors), 4, 0, vary or {}), "psi_s", H, 1.0)
        return plan.spec.control.parts

    ideal = modules([lw.control.Sensor(of="depth")])[0]
    assert ideal is built_in("laws.control", "sensor:depth")
    assert modules([lw.control.Sensor(of="depth", noise=0.1)])[0] is built_in("laws.control", "sensor:depth,noise")
    varied = {"sensor.dropout": lw.distributions.Uniform(0.0, 0.5), "sensor.bias": lw.distributions.Normal(std=0.1)}
    assert modules([lw.control.Sensor(of="depth")], varied)[0] is built_in("laws.control", "sensor:depth,bias,dropout")


@pytest.mark.ci
def test_a_filters_step_response():
    # A step of 1 at tick 1: after n periods 1 - exp(-n T / tau), exactly, for readings that are held.
    truth = np.zeros((TICKS, 1, 21))
    truth[..., 3:12] = np.eye(3).reshape(-1)
    truth[1:, :, 12] = 1.0
    numbers = {"slow.time_constant": np.full(MEMBERS, 0.7), "log.bias": np.zeros((MEMBERS, 3))} | VARIED["plain"]
    numbers["log.bias"][1:] = 0.3
    seen = measured(one(chain("plain"), parameters=numbers), truth, H)[:, 0, 12]
    assert np.abs(seen - (1.0 - np.exp(-np.arange(TICKS) * PERIOD / 0.7))).max() < TICKS * EPS["float64"]


@pytest.mark.ci
def test_dead_reckoning_with_a_bias_goes_astray_with_time():
    # Level, heading north: the error is that of the velocity times the time.
    truth = np.zeros((TICKS, 1, 21))
    truth[..., 3:12] = np.eye(3).reshape(-1)
    bias = VARIED["reckoned"]["flow.bias"]
    seen = measured(members_of("reckoned"), truth, H)[..., :3]
    assert np.abs(seen - bias * PERIOD * np.arange(TICKS)[:, None, None]).max() < 1e-13
