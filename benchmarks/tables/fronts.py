# SPDX-License-Identifier: Apache-2.0
"""Measure the fronts of accuracy against time of four scenes, keep the rows, and draw a picture of each beside the page.

The rows stay in benchmarks/rows; the table and the pictures follow from them: `--kept` writes both again without measuring.
"""

import json
import sys

import numpy as np

import lgvi_warp as lw
from benchmarks.fronts_picture import SUBJECTS, draw, picture_of, rows_of
from benchmarks.pages import ROOT, markdown, stamp

DECADES = range(-1, -13, -1)
SPREAD = {"start.angular_velocity": lw.distributions.Normal(relative=0.1)}
# At most seven, that a picture stays readable and a machine measures them in minutes.
METHODS = {
    "conservative": ("psi_x", "psi_s", "bm4(psi_x)", "kl8(psi_x)", "rkn6_14", "rk4", "rk8"),
    "damped": ("psi_x", "rkw3", "rk4", "rk5", "rk8"),
}
KINDS = {"paper": "conservative", "remus": "damped", "light": "conservative", "short": "damped"}
SECONDS = 90.0


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
        mass=2.0,
        inertia=[0.6, 1.0, 1.4],
        added_mass=[2.0, 20.0, 200.0],
        buoyancy=19.6,
        center_of_buoyancy=[0.0, 0.0, -0.01],
    )
    start = lw.Start(rotation_vector=[0.3, 0.2, 0.1], velocity=[0.5, 0.1, 0.3], angular_velocity=[0.5, 0.8, 0.3])
    return lw.Ensemble(lw.Scene(vehicle, lw.Environment(gravity=9.8), start=start), 256, 1, SPREAD), 10.0


def short():
    """A million runs of 2 s each: what a sweep of controllers asks."""
    start = {"velocity": [0.5, 0.0, 0.1], "angular_velocity": [0.1, 0.2, 0.3]}
    # Errors are compared at these times, which every step divides.
    scene = lw.Scene.named("bluerov2_heavy", start=start, run={"save_every": 0.4})
    return lw.Ensemble(scene, 256, 1, SPREAD), 2.0


SCENES = {"paper": paper, "remus": remus, "light": light, "short": short}


def measured(name):
    """Measure a scene; returns what is kept of it."""
    fleet, t1 = SCENES[name]()
    found = lw.tradeoff(fleet, t1=t1, methods=METHODS[KINDS[name]], seconds=SECONDS)
    rows = [
        [s.name, s.dtype, float(f"{s.h:.6g}"), float(f"{one.us_per_vehicle_second:.4g}"), float(f"{one.error():.4g}")]
        for one in found.shown()
        for s in (one.setting,)
    ]
    return {
        "where": stamp("fronts"),
        "reference": found.reference,
        "messages": list(found.messages),
        "missing": [f"{method} has no row: {why}" for method, why in found.missing.items()],
        "until": found.until,
        "members": found.members,
        "rows": rows,
    }


def kept_rows(name):
    """Stored content of a scene."""
    return json.loads(rows_of(name).read_text())


def keep(name, content):
    """Write what is kept of a scene, a row to a line."""
    rows = ",\n  ".join(json.dumps(row) for row in content["rows"])
    head = json.dumps({key: value for key, value in content.items() if key != "rows"}, indent=1)
    rows_of(name).parent.mkdir(exist_ok=True)
    rows_of(name).write_text(f'{head[:-2]},\n "rows": [\n  {rows}\n ]\n}}\n')


def cheapest(content, error):
    """The cheapest row with this largest error in position over the path, or None."""
    return min((row for row in content["rows"] if row[4] <= error), key=lambda row: row[3], default=None)


def section(name, content):
    """The text of one scene."""
    lines = [
        f"## {SCENES[name].__doc__.strip()}",
        "",
        f"![{SUBJECTS[name]}: error and cost]({picture_of(name).name})",
        "",
    ]
    texts = (f"reference: {content['reference']}", *content["messages"], *content["missing"])
    lines += [" ".join(f"{text[0].upper()}{text[1:]}." for text in texts), ""]
    rows = []
    for decade in DECADES:
        row = cheapest(content, 10.0**decade)
        if row is not None:
            method, dtype, h, cost, _ = row
            rows.append([f"1e{decade}", f"`{method}`", f"{h:.3g}", dtype, f"{cost:.3g}"])
    head = ["largest error in position [m]", "cheapest setting", "step [s]", "dtype", "us per vehicle and second"]
    return "\n".join([*lines, markdown(head, rows, "rlrlr")])


def text_of(names=tuple(SCENES)):
    """The text between the marks, from the rows that are kept."""
    contents = {name: kept_rows(name) for name in names}
    where = f"One core. {contents[names[0]]['where']}"
    return "\n\n".join([where, *(section(name, content) for name, content in contents.items())])


def add_options(parser):
    parser.add_argument(
        "scenes",
        nargs="*",
        choices=[*SCENES, []],
        metavar="SCENE",
        help=f"measure these of {', '.join(SCENES)}; default: all",
    )
    parser.add_argument(
        "--kept", action="store_true", help="measure nothing: write the page and the pictures from the rows"
    )


def main(scenes, kept=False):
    for name in () if kept else scenes or SCENES:
        keep(name, measured(name))
        print(section(name, kept_rows(name)), file=sys.stderr, flush=True)
    for name in scenes or SCENES:
        draw(name, kept_rows(name))
    return text_of()
