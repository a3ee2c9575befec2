# SPDX-License-Identifier: Apache-2.0
"""BlueROV2 heavy holds its place in a current; a thruster dies. Does it help that the allocation knows?"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

DEAD, DIES = 0, 20.0  # channel of the thruster, s
PLACE = (0.0, 0.0, 5.0)  # m
AXES = {"north": ("#0072B2", "-"), "east": ("#D55E00", "--"), "down": ("#009E73", "-.")}
TURNS = {"heading": ("#000000", "-"), "pitch": ("#E69F00", "--"), "roll": ("#CC79A7", "-.")}
SIDES = ("ahead right, dies", "ahead left", "astern right", "astern left")
THRUSTS = dict(zip(SIDES, (("#000000", "-"), ("#0072B2", "--"), ("#D55E00", "-."), ("#009E73", ":")), strict=True))
LABELS = ("off its place [cm]", "turned by [deg]", "thrust [N]")


def scene(known):
    """The vehicle, the current and the controller; `known`: whether the allocation leaves out the thruster that died."""
    # N/m, N/(m s), N s/m; N m, N m s
    gains = {"kp": [80.0] * 3, "ki": [15.0] * 3, "kd": [80.0, 80.0, 100.0], "kr": [10.0] * 3, "kw": [4.0] * 3}
    controller = lw.Controller(
        period=0.05,  # s between ticks
        guidance=[lw.control.SetPoint(position=PLACE, heading=0.0)],
        laws=[lw.control.PosePID(**gains, feedforward="restoring")],
        allocation=[lw.control.PseudoInverse(to="thrusters")],
        faults=[lw.control.Fault(of="thrusters", channel=DEAD, time=DIES, gain=0.0, known=known)],
    )
    current = lw.terms.Current(velocity=[-0.3, 0.15, 0.0])
    start = lw.Start(position=PLACE)
    return lw.Scene.named("bluerov2_heavy", terms=[current], start=start, controller=controller)


def turns(result):
    """Heading, pitch and roll (k, 3) [deg]."""
    R = result.attitude[:, 0]
    heading, roll = np.arctan2(R[:, 1, 0], R[:, 0, 0]), np.arctan2(R[:, 2, 1], R[:, 2, 2])
    return np.degrees(np.stack([heading, np.arcsin(-R[:, 2, 0]), roll], axis=1))


def plot(runs, path):
    """Position error, turns and thrusts over time; one column for each run."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    figure.suptitle("BlueROV2 in a current of 0.34 m/s; at 20 s the thruster ahead right dies")
    grid, first = figure.subplots(3, 2, sharex=True, sharey="row"), next(iter(runs))
    for column, (title, result) in zip(grid.T, runs.items(), strict=True):
        (thrusters,) = (term for term in scene(False).terms if isinstance(term, lw.terms.Thrusters))
        thrusts = thrusters.thrust(result.actuator[:, 0])[:, :4]
        values = (100.0 * (result.position[:, 0] - PLACE), turns(result), thrusts)
        for axes, styles, lines, label in zip(column, (AXES, TURNS, THRUSTS), values, LABELS, strict=True):
            for (name, (color, style)), line in zip(styles.items(), lines.T, strict=True):
                axes.plot(result.time, line, style, color=color, label=name)
            axes.axvline(DIES, color="#999999", linewidth=0.8)
            axes.set(ylabel=label if title is first else None, xlim=(0.0, result.time[-1]))
        column[0].set_title(title)
        column[-1].set_xlabel("time [s]")
    for axes in grid[:, 1]:
        axes.legend(loc="upper right", fontsize="small", ncols=2)
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/dead_thruster.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    save = lw.SaveAt(every=0.1, fields=("position", "attitude", "command", "actuator", "unmet"))
    titles = {"Not known: pushed off its place and turned": False, "Known: the other thrusters take over": True}
    runs = {title: lw.solve(scene(known), h=0.01, t1=50.0, save=save) for title, known in titles.items()}
    for title, result in runs.items():
        off = 100.0 * np.linalg.norm(result.position[-1, 0] - PLACE)
        print(f"{title}: in the end {off:.1f} cm off, heading {turns(result)[-1, 0]:.1f} deg off")
    print(plot(runs, target))
