# SPDX-License-Identifier: Apache-2.0
"""A box of named numbers, and the search for the lowest cost in it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults
from lgvi_warp.scene.names import single_number

# Candidates of a generation for each number, at least so many.
POPULATION, LEAST = 8, 16
# The part of the budget that evolution has; corners have at most as much as the walk.
EVOLUTION = 0.7
# The walk begins with steps of this part of each width, and ends with the other.
FIRST_STEP, LAST_STEP = 0.25, 1e-5
# Parts of what evolution and walk leave: for spread points, and for walks from the best of them; points that are run at once.
SPREAD, WALKS, AT_ONCE = 0.75, 0.2, 1000
# Neighbours than which a start of a walk is better, times the logarithm of the points (Rinnooy Kan & Timmer 1987).
NEIGHBOURS = 4.0
# Steps of each walk, at least, before the worse half of the walks ends.
STEPS = 2

# Candidates (k, d) -> cost of each (k,); infinite where a run failed.
Cost = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class SearchBox:
    """Bounds of numbers of a scene (d,); log: True if the search uses the logarithm of the number."""

    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    log: np.ndarray

    @classmethod
    def of(cls, key: str, bounds: Any, scene: Any) -> SearchBox:
        """Read bounds by name, (low, high) or (low, high, "log"); key: name of the argument, for messages."""
        faults, rows = Faults(), []
        example = '{"heading_pid.kp": (0.5, 5.0)}'
        if not isinstance(bounds, Mapping) or not bounds:
            faults.add(key, bounds, "maps no names to bounds", f"give {example}")
        for name, pair in bounds.items() if not faults else ():
            if not isinstance(name, str):
                faults.add(key, name, "is not a name of a number", f"give {example}")
                continue
            with faults.including():
                name = single_number(scene, name, key)[0].label
            values = tuple(items_of(pair) or ())
            log = len(values) == 3 and values[2] == "log"
            ends = faults.finite(f'{key}."{name}"', values[:2] if log else values or pair, (2,))
            if ends is None:
                continue
            if not ends[0] < ends[1]:
                faults.add(f'{key}."{name}"', pair, "does not rise", "give (low, high)")
            elif log and ends[0] <= 0.0:
                faults.add(f'{key}."{name}"', pair, "has no logarithm", "give bounds above 0")
            rows.append((name, *ends, log))
        faults.raise_if_any()
        names, low, high, logs = zip(*rows, strict=True)
        return cls(names, np.array(low), np.array(high), np.array(logs, bool))

    def values(self, inside: np.ndarray) -> np.ndarray:
        """Numbers (k, d) at points of the unit cube (k, d); 0 and 1 give exactly the bounds."""
        low, high = (np.log(np.where(self.log, end, 1.0)) for end in (self.low, self.high))
        curved, straight = np.exp(low + inside * (high - low)), self.low + inside * (self.high - self.low)
        within = np.clip(np.where(self.log, curved, straight), self.low, self.high)
        return np.where(inside <= 0.0, self.low, np.where(inside >= 1.0, self.high, within))


@dataclass(frozen=True)
class BestCandidate:
    """The best candidate of a search; at: point (d,) of the unit cube; restarts: the lowest cost of each evolution.

    points: number of candidates that were spread evenly over the cube, independent of their costs.
    """

    at: np.ndarray
    cost: float
    restarts: np.ndarray
    runs: int
    points: int = 0


def least_peak(points: int, confidence: float = 0.95) -> float:
    """Fraction of the cube that a region must fill to contain a spread point with this confidence."""
    return 1.0 - (1.0 - confidence) ** (1.0 / points) if points else 1.0


class _CountedCost:
    """Cost function that counts candidates and remembers the best."""

    def __init__(self, cost: Cost, most: int, good_enough: float, report: Callable[[int], None]):
        self.cost, self.most, self.good_enough, self.report, self.count = cost, most, good_enough, report, 0
        self.best: np.ndarray | None = None
        self.least = math.inf

    @property
    def remaining(self) -> int:
        return 0 if self.least <= self.good_enough else self.most - self.count

    def __call__(self, places: np.ndarray) -> np.ndarray:
        costs = np.where(np.isnan(values := self.cost(places)), np.inf, values)
        self.count += len(places)
        self.report(self.count)
        first = int(np.argmin(costs))
        if self.best is None or costs[first] < self.least:
            self.best, self.least = places[first].copy(), float(costs[first])
        return costs


def search(
    cost: Cost, d: int, most: int, seed: int, restarts: int, good_enough: float = -math.inf,
    report: Callable[[int], None] = lambda count: None, spend: bool = False) -> BestCandidate:  # fmt: skip
    """Find the lowest cost in the unit cube of d dimensions, or a cost that is good enough.

    Differential evolution (Storn & Price 1997) runs several times from different starts. Then come all corners, if they
    are few, and a walk along the axes from the best point, with a step that shrinks if no neighbour is better.
    report: called with the number of candidates tried. spend: True spends the remaining budget on points spread over
    the cube, and on walks from the best of them.
    """
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    ask = _CountedCost(cost, most, good_enough, report)
    size = max(LEAST, POPULATION * d)
    restarts = max(1, min(restarts, int(EVOLUTION * most / (4 * size))))
    each, least = int(EVOLUTION * most / restarts), []
    for i in range(restarts):
        generations = min(each, ask.remaining) // size - 1
        if generations < 0:
            break
        start = qmc.LatinHypercube(d, rng=np.random.default_rng((seed, i))).random(size)
        try:
            answer = differential_evolution(
                lambda x: ask(x.T), [(0.0, 1.0)] * d, init=start, maxiter=generations, vectorized=True, updating="deferred",
                polish=False, tol=1e-6, atol=0.0, rng=np.random.default_rng((seed, restarts + i)),
                callback=lambda intermediate_result: ask.remaining == 0)  # fmt: skip
        except RuntimeError as error:
            # SciPy hides a ValueError of the cost behind one of its own.
            raise error.__cause__ or error from None
        least.append(answer.fun)
    if ask.remaining and 2**d <= max(ask.remaining // 2, 1):
        ask(np.array(list(itertools.product((0.0, 1.0), repeat=d))))
    _walk_from_best(ask, FIRST_STEP)
    points, rng = size * len(least), np.random.default_rng((seed, 2 * restarts))
    while spend and (more := _spread(ask, d, rng)):
        points += more
    assert ask.best is not None
    return BestCandidate(ask.best, ask.least, np.array(least), ask.count, points)


def _spread(ask: _CountedCost, d: int, rng: np.random.Generator) -> int:
    """Spend most of the remaining budget on Sobol points and on walks from local minima; returns the number of points.

    Multi-level single linkage (Rinnooy Kan & Timmer 1987) with Sobol points (Kucherenko & Sytsko 2005).
    """
    from scipy.stats import qmc

    count = int(SPREAD * ask.remaining)
    if count < LEAST:
        return 0
    points = qmc.Sobol(d, rng=rng).random_base2(math.ceil(math.log2(count)))[:count]
    costs, asked = np.full(count, np.inf), 0
    while asked < count and ask.remaining:
        batch = points[asked : asked + AT_ONCE]
        costs[asked : asked + len(batch)] = ask(batch)
        asked += len(batch)
    if not ask.remaining:
        return asked
    # Of these walks the worse half ends after each round; all rounds take as many candidates.
    left = int(WALKS / (1.0 - SPREAD) * ask.remaining)
    starts = _starts(points, costs)[: max(1, left // (2 * d * STEPS))]
    while (rounds := len(starts).bit_length()) * 2 * d * STEPS * len(starts) > left and len(starts) > 1:
        starts = starts[: len(starts) // 2]
    before, walks = (
        ask.least,
        (points[starts], costs[starts], np.full(len(starts), min(FIRST_STEP, count ** (-1.0 / d)))),
    )
    for _ in range(rounds):
        for _ in range(left // (rounds * 2 * d * len(walks[0]))):
            if ask.remaining < 2 * d * len(walks[0]) or walks[2].max() < LAST_STEP:
                break
            walks = _stepped(ask, *walks)
        kept = np.argsort(walks[1], kind="stable")[: (len(walks[1]) + 1) // 2]
        walks = walks[0][kept], walks[1][kept], walks[2][kept]
    if ask.least < before:
        _walk_from_best(ask, float(walks[2][0]))
    return asked


def _starts(points: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """Indices of points (n, d) that are better than all their neighbours, the best first.

    If costs are equal, the first point counts as better.
    """
    from scipy.spatial import cKDTree

    n = len(points)
    order = np.argsort(costs, kind="stable")
    rank = np.empty(n, int)
    rank[order] = np.arange(n)
    tree, near = cKDTree(points), min(n, 1 + math.ceil(NEIGHBOURS * math.log(n)))
    best = [rank[tree.query(points[i : i + AT_ONCE], near)[1]].min(axis=1) for i in range(0, n, AT_ONCE)]
    return order[np.concatenate(best)[order] == np.arange(n)]


def _stepped(
    ask: _CountedCost, places: np.ndarray, costs: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One step of walks from points (k, d) to the best neighbour along the axes; if none is better, halve the step."""
    k, d = places.shape
    sides = np.concatenate([np.eye(d), -np.eye(d)])
    around = np.clip(places[:, None] + steps[:, None, None] * sides, 0.0, 1.0)
    theirs = ask(around.reshape(-1, d)).reshape(k, 2 * d)
    best = np.arange(k), theirs.argmin(axis=1)
    better = theirs[best] < costs
    return (np.where(better[:, None], around[best], places), np.where(better, theirs[best], costs),
            np.where(better, steps, 0.5 * steps))  # fmt: skip


def _walk_from_best(ask: _CountedCost, step: float) -> None:
    """Walk from the best point so far, until steps are short or the budget is spent."""
    if ask.best is None:
        return
    walk = ask.best[None], np.array([ask.least]), np.array([step])
    while walk[2][0] > LAST_STEP and ask.remaining >= 2 * len(ask.best):
        walk = _stepped(ask, *walk)
