# SPDX-License-Identifier: Apache-2.0
"""A second look for failure modes that chains missed: it only uses whether members fail, not how near they are to failure.

Members are drawn with enlarged spreads; failing members are carried back to the nominal spreads in stages (sequential
importance sampling, Papaioannou, Papadimitriou & Straub 2016). Without levels, none can lead past a failure mode. The
stages estimate the probability, but their members soon descend from a few wide members. Each wide member is therefore
also led to the nominal spread alone: these lookers stay in their failure modes and are independent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

# (n, d) standard normals -> (n,): whether the event happens.
Happens = Callable[[np.ndarray], np.ndarray]
# Members that are drawn wide at once, and at most; particles of a stage, steps of each, and what weights are worth at least.
FIRST, MOST_FIRST, PARTICLES, MOVES, WORTH = 1000, 10_000, 150, 2, 0.4
# Rounds by which a wide member is led to the nominal spread, and the part of its numbers that each draws anew.
LED, ANEW = 12, 0.3
# The enlarged spread: the distance of a half-space with the probability of the chains, over this; its least and largest value.
WIDE_OF, LEAST_WIDE, MOST_WIDE = 1.6, 1.8, 4.0
# First scale of steps, the acceptance that they are steered to, and most stages.
SCALE, ACCEPTANCE, STAGES = 0.5, 0.44, 60
# Times the spread that stages tell, since particles are related; more with more normals, from these on.
RELATED, MANY = 1.3, 3.5
# Members that nearness is measured from, and the part of each run's that are no nearer to the others.
LANDMARKS, ODD = 1000, 0.01
# Steps, and chains, by which few particles are made a group.
GROWTH, GROWN = 6, 100


@dataclass(frozen=True, eq=False)
class Witness:
    """Failing members, distributed nearly as standard normals within the event: u (m, d); m = 0 if none was found.

    lookers: (k, d), independent members, in each mode as often as wide members find it. probability: the stages'
    estimate. spread: its approximate relative error.
    """

    u: np.ndarray
    lookers: np.ndarray
    probability: float
    spread: float


def pooled(looks: Sequence[Witness]) -> Witness:
    """Pool independent looks; the spread is the larger of their own estimates and their scatter."""
    told = np.array([each.probability for each in looks])
    mean = float(told.mean())
    own = math.sqrt(sum((each.probability * each.spread) ** 2 for each in looks if each.probability))
    between = math.sqrt(float(((told - mean) ** 2).sum() * len(looks) / max(len(looks) - 1, 1)))
    u, lookers = (np.concatenate(parts) for parts in ([w.u for w in looks], [w.lookers for w in looks]))
    return Witness(u, lookers, mean, max(own, between) / (len(looks) * mean) if mean else math.inf)


class Surroundings:
    """Regions that independent runs reached; a point is apart if it is farther away than the runs are from each other.

    runs: failing members (m, d) of each run.
    """

    def __init__(self, runs: Sequence[np.ndarray], rng: np.random.Generator):
        u, of = np.concatenate(runs), np.repeat(np.arange(len(runs)), [len(run) for run in runs])
        chosen = rng.permutation(len(u))[:LANDMARKS]
        self._u, of = u[chosen], of[chosen]
        # Of a run that alone found a place, all are odd: the middle one of the runs tells.
        odd = [np.quantile(_least(self._u[of == i], self._u[of != i]), 1.0 - ODD)
               for i in range(len(runs)) if 0 < (of == i).sum() < len(of)]  # fmt: skip
        self._reach = float(np.median(odd)) if odd else math.inf

    def apart(self, u: np.ndarray) -> np.ndarray:
        """Mask (n,) of the points (n, d) that are apart."""
        return _least(u, self._u) > self._reach


def _least(u: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Distance (n,) of each point (n, d) to the nearest of others (m, d)."""
    from scipy.spatial.distance import cdist

    parts = [cdist(u[i : i + 1000], others).min(axis=1) for i in range(0, len(u), 1000)]
    return np.concatenate(parts) if parts else np.zeros(0)


