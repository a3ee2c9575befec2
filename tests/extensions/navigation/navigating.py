# SPDX-License-Identifier: Apache-2.0
"""A smooth voyage, the sensors and the filter of tests of navigation, and their twins."""

import numpy as np

import lgvi_warp as lw
from lgvi_warp.extensions.navigation.twin import dvl as twin_dvl
from lgvi_warp.extensions.navigation.twin import error_state_filter as twin_filter
from lgvi_warp.extensions.navigation.twin import imu as twin_imu
from lgvi_warp.physics.terms.noisy import channel, normals_at_start
from lgvi_warp.reference.control import Measurement
from lgvi_warp.reference.control.readings import attitude
from lgvi_warp.reference.control.sensor import Sensor
from lgvi_warp.reference.rotation import vee

PERIOD = 0.1
GRAVITY = 9.8
NOISES = dict(
    accelerometer_noise=1e-3, gyroscope_noise=1e-4, accelerometer_walk=1e-4, gyroscope_walk=1e-5,
    accelerometer_turn_on=0.02, gyroscope_turn_on=1e-3,
)  # fmt: skip
UNIT = dict(place=(0.3, 0.0, -0.1), **NOISES)
LOG = dict(place=(-0.4, 0.0, 0.2), noise=0.01, every=2, dropout=0.1)
# Sensors of the filter by their role there.
AIDS = {
    "depth": dict(name="cell", of="depth", noise=0.02),
    "heading": dict(name="compass", of="heading", noise=0.02, every=5),
    "fix": dict(name="gps", of="position", noise=1.0, deepest=9.0, every=10),
    "delayed_fix": dict(name="usbl", of="position", noise=0.5, every=50, latency=20),
}


def angles_at(t):
    return 0.1 * np.sin(0.3 * t), 0.15 * np.sin(0.13 * t + 1.0), 0.05 * t + 0.3 * np.sin(0.2 * t)


def place_at(t):
    return np.array([10.0 * np.sin(0.1 * t), 8.0 * np.cos(0.12 * t), 10.0 + 2.0 * np.sin(0.1 * t)])


def voyage(ticks, period=PERIOD, d=1e-4):
    """The motion (ticks, 1, 21) as tests.control.bench has it; velocities by central differences of places and attitudes."""
    rows = np.zeros((ticks, 1, 21))
    for k in range(ticks):
        t = k * period
        R = attitude(*angles_at(t))
        slope = (place_at(t + d) - place_at(t - d)) / (2.0 * d)
        skew = R.T @ (attitude(*angles_at(t + d)) - attitude(*angles_at(t - d))) / (2.0 * d)
        v, rate = R.T @ slope, vee(0.5 * (skew - skew.T))
        rows[k, 0] = np.concatenate([place_at(t), R.reshape(-1), v, v, rate])
    return rows


def parts(aids=tuple(AIDS), log=True, unit=UNIT, log_numbers=LOG, **filter_numbers):
    """Sensors, and the filter behind them."""
    sensors = [lw.control.IMU(**unit)]
    sensors += [lw.control.DVL(**log_numbers)] if log else []
    sensors += [lw.control.Sensor(**AIDS[role]) for role in aids]
    names = {role: AIDS[role]["name"] for role in aids} | ({"dvl": "dvl"} if log else {})
    return [*sensors, lw.control.ErrorStateFilter(**names, **filter_numbers)]


def twins(listed, member, seed=0, gravity=GRAVITY):
    """The twins of sensors and filter, of one member; of sensors alone where the last is no filter."""
    filtered, each = isinstance(listed[-1], lw.control.ErrorStateFilter), []
    handed = {} if filtered else None
    for part in listed[:-1] if filtered else listed:
        numbers = {name: getattr(part, name) for name in part.parameters()}
        key = dict(key=part.key, handed=handed, seed0=seed)
        if isinstance(part, lw.control.IMU):
            starts = {
                f"{kind}_start": numbers[f"{kind}_turn_on"]
                * normals_at_start(seed, f"{part.key}.{kind}", np.array([member]))[0]
                for kind in ("accelerometer", "gyroscope")
            }
            channels = {f"channel_{kind}": channel(f"{part.key}.{kind}") for kind in ("accelerometer", "gyroscope")}
            each.append(twin_imu.IMU(**numbers, **key, **starts, **channels, gravity=gravity))
        elif isinstance(part, lw.control.DVL):
            each.append(twin_dvl.DVL(**numbers, **key, channel=channel(part.key)))
        else:
            each.append(Sensor(**numbers, **key, of=part.of, channel=channel(part.key)))
    return [*each, twin_of_filter(listed, handed, member, seed, gravity)] if filtered else each


