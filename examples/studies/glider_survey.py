# SPDX-License-Identifier: Apache-2.0
"""A glider's sawtooth between 10 m and 100 m: a buoyancy engine in the nose, dense water below, a hull that yields.

    python examples/studies/glider_survey.py

In its nose the engine drives the glider, and pitches it as well. A picture shows depth, speed and the energy used over time.
"""

import sys
from pathlib import Path

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
    efficiency=0.4,
    **DENSITY,
)
COMPUTERS = lw.terms.EnergyUse(hotel=0.5)  # W


def plot(result, turns, path):
    """Depth, speed and energy."""
    from matplotlib.figure import Figure

    minutes, depth = result.time / 60.0, result.position[:, 0, 2]
    figure = Figure(figsize=(8.0, 6.5), layout="constrained")
    above, middle, below = figure.subplots(3, 1, sharex=True)
    above.plot(minutes, depth, color="#0072B2")
    above.plot(minutes[turns], depth[turns], "k.")
    for at in (ENGINE.depth_top, ENGINE.depth_bottom):
        above.axhline(float(at), color="0.5", linestyle=":")
    above.invert_yaxis()
    above.set(
        ylabel="depth; dotted: where\nthe engine turns [m]",
        xlim=(0.0, minutes[-1]),
        title="A glider goes on beyond a turning depth while its pump works",
    )
    middle.plot(minutes, np.linalg.norm(result.velocity[:, 0], axis=1), color="#D55E00")
    middle.set(ylabel="speed [m/s]", ylim=(0.0, None))
    used = result.energy_used[:, 0] / 1e3
    below.plot(minutes, used, color="0.2", label="all")
    below.plot(minutes, result.time * float(COMPUTERS.hotel) / 1e3, "--", color="0.5", label="computers and sensors")
    below.set(xlabel="time [min]", ylabel="energy used [kJ]", ylim=(0.0, None))
    below.legend()
    figure.savefig(path, dpi=100)
    return path


def main(path):
    """Survey for an hour, print how far it came, and draw depth, speed and energy."""
    scene = lw.Scene.named("seawing", terms=[ENGINE, WATER, COMPUTERS], start={"position": [0.0, 0.0, 12.0]})
    save = lw.SaveAt(every=5.0, fields=("position", "velocity", "energy_used"))
    result = lw.solve(scene, h=0.1, t1=3600.0, save=save)
    depth, speed = result.position[:, 0, 2], np.linalg.norm(result.velocity[:, 0], axis=1)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(depth)))) + 1
    print(f"{result.position[-1, 0, 0]:.0f} m north in an hour, {len(turns)} turns, from {depth[turns].min():.1f} m to "
          f"{depth[turns].max():.1f} m, {np.median(speed):.2f} m/s")  # fmt: skip
    used = result.energy_used[-1, 0]
    pumped = used - 3600.0 * float(COMPUTERS.hotel)
    print(f"{used:.0f} J used, {100.0 * pumped / used:.0f} % of them by the pump")
    print(plot(result, turns, path))


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/glider_survey.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    main(target)