def wide_of(probability: float) -> float:
    """The enlarged spread at which a few percent of the members fail, for a half-space of this probability."""
    from scipy.special import ndtri

    return float(np.clip(-ndtri(max(probability, 1e-300)) / WIDE_OF, LEAST_WIDE, MOST_WIDE))


def witnessed(happens: Happens, d: int, wide: float, rng: np.random.Generator, lookers: int = 1) -> Witness:
    """Find failing members among draws with `wide` times the spread in each direction. docs/theory/rare_events.md, (B14).

    lookers: minimum number of lookers.
    """
    drawn, u = 0, np.zeros((0, d))
    while drawn < FIRST or (0 < len(u) < lookers and drawn < MOST_FIRST):
        places = wide * rng.standard_normal((FIRST, d))
        drawn, u = drawn + FIRST, np.concatenate([u, places[happens(places)]])
    if not len(u):
        return Witness(u, u, 0.0, math.inf)
    alone = led(happens, u[: max(lookers, PARTICLES)], rng)
    log_probability, variance = math.log(len(u) / drawn), (1.0 - len(u) / drawn) / len(u)
    now, scale = wide, SCALE
    for _ in range(STAGES):
        if now <= 1.0:
            break
        squares = (u**2).sum(axis=1)
        then = _next(now, squares)
        logs = -0.5 * squares * (then**-2 - now**-2) + d * math.log(now / then)
        weights = np.exp(logs - logs.max())
        log_probability += float(logs.max()) + math.log(float(weights.mean()))
        variance += float(weights.var() / weights.mean() ** 2) / len(u)
        # Systematic: each particle as often as it weighs, but for one.
        places = (np.arange(PARTICLES) + rng.random()) / PARTICLES
        u = u[np.minimum(np.searchsorted(np.cumsum(weights) / weights.sum(), places), len(u) - 1)]
        for _ in range(MOVES):
            u, scale = moved(happens, u, then, scale, rng)
        now = then
    return Witness(u, alone, math.exp(log_probability), RELATED * max(1.0, d / MANY) * math.sqrt(variance))


def _next(now: float, squares: np.ndarray) -> float:
    """The smallest spread, at least 1, with a sufficient effective sample size of the particles, by bisection."""

    def worth(then: float) -> float:
        logs = -0.5 * squares * (then**-2 - now**-2)
        weights = np.exp(logs - logs.max())
        return float(weights.sum() ** 2 / (weights**2).sum()) / len(squares)

    if worth(1.0) >= WORTH:
        return 1.0
    low, high = 1.0, now
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if worth(middle) >= WORTH else (middle, high)
    return high if high < now else 1.0 + 0.9 * (now - 1.0)


def moved(
    happens: Happens, u: np.ndarray, spread: float, scale: float, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """One step (B4) of failing members within the event, for the distribution with this spread; and the next scale."""
    places = math.sqrt(1.0 - scale**2) * u + scale * spread * rng.standard_normal(u.shape)
    accepted = happens(places)
    factor = math.exp(float(accepted.mean()) - ACCEPTANCE)
    return np.where(accepted[:, None], places, u), float(np.clip(scale * factor, 0.02, 0.95))


def led(happens: Happens, u: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Lead wide members (n, d) to the nominal spread within the event: redraw some numbers, alternating with steps (B4)."""
    scale = SCALE
    for _ in range(LED):
        places = np.where(rng.random(u.shape) < ANEW, rng.standard_normal(u.shape), u)
        u = np.where(happens(places)[:, None], places, u)
        u, scale = moved(happens, u, 1.0, scale, rng)
    return u


def grown(happens: Happens, u: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Add failing members about the given ones (m, d) by short chains, so that a mixture can be fitted."""
    places, scale, kept = u[rng.permutation(GROWN) % len(u)], SCALE, []
    for _ in range(GROWTH):
        places, scale = moved(happens, places, 1.0, scale, rng)
        kept.append(places)
    return np.concatenate([u, *kept[GROWTH // 2 :]])
