# SPDX-License-Identifier: Apache-2.0
"""The probability of a rare event of standard normals: several runs of chains, then weights where they are the answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.studies.rare.mixture import MOST_NORMALS, Mixture, WeightedMembers, doubts, fitted, wanting
from lgvi_warp.studies.rare.plain import sampled
from lgvi_warp.studies.rare.subset import SHARE, Limit, SubsetRun, climb, first_levels

# Independent runs of chains; the members of a level in the first ones, and at least and at most in those that follow.
RUNS, FIRST_SIZE, LEAST_SIZE, LARGEST_SIZE = 4, 500, 1000, 200_000
# Mixtures that are tried; members that are drawn from one first, and at most; the fewest that one is made from.
TRIES, TRIED, MOST_DRAWN, FEWEST_FITTED = 2, 2000, 10_000, 100
# Part of the failing members that may be near the margin of the cheap limit.
NEAR_GATE = 0.01
# What is likelier than this is looked for by plain sampling, with so many members at least.
RARE, FEWEST_PLAIN = 1e-3, 256
# Chains' own spread is less than there is, by this, since chains begin at members that are related; it counts for so many
# runs beside the spread between runs, unless that is larger beyond chance (F, 1 %).
RELATED, OWN_COUNT, BEYOND_CHANCE = 1.2, 12, 0.01
# The part of the error asked for that numbers are chosen for; one so much larger is left as it is. Most rounds of runs.
AIM, LEFT, ROUNDS = 1.0, 1.2, 4
TAKES_MORE = "the error asked takes more than the {:,} members that may be run"


@dataclass(frozen=True, eq=False)
class RareAnswer:
    """What a search found, in standard normals.

    Attributes:
        probability: of the event.
        spread: standard deviation of its relative error.
        degrees: degrees of freedom of that spread.
        estimator: "importance", "subset" or "plain".
        members: number of members that were run.
        failing: (m, d), members for which the event happens, each once.
        limits: (m,), their limits.
        weights: (m,), of these; they sum to 1.
        runs: the runs of chains.
        notes: what else is worth knowing.
    """

    probability: float
    spread: float
    degrees: float
    estimator: str
    members: int
    failing: np.ndarray
    limits: np.ndarray
    weights: np.ndarray
    runs: tuple[SubsetRun, ...] = ()
    notes: tuple[str, ...] = ()

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """The interval of the probability, by Student's t of its logarithm. docs/theory/rare_events.md, (B7)."""
        from scipy.stats import t

        away = float(t.ppf(0.5 + 0.5 * confidence, self.degrees)) * self.spread
        return self.probability * math.exp(-away), min(1.0, self.probability * math.exp(away))


def joined(runs: Sequence[SubsetRun]) -> tuple[float, float, float]:
    """(probability, spread of its relative error, degrees of freedom) of independent runs, weighed by their sizes.

    docs/theory/rare_events.md, (B6).

    The spread is that of the runs about each other, beside what their own chains say; where the runs differ more than chains
    explain, that of the runs alone.
    """
    from scipy.stats import f

    sizes = np.array([run.size for run in runs], float)
    probabilities = np.array([run.probability for run in runs])
    probability = float(sizes @ probabilities / sizes.sum())
    # Of a run with one member a level.
    between = float((sizes * (probabilities / probability - 1.0) ** 2).sum() / (len(runs) - 1))
    own = float(np.mean([run.size * (RELATED * run.spread) ** 2 for run in runs]))
    degrees = float(len(runs) - 1)
    if between > own * f.isf(BEYOND_CHANCE, degrees, OWN_COUNT):
        return probability, math.sqrt(between / sizes.sum()), degrees
    both = (degrees * between + OWN_COUNT * own) / (degrees + OWN_COUNT)
    return probability, math.sqrt(both / sizes.sum()), degrees + OWN_COUNT


