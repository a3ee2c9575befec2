# SPDX-License-Identifier: Apache-2.0
"""The cost of lw.estimate, pilot included, beside plain Monte Carlo to the same error in the same setting.

The paper's vehicle to 20 s, REMUS 100 in noise and its autopilot to 60 s; errors in spreads of the statistic. Plain Monte
Carlo is a run that is prepared, and what its members would cost by a measured call of 4,096 of them, at the setting that was
found. Processor time of the whole call on one thread, without compiling; medians over seeds. inside: how many intervals hold
the value of a run to half of the error. Beside it QMCPy over the same model, where it can be imported.
"""

import dataclasses
import time

import numpy as np

import lgvi_warp as lw
from benchmarks.cases.estimate.peers import peers
from benchmarks.pages import ROOT

SEEDS, MEMBERS = 3, 4096


def paper():
    """North of the paper's vehicle."""
    return (
        lw.Ensemble.from_scene(lw.Scene.load(ROOT / "examples" / "paper.toml")),
        lw.statistics.Mean("position[0]"),
        20.0,
    )


def remus():
    """North of REMUS 100 with noise of the water and of forces, whose current, start, buoyancy and rudder are uncertain."""
    normal = lw.distributions.Normal
    noise = [
        lw.terms.Current(velocity=[0.2, 0.1, 0.0]),
        lw.terms.GaussMarkovCurrent(standard_deviation=(0.02, 0.02, 0.0), time_constant=60.0),
        lw.terms.WrenchNoise(force=(0.5, 0.5, 0.5), torque=(0.02, 0.02, 0.02)),
    ]
    base = lw.Scene.named("remus_100", start={"position": [0.0, 0.0, 50.0], "velocity": [1.5, 0.0, 0.0]})
    scene = dataclasses.replace(base, terms=[*base.terms, *noise])
    vary = {
        "current.velocity": normal(std=0.05),
        "start.velocity": normal(std=0.05),
        "vehicle.buoyancy": normal(std=1.0),
        "control_fins.command[0]": normal(std=0.005),
    }
    return lw.Ensemble(scene, 64, vary=vary), lw.statistics.Mean("position[0]"), 60.0


def autopilot():
    """The integral of time times error of depth, with noise of the sensors and without the scene's fault."""
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
    scene = dataclasses.replace(scene, controller=dataclasses.replace(scene.controller, faults=()))
    return lw.Ensemble.from_scene(scene), lw.metrics.ITAE("depth"), 60.0


def chaos():
    """A number that the last digits of a position decide: members of no two steps have anything in common."""
    fleet, _, t1 = paper()

    def last_digits(result):
        return np.sin(1e10 * result.position[-1, :, 0])

    return fleet, last_digits, t1


# Scene, and errors in spreads.
SCENES = (
    ("chaos", chaos, (1e-2,)),
    ("paper", paper, (1e-2, 3e-3, 1e-3)),
    ("autopilot", autopilot, (1e-2, 1e-3)),
    ("remus in noise", remus, (1e-2, 3e-3)),
)


# Those whose answer is smooth in what varies.
SMOOTH = ("paper", "autopilot")


def plain_members(fleet, of, t1, settings, members):
    """Spread of the statistic, and processor time to prepare a run and of a member of it [s], by a plain one of some."""
    if isinstance(of, lw.statistics.Mean) or callable(of):
        asked = {"of": getattr(of, "of", of)}
    else:
        each = dataclasses.replace(of, then=lw.statistics.MemberValues())
        asked = {"statistics": [each], "save": lw.SaveAt(fields=("position",))}
    drawn = lw.Ensemble(fleet.scene, members, 99, fleet.vary)
    begun = time.process_time()
    run = lw.prepare(drawn, t1=t1, threads=1, **settings, **asked)
    prepared = time.process_time() - begun
    run(seed=1, members=members)
    begun = time.process_time()
    answer = run(seed=2, members=members)
    seconds = time.process_time() - begun
    if "of" not in asked:
        (answer,) = (estimate.value[-1, 0] for estimate in answer.statistics.values())
    return float(np.std(answer)), prepared, seconds / members


def run(quick):
    for name, make, errors in SCENES:
        fleet, of, t1 = make()
        first = {"error": 0.5} if callable(of) else {"relative_error": 0.5}
        spread = lw.estimate(fleet, of, t1=t1, threads=1, **first)
        spread, *_ = plain_members(fleet, of, t1, spread.settings, 256 if quick else MEMBERS)
        for part in errors[:1] if quick else errors:
            error, found = part * spread, []
            close = lw.estimate(fleet, of, error / 2.0, t1=t1, seed=1000, threads=1)
            for seed in range(1 if quick else SEEDS):
                begun = time.process_time()
                each = lw.estimate(fleet, of, error, t1=t1, seed=seed, threads=1)
                whole = time.process_time() - begun
                prepared, member = plain_members(fleet, of, t1, each.settings, 256 if quick else MEMBERS)[1:]
                plain = prepared + spread**2 / max(error**2 - each.bias**2, 0.25 * error**2) * member
                found.append((each, plain, whole))
            inside = sum(each.interval[0] <= close.value <= each.interval[1] for each, *_ in found)
            yield {
                "scene": name,
                "error_in_spreads": part,
                "estimators": sorted({each.estimator for each, *_ in found}),
                "settings": sorted({each.setting for each, *_ in found}),
                "seconds": round(float(np.median([whole for *_, whole in found])), 4),
                "pilot_share": round(float(np.median([each.pilot_seconds / each.seconds for each, *_ in found])), 2),
                "plain_seconds": round(float(np.median([plain for _, plain, _ in found])), 3),
                "times_less_than_plain": round(float(np.median([plain / whole for _, plain, whole in found])), 2),
                "inside": f"{inside} of {len(found)}",
            }
            seeds = 1 if quick else SEEDS
            for row in peers(fleet, of, t1, found[0][0], error, seeds, close.value) if name in SMOOTH else ():
                yield {"scene": name, "error_in_spreads": part} | row
