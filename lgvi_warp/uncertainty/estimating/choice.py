# SPDX-License-Identifier: Apache-2.0
"""Choice of an estimator by predicted cost: plain, replicates of Sobol points, regression, or levels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lgvi_warp.uncertainty.estimating.bias import APART
from lgvi_warp.uncertainty.estimating.estimators import (
    REPLICATES,
    UNSEEN,
    VarianceModel,
    best_numbers,
    regressed,
    slope,
    spread_of_plain,
    spread_of_replicates,
)
from lgvi_warp.uncertainty.estimating.levels import Setting
from lgvi_warp.uncertainty.estimating.target import Solved

# Numbers of members are larger than predicted by this factor: variances are known to a third by 16 replicates, and better by
# independent members.
ROOM = {"sobol": 1.3, "plain": 1.05, "regression": 1.1}
# Replicates must beat independent members by this, whose spread is known better.
CLEARLY = 1.1
# A coarse setting must cost less than this part of the fine one.
CHEAPER = 0.6
ESTIMATORS = ("plain Monte Carlo", "sobol", "regression", "levels", "levels of sobol")
# Least members of a level.
FEWEST = 4 * REPLICATES


@dataclass(frozen=True)
class Way:
    """A way to estimate: indices of settings in the pilot, from the finest to the coarsest, and members of each level.

    slopes: factor of the coarser setting, for each level except the last.
    seconds, variance: predictions with these members.
    """

    kind: str
    chain: tuple[int, ...]
    slopes: tuple[float, ...]
    members: tuple[int, ...]
    seconds: float
    variance: float

    @property
    def name(self) -> str:
        """Name of the estimator."""
        if len(self.chain) == 1:
            return {"plain": "plain Monte Carlo"}.get(self.kind, self.kind)
        return "levels of sobol" if self.kind == "sobol" else "levels"


@dataclass(frozen=True)
class Observed:
    """Observations of a pilot: contributions of the same members in several settings, the finest first.

    z: contributions (settings, n). normals: (n, d) of the members' numbers. least: smallest change of a contribution.
    costs: cost of a member in each of `settings` [s]. pair: cost of a member in two settings, by index [s].
    at: the solved target that defines the contributions. alone: index of a setting -> contributions of more members.
    call: fixed cost of a call [s]. weight: weight of all contributions. reach: as in `Level`.
    """

    z: Sequence[np.ndarray]
    normals: np.ndarray
    costs: Sequence[float]
    pair: Callable[[int, int], float]
    least: float
    settings: Sequence[Setting]
    at: Solved
    alone: Mapping[int, np.ndarray] = field(default_factory=dict)
    call: float = 0.0
    weight: float = 1.0
    reach: float = 0.0


def candidates(seen: Observed, variance: float, only: str | None = None) -> list[Way]:
    """All ways to reach a variance, the cheapest first; only: an estimator whose ways come before all others."""
    asked = only is not None and only.startswith("levels")
    chains = [(0,)] + [chain for k in (2, 3) for chain in coupled(seen, k, asked)]
    kinds = ["plain"] + (["sobol"] if seen.normals.shape[1] else [])
    ways = [_candidate(seen, kind, chain, variance) for chain in chains for kind in kinds]
    if 0 < 8 * (seen.normals.shape[1] + 1) <= len(seen.z[0]) and seen.normals.shape[1]:
        ways.append(_candidate(seen, "regression", (0,), variance))
    ways.sort(key=lambda way: way.seconds * (CLEARLY if way.kind == "sobol" else 1.0))
    ways.sort(key=lambda way: only is not None and way.name != only)
    # Of those that cost about the same, as where few members do, the one with the least variance.
    near = [way for way in ways if way.seconds <= CLEARLY * ways[0].seconds and only in (None, way.name)] or ways[:1]
    best = min(near, key=lambda way: way.variance)
    return [best, *(way for way in ways if way is not best)]


def coupled(seen: Observed, count: int, asked: bool = False) -> list[tuple[int, ...]]:
    """Chains of `count` settings, each correlated with the last and much cheaper; asked: True allows any cost."""
    chains = []
    for rest in itertools.combinations(range(1, len(seen.z)), count - 1):
        chain = (0, *sorted(rest, key=lambda i: -seen.costs[i]))
        links = list(itertools.pairwise(chain))
        cheap = asked or all(seen.costs[c] < CHEAPER * seen.costs[f] for f, c in links)
        if cheap and all(slope(seen.z[f], seen.z[c])[1] <= APART for f, c in links):
            chains.append(chain)
    return chains


def _candidate(seen: Observed, kind: str, chain: tuple[int, ...], variance: float) -> Way:
    slopes, spreads, weight = list[float](), list[VarianceModel](), seen.weight
    for f, c in itertools.pairwise(chain):
        factor = slope(seen.z[f], seen.z[c])[0]
        spreads.append(_spread(seen, kind, weight * (seen.z[f] - factor * seen.z[c]), seen.pair(f, c), weight))
        slopes.append(factor)
        weight *= factor
    last = chain[-1]
    z = weight * seen.alone.get(last, seen.z[last])
    spreads.append(_spread(seen, kind, z, seen.costs[last], weight, seen.reach))
    numbers = best_numbers(spreads, variance)
    dimensions = seen.normals.shape[1]
    members = tuple(
        rounded(kind, ROOM[kind] * n, dimensions, spread.power) for n, spread in zip(numbers, spreads, strict=True)
    )
    seconds = float(sum(max(ROOM[kind] * n, FEWEST) * spread.cost for n, spread in zip(numbers, spreads, strict=True)))
    seconds += (2 * len(chain) - 1) * seen.call
    left = sum(spread.at(n) for spread, n in zip(spreads, members, strict=True))
    return Way(kind, chain, tuple(slopes), members, seconds, left)


def _spread(seen: Observed, kind: str, z: np.ndarray, cost: float, weight: float, reach: float = 0.0) -> VarianceModel:
    least = abs(weight) * seen.least
    if kind == "sobol":
        model = spread_of_replicates(z, cost, least)
    elif kind == "regression":
        model = VarianceModel(regressed(z, seen.normals, least).variance * len(z), cost)
    else:
        model = spread_of_plain(z, cost, least)
    return replace(model, unseen=UNSEEN * max(least, abs(weight) * reach, float(np.std(z))))


def rounded(kind: str, members: float, dimensions: int, power: float = 1.0) -> int:
    """Round a number of members to one that the estimator accepts.

    Replicates of a power of two of Sobol points are balanced, which pays if the variance falls faster than 1 / members;
    otherwise a multiple of an eighth of a power is fine enough.
    """
    if kind == "sobol":
        points = max(members / REPLICATES, 4.0)
        whole = 2 ** math.ceil(math.log2(points))
        part = whole if power > 1.0 else max(whole // 16, 1)
        return REPLICATES * part * math.ceil(points / part)
    least = max(FEWEST, 8 * (dimensions + 1)) if kind == "regression" else FEWEST
    return REPLICATES * math.ceil(max(members, least) / REPLICATES)


def gains(ways: Sequence[Way]) -> dict[str, float]:
    """Estimator -> predicted cost of plain Monte Carlo in the same setting, divided by the cost of this estimator."""
    plain = next(way.seconds for way in ways if way.kind == "plain" and len(way.chain) == 1)
    best: dict[str, float] = {}
    for way in ways:
        best[way.name] = max(best.get(way.name, 0.0), plain / way.seconds)
    return {name: gain for name, gain in best.items() if name != "plain Monte Carlo"}
