# SPDX-License-Identifier: Apache-2.0
"""Compare two runs: the same 300 vehicles, with the same ballast and the same waves, under two depth controllers.

The draws of a member depend on the seed and the member's index alone. So the two runs of a member differ only by the
controller. The interval of their mean difference is far narrower than the spread of the fleet.
"""

import numpy as np

import lgvi_warp as lw

WANTED = 10.0  # m
GAINS = {"proportional": 0.0, "with an integral": 0.002}  # ki of the depth, 1/(m s)
vary = {
    "vehicle.buoyancy": lw.distributions.Uniform(low=299.0, high=308.0),
    "waves.phases": lw.distributions.Uniform(low=0.0, high=2.0 * np.pi),
}


def fleet(ki):
    """Build a fleet whose depth law has this integral gain."""
    controller = lw.Controller(
        period=0.1,  # s between ticks
        guidance=[lw.control.SetPoint(depth=WANTED, heading=0.0)],
        laws=[
            lw.control.DepthPID(kp=0.05, ki=ki, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.0, kd_pitch=1.5),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        # The gains are radians of a fin for each radian of error: rows rudder and stern planes, columns X Y Z K M N.
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
    )
    waves = lw.terms.Waves(amplitudes=[0.3, 0.2], periods=[8.0, 6.0], headings_deg=[180.0, 150.0])
    start = {"position": [0.0, 0.0, 5.0], "velocity": [1.54, 0.0, 0.0]}
    scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 303.0}, terms=[waves], start=start, controller=controller)
    return lw.Ensemble(scene, members=300, seed=3, vary=vary)


if __name__ == "__main__":
    runs = {label: lw.solve(fleet(ki), h=0.02, t1=120.0, save=lw.SaveAt(every=0.5)) for label, ki in GAINS.items()}
    errors = {}
    for label, result in runs.items():
        errors[label] = np.abs(result.depth[result.time >= 80.0] - WANTED).mean(axis=0)
        print(f"{label}: {result.status.counts()}, from 80 s on {errors[label].mean():.2f} m off")
    gain = errors["proportional"] - errors["with an integral"]
    half_width = 1.96 * gain.std(ddof=1) / np.sqrt(len(gain))
    print(f"the integral brings each vehicle {gain.mean():.2f} m nearer, 95 % interval +- {half_width:.2f} m")
    axes = lw.plots.compare(runs, "depth")
    axes.axhline(WANTED, color="black", linestyle=":")
    axes.annotate("wanted", (0.0, WANTED), xytext=(0, -12), textcoords="offset points")
    axes.set_title(f"The integral brings each vehicle {gain.mean():.2f} ± {half_width:.2f} m nearer (95 % interval)")
    axes.figure.savefig("11_compare_two_runs.png", dpi=100)
    print("11_compare_two_runs.png")
