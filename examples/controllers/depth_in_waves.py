# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 keeps 4 m of depth in head seas: waves at its origin, loads along its hull, a pressure cell."""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

WANTED, MEMBERS = 4.0, 64

waves = lw.terms.Waves(amplitudes=[0.25, 0.2], periods=[4.0, 3.2], headings_deg=[180.0, 170.0])
# Half of the length ahead of the centre of buoyancy is the nose of 0.19 m, half a body that ends in a tail of 0.54 m.
hull = lw.terms.HullLoads(stations=[-0.72, -0.18, 0.42, 0.52, 0.61], diameters=[0.01, 0.191, 0.191, 0.16, 0.0])


def controller(reads):
    """The loop that keeps the depth, by the geometric depth or by the pressure."""
    return lw.Controller(
        period=0.1,  # s between ticks
        sensors=[lw.control.Sensor(name="depth_cell", of="depth", reads=reads, noise=0.02)],  # m
        guidance=[lw.control.SetPoint(depth=WANTED, heading=0.0)],
        laws=[
            lw.control.DepthPID(kp=0.15, ki=0.004, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
    )


def run(*terms, reads="geometry"):
    """Time [s], depth [m], pitch [deg] and what the cell reads [m] of a fleet that differs by the phases of its waves."""
    start = {"position": [0.0, 0.0, WANTED], "velocity": [1.54, 0.0, 0.0]}
    scene = lw.Scene.named("remus_100", terms=[waves, *terms], start=start, controller=controller(reads))
    vary = {"waves.phases": lw.distributions.Uniform(low=0.0, high=2.0 * np.pi)}
    fleet = lw.Ensemble(scene, members=MEMBERS, seed=4, vary=vary)
    save = lw.SaveAt(every=0.1, fields=("position", "attitude", "measured_depth"))
    result = lw.solve(fleet, h=0.02, t1=90.0, save=save)
    pitch = np.degrees(np.arcsin(-result.attitude[:, :, 2, 0]))
    return result.time, result.position[:, :, 2], pitch, result.measured_depth


def plot(runs, path):
    """Depth and pitch of the first vehicle over the last half minute."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for (name, (time, depth, pitch, _)), (color, style) in zip(
        runs.items(), (("#0072B2", "-"), ("#D55E00", "--"), ("#009E73", ":")), strict=True
    ):
        late = time >= 60.0
        for axes, values in ((above, depth), (below, pitch)):
            axes.plot(time[late], values[late, 0], style, color=color, label=name)
    above.set(
        ylabel="depth [m]",
        title="Loads along the hull take a quarter of the pitch, a pressure cell more than half of the rest",
    )
    above.invert_yaxis()
    below.set(xlabel="time [s]", ylabel="pitch [deg]", xlim=(60.0, 90.0))
    for axes in (above, below):
        axes.legend(loc="upper right")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/depth_in_waves.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    runs = {
        "waves at the origin": run(),
        "and along the hull": run(hull),
        "and depth by pressure": run(hull, reads="pressure"),
    }
    for name, (time, depth, pitch, read) in runs.items():
        late = time >= 30.0
        moves = f"depth moves by {depth[late].std():.3f} m, pitch by {pitch[late].std():.2f} deg"
        print(f"{name}: {moves}; the cell reads {read[late].std():.3f} m")
    print(plot(runs, target))
