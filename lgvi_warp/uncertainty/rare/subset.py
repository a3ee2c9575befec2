# SPDX-License-Identifier: Apache-2.0
"""Subset simulation: the probability that a limit function of standard normals is above 0, however small (Au & Beck 2001).

Several independent runs advance by levels together, so that all their chains form one batch of the limit function.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

# (n, d) standard normals -> (n,): above 0 where the event happens.
Limit = Callable[[np.ndarray], np.ndarray]

# The part of a level's members that is above the next threshold, and the acceptance that chains are steered to.
SHARE, ACCEPTANCE = 0.1, 0.44
# The first scale of the chains' steps.
FIRST_SCALE = 0.6
# Most levels: what is rarer than 1e-16 is not looked for, since levels of the cube end there.
MOST_LEVELS = 17
# A threshold that so large a part of a level's members reaches sorts nothing out.
FLAT = 0.5
# How often members that no event narrows may look narrower in any number.
BY_CHANCE = 1e-3
# Fewest members that may make the next level, where all others have one value that is farthest from the event.
FEWEST_SEEDS = 10


class NoProgress(Exception):  # noqa: N818  (what happened, and no fault of the program)
    """Raised if the levels come no nearer to the event.

    kind: "steps" if the limit takes few values, "never" if the event is too rare. largest: the largest limit so far.
    """

    def __init__(self, kind: str, largest: float):
        super().__init__(kind)
        self.kind, self.largest = kind, largest


@dataclass(frozen=True, eq=False)
class ChainLevel:
    """The members of one level; all their limits are at or above the threshold.

    u: (n, d), chain by chain. limits: (n,). chains: number of chains; n if the members are independent. threshold: -inf for
    the first level. log_probability: logarithm of the level's probability. variance: of its relative error, by the chains.
    """

    u: np.ndarray
    limits: np.ndarray
    chains: int
    threshold: float = -math.inf
    log_probability: float = 0.0
    variance: float = 0.0
    acceptance: float = 1.0


@dataclass(frozen=True, eq=False)
class SubsetRun:
    """One run of subset simulation.

    Attributes:
        probability: probability of the event.
        spread: standard deviation of its relative error, estimated from the run's own chains: an underestimate.
        thresholds: (k,), the smallest limit allowed at each level; the first is -inf.
        limits: limits (n,) of the members of each level.
        acceptance: (k,), fraction of the chains' proposals that were accepted at each level.
        failing: (m, d), the standard normals of the last level's members for which the event happens.
        failing_limits: (m,), limits of the failing members.
        size: number of members of a level.
        members: number of members that were run.
        failing_chains: (m,), the chain of each of the failing members.
        failing_ancestors: (m,), the member of the first level from which each failing member descends.
        parts: (m,), for several conditions: 1 / number of conditions that each failing member fulfils.
        rows: (k, m), limits of the failing members for each condition; empty for a single condition.
    """

    probability: float
    spread: float
    thresholds: np.ndarray
    limits: tuple[np.ndarray, ...]
    acceptance: np.ndarray
    failing: np.ndarray
    failing_limits: np.ndarray
    size: int
    members: int
    failing_chains: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    failing_ancestors: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    parts: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rows: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def share(self) -> float:
        """Share of this condition in the event's probability: members that fulfil several conditions count in parts."""
        return self.probability * (float(self.parts.mean()) if len(self.parts) else 1.0)


