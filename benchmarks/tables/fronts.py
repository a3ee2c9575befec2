# SPDX-License-Identifier: Apache-2.0
"""Measure the fronts of accuracy against time of four scenes, with a picture of each beside the page."""

import sys

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import PAGES, ROOT, markdown, stamp

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
    vehicle = lw.Vehicle(
        2.0, inertia=[0.6, 1.0, 1.4], added_mass=[2.0, 20.0, 200.0], buoyancy=19.6, center_of_buoyancy=[0.0, 0.0, -0.01]
    )
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
    picture = (ROOT / PAGES["fronts"]).parent / f"accuracy_{name}.png"
    lw.plot_tradeoff(found, picture)
    lines = [f"## {make.__doc__.strip()}", "", f"![errors and cost]({picture.name})", ""]
    lines += [f"Reference: {found.reference}. {' '.join(f'{text}.' for text in found.messages)}", ""]
    rows = []
    for decade in DECADES:
        one = cheapest(found, 10.0**decade)
        if one is not None:
            s = one.setting
            rows.append([f"1e{decade}", f"`{s.method}`", f"{s.h:.3g}", s.dtype, f"{one.us_per_vehicle_second:.3g}"])
    head = ["largest error in position [m]", "cheapest setting", "step [s]", "dtype", "us per vehicle and second"]
    text = "\n".join([*lines, markdown(head, rows, "rlrlr")])
    print(text, file=sys.stderr, flush=True)
    return text


def add_options(parser):
    parser.add_argument(
        "scenes", nargs="*", choices=[*SCENES, []], metavar="SCENE", help=f"of {', '.join(SCENES)}; default: all"
    )


def main(scenes):
    sections = [section(name, SCENES[name]) for name in scenes or SCENES]
    where = f"One core. {stamp('fronts', ' '.join(scenes))}"
    return "\n\n".join([where, *sections])
