# SPDX-License-Identifier: Apache-2.0
"""Cost of parts of navigation per tick, in processor time: REMUS 100 with more and more of them, in turn, on one thread."""

import numpy as np

import lgvi_warp as lw
from benchmarks.cases.controllers.case import H, packets_of, remus, seconds

NOISES = dict(accelerometer_noise=1e-3, gyroscope_noise=1e-4, accelerometer_walk=1e-4, gyroscope_walk=1e-5)
UNIT = lw.control.IMU(place=(0.1, 0.0, 0.0), **NOISES)
LOG = lw.control.DVL(place=(-0.1, 0.0, 0.05), noise=0.01)
CELL = lw.control.Sensor(name="cell", of="depth", noise=0.02)
FIX = lw.control.Sensor(name="gps", of="position", noise=1.0)
USBL = lw.control.Sensor(name="usbl", of="position", noise=1.0, every=2, latency=1)
COMPASS = lw.control.Sensor(name="compass", of="attitude", noise=0.01)
SPEED = lw.control.Sensor(name="log", of="velocity", noise=0.01)


def filtered(*sensors, report=False, **names):
    """Sensors with a filter behind them."""
    return [UNIT, *sensors, lw.control.ErrorStateFilter(report=report, **names)]


# By name: the sensors, beside which scene they are, and how many numbers they read more at a tick.
SCENES = {
    "no sensor": ([], "", 0),
    "imu": ([UNIT], "no sensor", 0),
    "imu, filter": (filtered(), "no sensor", 0),
    "and depth": (filtered(CELL, depth="cell"), "imu, filter", 1),
    "and log": (filtered(LOG, dvl="dvl"), "imu, filter", 4),
    "and fix": (filtered(FIX, fix="gps"), "imu, filter", 3),
    "and delayed fix": (filtered(USBL, delayed_fix="usbl"), "imu, filter", 1.5),
    "log, depth": (filtered(LOG, CELL, dvl="dvl", depth="cell"), "no sensor", 5),
    "log, depth, report": (filtered(LOG, CELL, dvl="dvl", depth="cell", report=True), "log, depth", 0),
    "complementary": (
        [SPEED, COMPASS, CELL, lw.control.ComplementaryFilter(time_constant=5.0), lw.control.DeadReckoning()],
        "no sensor", 0),
}  # fmt: skip
QUICK = ("no sensor", "imu, filter", "and depth")


def run(quick):
    members, steps, rounds = (64, 100, 2) if quick else (512, 500, 9)
    chosen = QUICK if quick else tuple(SCENES)
    for dtype in ("float64",) if quick else ("float64", "float32"):
        each = [packets_of(remus(1, sensors=SCENES[name][0]), "psi_x", dtype, members, steps) for name in chosen]
        times = np.empty((rounds, len(each)))
        for i in range(rounds):
            for j, packets in enumerate(each):
                packets.refill(packets.members)
                times[i, j] = seconds(packets, 0, steps)
        found = dict(zip(chosen, 1e9 * times.min(axis=0) / (members * steps), strict=True))
        for name in chosen:
            _, beside, count = SCENES[name]
            record = {"scene": name, "dtype": dtype, "step_s": H, "ns_a_tick": round(found[name], 1)}
            if beside:
                more = found[name] - found[beside]
                record |= {"beside": beside, "ns_more": round(more, 1)}
                record |= {"ns_a_number": round(more / count, 1)} if count else {}
            yield record
