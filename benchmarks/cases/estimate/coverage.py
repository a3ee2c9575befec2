# SPDX-License-Identifier: Apache-2.0
"""Coverage of lw.estimate's intervals against independent runs, by seeds, in pieces that add up.

python -m benchmarks.cases.estimate.coverage SCENE ERROR FIRST LAST

SCENE as of `python -m benchmarks run estimate`, ERROR in spreads of the statistic, seeds from FIRST up to LAST. The reference
is 16 replicates of Sobol points at a finer step with another seed, whose own error is added.
"""

import argparse
import json
import math

import numpy as np

import lgvi_warp as lw
from benchmarks.cases.estimate.case import SCENES

# Method, step [s] and members of the reference; its error is an eighth of 1e-2 spreads, or less.
REFERENCES = {
    "paper": ({"method": "rk8", "h": 0.125}, 1 << 17),
    "autopilot": ({"method": "rk4", "h": 0.02}, 1 << 16),
    "remus in noise": ({"method": "psi_x", "h": 0.0234375}, 1 << 17),
}
REPLICATES, AT_ONCE = 16, 1 << 15


def numbers(fleet, of, t1, settings, members):
    """The number of each member (members,) of 16 replicates of Sobol points, by a run of its own."""
    asked = of.of if isinstance(of, lw.statistics.Mean) else of
    sampling = lw.designs.Sobol(replicates=REPLICATES)
    drawn, groups = lw.Ensemble(fleet.scene, members, 123_456, fleet.vary, sampling=sampling), []
    for first in range(0, members, AT_ONCE):
        some = drawn.subset(np.arange(first, min(first + AT_ONCE, members)))
        groups.append(lw.prepare(some, of=asked, t1=t1, threads=1, **settings)())
    return np.concatenate(groups)


def reference(name):
    """Mean, its standard error, and the spread of the members."""
    fleet, of, t1 = {scene: make for scene, make, _ in SCENES}[name]()
    y = numbers(fleet, of, t1, *REFERENCES[name])
    means = y.reshape(-1, REPLICATES).mean(axis=0)
    return float(means.mean()), float(means.std(ddof=1)) / math.sqrt(REPLICATES), float(y.std())


def holds(answer, mean, error):
    """Whether an interval holds a mean that is known to a standard error."""
    low, high = answer.interval
    more = [math.hypot(answer.value - low, 2.0 * error), math.hypot(high - answer.value, 2.0 * error)]
    return answer.value - more[0] <= mean <= answer.value + more[1]


def run(name, part, seeds):
    """Intervals that held, of how many, and the root mean square of the error over the one asked for."""
    fleet, of, t1 = {scene: make for scene, make, _ in SCENES}[name]()
    mean, own, spread = reference(name)
    held, apart, seconds, told = 0, [], [], []
    for seed in seeds:
        found = lw.estimate(fleet, of, part * spread, t1=t1, seed=seed, threads=1)
        held += holds(found, mean, own)
        apart.append((found.value - mean) / (part * spread))
        told.append(found.error_reached / (part * spread))
        seconds.append(found.seconds)
    return {
        "scene": name, "error_in_spreads": part, "first": seeds[0], "held": held, "of": len(seeds),
        "reference": mean, "reference_error_in_asked": own / (part * spread),
        "rms_in_asked": float(np.sqrt(np.mean(np.square(apart)))), "told_in_asked": float(np.sqrt(np.mean(np.square(told)))),
        "seconds": float(np.median(seconds)),
    }  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", choices=REFERENCES)
    parser.add_argument("error", type=float)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    chosen = parser.parse_args()
    print(json.dumps(run(chosen.scene, chosen.error, range(chosen.first, chosen.last))))
