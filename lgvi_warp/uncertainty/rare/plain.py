# SPDX-License-Identifier: Apache-2.0
"""Plain sampling of a limit function of standard normals, by Sobol points if there are few normals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.uncertainty.rare.subset import Limit

# Independent scrambled sequences, most normals for them, the fewest members of one, and members that are run at once.
REPLICATES, MOST_SOBOL, FEWEST_EACH, AT_ONCE = 16, 64, 64, 16_384
# With fewer failing members the interval holds that of a count, too.
FEW = 50


@dataclass(frozen=True, eq=False)
class PlainAnswer:
    """A probability; spread: its relative error; failing: (m, d), members with the event; limits: (m,), their limits.

    rows: (k, m), the limits of each condition. bounds: the 95 % interval of a count, if it is small; None otherwise.
    """

    probability: float
    spread: float
    degrees: float
    failing: np.ndarray
    limits: np.ndarray
    rows: np.ndarray
    bounds: tuple[float, float] | None = None


def counted(hits: int, count: int) -> tuple[float, float] | None:
    """The 95 % interval of a fraction of independent members for few hits (Clopper & Pearson 1934); None for many."""
    from scipy.stats import beta

    if min(hits, count - hits) >= FEW:
        return None
    return (float(beta.ppf(0.025, hits, count - hits + 1)) if hits else 0.0,
            float(beta.ppf(0.975, hits + 1, count - hits)) if hits < count else 1.0)  # fmt: skip


def sampled(
    limit: Limit, d: int, count: int, seed: int, report: Callable[[int], None] = lambda members: None
) -> PlainAnswer:
    """The probability that a limit is positive, from at least `count` members; limit: (n, d) -> (n,) or (k, n)."""
    if d > MOST_SOBOL:
        return _at_random(limit, d, count, seed, report)
    from scipy.special import ndtri
    from scipy.stats import qmc

    each = max(FEWEST_EACH, 2 ** math.ceil(math.log2(count / REPLICATES)))
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
    # Sequences that agree by chance have no spread: one member of each is never sure.
    spread = max(float(np.std(shares, ddof=1)), 1.0 / each) / math.sqrt(REPLICATES)
    bounds = counted(round(share * each * REPLICATES), each * REPLICATES)
    return PlainAnswer(share, spread / share if share else math.inf, REPLICATES - 1.0, *failing.all(), bounds)


class _Failing:
    """Collects the members for which the event happens, batch by batch."""

    def __init__(self, d: int):
        self._u, self._rows = [np.zeros((0, d))], list[np.ndarray]()

    def take(self, u: np.ndarray, limits: np.ndarray) -> int:
        """Keep those of a batch, and return their number."""
        limits = np.atleast_2d(limits)
        happens = (limits > 0.0).any(axis=0)
        self._u.append(u[happens])
        self._rows.append(limits[:, happens])
        return int(happens.sum())

    def all(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All members: (normals (m, d), limits (m,), limits of each condition (k, m))."""
        rows = np.concatenate(self._rows, axis=1)
        return np.concatenate(self._u), rows.max(axis=0, initial=-math.inf), rows


def _at_random(limit: Limit, d: int, count: int, seed: int, report: Callable[[int], None]) -> PlainAnswer:
    # docs/theory/rare_events.md, (B2).
    rng, failing, hits = generator(seed, "rare plain"), _Failing(d), 0
    for first in range(0, count, AT_ONCE):
        u = rng.standard_normal((min(AT_ONCE, count - first), d))
        hits += failing.take(u, limit(u))
        report(len(u))
    share = hits / count
    spread = math.sqrt(max(1.0 - share, 1.0 / count) / max(1, hits))
    return PlainAnswer(share, spread, float(count), *failing.all(), counted(hits, count))
