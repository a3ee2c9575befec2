# SPDX-License-Identifier: Apache-2.0
"""BlueROV2 heavy comes back to its place against a current. What do its thrusters give up when they cannot do all?"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

PLACE = (0.0, 0.0, 5.0)  # m
COLUMNS = {"from its place [m]": "off", "tilt [deg]": "tilt", "heading [deg]": "heading"}
STYLES = (("#000000", ":"), ("#D55E00", "--"), ("#0072B2", "-"))
ALLOCATIONS = {
    "pseudo-inverse, cut off": lw.control.PseudoInverse(to="thrusters"),
    "least squares within limits": lw.control.BoundedLeastSquares(to="thrusters"),
    "the same, moments before forces": lw.control.BoundedLeastSquares(to="thrusters", priorities=[1, 1, 1, 10, 10, 10]),
}


def scene(allocation):
    """The vehicle 3.7 m off its place and turned by 40 degrees, in a current of 0.47 m/s."""
    # N/m, N/(m s), N s/m; N m, N m s
    gains = {"kp": [80.0] * 3, "ki": [15.0] * 3, "kd": [80.0, 80.0, 100.0], "kr": [20.0] * 3, "kw": [8.0] * 3}
    controller = lw.Controller(
        period=0.05,  # s between ticks
        guidance=[lw.control.SetPoint(position=PLACE, heading=0.0)],
        laws=[lw.control.PosePID(**gains, feedforward="restoring")],
        allocation=[allocation],
    )
    current = lw.terms.Current(velocity=[-0.4, 0.24, 0.0])
    start = lw.Start(position=[-3.0, 2.0, 4.0], euler_deg=[0.0, 0.0, 40.0])
    return lw.Scene.named("bluerov2_heavy", terms=[current], start=start, controller=controller)


def seen(result):
    """Distance from the place (k,) [m], tilt of the vertical axis and heading (k,) [deg]."""
    R = result.attitude[:, 0]
    return {
        "off": np.linalg.norm(result.position[:, 0] - PLACE, axis=1),
        "tilt": np.degrees(np.arccos(np.clip(R[:, 2, 2], -1.0, 1.0))),
        "heading": np.degrees(np.arctan2(R[:, 1, 0], R[:, 0, 0])),
    }


def plot(runs, path):
    """Distance, tilt and heading over time, a line for each allocation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 7.5), layout="constrained")
    figure.suptitle("BlueROV2 comes back against 0.47 m/s: its thrusters cannot do all at once")
    rows = figure.subplots(3, 1, sharex=True)
    for (name, result), (color, style) in zip(runs.items(), STYLES, strict=True):
        numbers = seen(result)
        for axes, key in zip(rows, COLUMNS.values(), strict=True):
            axes.plot(result.time, numbers[key], style, color=color, label=name, linewidth=1.8)
    for axes, label in zip(rows, COLUMNS, strict=True):
        axes.set(ylabel=label, xlim=(0.0, result.time[-1]))
        axes.grid(alpha=0.3)
    rows[0].legend(loc="upper right")
    rows[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/saturated_thrusters.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    save = lw.SaveAt(every=0.1, fields=("position", "attitude", "command"))
    runs = {name: lw.solve(scene(one), "rk4", h=0.01, t1=20.0, save=save) for name, one in ALLOCATIONS.items()}
    for name, result in runs.items():
        numbers = seen(result)
        print(f"{name}: tilts by {numbers['tilt'].max():.0f} deg, {100.0 * numbers['off'][-1]:.1f} cm off in the end")
    print(plot(runs, target))