@dataclass(eq=False)
class _Climber:
    """A run in progress: its levels; only the last level keeps its normals."""

    rng: np.random.Generator
    level: ChainLevel
    size: int
    members: int = 0
    scale: float = FIRST_SCALE
    below: list[ChainLevel] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.ancestors = np.arange(len(self.level.limits))

    @property
    def arrived(self) -> bool:
        """True if the event is no longer rare among the members of this level."""
        return int((self.level.limits > 0.0).sum()) >= self.seeds

    @property
    def seeds(self) -> int:
        """Number of chains of a level."""
        return max(1, round(SHARE * self.size))

    def threshold(self) -> float:
        """The next threshold, which a tenth of the members reach. Raises NoProgress."""
        limits = self.level.limits
        bound, farthest = min(0.0, float(np.partition(limits, -self.seeds)[-self.seeds])), -np.finfo(float).max
        if bound <= farthest and (limits > farthest).sum() >= FEWEST_SEEDS:
            # Most are farthest from the event, as the logarithm of 0 is: the others are the next level, though fewer.
            bound = min(0.0, float(limits[limits > farthest].min()))
        reached, largest = (limits >= bound).mean(), float(limits.max())
        if bound <= farthest:
            raise NoProgress("steps", largest)
        if reached > FLAT or bound <= self.level.threshold:
            # A value that many members have is a step; after more levels the limit has come to its largest value.
            steps = len(self.below) < 3 or bool((self.below[0].limits == bound).any())
            raise NoProgress("steps" if steps else "never", largest)
        if len(self.below) + 1 >= MOST_LEVELS:
            raise NoProgress("never", largest)
        return bound

    def begin(self) -> None:
        """Start chains at members that reach the next threshold."""
        level, bound = self.level, self.threshold()
        inside = np.flatnonzero(level.limits >= bound)
        chosen = np.resize(self.rng.permutation(inside), self.seeds)
        self._u, self._limits, self._ancestors = [level.u[chosen]], [level.limits[chosen]], self.ancestors[chosen]
        self.inside, self.of = level.u[inside], inside // (len(level.limits) // level.chains)
        share = len(inside) / len(level.limits)
        log_probability = level.log_probability + math.log(share)
        variance = level.variance + share_variance(level.limits >= bound, level.chains)
        self._next = ChainLevel(level.u[:0], level.limits[:0], len(chosen), bound, log_probability, variance)
        self._accepted, self._steps = 0.0, 0

    def step_as(self, others: Sequence[_Climber]) -> None:
        """Take the step widths from other runs, if there are any, since widths from a run's own members would bias it."""
        runs = [run.inside for run in others if run is not self]
        if runs:
            self._widths = np.clip(np.concatenate(runs).std(axis=0), 1e-3, 1.0)
        else:
            self._widths = widths_of(self.inside, len(np.unique(self.of)))

    def proposals(self) -> np.ndarray:
        """Proposals of all chains, which preserve the standard normal distribution (Papaioannou et al. 2015).

        docs/theory/rare_events.md, (B4).
        """
        u, step = self._u[-1], np.minimum(1.0, self.scale * self._widths)
        return np.sqrt(1.0 - step**2) * u + step * self.rng.standard_normal(u.shape)

    def take(self, places: np.ndarray, limits: np.ndarray) -> None:
        """Move the chains whose proposals reach the threshold, and adapt the step to the acceptance."""
        accepted = limits >= self._next.threshold
        self._u.append(np.where(accepted[:, None], places, self._u[-1]))
        self._limits.append(np.where(accepted, limits, self._limits[-1]))
        share, self._steps = float(accepted.mean()), self._steps + 1
        self._accepted += share
        self.scale = float(np.clip(self.scale * math.exp((share - ACCEPTANCE) / math.sqrt(self._steps)), 1e-3, 1e3))
        self.members += len(limits)

    def end(self) -> None:
        """Make the chains' members the current level."""
        self.below.append(replace(self.level, u=self.level.u[:0]))
        u, limits = np.stack(self._u, axis=1), np.stack(self._limits, axis=1)
        acceptance, self.ancestors = self._accepted / max(1, self._steps), np.repeat(self._ancestors, u.shape[1])
        self.level = replace(self._next, u=u.reshape(-1, u.shape[2]), limits=limits.ravel(), acceptance=acceptance)

    def result(self) -> SubsetRun:
        """The finished run."""
        level, levels = self.level, [*self.below, self.level]
        happens = level.limits > 0.0
        return SubsetRun(
            probability=math.exp(level.log_probability) * float(happens.mean()),
            spread=math.sqrt(level.variance + share_variance(happens, level.chains)),
            thresholds=np.array([each.threshold for each in levels]),
            limits=tuple(each.limits for each in levels),
            acceptance=np.array([each.acceptance for each in levels]),
            failing=level.u[happens],
            failing_limits=level.limits[happens],
            size=self.size,
            members=self.members,
            failing_chains=np.flatnonzero(happens) // (len(happens) // level.chains),
            failing_ancestors=self.ancestors[happens],
        )


def widths_of(u: np.ndarray, count: int) -> np.ndarray:
    """Step widths (d,): normals that the event narrows get narrow steps; u: (n, d), from `count` independent members.

    docs/theory/rare_events.md, (B4).
    """
    from scipy.stats import chi2

    spread = u.std(axis=0)
    least = math.sqrt(chi2.ppf(BY_CHANCE / u.shape[1], count - 1) / count) if count > 1 else 0.0
    return np.where(spread < least, np.maximum(spread, 1e-3), 1.0)


def share_variance(happens: np.ndarray, chains: int) -> float:
    """Variance of a share's relative error, of members (n,) chain by chain: from the scatter of the chains' own shares.

    docs/theory/rare_events.md, (B5).
    """
    share = float(happens.mean())
    if chains == len(happens):
        return (1.0 - share) / (share * chains)
    own = happens.reshape(chains, -1).mean(axis=1)
    return float(own.var(ddof=1)) / (share**2 * chains) if chains > 1 else math.inf


def levels_of(u: np.ndarray, limits: np.ndarray, size: int) -> list[ChainLevel]:
    """First levels of several runs, from the members of all runs."""
    return [ChainLevel(u[i : i + size], limits[i : i + size], size) for i in range(0, len(u), size)]


def climb(
    limit: Limit, levels: Sequence[ChainLevel], generators: Sequence[np.random.Generator],
    report: Callable[[int], None] = lambda members: None) -> list[SubsetRun]:  # fmt: skip
    """Subset simulation from given first levels to the event: independent runs, all chains in one batch.

    docs/theory/rare_events.md, (B3).

    report: called with the number of members that each step runs.
    Raises: NoProgress.
    """
    runs = [
        _Climber(rng, level, len(level.limits), len(level.limits))
        for rng, level in zip(generators, levels, strict=True)
    ]
    while active := [run for run in runs if not run.arrived]:
        for run in active:
            run.begin()
        for run in active:
            run.step_as(active)
        for _ in range(1, round(1.0 / SHARE)):
            places = [run.proposals() for run in active]
            limits = limit(np.concatenate(places))
            report(len(limits))
            ends = np.cumsum([len(each) for each in places])[:-1]
            for run, own, values in zip(active, places, np.split(limits, ends), strict=True):
                run.take(own, values)
        for run in active:
            run.end()
    return [run.result() for run in runs]
