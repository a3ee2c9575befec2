# SPDX-License-Identifier: Apache-2.0
"""A million members: the mean depth of a fleet to a millimetre, in little memory.

Samples of a million members would fill gigabytes. The run computes statistics block by block, and `keep="none"` stores
no samples. Memory does not grow with the number of samples, and results have the same bits for any number of threads.
"""

import time
from pathlib import Path

import lgvi_warp as lw

scene = lw.Scene.load(Path(__file__).parent / "paper.toml")
vary = {
    "start.angular_velocity": lw.distributions.Normal(std=0.03),
    "vehicle.mass": lw.distributions.TruncatedNormal(relative=0.001),
}
fleet = lw.Ensemble(scene, members=1_000_000, seed=1, vary=vary)
statistics = [
    lw.statistics.Mean("position"),
    lw.statistics.Quantiles("depth", (0.001, 0.05, 0.5, 0.95, 0.999)),
    lw.statistics.Histogram("speed", bins=40, limits=(0.6, 1.1)),
]
save = lw.SaveAt(every=0.5)

if __name__ == "__main__":
    print(lw.predict(fleet, h=0.05, t1=10.0, save=save, statistics=statistics, keep="none"))
    begun = time.perf_counter()
    result = lw.solve(fleet, h=0.05, t1=10.0, save=save, statistics=statistics, keep="none")
    seconds = time.perf_counter() - begun
    depth, quantiles = result.statistics["mean position"], result.statistics["quantiles depth"]
    print(f"{result.status.counts()} in {seconds:.1f} s, 200 steps each")
    print(f"mean depth {depth.value[-1, 2]:.4f} m, 95 % interval +- {depth.half_width[-1, 2]:.4f} m")
    print(f"one in a thousand is deeper than {quantiles.value[-1, -1, 0]:.2f} m")
    lw.plots.statistics(result, path="10_a_million_members.png")
    print("10_a_million_members.png")
