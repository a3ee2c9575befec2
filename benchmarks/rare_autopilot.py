# SPDX-License-Identifier: Apache-2.0
"""The deepest depth of the REMUS autopilot in sensor noise: rare_event beside plain members, in pieces that add up.

    python -m benchmarks.rare_autopilot plain counts.json --members 100000     # again and again, until there are enough
    python -m benchmarks.rare_autopilot rare counts.json --above 10.41 --by chains --seed 0
    python -m benchmarks.rare_autopilot show counts.json

Each piece of plain members has the next seed, which the file notes once the piece is done: a piece that is stopped leaves
nothing. The file counts members above bounds 5 mm apart, so that the bound need not be known beforehand.
"""

import argparse
import dataclasses
import json
import math
import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import ROOT

BOUNDS = np.round(np.arange(10.0, 12.0001, 0.005), 3)
SETTINGS = {"method": "rk4", "h": 0.02, "t1": 60.0, "threads": 1}
OF, LOOKS = "max(depth)", lw.SaveAt(every=0.1)
AT_ONCE = 2_000


def fleet():
    """The autopilot of the examples with noise of its sensors, and without the fault."""
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
    controller = dataclasses.replace(scene.controller, faults=())
    return lw.Ensemble.from_scene(dataclasses.replace(scene, controller=controller))


def read(path):
    """Answers so far."""
    if path.exists():
        return json.loads(path.read_text())
    return {"seed": 0, "members": 0, "above": [0] * len(BOUNDS), "answers": []}


def write(path, content):
    """Put it in place of what was known before, whole or not at all."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(content))
    new.replace(path)


def add_plain(path, members):
    """Run some plain members, and count them above each bound."""
    run = lw.prepare(fleet(), of=OF, save=LOOKS, failed="nan", **SETTINGS)
    while members > 0:
        known, count = read(path), min(members, AT_ONCE)
        depths = run(seed=1_000_000 + known["seed"], members=count)
        # A member that fails is the event.
        above = (np.nan_to_num(depths, nan=np.inf)[:, None] > BOUNDS).sum(axis=0)
        known["above"] = [a + int(b) for a, b in zip(known["above"], above, strict=True)]
        known |= {"seed": known["seed"] + 1, "members": known["members"] + count}
        write(path, known)
        members -= count


def add_rare(path, above, by, seed, error):
    """Ask rare_event for the probability of a bound."""
    found = lw.rare_event(
        fleet(), f"{OF} above {above}", by=by, seed=seed, relative_error=error, save=LOOKS, **SETTINGS
    )
    print(found)
    known = read(path)
    known["answers"].append(
        {
            "above": above,
            "by": by,
            "seed": seed,
            "probability": found.probability,
            "interval": list(found.interval),
            "relative_error": found.relative_error,
            "members": sum(found.members.values()),
            "seconds": round(found.seconds, 1),
        }
    )
    write(path, known)


def lines(content):
    """The answers beside plain members, a line each: how far apart they are, in both errors."""
    yield f"{content['members']:,} plain members"
    for answer in content["answers"]:
        hits = content["above"][int(np.argmin(np.abs(BOUNDS - answer["above"])))]
        share, p = hits / max(1, content["members"]), answer["probability"]
        error = math.hypot(math.sqrt(max(1, hits)) / max(1, content["members"]), answer["relative_error"] * p)
        yield (
            f"above {answer['above']:g} m by {answer['by']}, seed {answer['seed']}: {p:.3g} "
            f"({100.0 * answer['relative_error']:.2g} %), plain {share:.3g} ({hits} members), "
            f"apart by {(p - share) / error:+.1f} errors; {answer['members']:,} members, {answer['seconds']:g} s"
        )


def main(arguments=None):
    """Run a piece, or show what there is."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rare_autopilot", description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("plain", "rare", "show"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--members", type=int, default=100_000)
    parser.add_argument("--above", type=float, default=10.41)
    parser.add_argument("--by", choices=("chains", "splitting"), default="chains")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--error", type=float, default=0.1)
    chosen = parser.parse_args(arguments)
    if chosen.what == "plain":
        add_plain(chosen.file, chosen.members)
    elif chosen.what == "rare":
        add_rare(chosen.file, chosen.above, chosen.by, chosen.seed, chosen.error)
    print(*lines(read(chosen.file)), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
