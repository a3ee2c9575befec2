"""Sensors, estimators and faults of sensors: the device against twins, against what is known, and alone in their lanes."""

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

MEMBERS, LOOKS, PERIOD, H = 6, 60, 0.1, 0.02
EPS = {"float64": 2.0**-52, "float32": 2.0**-23}

# The chains: every part in two of them, so that few kernels are compiled.
SENSORS = {
    "all": [
        dict(name="cell", of="depth", noise=0.02, bias=0.01, drift=0.03, quantum=0.005, every=2, latency=3, dropout=0.3),
        dict(name="ahrs", of="attitude", noise=0.02, bias=(0.01, 0.0, -0.02), drift=0.01, latency=2),
        dict(name="compass", of="heading", noise=0.05, quantum=0.1, drift=0.02, every=3),
        dict(name="log", of="velocity", noise=(0.1, 0.0, 0.2), dropout=0.4),
        dict(name="flow", of="water_velocity", quantum=(0.1, 0.0, 0.2), bias=0.1),
        dict(name="gyro", of="angular_velocity", noise=0.01, bias=0.02, drift=0.03),
        dict(name="fix", of="position", noise=0.5, every=4, dropout=0.5),
    ],
    "plain": [
        dict(name="cell", of="depth", noise=0.02),
        dict(name="ahrs", of="attitude", quantum=(0.1, 0.0, 0.2)),
        dict(name="log", of="velocity", bias=0.3),
        dict(name="fix", of="position"),
    ],
}
FAULTS = {
    "all": [
        dict(name="weak", of="log", channel=1, time=2.0, gain=0.5, offset=0.1),
        dict(name="lost", of="compass", time=3.0, offset=-1.0),
        dict(name="tilted", of="ahrs", channel=1, time=1.0, gain=1.0, offset=0.2),
    ],
    "plain": [dict(of="cell", time=1.55)],
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
        ("DeadReckoning", dict(rule="euler", velocity="water_velocity")),
    ],
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
    "plain": {"cell.noise": 0.01 * np.arange(MEMBERS), "calm.time_constant": np.array([0.0, 0.1, 0.3, 1.0, 2.0, 50.0])},
}


def motion(looks=LOOKS, members=MEMBERS, period=PERIOD):
    """Turns and turns about of each member, (looks, members, FIELDS): the heading goes round, roll and pitch swing."""
    rng = np.random.default_rng(3)
    t = period * np.arange(looks)
    rows = np.zeros((looks, members, 21))
    for m in range(members):
        a = rng.normal(size=12)
        for k in range(looks):
            rates = np.array([0.3 * np.sin(t[k] + a[0]), 0.2 * np.cos(1.3 * t[k] + a[1]), 1.5 + 0.3 * a[2]])
            turn = exp(np.array([0.0, 0.0, 1.5 * t[k] + a[5]])) @ exp(0.5 * np.array([np.sin(t[k] + a[3]), np.cos(t[k]), 0.0]))
            position = np.array([3.0 * t[k], a[6] * t[k], 10.0 + a[7] * np.sin(t[k])])
            velocity = np.array([1.5 + a[8] * np.sin(t[k]), 0.3 * np.cos(2.0 * t[k]), 0.1 * a[9]])
            rows[k, m] = np.concatenate([position, turn.reshape(-1), velocity, velocity - 0.2, rates])
    return rows


def of_members(scene, n, parameters):
    """An ensemble of members with numbers of their own, whose seed is 0."""
    rest, upright = np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1))
    return lw.Ensemble.from_states(scene, rest, upright, rest, rest, parameters)


def chain(case):
    parts = [lw.Sensor(**numbers) for numbers in SENSORS[case]]
    parts += [getattr(lw, kind)(**numbers) for kind, numbers in ESTIMATORS[case]]
    return scene(parts, [lw.Fault(**numbers) for numbers in FAULTS[case]], PERIOD)


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
    """What the twin measures, (looks, members, FIELDS)."""
    seen = np.zeros_like(truth)
    for m in range(truth.shape[1]):
        parts = twins(case, m)
        for part in parts:
            part.begin()
        for k, row in enumerate(truth[:, m]):
            vectors = row[:3], row[3:12].reshape(3, 3), row[12:15], row[15:18], row[18:21]
            y = Measurement(*vectors, t=k * 5 * H, period=PERIOD, h=H, step=5 * k, look=k, member=m)
            for part in parts:
                y = part.measure(y)
            numbers = y.position, y.R.reshape(-1), y.velocity, y.water_velocity, y.angular_velocity
            seen[k, m] = np.concatenate(numbers)
    return seen


def members_of(case):
    return of_members(chain(case), MEMBERS, VARIED[case])


@pytest.mark.slow_for("all-float32", "plain-float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", ["all", "plain"])
def test_what_is_measured_is_the_twins(case, dtype):
    truth = motion()
    seen, wanted = measured(members_of(case), truth, H, dtype), of_twin(case, truth)
    # Some ten operations a look on numbers up to 40; estimators add those of all looks up.
    assert np.abs(seen - wanted).max() < 10 * LOOKS * 40 * EPS[dtype]
