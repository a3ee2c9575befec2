"""Measure accuracy against time of four scenes; write docs/guide/accuracy_and_speed.md, with a picture of each.

python benchmarks/fronts.py
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import lgvi_warp as lw
from lgvi_warp.common import machine, warp_setup

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "docs" / "guide" / "accuracy_and_speed.md"
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
DECADES = range(-1, -13, -1)
SPREAD = {"start.angular_velocity": lw.Normal(relative=0.1)}


def paper():
    """The paper's vehicle over 20 s: rotation and Munk moment, no damping."""
    return lw.Ensemble(lw.Scene.load(ROOT / "examples" / "paper.toml"), 256, 1, SPREAD), 20.0


def remus():
    """REMUS 100 with drag, lift and fins, thrust and a rudder held at 4 degrees, in a current, 60 s."""
    n, rng = 256, np.random.default_rng(1)
    current = {"type": "current", "velocity": [0.3, 0.1, 0.0]}
    scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, terms=[current])
    spread = 0.02 * rng.normal(size=(n, 3))
    states = (np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.add(spread, (1.5, 0.0, 0.0)), spread)
    return lw.Ensemble.from_states(
        scene, *states, {"control_fins.command": np.full((n, 2), [np.radians(4.0), 0.0])}
    ), 60.0


def light():
    """A plate of 2 kg that moves 200 kg of water across itself and tumbles, 10 s."""
    vehicle = lw.Vehicle(2.0, [0.6, 1.0, 1.4], [2.0, 20.0, 200.0], 19.6, [0.0, 0.0, -0.01])
    start = lw.Start(rotation_vector=[0.3, 0.2, 0.1], velocity=[0.5, 0.1, 0.3], angular_velocity=[0.5, 0.8, 0.3])
    return lw.Ensemble(lw.Scene(vehicle, lw.Environment(gravity=9.8), start=start), 256, 1, SPREAD), 10.0


def short():
    """A million runs of 2 s each: what a sweep of controllers asks."""
    scene = lw.Scene.named("bluerov2_heavy", start={"velocity": [0.5, 0.0, 0.1], "angular_velocity": [0.1, 0.2, 0.3]})
    return lw.Ensemble(scene, 256, 1, SPREAD), 2.0


SCENES = {"paper": paper, "remus": remus, "light": light, "short": short}


def cheapest(found, error):
    """The cheapest measurement with this largest error in position over the path, or None."""
    good = [one for one in found.shown() if one.error() <= error]
    return min(good, key=lambda one: one.us_per_vehicle_second, default=None)


def section(name, make):
    """The text of one scene."""
    fleet, t1 = make()
    found = lw.tradeoff(fleet, t1=t1, seconds=90.0)
    picture = ROOT / "docs" / "guide" / f"accuracy_{name}.png"
    lw.plot_tradeoff(found, picture)
    lines = [f"## {make.__doc__.strip()}", "", f"![errors and cost]({picture.name})", ""]
    lines += [f"Reference: {found.reference}. {' '.join(f'{text}.' for text in found.messages)}", ""]
    lines += ["| largest error in position [m] | cheapest setting | step [s] | dtype | us per vehicle and second |",
              "| ---: | --- | ---: | --- | ---: |"]  # fmt: skip
    for decade in DECADES:
        one = cheapest(found, 10.0**decade)
        if one is not None:
            s = one.setting
            lines.append(f"| 1e{decade} | `{s.method}` | {s.h:.3g} | {s.dtype} | {one.us_per_vehicle_second:.3g} |")
    print("\n".join(lines), flush=True)
    return "\n".join(lines)


def main():
    warp_setup.start()
    chosen = sys.argv[1:] or list(SCENES)
    described, versions = machine.describe(), machine.versions()
    where = f"One core of {described['cpu']}, {described['simd']}; Warp {versions['warp-lang']}."
    head = f"{where} Written by `python -m benchmarks table fronts`."
    text = "\n\n".join([head, *(section(name, SCENES[name]) for name in chosen)])
    page = TARGET.read_text()
    before, rest = page.split(BEGIN)
    TARGET.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.split(END)[1]}")


if __name__ == "__main__":
    main()
