# SPDX-License-Identifier: Apache-2.0
"""BlueROV2 heavy sails a way on time, circles about a point, and docks: 24 vehicles, each in a current of its own."""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

POINTS = np.array([[0, 0, 5], [40, 0, 5], [40, 30, 8], [0, 30, 8]], dtype=float)  # m
TIMES = [0.0, 60.0, 190.0, 260.0]  # s
DOCK = dict(position=[60.0, 0.0, 5.0], heading=0.0, speed=0.6, contact_speed=0.2, slowing=20.0, look_ahead=3.0, mouth=0.5,
            funnel=0.12, approach=35.0, judged=25.0, offset=6.0, kappa=0.3)  # fmt: skip
STYLES = {"at the first try": ("#0072B2", "-"), "round again": ("#D55E00", "--")}


def scene(guidance, current, north=0.0):
    """The vehicle, pushed ahead and turned as the guidance wants, in a current."""
    none = [0.0, 0.0, 0.0]
    laws = [
        lw.control.SpeedPID(kp=60.0, ki=10.0, drag=60.0, integral_limit=2.0),
        lw.control.HeavePID(kp=60.0, ki=6.0, kd=80.0, integral_limit=10.0),
        # Of the pose its attitude alone: thrust ahead pitches this vehicle.
        lw.control.PosePID(kp=none, kd=none, kr=[15.0] * 3, ki_r=[1.0] * 3, kw=[8.0] * 3, integral_limit=[1.0, 5.0]),
    ]
    controller = lw.Controller(period=0.1, guidance=[guidance], laws=laws)
    start = lw.Start(position=[north, 0.0, 5.0], velocity=[0.3, 0.0, 0.0])
    return lw.Scene.named(
        "bluerov2_heavy", terms=[lw.terms.Current(velocity=current)], start=start, controller=controller
    )


way = lw.control.Waypoints(
    points=POINTS, speed=0.9, times=TIMES, look_ahead=3.0, radius=2.0, method="ilos", kappa=0.2,
    loiter_radius=6.0, loiter_turns=[0, 1.5, 0, 0], at_end="loiter",
)  # fmt: skip
vary = {
    "current.velocity": lw.distributions.Normal(std=[0.08, 0.08, 0.0]),
    "start.position": lw.distributions.Normal(std=[2.0, 4.0, 0.5]),
}
fleet = lw.Ensemble(scene(lw.control.Docking(**DOCK), [0.0, 0.0, 0.0], 38.0), members=24, seed=2, vary=vary)


def contacts(docked):
    """Speed, offset and time (n,) at the dock; the time is infinite where a vehicle did not come into it."""
    speed, offset, time = (
        docked.statistics[f"each dock_contact {of}"].value[0, 0] for of in ("speed", "offset", "time")
    )
    return speed, offset, np.where(np.isfinite(time), time, np.inf)


def ways(docked):
    """Positions (k, n, 3) up to the dock, in which nothing holds a vehicle here; and which members turned back."""
    way = np.where((docked.time[:, None] <= contacts(docked)[2])[..., None], docked.position, np.nan)
    return way, np.nanmin(way[..., 0], axis=0) < way[0, :, 0] - 2.0


def plot(sailed, docked, path):
    """The way from above, the approaches from above, and how the vehicles entered."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 8.0), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=[1.0, 0.9])
    above, approach, entered = (figure.add_subplot(place) for place in (grid[0, 0], grid[1, :], grid[0, 1]))
    above.plot(POINTS[:, 1], POINTS[:, 0], "o:", color="black", label="waypoints")
    above.plot(sailed.position[:, 0, 1], sailed.position[:, 0, 0], color="#0072B2", label="way over ground")
    for (north, east, _), when in zip(POINTS, TIMES, strict=True):
        above.annotate(f"{when:g} s", (east, north), xytext=(6.0, 6.0), textcoords="offset points")
    above.set(
        xlabel="east [m]",
        ylabel="north [m]",
        aspect="equal",
        title="On time, 1.5 turns on the way and a circle at the end",
    )
    above.legend(loc="center")
    way, again = ways(docked)
    speed, offset, _time = contacts(docked)
    for name, members in (("at the first try", ~again), ("round again", again)):
        color, line = STYLES[name]
        approach.plot(way[:, members, 0], way[:, members, 1], line, color=color, linewidth=0.8)
        approach.plot([], [], line, color=color, label=f"{name}: {members.sum()}")
        entered.plot(offset[members], speed[members], "o" if line == "-" else "^", color=color, label=name)
    length = np.array([0.0, DOCK["judged"]])
    room = DOCK["mouth"] + np.tan(DOCK["funnel"]) * length
    for side in (-1.0, 1.0):
        approach.plot(DOCK["position"][0] - length, side * room, color="black", label="funnel" if side > 0.0 else None)
    approach.set(
        xlabel="north [m]", ylabel="east [m]", title=f"{docked.members} vehicles come into the dock at 60 m north"
    )
    approach.set(xlim=(15.0, 62.0), ylim=(-16.0, 16.0))
    approach.legend(loc="upper center", ncols=3)
    entered.axhline(DOCK["contact_speed"], color="black", linestyle=":", label="wanted speed")
    entered.set(xlabel="distance from the centre line [m]", ylabel="speed at the dock [m/s]", title="How they enter it")
    entered.set(xlim=(0.0, DOCK["mouth"]), ylim=(0.0, 0.4))
    entered.legend(loc="lower right")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/loiter_and_dock.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    sailed = lw.solve(scene(way, [0.1, 0.15, 0.0]), "psi_s", h=0.02, t1=400.0, save=lw.SaveAt(every=0.5))
    each = [lw.metrics.DockContact(of, then=[lw.statistics.MemberValues()]) for of in ("speed", "offset", "time")]
    save = lw.SaveAt(every=0.5, fields=("position",))
    docked = lw.solve(fleet, "psi_s", h=0.02, t1=600.0, save=save, statistics=each)
    for point, time in zip(POINTS[1:3], TIMES[1:3], strict=True):
        at = np.array([np.interp(time, sailed.time, sailed.position[:, 0, axis]) for axis in range(2)])
        print(f"at {time:g} s {np.linalg.norm(at - point[:2]):.1f} m from the point")
    speed, offset, _time = contacts(docked)
    print(f"{np.isfinite(speed).sum()} of {docked.members} docked, {ways(docked)[1].sum()} of them went round")
    print(f"at {np.nanmin(speed):.2f} to {np.nanmax(speed):.2f} m/s, at most {np.nanmax(offset):.2f} m off")
    print(plot(sailed, docked, target))
