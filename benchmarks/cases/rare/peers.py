# SPDX-License-Identifier: Apache-2.0
"""Subset simulation by other libraries, where they are installed, over the same vehicles by lw.uq.model."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np
from scipy.special import ndtr

import lgvi_warp as lw
from benchmarks.cases.rare.problems import RUN, T1, Event

# Members of a level; of UQpy, whose chains step in all numbers at once, their steps, and the most numbers.
SIZE, QUICK_SIZE = 20_000, 500
STEP, MOST_OF_UQPY = 0.5, 6
Limit = Callable[[np.ndarray], np.ndarray]


def openturns(limit: Limit, d: int, size: int, seed: int) -> tuple[float, float]:
    """(probability, its relative error as told) by OpenTURNS."""
    import openturns as ot

    ot.RandomGenerator.SetSeed(seed)
    function = ot.PythonFunction(d, 1, func_sample=lambda u: limit(np.asarray(u))[:, None])
    output = ot.CompositeRandomVector(ot.Function(function), ot.RandomVector(ot.Normal(d)))
    subset = ot.SubsetSampling(ot.ThresholdEvent(output, ot.Greater(), 0.0))
    subset.setMaximumOuterSampling(10)
    subset.setBlockSize(size // 10)
    subset.run()
    answer = subset.getResult()
    return answer.getProbabilityEstimate(), answer.getCoefficientOfVariation()


def uqpy(limit: Limit, d: int, size: int, seed: int) -> tuple[float, float]:
    """(probability, its relative error as told) by UQpy."""
    from UQpy.distributions import JointIndependent, Normal
    from UQpy.reliability import SubsetSimulation
    from UQpy.run_model import RunModel
    from UQpy.sampling import MetropolisHastings

    class Batches(RunModel):
        """All members of a call at once; below 0 is the event."""

        def __init__(self) -> None:
            self.qoi_list: list[float] = []

        def run(self, samples: Any = None, **more: Any) -> None:
            self.qoi_list.extend(-limit(np.asarray(samples)))

    first = np.random.default_rng(seed).standard_normal((size, d))
    chains = MetropolisHastings(
        dimension=d, log_pdf_target=lambda u: -0.5 * (u**2).sum(axis=1), seed=[[0.0] * d], random_state=seed,
        proposal=JointIndependent([Normal(0.0, STEP)] * d), proposal_is_symmetric=True,
    )  # fmt: skip
    found = SubsetSimulation(
        runmodel_object=Batches(), sampling=chains, samples_init=first, nsamples_per_subset=size, max_level=15
    )
    return float(found.failure_probability), float(found.dependent_chains_CoV)


PEERS = {"openturns": openturns, "UQpy": uqpy}


def importable(name: str) -> bool:
    """Whether a library is there, with what it needs."""
    try:
        import_module(name)
    except ImportError:
        return False
    return True


def records(name: str, event: Event, p: float, runs: int, quick: bool) -> Iterator[dict[str, Any]]:
    """Answers of each peer on an event; none for one with noise, which a model draws anew by row and not by chain."""
    present = [peer for peer in PEERS if importable(peer)]
    if not present or not event.fleet.vary or any(term.type == "wrench_noise" for term in event.fleet.scene.terms):
        return
    model = lw.uq.model(event.fleet.scene, event.fleet.vary, event.of, levels=True, save=lw.SaveAt(at=[T1]), **RUN)
    members = 0

    def limit(u: np.ndarray) -> np.ndarray:
        nonlocal members
        members += len(u)
        return np.asarray(model(np.clip(ndtr(u), 1e-16, 1.0 - 2.0**-53)))

    for peer in (peer for peer in present if peer != "UQpy" or len(model.names) <= MOST_OF_UQPY):
        ratios, told, seconds = [], [], []
        members = 0
        for seed in range(runs):
            begun = time.process_time()
            probability, spread = PEERS[peer](limit, len(model.names), QUICK_SIZE if quick else SIZE, seed)
            seconds.append(time.process_time() - begun)
            ratios.append(probability / p)
            told.append(spread)
        yield {
            "event": name,
            "peer": peer,
            "truth": p,
            "runs": runs,
            "told_spread": round(float(np.sqrt(np.mean(np.square(told)))), 4),
            "error": round(float(np.sqrt(np.mean((np.array(ratios) - 1.0) ** 2))), 4),
            "members": round(members / runs),
            "seconds": round(float(np.median(seconds)), 3),
        }
