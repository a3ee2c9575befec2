# SPDX-License-Identifier: Apache-2.0
"""Ratio of the probabilities of two rare events, from failing members of each that are run for the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.uncertainty.rare.answer import RareEvent
from lgvi_warp.uncertainty.rare.limit import VehicleLimit

# Most failing members of one event that are run in the other, and most of their normals; the fewest independent ones, in
# effect, that happen in both.
MOST_RUN, MOST_NUMBERS, FEWEST_SHARED = 4000, 4_000_000, 8.0


@dataclass(frozen=True)
class Share:
    """Fraction of an event's members for which another happens; spread: relative error; count: independent members."""

    value: float
    spread: float
    count: float

    @classmethod
    def of(cls, happens: np.ndarray, weights: np.ndarray, ancestors: np.ndarray) -> Share:
        """Compute it from weighted members (n,); members with the same ancestor (n,), counted from 0, are related.

        docs/theory/rare_events.md, (B13).
        """
        total = np.bincount(ancestors, weights)
        alike = bool((happens == happens[0]).all())
        share = float(happens[0]) if alike else float(weights @ happens) / total.sum()
        # Of a ratio of two sums over independent ancestors.
        away = np.bincount(ancestors, weights * (happens - share))
        variance = float((away**2).sum()) / total.sum() ** 2
        count = float(total.sum() ** 2 / (total**2).sum())
        # Where all or none are seen, chance may have hidden one: no less than half a member is unsure.
        smooth = (share * count + 0.5) / (count + 1.0)
        variance = smooth * (1.0 - smooth) / (count + 2.0) if alike else variance
        return cls(share, math.sqrt(variance) / share if share > 0.0 else math.inf, count)


@dataclass(frozen=True)
class RareRatio:
    """Ratio of the probabilities of a second and a first event; paired: True if failing members were run in both.

    p: p-value of a ratio of 1, from the normal distribution of its logarithm.
    """

    value: float
    lower: float
    upper: float
    p: float
    paired: bool


class FailingMembers(NamedTuple):
    """Members for which an event happens: normals u (m, d) of numbers and noise, their weights and their ancestors (m,)."""

    u: np.ndarray
    weights: np.ndarray
    ancestors: np.ndarray


def members_of(found: RareEvent) -> FailingMembers:
    """An event's failing members, at most 4,000; from more, they are drawn by their weights."""
    u, weights = np.concatenate([found.normals, found.draws], axis=1), found.weights
    ancestors = np.unique(found.ancestors, return_inverse=True)[1]
    most = min(MOST_RUN, max(100, MOST_NUMBERS // max(1, u.shape[1])))
    if len(u) > most:
        kept = np.sort(generator(0, "rare pairs").choice(len(u), most, p=weights))
        u, weights, ancestors = u[kept], np.full(most, 1.0 / most), ancestors[kept]
    return FailingMembers(u, weights, ancestors)


def carried(u: np.ndarray, own: VehicleLimit, other: VehicleLimit, seed: int) -> np.ndarray:
    """Convert the normals of members from one limit to another, by the names of numbers and draws.

    Normals that the first limit does not have are redrawn, since they have no effect there.
    """
    v = generator(seed, "rare carried").standard_normal((len(u), other.d))
    columns = {name: i for i, name in enumerate(own.names)}
    for i, name in enumerate(other.names):
        if name in columns:
            v[:, i] = u[:, columns[name]]
    sources = {(each.of, each.stream, each.first, each.spacing, each.numbers): each for each in own.sources}
    for each in other.sources:
        same = sources.get((each.of, each.stream, each.first, each.spacing, each.numbers))
        if same is not None:
            v[:, len(other.names) :][:, each.columns] = u[:, len(own.names) :][:, same.columns]
    return v


def shared(failing: FailingMembers, own: VehicleLimit, other: VehicleLimit, seed: int = 0) -> Share:
    """Fraction of an event's members for which the event of another limit happens, with the same numbers and noise.

    docs/theory/rare_events.md, (B12).
    """
    happens = other(carried(failing.u, own, other, seed)) > 0.0
    return Share.of(happens.astype(float), failing.weights, failing.ancestors)


def ratio_of(
    first: RareEvent, second: RareEvent, of_first: Share, of_second: Share, confidence: float = 0.95
) -> RareRatio:
    """The ratio of two probabilities; of_first: fraction of the first's members for which the second happens.

    docs/theory/rare_events.md, (B12).

    P(B) / P(A) = P(B | A) / P(A | B) is the best bridge between the two distributions of failing members (Meng & Wong 1996)
    if the events have members in common. If the ratio of the two independent answers has a smaller error, it is used.
    """
    from scipy.special import ndtr, ndtri

    spread = math.hypot(first.relative_error, second.relative_error)
    log_ratio, paired = math.log(second.probability / first.probability), False
    if min(each.value * each.count for each in (of_first, of_second)) >= FEWEST_SHARED:
        bridged = math.hypot(of_first.spread, of_second.spread)
        if bridged < spread:
            spread, paired = bridged, True
            log_ratio = math.log(of_first.value / of_second.value)
    away = float(ndtri(0.5 + 0.5 * confidence)) * spread
    p = 2.0 * float(ndtr(-abs(log_ratio) / spread)) if spread > 0.0 else float(log_ratio == 0.0)
    return RareRatio(math.exp(log_ratio), math.exp(log_ratio - away), math.exp(log_ratio + away), p, paired)