def twin_of_filter(listed, handed, member, seed, gravity):
    design, by_key = listed[-1], {part.key: part for part in listed}
    numbers = {name: getattr(design, name) for name in design.parameters()}
    unit = by_key[design.imu]
    believed = {name: getattr(unit, name) for name in NOISES if not name.endswith("turn_on")}
    believed |= {role: by_key[key].noise for role, key in design.uses.items() if role != "imu"}
    errors = [
        normals_at_start(seed, f"{design.key}.{name}", np.array([member]))[0]
        for name in ("position", "velocity", "attitude")
    ]
    log = by_key.get(design.dvl, lw.control.DVL())
    latency = int(by_key[design.delayed_fix].latency) if design.delayed_fix else 0
    copies = 1 + latency // int(by_key[design.delayed_fix].every) if design.delayed_fix else 1
    places = {
        f"{role}_place": by_key[key].place
        for role, key in design.uses.items()
        if getattr(by_key[key], "place", None) is not None and role in ("fix", "delayed_fix", "depth")
    }
    return twin_filter.ErrorStateFilter(
        **numbers, **dict(design.uses), handed=handed, believed=believed, place=unit.place, dvl_place=log.place,
        dvl_angle=float(log.angle), gravity=gravity, latency=latency, copies=copies, errors=np.concatenate(errors), **places,
    )  # fmt: skip


def through(item, truth, member=0, h=0.02, period=PERIOD, then=lambda k: None):
    """Effect of one member's twins on a motion (ticks, 1 or n, 21): (ticks, 21); then: called after each tick."""
    for part in item:
        part.begin()
    seen, every = np.zeros((len(truth), 21)), round(period / h)
    for k, row in enumerate(truth):
        row = row[min(member, len(row) - 1)]
        vectors = row[:3], row[3:12].reshape(3, 3), row[12:15], row[15:18], row[18:21]
        y = Measurement(*vectors, t=k * period, period=period, h=h, step=every * k, tick=k, member=member)
        for part in item:
            y = part.measure(y)
        seen[k] = np.concatenate([y.position, y.R.reshape(-1), y.velocity, y.water_velocity, y.angular_velocity])
        then(k)
    return seen


def run_twins(listed, truth, member, seed=0, **how):
    """(measurements (ticks, 21), of a filter (ticks, 3): NEES, NIS and how many) of one member."""
    each, belief = twins(listed, member, seed), np.zeros((len(truth), 3))

    def note(k):
        if isinstance(listed[-1], lw.control.ErrorStateFilter):
            belief[k] = each[-1].nees, each[-1].nis, each[-1].nis_count

    return through(each, truth, member, then=note, **how), belief


# Sensors of a REMUS 100 that are near to one another; the first estimates are good enough for a linear filter.
ON_BOARD = dict(
    unit=UNIT | {"place": (0.1, 0.0, 0.0)}, log_numbers=dict(place=(-0.1, 0.0, 0.05), noise=0.01, every=2, dropout=0.05),
    velocity_sigma=0.02, attitude_sigma=(0.002, 0.002, 0.005),
)  # fmt: skip
BELIEFS = ("nees", "nis", "nis_count", "estimate_sigma", "estimate_bias", "innovation", "innovation_sigma")


def remus(listed):
    """REMUS 100 goes to 5 m and turns to 0.5 rad, by what its filter believes."""
    fins = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])
    depth = lw.control.DepthPID(kp=0.15, ki=0.002, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5)
    controller = lw.Controller(
        period=PERIOD, sensors=listed, guidance=[lw.control.SetPoint(depth=5.0, heading=0.5)],
        laws=[depth, lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)], allocation=[fins],
    )  # fmt: skip
    start = {"velocity": [1.54, 0.0, 0.0], "position": [0.0, 0.0, 3.0]}
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start=start, controller=controller)