@dataclass(eq=False)
class RareSearch:
    """A search for the probability that a limit of d standard normals is above 0.

    limit: the one that the answer is of. chained: the one that first chains go by, itself by default. margin: how far from
    failure by `chained` a member of the event may be. weighted: whether weights may be the answer. most: members that may be
    run. report: called with the fraction of the work that is done.
    """

    limit: Limit
    d: int
    relative_error: float = 0.1
    seed: int = 0
    most: int = 1_000_000
    weighted: bool = True
    chained: Limit | None = None
    margin: float = 0.0
    report: Callable[[float], None] = lambda fraction: None
    members: int = 0
    notes: list[str] = field(default_factory=list)
    _expected: float = 8.0 * RUNS * FIRST_SIZE
    _fraction: float = 0.0

    def answer(self) -> RareAnswer:
        """The probability. Raises NoProgress."""
        found = self._answer()
        self.report(1.0)
        return found

    def _answer(self) -> RareAnswer:
        runs = self.climbed(0, FIRST_SIZE, self.chained or self.limit)
        probability, spread, _ = joined(runs)
        if probability > RARE:
            return self.plain(probability, runs)
        if self.weighted:
            if self.d > MOST_NORMALS:
                self.notes.append(f"weights: not tried with {self.d} normals, more than {MOST_NORMALS}")
            elif (found := self.importance(runs, probability, spread)) is not None:
                return found
        return self.subset(runs)

    def _told(self, count: int) -> None:
        self.members += count
        self._expected = max(self._expected, 1.05 * self.members)
        # How much work there is turns out on the way: what was told is never taken back.
        self._fraction = max(self._fraction, self.members / self._expected)
        self.report(self._fraction)

    def climbed(self, round_: int, size: int, limit: Limit) -> list[SubsetRun]:
        """Independent runs of chains."""
        generators = [generator(self.seed, "rare chains", round_, run) for run in range(RUNS)]
        levels = first_levels(limit, self.d, size, generators)
        self._told(RUNS * size)
        return climb(limit, levels, generators, self._told)

    def plain(self, probability: float, runs: Sequence[SubsetRun]) -> RareAnswer:
        """Plain sampling, of what is not rare; chains go on from those of these runs where it meets none.

        docs/theory/rare_events.md, (B2).
        """
        count = max((1.0 - probability) / (probability * (AIM * self.relative_error) ** 2), FEWEST_PLAIN)
        if count > self.most - self.members:
            self.notes.append(TAKES_MORE.format(self.most))
            count = self.most - self.members
        self._expected = self.members + count
        found = sampled(self.limit, self.d, math.ceil(count), self.seed, self._told)
        if not len(found.failing):
            return self.subset(runs)
        weights = np.full(len(found.failing), 1.0 / len(found.failing))
        return self._found(
            "plain", (found.probability, found.spread, found.degrees), found.failing, found.limits, weights
        )

    def _found(
        self, estimator: str, told: tuple[float, float, float], failing: np.ndarray, limits: np.ndarray, weights: np.ndarray,
        runs: Sequence[SubsetRun] = ()) -> RareAnswer:  # fmt: skip
        """The answer; members that chains repeat are one, with the weights of all."""
        distinct, first, place = np.unique(failing, axis=0, return_index=True, return_inverse=True)
        weights = np.bincount(place.reshape(-1), weights, len(distinct))
        return RareAnswer(
            *told, estimator, self.members, distinct, limits[first], weights, tuple(runs), tuple(self.notes)
        )

    def importance(self, runs: Sequence[SubsetRun], probability: float, spread: float) -> RareAnswer | None:
        """Weights of members drawn about the failing ones of all runs; None where they are not the answer."""
        rng = generator(self.seed, "rare mixture")
        points = np.concatenate([run.failing for run in runs])
        if len(np.unique(points, axis=0)) < FEWEST_FITTED:
            self.notes.append(f"weights: not tried with fewer than {FEWEST_FITTED} failing members")
            return None
        asked, around = AIM * self.relative_error, points
        for _ in range(TRIES):
            mixture = fitted(around, rng).widened()
            u, limits = self._drawn(mixture, rng, TRIED)
            found = WeightedMembers.of(u, limits, mixture)
            if TRIED < (wanted := TRIED * wanting(found, asked)) <= MOST_DRAWN:
                more, their_limits = self._drawn(mixture, rng, math.ceil(1.2 * wanted) - TRIED)
                found = WeightedMembers.of(np.concatenate([u, more]), np.concatenate([limits, their_limits]), mixture)
            reasons = doubts(found, mixture, probability, spread, [run.failing for run in runs], self.relative_error)
            if not reasons:
                told = found.probability, found.spread, found.effective
                return self._found("importance", told, found.failing, found.limits, found.weights, runs)
            if not len(found.failing):
                break
            # Beside the members of the chains, those that were drawn, as often as they weigh.
            chosen = rng.choice(len(found.failing), size=len(points), p=found.weights)
            around = np.concatenate([points, found.failing[chosen]])
        self.notes.append(f"weights are not the answer: {'; '.join(reasons)}")
        return None

    def _drawn(self, mixture: Mixture, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
        u = mixture.draw(rng, count)
        limits = self.limit(u)
        self._told(count)
        return u, limits

    def subset(self, first: Sequence[SubsetRun]) -> RareAnswer:
        """Chains alone, of sizes chosen from those before; the first ones, which are small, serve the choice alone."""
        runs: list[SubsetRun] = []
        spread = RELATED * math.sqrt(sum(run.spread**2 for run in first)) / RUNS
        total, levels = RUNS * first[0].size, sum(run.members / run.size for run in first) / RUNS
        for round_ in range(1, ROUNDS + 1):
            wanted = total * (spread / (AIM * self.relative_error)) ** 2
            # Four runs tell their spread only roughly: there are no more than twice as many members in each round.
            most = sum(run.size for run in runs) / RUNS or LARGEST_SIZE
            size = int(np.clip((wanted - sum(run.size for run in runs)) / RUNS, LEAST_SIZE, max(LEAST_SIZE, most)))
            size = round(size / (1.0 / SHARE)) * round(1.0 / SHARE)
            if self.members + RUNS * size * levels > self.most:
                afford = int((self.most - self.members) / (RUNS * levels)) // 10 * 10
                self.notes.append(TAKES_MORE.format(self.most))
                if afford < LEAST_SIZE:
                    break
                size = afford
            self._expected = self.members + RUNS * size * levels
            runs += self.climbed(round_, size, self.limit if self.chained is None else self._gated)
            probability, spread, degrees = joined(runs)
            total = sum(run.size for run in runs)
            if spread <= LEFT * self.relative_error or self.members >= self.most - RUNS * LEAST_SIZE:
                break
        runs = runs or list(first)
        probability, spread, degrees = joined(runs)
        failing, limits = (
            np.concatenate([getattr(run, name) for run in runs]) for name in ("failing", "failing_limits")
        )
        weights = np.concatenate(
            [np.full(len(run.failing), run.size * run.probability / len(run.failing)) for run in runs]
        )
        self._look_at_gate(failing)
        return self._found("subset", (probability, spread, degrees), failing, limits, weights / weights.sum(), runs)

    def _look_at_gate(self, failing: np.ndarray) -> None:
        """Say so where members may fail that the cheap limit shuts out: some fail that it just lets in."""
        if self.chained is None:
            return
        near = float((self.chained(failing) < -0.75 * self.margin).mean())
        if near > NEAR_GATE:
            problem = f"{near:.0%} of the failing members are hardly near failure at the cheaper setting"
            self.notes.append(f"{problem}, so that more may be shut out: leave cheaper out, or name another")

    def _gated(self, u: np.ndarray) -> np.ndarray:
        """The limit where the cheap one is no further from failure than the margin, and elsewhere the cheap one."""
        assert self.chained is not None
        limits = self.chained(u)
        near = limits > -self.margin
        if near.any():
            limits[near] = np.maximum(self.limit(u[near]), -self.margin)
        return limits
