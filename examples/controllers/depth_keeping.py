# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 keeps its depth under waves although nobody knows its ballast: 500 vehicles between neutral and 9 N light."""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

WANTED, LIMIT = 10.0, 20.0  # m, deg of a fin
GROUPS = {"the least buoyant fifth": ("#0072B2", "-"), "the most buoyant fifth": ("#D55E00", "--")}

waves = lw.terms.Waves(amplitudes=[0.75, 0.45, 0.3], periods=[9.0, 7.0, 5.5], headings_deg=[180.0, 150.0, 200.0])
controller = lw.Controller(
    period=0.1,  # s between ticks
    sensors=[lw.control.Sensor(name="depth_cell", of="depth", noise=0.02)],  # m
    guidance=[lw.control.SetPoint(depth=WANTED, heading=0.0), lw.control.ReferenceModel(natural_frequency=[0.2, 0.3])],
    laws=[
        lw.control.DepthPID(kp=0.15, ki=0.004, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5),
        lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
    ],
    # The gains are radians of a fin for each radian of error: rows rudder and stern planes, columns X Y Z K M N.
    allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
)
scene = lw.Scene.named(
    "remus_100",
    vehicle={"buoyancy": 300.5},  # N; the weight is 299 N
    terms=[waves],
    start={"position": [0.0, 0.0, 5.0], "velocity": [1.54, 0.0, 0.0]},
    controller=controller,
)
vary = {
    "vehicle.buoyancy": lw.distributions.Uniform(low=299.0, high=308.0),
    "waves.phases": lw.distributions.Uniform(low=0.0, high=2.0 * np.pi),
}
fleet = lw.Ensemble(scene, members=500, seed=4, vary=vary)


def plot(time, depth, planes, buoyancy, path):
    """Depth and angle of the stern planes over time, of the least and of the most buoyant vehicles."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    low, high = np.quantile(buoyancy, (0.2, 0.8))
    for axes, values in ((above, depth), (below, planes)):
        for (name, (color, style)), group in zip(GROUPS.items(), (buoyancy <= low, buoyancy >= high), strict=True):
            edges = np.quantile(values[:, group], (0.05, 0.5, 0.95), axis=1)
            axes.fill_between(time, edges[0], edges[2], color=color, alpha=0.25, linewidth=0)
            axes.plot(time, edges[1], style, color=color, label=f"{name}: median and 90 %")
    above.axhline(WANTED, color="black", linestyle=":", label="wanted")
    above.set(
        ylabel="depth [m]", xlim=(0.0, time[-1]), title="Whatever their ballast, all go from 5 m to 10 m and stay"
    )
    above.invert_yaxis()
    for side in (-LIMIT, LIMIT):
        below.axhline(side, color="black", linestyle="-.", label="limit of the planes" if side > 0 else None)
    title = "Their stern planes find the ballast out; in waves some of the most buoyant reach the limit"
    below.set(xlabel="time [s]", ylabel="stern planes [deg]", ylim=(-24.0, 48.0), title=title)
    for axes in (above, below):
        axes.legend(loc="upper right")
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/depth_keeping.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    fields = ("position", "command", "actuator", "unmet")
    result = lw.solve(fleet, h=0.02, t1=120.0, save=lw.SaveAt(every=0.5, fields=fields))
    depth, planes = result.position[:, :, 2], np.degrees(result.actuator[:, :, 1])
    late = result.time >= 80.0
    error, at_limit = depth[late] - WANTED, np.abs(planes[late]) >= LIMIT - 1e-6
    print(f"{result.status.counts()}, from 80 s on {error.mean():+.2f} m off on average, moved by {error.std():.2f} m")
    print(
        f"planes at their limit: {at_limit.mean():.1%} of that time, {at_limit.any(axis=0).mean():.0%} of the vehicles"
    )
    buoyancy = fleet.parameters(0, fleet.members)["vehicle.buoyancy"]
    print(plot(result.time, depth, planes, buoyancy, target))
