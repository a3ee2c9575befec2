# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 sails 600 m by its own navigation: the loop keeps the line that it believes in, and leaves the true one."""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

LENGTH, SPEED, DEPTH = 600.0, 1.54, 5.0  # m, m/s, m
DURATION = 380.0  # s
CASES = {
    "all sensors": {},
    "log silent from 300 s": {"dvl.silent_from": 300.0},
    "compass 2 degrees off": {"compass.bias": np.radians(2.0)},
}
COLORS = ["#0072B2", "#D55E00", "#009E73"]
LIMIT = 10.0  # m off the line


def scene():
    """The vehicle at the begin of its line, with an IMU of the better MEMS kind, a log, a depth cell and a compass."""
    sensors = [
        lw.control.IMU(
            place=(0.2, 0.0, 0.0),
            accelerometer_noise=5e-4,
            gyroscope_noise=5e-5,
            accelerometer_walk=1e-5,
            gyroscope_walk=1e-6,
            accelerometer_turn_on=5e-3,
            gyroscope_turn_on=5e-5,
        ),
        lw.control.DVL(noise=0.01, every=2),
        lw.control.Sensor(name="depth_cell", of="depth", noise=0.02),
        lw.control.Sensor(name="compass", of="heading", noise=0.02, every=10),
        lw.control.ErrorStateFilter(
            dvl="dvl",
            depth="depth_cell",
            heading="compass",
            position_sigma=0.5,
            velocity_sigma=0.02,
            attitude_sigma=0.005,
            accelerometer_sigma=5e-3,
            gyroscope_sigma=5e-5,
        ),
    ]
    line = np.array([[0.0, 0.0, DEPTH], [LENGTH, 0.0, DEPTH]])
    controller = lw.Controller(
        period=0.1,  # s between ticks
        sensors=sensors,
        guidance=[lw.control.Waypoints(points=line, speed=SPEED, look_ahead=15.0, radius=5.0)],
        laws=[
            lw.control.DepthPID(kp=0.15, ki=0.002, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        # The gains are radians of a fin for each radian of error: rows rudder and stern planes, columns X Y Z K M N.
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
    )
    start = lw.Start(position=line[0], velocity=[SPEED, 0.0, 0.0])
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 300.0}, start=start, controller=controller)


def compared(members):
    """Distance of members from the true line, and from the estimated one, in each case."""
    off = [lw.metrics.CrossTrack(), lw.metrics.CrossTrack(measured=True, name="cross_track believed")]
    return lw.sweep(
        scene(), CASES, members=members, seed=1, metrics=off, success={"cross_track": {"below": LIMIT}},
        method="psi_x", h=0.05, t1=DURATION, threads=1,
    )  # fmt: skip


def sailed(members):
    """Runs of the cases, with what the filters believe."""
    fields = ("position", "measured_position", "estimate_sigma", "nees", "nis", "nis_count")
    save = lw.SaveAt(every=10.0, fields=fields)
    how = dict(method="psi_x", h=0.05, t1=DURATION, save=save, threads=1)
    for name, numbers in CASES.items():
        yield name, lw.solve(lw.Ensemble(scene().with_numbers(numbers), members, seed=1), **how)


def plot(runs, path):
    """By time: distance to the true line, to the line as believed, and NEES; 90 % of the members."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    panels = figure.subplots(1, 3)
    for (name, run), color in zip(runs, COLORS, strict=True):
        for panel, places in zip(panels, (run.measured_position, run.position), strict=False):
            low, high = np.quantile(places[..., 1], (0.05, 0.95), axis=1)
            panel.fill_between(run.time, low, high, color=color, alpha=0.35, label=name)
            panel.plot(run.time, np.stack([low, high], axis=1), color=color, linewidth=0.8)
        sigma = run.estimate_sigma[:, 0, 1]
        panels[1].plot(run.time, 1.645 * sigma, ":", color=color)
        panels[1].plot(run.time, -1.645 * sigma, ":", color=color)
        judged = lw.metrics.consistency(run)
        panels[2].semilogy(run.time, judged.nees, color=color, label=name)
    panels[2].fill_between(run.time, *judged.nees_band.T, color="black", alpha=0.3)
    panels[2].set_yticks([15, 50, 100, 500], ["15", "50", "100", "500"])
    panels[2].minorticks_off()
    panels[0].set(title="Off the line, as the loop believes", xlabel="time [s]", ylabel="to starboard of the line [m]")
    panels[1].set(title="Off the true line; dotted: 90 % by the filter", xlabel="time [s]")
    panels[2].set(title="NEES (grey: 95 % band of a right filter)", xlabel="time [s]")
    for panel in panels[:2]:
        panel.set_ylim(-30.0, 30.0)
    panels[0].legend(loc="upper left")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/lost_bottom.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    members = int(sys.argv[2]) if len(sys.argv) > 2 else 400
    sweep = compared(members)
    for name in sweep.cases:
        cell = sweep.cell(name)
        truth, belief = (sweep.record(cell).numbers[off].mean() for off in sweep.metrics[:2])
        passing = 100.0 * sweep.passed(cell).mean()
        off = f"at most {truth:.1f} m off the true line on average, {belief:.1f} m off the believed one"
        print(f"{name}: {off}; {passing:.0f} % stay")
    print(plot(list(sailed(members)), target))
