# SPDX-License-Identifier: Apache-2.0
"""A Slocum glider dives, spirals and climbs: a pump makes it heavy or light, its battery pitches it and banks it.

    python examples/laws/glider_by_its_battery.py

The battery of 9 kg slides along the hull and turns about its axis. What the pump and the computers use is accounted.
"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

# From when on [s]: a dive straight ahead, a spiral downward, a climb straight ahead.
STRAIGHT, SPIRAL, CLIMB, END = 0.0, 300.0, 900.0, 1500.0
COLORS = {"dive": "#0072B2", "spiral": "#D55E00", "climb": "#009E73"}
BELOW, AHEAD, TURNED = 0.05, 0.025, np.deg2rad(20.0)  # m, m, rad

banked = [AHEAD, -BELOW * np.sin(TURNED), BELOW * np.cos(TURNED)]
# It moves within 20 s.
battery = lw.terms.MovingMass(
    mass=9.0,
    reference=[0.0, 0.0, BELOW],
    times=[STRAIGHT, SPIRAL, SPIRAL + 20.0, CLIMB, CLIMB + 20.0],
    places=[[AHEAD, 0.0, BELOW], [AHEAD, 0.0, BELOW], banked, banked, [-AHEAD, 0.0, BELOW]],
)
pump = lw.terms.Ballast(
    times=[STRAIGHT, CLIMB - 1.0, CLIMB],
    command_schedule=[[-2.5e-4], [-2.5e-4], [2.5e-4]],
    rate_limit=1e-5,  # m3/s: it works for 50 s
    efficiency=0.4,
)
scene = lw.Scene.named(
    "slocum",
    terms=[battery, pump, lw.terms.EnergyUse(hotel=0.5)],
    start={"position": [0.0, 0.0, 10.0], "euler_deg": [0.0, -20.0, 0.0], "velocity": [0.3, 0.0, 0.0]},
)


def plot(result, path):
    """Path from above, depth, pitch and roll, and energy over time."""
    from matplotlib.figure import Figure

    time, (north, east, depth), R = result.time, result.position[:, 0].T, result.attitude[:, 0]
    figure = Figure(figsize=(10.0, 6.5), layout="constrained")
    axes = figure.subplot_mosaic([["plan", "depth"], ["plan", "angles"], ["plan", "energy"]], width_ratios=(1.0, 1.2))
    for (name, color), begun, ended in zip(
        COLORS.items(), (STRAIGHT, SPIRAL, CLIMB), (SPIRAL, CLIMB, END), strict=True
    ):
        part = (time >= begun) & (time <= ended)
        axes["plan"].plot(east[part], north[part], color=color, label=name)
        axes["depth"].plot(time[part] / 60.0, depth[part], color=color)
    axes["plan"].plot(east[0], north[0], "ko", markersize=4.0)
    axes["plan"].annotate("start", (east[0], north[0]), textcoords="offset points", xytext=(6, 0))
    axes["plan"].set(xlabel="east [m]", ylabel="north [m]", aspect="equal", title="from above")
    axes["plan"].legend()
    axes["depth"].invert_yaxis()
    axes["depth"].set(ylabel="depth [m]", title="A pump and a battery that moves steer a glider")
    pitch, roll = -np.arcsin(R[:, 2, 0]), np.arctan2(R[:, 2, 1], R[:, 2, 2])
    axes["angles"].plot(time / 60.0, np.rad2deg(pitch), color="0.2", label="pitch")
    axes["angles"].plot(time / 60.0, np.rad2deg(roll), "--", color="0.5", label="roll")
    axes["angles"].set(ylabel="angle [deg]")
    axes["angles"].legend()
    axes["energy"].plot(time / 60.0, result.energy_used[:, 0] / 1e3, color="0.2")
    axes["energy"].set(xlabel="time [min]", ylabel="energy used [kJ]")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/glider_by_its_battery.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    save = lw.SaveAt(every=1.0, fields=("position", "attitude", "angular_velocity", "energy_used"))
    result = lw.solve(scene, "rk4", h=0.1, t1=END, save=save)
    late = int(np.searchsorted(result.time, CLIMB - 50.0))
    turn = result.attitude[late, 0, 2] @ result.angular_velocity[late, 0]
    roll = np.arctan2(result.attitude[late, 0, 2, 1], result.attitude[late, 0, 2, 2])
    used = result.energy_used[:, 0]
    print(f"spiral: roll {np.rad2deg(roll):.2f} deg, {360.0 / np.rad2deg(abs(turn)) / 60.0:.1f} min a turn")
    deepest, pumped = result.position[:, 0, 2].max(), used[-1] - 0.5 * END
    print(f"deepest {deepest:.1f} m; {used[-1]:.0f} J used, {pumped:.0f} J of them by the pump")
    print(plot(result, target))
