# SPDX-License-Identifier: Apache-2.0
"""A REMUS 100 mission: three legs, the last two deeper, in a current that no vehicle measures.

Line-of-sight guidance with an integral (`ilos`) holds 200 vehicles on the legs. The current differs from vehicle to
vehicle, and reaches a third of their speed.
"""

import numpy as np
from matplotlib.figure import Figure

import lgvi_warp as lw

POINTS = np.array([[0.0, 0.0, 5.0], [200.0, 0.0, 5.0], [200.0, 60.0, 15.0], [0.0, 60.0, 15.0]])  # m: north, east, down

controller = lw.Controller(
    period=0.1,  # s between ticks
    guidance=[lw.control.Waypoints(points=POINTS, speed=1.54, look_ahead=20.0, radius=12.0, method="ilos", kappa=0.8)],
    laws=[
        lw.control.DepthPID(kp=0.15, ki=0.002, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5),
        lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
    ],
    # The gains are radians of a fin for each radian of error: rows rudder and stern planes, columns X Y Z K M N.
    allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
)
scene = lw.Scene.named(
    "remus_100",
    vehicle={"buoyancy": 300.0},  # N: one newton more than the weight
    terms=[lw.terms.Current(velocity=[0.0, 0.3, 0.0])],  # m/s
    start={"position": POINTS[0], "velocity": [1.54, 0.0, 0.0]},
    controller=controller,
)
fleet = lw.Ensemble(scene, members=200, seed=1, vary={"current.velocity": lw.distributions.Normal(std=[0.1, 0.1, 0.0])})


def off_track(position):
    """Horizontal distance (k, n) [m] to the nearest leg."""
    begin, leg = POINTS[:-1, :2], np.diff(POINTS[:, :2], axis=0)
    from_begin = position[..., None, :2] - begin
    share = np.clip(np.sum(from_begin * leg, axis=-1) / np.sum(leg * leg, axis=-1), 0.0, 1.0)
    return np.linalg.norm(from_begin - share[..., None] * leg, axis=-1).min(axis=-1)


if __name__ == "__main__":
    result = lw.solve(fleet, h=0.02, t1=300.0, save=lw.SaveAt(every=1.0))
    distance = off_track(result.position)
    late = result.time > 60.0
    print(result.status.counts())
    print(
        f"off the legs: {np.median(distance[late]):.1f} m in the median, {np.quantile(distance[late], 0.95):.1f} m in 95 %"
    )
    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    above, depth = figure.subplots(1, 2, width_ratios=[1.0, 1.3])
    lw.plots.plan_view(result, 25, ax=above)
    above.plot(POINTS[:, 1], POINTS[:, 0], "o:", color="black", zorder=5, label="waypoints")
    above.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, frameon=False)
    lw.plots.fan(result, "depth", ax=depth).set_title("Depth of 200 members")
    figure.savefig("02_remus_mission.png", dpi=100)
    print("02_remus_mission.png")
