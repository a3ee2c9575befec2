# SPDX-License-Identifier: Apache-2.0
"""A glider's sawtooth between 10 m and 100 m: a buoyancy engine in the nose, dense water below, a hull that yields.

    python examples/studies/glider_survey.py

In its nose the engine drives the glider, and pitches it as well. A picture shows depth and speed over time.
"""

import matplotlib.pyplot as plt
import numpy as np

import lgvi_warp as lw

DENSITY = {"gradient": 8e-6, "reference_depth": 50.0}
WATER = lw.terms.Stratification(compressibility=4.4e-6, **DENSITY)
ENGINE = lw.terms.BuoyancyEngine(
    pump_rate=1e-5,
    volume_down=-3e-4,
    volume_up=3e-4,
    depth_top=10.0,
    depth_bottom=100.0,
    position=[0.73, 0.0, 0.0],
    **DENSITY,
)


def main():
    """Survey for an hour, print how far it came, and draw depth and speed."""
    scene = lw.Scene.named("seawing", terms=[ENGINE, WATER], start={"position": [0.0, 0.0, 12.0]})
    result = lw.solve(scene, h=0.1, t1=3600.0, save=lw.SaveAt(every=5.0))
    minutes, depth = result.time / 60.0, result.position[:, 0, 2]
    speed = np.linalg.norm(result.velocity[:, 0], axis=1)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(depth)))) + 1
    print(f"{result.position[-1, 0, 0]:.0f} m north in an hour, {len(turns)} turns, from {depth[turns].min():.1f} m to "
          f"{depth[turns].max():.1f} m, {np.median(speed):.2f} m/s")  # fmt: skip
    figure, (above, below) = plt.subplots(2, 1, figsize=(8.0, 5.0), sharex=True, layout="constrained")
    above.plot(minutes, depth)
    above.plot(minutes[turns], depth[turns], "k.")
    above.axhline(10.0, color="0.7", linestyle=":")
    above.axhline(100.0, color="0.7", linestyle=":")
    above.invert_yaxis()
    above.set(ylabel="depth [m]")
    below.plot(minutes, speed, "C1")
    below.set(xlabel="time [min]", ylabel="speed [m/s]")
    figure.savefig("glider_survey.png", dpi=100)
    print("glider_survey.png")


if __name__ == "__main__":
    main()
