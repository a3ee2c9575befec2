# SPDX-License-Identifier: Apache-2.0
"""Plain sampling of a limit function of standard normals, by Sobol points where there are few of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.studies.rare.subset import Limit

# Independent scrambled sequences, most normals for them, and members that are run at once.
REPLICATES, MOST_SOBOL, AT_ONCE = 16, 64, 16_384


@dataclass(frozen=True, eq=False)
class PlainAnswer:
    """A share of members; spread: of its relative error; failing: (m, d), those that happen; limits: (m,), theirs."""

    probability: float
    spread: float
    degrees: float
    failing: np.ndarray
    limits: np.ndarray


def sampled(
    limit: Limit, d: int, count: int, seed: int, report: Callable[[int], None] = lambda members: None
) -> PlainAnswer:
    """The probability that the limit is above 0, of at least so many members."""
    if d > MOST_SOBOL:
        return _at_random(limit, d, count, seed, report)
    from scipy.special import ndtri
    from scipy.stats import qmc

    each = 2 ** max(4, math.ceil(math.log2(count / REPLICATES)))
    shares, failing = [], _Failing(d)
    for replicate in range(REPLICATES):
        sequence, hits = qmc.Sobol(d, bits=48, rng=generator(seed, "rare sobol", replicate)), 0
        for first in range(0, each, AT_ONCE):
            # In the middle of a cell, so that no point is 0.
            u = ndtri(sequence.random(min(AT_ONCE, each - first)) + 2.0**-49)
            hits += failing.take(u, limit(u))
            report(len(u))
        shares.append(hits / each)
    share = float(np.mean(shares))
    spread = float(np.std(shares, ddof=1)) / math.sqrt(REPLICATES)
    return PlainAnswer(share, spread / share if share else math.inf, REPLICATES - 1.0, *failing.all())


class _Failing:
    """The members for which the event happens, batch by batch."""

    def __init__(self, d: int):
        self._u, self._limits = [np.zeros((0, d))], [np.zeros(0)]

    def take(self, u: np.ndarray, limits: np.ndarray) -> int:
        """Keep those of a batch, and return how many there are."""
        happens = limits > 0.0
        self._u.append(u[happens])
        self._limits.append(limits[happens])
        return int(happens.sum())

    def all(self) -> tuple[np.ndarray, np.ndarray]:
        """(normals (m, d), limits (m,))."""
        return np.concatenate(self._u), np.concatenate(self._limits)


def _at_random(limit: Limit, d: int, count: int, seed: int, report: Callable[[int], None]) -> PlainAnswer:
    # docs/theory/rare_events.md, (B2).
    rng, failing, hits = generator(seed, "rare plain"), _Failing(d), 0
    for first in range(0, count, AT_ONCE):
        u = rng.standard_normal((min(AT_ONCE, count - first), d))
        hits += failing.take(u, limit(u))
        report(len(u))
    share = hits / count
    return PlainAnswer(share, math.sqrt((1.0 - share) / max(1, hits)), float(count), *failing.all())
