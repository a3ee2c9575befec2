# SPDX-License-Identifier: Apache-2.0
"""lw.rare_event where probabilities are known: error told and seen, members, seconds of one thread, beside other libraries.

Events of a sphere in linear drag, over runs with other seeds: told_spread and seen_spread are parts of the probability,
within_three counts the runs within three told spreads. The autopilot's probability is that of a run to 2 %. OpenTURNS and
UQpy, where they are installed, call lw.uq.model with the same events at the first probability, with 20,000 members a level.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks.cases.rare import peers
from benchmarks.cases.rare.problems import EVENTS, RUN, T1, Event, autopilot

PROBABILITIES, RUNS = (1e-5, 1e-7), 20
# Of an event whose smaller side may be lost, and the runs that look for that.
LOST, MANY = "unequal sides", 200
PEERS_RUNS = 3
SAVE = lw.SaveAt(at=[T1], fields=("position",))
# The autopilot's limit [m], and the setting at which its chains may run.
DEEP = "peak depth"
BOUND = 10.46
CHEAPER = {"h": 0.1, "dtype": "float32", "controller.delay": 0.0}


def found_of(event: Event, seed: int) -> tuple[lw.studies.RareEvent, float]:
    """The answer, and processor time [s]."""
    begun = time.process_time()
    found = lw.rare_event(event.fleet, event.of, save=SAVE, seed=seed, **RUN)
    return found, time.process_time() - begun


def summary(answer: list[tuple[lw.studies.RareEvent, float]], truth: float) -> dict[str, Any]:
    """Summary of runs with different seeds."""
    ratios = np.array([each.probability for each, _ in answer]) / truth
    told = np.array([each.relative_error for each, _ in answer])
    members = [sum(each.members.values()) for each, _ in answer]
    seen = float(np.std(ratios, ddof=1)) if len(answer) > 1 else math.nan
    return {
        "truth": truth,
        "runs": len(answer),
        "probability": float(ratios.mean()) * truth,
        "told_spread": round(float(np.sqrt(np.mean(told**2))), 4),
        "seen_spread": round(seen, 4),
        "within_three": int((np.abs(ratios - 1.0) <= 3.0 * told).sum()),
        "lowest": round(float(ratios.min()), 3),
        "members": round(float(np.mean(members))),
        "most_members": max(members),
        "estimators": dict(Counter(each.estimator for each, _ in answer)),
        "seconds": round(float(np.median([seconds for _, seconds in answer])), 3),
    }


def of_autopilot(quick: bool) -> Iterator[dict[str, Any]]:
    """The depth that the autopilot of REMUS 100 comes to."""
    limit, settings = {DEEP: {"above": BOUND}}, {"method": "rk4", "h": 0.02, "t1": 60.0, "threads": 1}
    fleet = autopilot()
    error = 0.5 if quick else 0.02
    truth = lw.rare_event(fleet, limit, relative_error=error, cheaper=[CHEAPER], seed=1000, **settings)
    found = []
    for seed in range(2 if quick else RUNS):
        begun = time.process_time()
        each = lw.rare_event(fleet, limit, cheaper=[CHEAPER], seed=seed, **settings)
        found.append((each, time.process_time() - begun))
    yield {"event": f"autopilot, {DEEP} above {BOUND} m"} | summary(found, truth.probability)


def run(quick: bool) -> Iterator[dict[str, Any]]:
    for p in PROBABILITIES[:1] if quick else PROBABILITIES:
        for name, make in EVENTS.items():
            event = make(p)
            found_of(event, 1000)  # compiles
            runs = 2 if quick else MANY if name == LOST else RUNS
            yield {"event": name} | summary([found_of(event, seed) for seed in range(runs)], p)
            if p == PROBABILITIES[0]:
                yield from peers.records(name, event, p, 1 if quick else PEERS_RUNS, quick)
    yield from of_autopilot(quick)
