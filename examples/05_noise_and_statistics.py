# SPDX-License-Identifier: Apache-2.0
"""Noise and statistics: a random current, and estimates with confidence intervals that need no samples.

Each of 4,000 vehicles drifts in its own random current, with a time constant of a minute. The run computes statistics
block by block. `keep="none"` stores no samples, so a million members would need little more memory.
"""

import lgvi_warp as lw

scene = lw.Scene.named(
    "torpedo",
    terms=[
        lw.terms.GaussMarkovCurrent(standard_deviation=[0.1, 0.1, 0.02], time_constant=60.0, start="stationary"),
        lw.terms.WrenchNoise(force=[0.5, 0.5, 0.5], torque=[0.01, 0.01, 0.01]),
    ],
    start={"position": [0.0, 0.0, 30.0], "velocity": [1.0, 0.0, 0.0]},
)
fleet = lw.Ensemble(scene, members=4000, seed=1)
statistics = [
    lw.statistics.Mean("position"),
    lw.statistics.Quantiles("position[1]", (0.05, 0.25, 0.5, 0.75, 0.95)),
    lw.statistics.Histogram("depth", bins=30, limits=(20.0, 40.0)),
    lw.statistics.Exceedance("depth", above=32.0, name="deeper than 32 m"),
    lw.statistics.Exceedance("position[1]", above=10.0, name="more than 10 m east"),
    lw.statistics.Extremes("depth"),
]

if __name__ == "__main__":
    result = lw.solve(fleet, h=0.05, t1=120.0, save=lw.SaveAt(every=2.0), keep="none", statistics=statistics)
    mean, p = result.statistics["mean position"], result.statistics["deeper than 32 m"]
    print(result.status.counts(), "samples kept:", len(result.samples))
    for axis, value, half_width in zip(("north", "east", "down"), mean.value[-1], mean.half_width[-1], strict=True):
        print(f"mean {axis} after 120 s: {value:.2f} m, 95 % interval +- {half_width:.2f} m")
    print(f"deeper than 32 m: {p.value[-1, 0]:.1%}, 95 % interval {p.lower[-1, 0]:.1%} to {p.upper[-1, 0]:.1%}")
    lw.plots.statistics(result, path="05_noise_and_statistics.png")
    print("05_noise_and_statistics.png")
