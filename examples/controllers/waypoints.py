# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 sails from waypoint to waypoint through a current that differs by depth: plain and integral line of sight."""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

POINTS = np.array([[0, 0, 5], [300, 0, 5], [300, 90, 25], [0, 90, 25], [0, 180, 5], [300, 180, 5]], dtype=float)  # m
DEPTHS, EAST = [0.0, 10.0, 30.0], [0.7, 0.5, 0.1]  # m, m/s of the current
STYLES = {"los": ("plain line of sight", "#D55E00", "--"), "ilos": ("integral line of sight", "#0072B2", "-")}


def scene(method):
    """The vehicle at its first waypoint, in a current towards the east."""
    way = lw.control.Waypoints(points=POINTS, speed=1.54, look_ahead=20.0, radius=12.0, method=method, kappa=0.8)
    controller = lw.Controller(
        period=0.1,  # s between ticks
        guidance=[way],
        laws=[
            lw.control.DepthPID(kp=0.15, ki=0.002, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        # The gains are radians of a fin for each radian of error: rows rudder and stern planes, columns X Y Z K M N.
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
    )
    current = lw.terms.CurrentProfile(depths=DEPTHS, velocities=[[0.0, east, 0.0] for east in EAST])
    start = lw.Start(position=POINTS[0], velocity=[1.54, 0.6, 0.0])
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 300.0}, terms=[current], start=start, controller=controller)


def off_track(result):
    """Horizontal distance (k,) [m] to the nearest leg."""
    begin, leg = POINTS[:-1, :2], np.diff(POINTS[:, :2], axis=0)
    from_begin = result.position[:, :1, :2] - begin
    share = np.clip(np.sum(from_begin * leg, axis=2) / np.sum(leg * leg, axis=1), 0.0, 1.0)
    return np.linalg.norm(from_begin - share[:, :, None] * leg, axis=2).min(axis=1)


def plot(runs, path):
    """Paths from above, distance to the legs and depth over time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    grid = figure.add_gridspec(2, 2)
    above, off, depth = (figure.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1]))
    above.plot(POINTS[:, 1], POINTS[:, 0], "o:", color="black", label="waypoints")
    for method, result in runs.items():
        name, color, style = STYLES[method]
        above.plot(result.position[:, 0, 1], result.position[:, 0, 0], style, color=color, label=name)
        off.plot(result.time, off_track(result), style, color=color, label=name)
        depth.plot(result.time, result.position[:, 0, 2], style, color=color, label=name)
    for _, east, deep in POINTS[::2]:
        speed = np.interp(deep, DEPTHS, EAST)
        above.arrow(east + 12.0, 130.0, 60.0 * speed, 0.0, head_width=6.0, color="#009E73")
        above.text(east + 14.0, 138.0, f"{deep:g} m deep:\n{speed:g} m/s", color="#009E73")
    above.set(xlabel="east [m]", ylabel="north [m]", aspect="equal", xlim=(-20.0, 260.0), ylim=(-20.0, 390.0))
    above.set_title("Paths from above, and the current")
    off.set(
        ylabel="distance to the legs [m]",
        ylim=(0.0, 12.0),
        title="The integral brings the vehicle back to each long leg",
    )
    depth.set(xlabel="time [s]", ylabel="depth [m]", ylim=(28.0, 2.0), title="Two crossings change the depth")
    above.legend(loc="upper left")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/waypoints.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    save = lw.SaveAt(every=0.5, fields=("position", "command", "actuator", "unmet"))
    runs = {method: lw.solve(scene(method), h=0.02, t1=680.0, save=save) for method in STYLES}
    for method, result in runs.items():
        off = off_track(result)
        print(f"{STYLES[method][0]}: {off.mean():.1f} m off the legs on average, at most {off.max():.1f} m")
    print(plot(runs, target))
