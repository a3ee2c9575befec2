# SPDX-License-Identifier: Apache-2.0
"""The sea of a forecast in 20 m of water: its spectrum, the surface of three members, and the motion of the water below."""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

HS, TP, FROM_DEG, SPREAD_DEG = 1.2, 6.5, 250.0, 30.0
DEPTHS = (2.0, 10.0, 19.0)

sea = lw.terms.SeaState(
    significant_height=HS,
    peak_period=TP,
    heading_deg=FROM_DEG + 180.0,
    spreading=2.0 / np.radians(SPREAD_DEG) ** 2 - 1.0,
)
scene = lw.Scene.named(
    "remus_100", terms=[sea], start={"position": [0.0, 0.0, 10.0]}, events=[lw.events.Floor(depth=20.0)]
)
sea = scene.terms[-1]


def waves(members, time):
    """Surface (k, n) [m] at one place, and speed of the water (depths, k, n) [m/s] below it, of so many members."""
    p = lw.Ensemble(scene, members, seed=1).parameters(0, members)
    numbers = {key.removeprefix("sea_state."): value for key, value in p.items() if key.startswith("sea_state.")}
    places = [np.broadcast_to([0.0, 0.0, z], (len(time), members, 3)) for z in (0.0, *DEPTHS)]
    speeds = [np.linalg.norm(sea.water(numbers, place, time, p), axis=-1) for place in places[1:]]
    return sea.elevation(numbers, places[0], time, p), np.array(speeds)


def plot(path):
    """Spectrum beside its sum, and the water below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    f = np.linspace(0.05, 0.5, 400)
    left.plot(f, sea.density(f), color="#0072B2")
    left.axvline(1.0 / TP, color="0.6", linestyle="--", label="1 / Tp")
    left.set(xlabel="frequency [Hz]", ylabel="density [m$^2$/Hz]", title="JONSWAP spectrum")
    left.legend()
    time = np.linspace(0.0, 60.0, 601)
    surface, speeds = waves(3, time)
    for member, color in enumerate(("#0072B2", "#D55E00", "#009E73")):
        middle.plot(time, surface[:, member], color=color, label=f"member {member}")
    middle.set(xlabel="time [s]", ylabel="surface [m]", title=f"Hs {HS:g} m, Tp {TP:g} s")
    middle.legend(loc="lower right")
    for depth, speed, color in zip(DEPTHS, speeds, ("#0072B2", "#D55E00", "#009E73"), strict=True):
        right.plot(time, speed[:, 0], color=color, label=f"at {depth:g} m")
    right.set(xlabel="time [s]", ylabel="speed of the water [m/s]", title="member 0, in 20 m of water")
    right.legend(loc="upper right")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/forecast_sea.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    surface, speeds = waves(2000, np.linspace(0.0, 60.0, 61))
    print(f"4 standard deviations of the surface of 2,000 members: {4.0 * surface.std():.2f} m")
    rms = [f"{np.sqrt(np.mean(speed**2)):.2f} m/s at {depth:g} m" for depth, speed in zip(DEPTHS, speeds, strict=True)]
    print(f"the water moves by {', '.join(rms)} (root mean square)")
    print(plot(target))
