# SPDX-License-Identifier: Apache-2.0
"""The search of lw.suggest: its processor time, and the cost of what it finds beside a search of all methods.

Each shipped vehicle, 128 members under way for 10 s: bluerov2_heavy with its thrusters ahead, remus_100 with its rudder at 4
degrees. Limit: 20 s of processor time with an empty kernel cache. times_best: cost of the setting over that of the one that a
search of every method finds, read in turn.
"""

import dataclasses
import os
import tempfile
import time

import numpy as np

import lgvi_warp as lw
from benchmarks import own_process
from lgvi_warp.accuracy.suggest import CANDIDATES
from lgvi_warp.common import warp_setup
from lgvi_warp.measuring import cost
from lgvi_warp.runs.settle import make_plan

MOST = 20.0  # s
ERRORS = (1e-2, 1e-3, 1e-5)  # m
TIME = 10.0  # s
START = {
    "position": [0.0, 0.0, 10.0],
    "euler_deg": [10.0, 5.0, 20.0],
    "velocity": [1.0, 0.1, 0.1],
    "angular_velocity": [0.1, 0.2, 0.3],
}
STARTS = {"remus_100": {"position": [0.0, 0.0, 10.0], "velocity": [1.5, 0.0, 0.0], "angular_velocity": [0.0, 0.0, 0.0]}}
COMMANDS = {
    "remus_100": {"control_fins": {"command": [np.radians(4.0), 0.0]}},
    "bluerov2_heavy": {"thrusters": {"command": [0.4, 0.5, 0.45, 0.4, 0.1, 0.1, 0.1, 0.1]}},
}


def fleet(vehicle):
    """Members a little apart in their velocities and rates."""
    scene = lw.Scene.named(vehicle, start=STARTS.get(vehicle, START))
    commands = COMMANDS.get(vehicle, {})
    terms = [
        dataclasses.replace(term, **commands[term.key], command_schedule=None, times=None)
        if term.key in commands
        else term
        for term in scene.terms
    ]
    vary = {
        "start.velocity": lw.distributions.Normal(std=0.02),
        "start.angular_velocity": lw.distributions.Normal(std=0.02),
    }
    return lw.Ensemble(dataclasses.replace(scene, terms=terms), 128, 1, vary)


def searched(vehicle, error, cache):
    """Processor time of a search in this process [s], and the setting that it finds."""
    os.environ["WARP_CACHE_PATH"] = cache
    warp_setup.start()
    ensemble = fleet(vehicle)
    begun = time.process_time()
    found = lw.suggest(ensemble, error, t1=TIME, threads=1)
    return time.process_time() - begun, found.settings


def best_of_all(ensemble, error):
    """The setting that a search of every method finds, with time enough."""
    return lw.suggest(ensemble, error, t1=TIME, threads=1, methods=CANDIDATES, seconds=60.0).settings


def times_best(ensemble, settings, best):
    """Cost of the first setting over that of the second."""
    plans = [make_plan(ensemble, t1=TIME, **one) for one in (settings, best)]
    for plan in plans:
        plan.compile()
    own, least = (price.us_per_vehicle_second for price in cost.costs(plans))
    return own / least


def run(quick):
    for vehicle in ("sphere",) if quick else lw.vehicles.names():
        ensemble = fleet(vehicle)
        for error in ERRORS[:1] if quick else ERRORS:
            with tempfile.TemporaryDirectory() as cache:
                empty, settings = own_process.call(searched, vehicle, error, cache)
                full, _ = own_process.call(searched, vehicle, error, cache)
            best = best_of_all(ensemble, error)
            yield {
                "vehicle": vehicle,
                "to_m": error,
                "found": settings,
                "best": best,
                "times_best": round(times_best(ensemble, settings, best), 2),
                "empty_cache_over_limit": round(empty / MOST, 3),
                "full_cache_over_limit": round(full / MOST, 3),
            }
