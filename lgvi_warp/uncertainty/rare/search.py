# SPDX-License-Identifier: Apache-2.0
"""The probability of a rare event of standard normals: several runs of chains, then importance sampling."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.uncertainty.rare.causes import RELATED
from lgvi_warp.uncertainty.rare.mixture import (
    AGREEMENT,
    LARGEST,
    MOST_NORMALS,
    Mixture,
    WeightedMembers,
    doubts,
    fitted,
    log_weights,
    together,
    uncovered,
    wanting,
)  # fmt: skip
from lgvi_warp.uncertainty.rare.plain import sampled
from lgvi_warp.uncertainty.rare.subset import SHARE, Limit, NoProgress, SubsetRun, climb, levels_of
from lgvi_warp.uncertainty.rare.witness import Surroundings, Witness, grown, pooled, wide_of, witnessed

# Independent runs of chains; the members of a level in the first ones, and at least and at most in those that follow.
RUNS, FIRST_SIZE, LEAST_SIZE, LARGEST_SIZE = 4, 500, 1000, 200_000
# Mixtures that are tried; members that are drawn from one first, and at most; the fewest that one is made from.
TRIES, TRIED, MOST_DRAWN, FEWEST_FITTED = 2, 2000, 10_000, 100
# Part of the failing members that may be near the margin of the cheap limit.
NEAR_GATE = 0.01
# What is likelier than this is looked for by plain sampling, with so many members at least.
RARE, FEWEST_PLAIN = 1e-3, 256
# Chains' own spread counts for so many runs beside the spread between runs, unless that is larger beyond chance (F, 1 %).
OWN_COUNT, BEYOND_CHANCE = 12, 0.01
# The part of the error asked for that numbers are chosen for; one so much larger is left as it is. Most rounds of runs.
AIM, LEFT, ROUNDS = 1.0, 1.2, 4
# How often a normal number is more than three spreads above its mean.
BEYOND_THREE = 0.00135
# The least probability: the cube's levels end at 1e-16.
LEAST = 1e-15
# Independent members of the second look times the error asked: what they do not see is then below half of that error.
LOOKED = 3.5
# Looks that follow a second look which refutes an answer, before it is believed.
MORE_LOOKS = 3
# The least part of the second look's members that makes a failure mode which the chains passed by.
LEAST_MISSED = 0.03
BLIND = (
    "weights and the second look for other failure modes have no power with {} normals, more than {}: a mode to which no "
    "level leads is not seen; n plain members without such a failure bound it by 3 / n"
)
TAKES_MORE = "the error asked takes more than the {:,} members that may be run"


@dataclass(frozen=True, eq=False)
class RareAnswer:
    """Answer of a search, in standard normals.

    Attributes:
        probability: probability of the event.
        spread: standard deviation of the probability's relative error.
        degrees: degrees of freedom of the spread.
        estimator: "importance", "subset" or "plain".
        members: number of members that were run.
        failing: (m, d), members for which the event happens, without duplicates.
        limits: (m,), limits of the failing members.
        weights: (m,), weights of the failing members; they sum to 1.
        runs: the runs of chains.
        notes: notes for the user.
        rows: (k, m), limits of the failing members for each of k conditions.
        chains: (m,), chain of each failing member; members of one chain are related.
        ancestors: (m,), member of the first level from which each failing member descends.
        parts: (m,), index of one of four independent parts to which each failing member belongs.
        bounds: the 95 % interval if it follows from a count; None otherwise.
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
    rows: np.ndarray = field(default_factory=lambda: np.zeros((1, 0)))
    chains: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    ancestors: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    parts: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    bounds: tuple[float, float] | None = None

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """The interval of the probability, by Student's t for its logarithm. docs/theory/rare_events.md, (B7)."""
        from scipy.stats import t

        # No answer is surer than one member of all that were run.
        away = float(t.ppf(0.5 + 0.5 * confidence, self.degrees)) * max(self.spread, 1.0 / self.members)
        low, high = self.probability * math.exp(-away), min(1.0, self.probability * math.exp(away))
        return (min(low, self.bounds[0]), max(high, self.bounds[1])) if self.bounds else (low, high)


def joined(runs: Sequence[SubsetRun]) -> tuple[float, float, float]:
    """Join independent runs, weighted by their sizes: (probability, its relative error, degrees of freedom).

    docs/theory/rare_events.md, (B6).

    The error combines the scatter of the runs with the errors that their own chains estimate. If the runs differ more
    than the chains explain, only the scatter counts.
    """
    from scipy.stats import f

    sizes = np.array([run.size for run in runs], float)
    probabilities = np.array([run.share for run in runs])
    probability = float(sizes @ probabilities / sizes.sum())
    # Of a run with one member a level.
    between = float((sizes * (probabilities / probability - 1.0) ** 2).sum() / (len(runs) - 1))
    own = float(np.mean([run.size * (RELATED * run.spread) ** 2 for run in runs]))
    degrees = float(len(runs) - 1)
    if between > own * f.isf(BEYOND_CHANCE, degrees, OWN_COUNT):
        return probability, math.sqrt(between / sizes.sum()), degrees
    both = (degrees * between + OWN_COUNT * own) / (degrees + OWN_COUNT)
    return probability, math.sqrt(both / sizes.sum()), degrees + OWN_COUNT


class Groups(dict[int, list[SubsetRun]]):
    """Runs of chains, by the index of the condition that they reach."""


def united(groups: Groups) -> tuple[float, float, float]:
    """Probability that any condition holds: (probability, its relative error, degrees of freedom).

    docs/theory/rare_events.md, (B15).
    """
    told = [joined(runs) for runs in groups.values()]
    if len(told) == 1:
        return told[0]
    probability = sum(each[0] for each in told)
    variances = [(share * spread) ** 2 for share, spread, _ in told]
    # Degrees of freedom of a sum, by Welch and Satterthwaite.
    degrees = sum(variances) ** 2 / sum(v**2 / each[2] for v, each in zip(variances, told, strict=True))
    return probability, math.sqrt(sum(variances)) / probability, degrees


def portions(shares: np.ndarray) -> np.ndarray:
    """Fractions of the draws for groups with these shares of the event: half by the shares, half evenly."""
    return np.asarray(0.5 * shares / max(shares.sum(), 1e-300) + 0.5 / len(shares)) if len(shares) > 1 else np.ones(1)


def spread_over(fits: Sequence[Mixture], shares: np.ndarray) -> Mixture:
    """Join the mixtures of all groups to one."""
    return together(fits, portions(shares))


def beyond(seen: Witness, probability: float, spread: float) -> bool:
    """True if a second look gives a significantly larger probability."""
    return seen.probability > 0.0 and math.log(seen.probability / max(probability, 1e-300)) > AGREEMENT * math.hypot(
        seen.spread, min(spread, 1.0)
    )


def unseen(share: float, count: float) -> float:
    """Root mean square of the fraction of an event that the weights miss. docs/theory/rare_events.md, (B18).

    share: fraction of the second look's independent members where the mixture hardly draws. count: their number, or 0.
    """
    odd = share * count
    return math.sqrt((odd + 1.0) * (odd + 2.0) / ((count + 2.0) * (count + 3.0))) if count else 0.0


def _of_runs(groups: Groups) -> FailingGroup:
    """The failing members of all runs, with their weights."""
    columns, first = [], 0
    for runs in groups.values():
        sizes = sum(run.size for run in runs)
        for i, run in enumerate(runs):
            parts = run.parts if len(run.parts) else np.ones(len(run.failing))
            rows = run.rows if len(run.rows) else run.failing_limits[None]
            weights = run.size / sizes * run.probability / len(parts) * parts
            chains, ancestors = run.failing_chains + first, run.failing_ancestors + first
            columns.append((run.failing, rows.T, weights, chains, ancestors, np.full(len(parts), i % RUNS)))
            first += run.size
    u, rows, weights, chains, ancestors, parts = (np.concatenate(column) for column in zip(*columns, strict=True))
    return FailingGroup(u, rows.T, weights / weights.sum(), chains, ancestors, parts)


class FailingGroup(NamedTuple):
    """Failing members: u (m, d), rows: limits by condition (k, m); weights, chains, ancestors, independent parts (m,)."""

    u: np.ndarray
    rows: np.ndarray
    weights: np.ndarray
    chains: np.ndarray
    ancestors: np.ndarray
    parts: np.ndarray

    @classmethod
    def alone(cls, u: np.ndarray, rows: np.ndarray, weights: np.ndarray) -> FailingGroup:
        """Members that are all independent."""
        own = np.arange(len(u))
        return cls(u, rows, weights, own, own, own % RUNS)


@dataclass(eq=False)
class RareSearch:
    """A search for the probability that any of k limits of d standard normals is above 0.

    limit: the limit of the answer, (n, d) -> (n,) or (k, n); NaN is a failed member, which counts as the event.
    chained: the limit of the first chains; default `limit`. margin: largest distance from failure in `chained` of a
    member of the event. weighted: True if importance sampling may give the answer. most: number of members that may be
    run. report: called with the completed fraction of the work. witness: the limit of the second look; default `limit`.
    """

    limit: Limit
    d: int
    relative_error: float
    seed: int
    most: int
    weighted: bool = True
    chained: Limit | None = None
    margin: float = 0.0
    report: Callable[[float], None] = lambda fraction: None
    members: int = 0
    notes: list[str] = field(default_factory=list)
    witness: Limit | None = None
    _expected: float = 8.0 * RUNS * FIRST_SIZE
    _fraction: float = 0.0
    _beside: tuple[float, float] = (0.0, 0.0)
    _wide: float = 0.0
    _cost: int = 0
    _looks: list[Witness] = field(default_factory=list)

    def answer(self) -> RareAnswer:
        """Find the probability. Raises NoProgress."""
        found = self._answer()
        self.report(1.0)
        return found

    def _answer(self) -> RareAnswer:
        from scipy.stats import t

        groups, stuck = self._first()
        if groups:
            probability, spread, degrees = united(groups)
            if probability > RARE:
                return self.plain(probability, groups)
            # Three spreads of a normal law, by as many of Student's.
            spread *= float(t.isf(BEYOND_THREE, degrees)) / 3.0
        seen = self._witnessed(probability if groups else None)
        if seen is not None and self.weighted and (groups or len(seen.u)):
            found = self.importance(groups, (probability, spread) if groups else None, seen)
            # An event that no chain leads to must be one whose probability the numbers can hold.
            if found is not None and (groups or found.probability > LEAST):
                return found if found.probability <= RARE else self.plain(found.probability, groups)
        if not groups:
            assert stuck is not None
            raise stuck
        return self.subset(groups, seen)

    def _ran(self, count: int) -> None:
        self.members += count
        self._expected = max(self._expected, 1.05 * self.members)
        # How much work there is turns out on the way: what was told is never taken back.
        self._fraction = max(self._fraction, self.members / self._expected)
        self.report(self._fraction)

    def _rows(self, u: np.ndarray, limit: Limit | None = None) -> np.ndarray:
        """The limits for each condition (k, n); infinite for failed members."""
        rows = np.atleast_2d((limit or self.limit)(u))
        return np.where(np.isnan(rows), np.inf, rows)

    def _first(self) -> tuple[Groups, NoProgress | None]:
        """First runs of chains to each condition that they reach, and the reason if one is not reached."""
        limit, stuck, groups = self.chained or self.limit, None, Groups()
        generators = [generator(self.seed, "rare chains", 0, run) for run in range(RUNS)]
        u = np.concatenate([rng.standard_normal((FIRST_SIZE, self.d)) for rng in generators])
        rows = self._rows(u, limit)
        self._ran(len(u))
        self._expected *= 0.5 + 0.5 * len(rows)
        for i, own in enumerate(rows):
            if i:  # the same members, and steps of its own
                generators = [generator(self.seed, "rare chains", 0, run, i) for run in range(RUNS)]
            try:
                runs = climb(self._row(i, limit), levels_of(u, own, FIRST_SIZE), generators, self._ran)
            except NoProgress as why:
                stuck = why
                continue
            groups[i] = self._parted(runs, len(rows))
        return groups, stuck

    def _row(self, i: int, limit: Limit) -> Limit:
        """The limit of a single condition."""
        return lambda u: np.asarray(self._rows(u, limit)[i])

    def climbed(self, round_: int, size: int, i: int, count: int) -> list[SubsetRun]:
        """Independent runs of chains to condition i of `count` conditions."""
        generators = [generator(self.seed, "rare chains", round_, run, *[i] * bool(i)) for run in range(RUNS)]
        u = np.concatenate([rng.standard_normal((size, self.d)) for rng in generators])
        own = self._row(i, self.limit) if self.chained is None else self._gated
        levels = levels_of(u, own(u), size)
        self._ran(len(u))
        return self._parted(climb(own, levels, generators, self._ran), count)

    def _parted(self, runs: list[SubsetRun], count: int) -> list[SubsetRun]:
        """Runs to one of `count` conditions; a member that meets m of them counts 1 / m in each.

        docs/theory/rare_events.md, (B15).
        """
        if count == 1:
            return runs
        rows = self._rows(np.concatenate([run.failing for run in runs]))
        self._ran(rows.shape[1])
        each = np.split(rows, np.cumsum([len(run.failing) for run in runs])[:-1], axis=1)
        return [replace(run, parts=1.0 / (own > 0.0).sum(axis=0), rows=own)
                for run, own in zip(runs, each, strict=True)]  # fmt: skip

    def _witnessed(self, probability: float | None) -> Witness | None:
        """Failing members found without levels; None, and a note, if they would not help."""
        if not self.weighted:
            return None
        if self.d > MOST_NORMALS:
            self.notes.append(BLIND.format(self.d, MOST_NORMALS))
            return None
        # Chains that did not arrive know no probability: an event of one in a million is looked for.
        self._wide = wide_of(probability or 1e-6)
        seen = self._look()
        if not len(seen.u) and probability is not None:
            self.notes.append("the second look for other failure modes met no failing member, so it is inconclusive")
        return seen

    def _look(self, *again: int) -> Witness:
        before, lookers = self.members, math.ceil(LOOKED / self.relative_error)
        seen = witnessed(self._happens, self.d, self._wide, generator(self.seed, "rare witness", *again), lookers)
        self._cost = self.members - before
        return seen

    def _refuted(self, seen: Witness, probability: float, spread: float) -> Witness | None:
        """The second look, pooled with further ones, if together they give a significantly larger probability.

        One look is worth only about a dozen members, so a single look is too inaccurate to decide.
        """
        if beyond(seen, probability, spread):
            while len(self._looks) < MORE_LOOKS and self.members + self._cost <= self.most:
                self._looks.append(self._look(1 + len(self._looks)))
            seen = pooled([seen, *self._looks])
        return seen if beyond(seen, probability, spread) else None

    def _happens(self, u: np.ndarray) -> np.ndarray:
        limit = self.witness or self.limit
        rows = self._rows(u, limit) if self.chained is None else self._gated(u, limit)[None]
        self._ran(len(u))
        return np.asarray((rows > 0.0).any(axis=0))

    def plain(self, probability: float, groups: Groups) -> RareAnswer:
        """Plain sampling of an event that is not rare; if no member meets the event, more chains are run.

        docs/theory/rare_events.md, (B2).
        """
        count = max((1.0 - probability) / (probability * (AIM * self.relative_error) ** 2), FEWEST_PLAIN)
        if count > self.most - self.members:
            self.notes.append(TAKES_MORE.format(self.most))
            count = max(self.most - self.members, FEWEST_PLAIN)
        self._expected = self.members + count
        found = sampled(self._rows, self.d, math.ceil(count), self.seed, self._ran)
        if not len(found.failing) and groups:
            return self.subset(groups)
        members = FailingGroup.alone(found.failing, found.rows, np.full(len(found.failing), 1.0 / len(found.failing)))
        return self._answer_of("plain", (found.probability, found.spread, found.degrees), members, (), found.bounds)

    def _answer_of(
        self, estimator: str, reported: tuple[float, float, float], members: FailingGroup, runs: Sequence[SubsetRun] = (),
        bounds: tuple[float, float] | None = None) -> RareAnswer:  # fmt: skip
        """Build the answer; members that chains repeat are merged, and their weights are added."""
        distinct, first, place = np.unique(members.u, axis=0, return_index=True, return_inverse=True)
        weights, rows = np.bincount(place.reshape(-1), members.weights, len(distinct)), members.rows[:, first]
        return RareAnswer(
            *reported, estimator, self.members, distinct, rows.max(axis=0), weights, tuple(runs), tuple(self.notes), rows,
            chains=members.chains[first], ancestors=members.ancestors[first], parts=members.parts[first], bounds=bounds,
        )  # fmt: skip

    def importance(self, groups: Groups, chains: tuple[float, float] | None, seen: Witness) -> RareAnswer | None:
        """Importance sampling about the failing members of all runs; None if its answer fails the checks.

        chains: (probability, spread) of the chains; None if none reached the event. seen: result of the second look.
        """
        rng, runs = generator(self.seed, "rare mixture"), [run for each in groups.values() for run in each]
        points = [np.concatenate([run.failing for run in each]) for each in groups.values()]
        if len(np.unique(np.concatenate([*points, seen.u]), axis=0)) < FEWEST_FITTED:
            self.notes.append(f"weights: not tried with fewer than {FEWEST_FITTED} failing members")
            return None
        asked, shares = AIM * self.relative_error, np.array([joined(each)[0] for each in groups.values()])
        fits = [fitted(each, rng) for each in points]
        around, missed, part = None, np.concatenate([seen.lookers, seen.u]), 1.0
        if chains is not None:
            around = Surroundings([run.failing for run in runs], generator(self.seed, "rare surroundings"))
            logs = log_weights(spread_over(fits, shares).widened(), missed)
            odd = around.apart(missed) & (logs > math.log(LARGEST * chains[0] * TRIED))
            part = int(odd[: len(seen.lookers)].sum()) / max(len(seen.lookers), 1)
            missed = missed[odd & (part > LEAST_MISSED)]
        if len(missed):
            points.append(grown(self._happens, missed, generator(self.seed, "rare grown")))
            fits.append(fitted(points[-1], rng))
            shares = np.append(shares / max(shares.sum(), 1e-300) * (1.0 - part), part)
        for attempt in range(TRIES):
            mixture = spread_over(fits, shares).widened()
            u, limits = self._drawn(mixture, rng, TRIED)
            found = WeightedMembers.of(u, limits, mixture)
            if TRIED < (wanted := TRIED * wanting(found, asked)) <= MOST_DRAWN:
                more, their_limits = self._drawn(mixture, rng, math.ceil(1.2 * wanted) - TRIED)
                found = WeightedMembers.of(np.concatenate([u, more]), np.hstack([limits, their_limits]), mixture)
            if not len(found.failing):
                reasons = ["none of its members fails"]
                break
            inside = np.ones(len(found.failing), bool)
            if around is not None and len(missed):
                inside = ~around.apart(found.failing)
            places = [*(run.failing for run in runs), *[missed] * bool(len(missed))]
            known, error = chains or (None, 0.0)
            reasons = doubts(found, mixture, known, error, places, self.relative_error, inside)
            if refuting := self._refuted(seen, found.probability, found.spread):
                reasons.append(f"a second look gives {refuting.probability:.2e}")
            self._beside = 0.0, 0.0
            if (outside := found.weights[~inside]).sum() > 0.0:
                self._beside = found.probability * outside.sum(), math.sqrt((outside**2).sum()) / outside.sum()
            if not reasons:
                self._note_beside(found.probability)
                hidden = unseen(uncovered(found, mixture, [seen.lookers]), len(seen.lookers))
                told = found.probability, math.hypot(found.spread, hidden), found.effective
                members = FailingGroup.alone(found.failing, found.rows, found.weights)
                return self._answer_of("importance", told, members, runs)
            if attempt + 1 < TRIES:
                # Beside the members of the chains, those that were drawn, as often as they weigh.
                densities = [
                    math.log(share) + each.log_density(found.failing)
                    for share, each in zip(portions(shares), fits, strict=True)
                ]
                belongs = np.argmax(densities, axis=0)
                shares = np.bincount(belongs, found.weights, len(points))
                grouped = [self._with_drawn(each, found, belongs == i, rng) for i, each in enumerate(points)]
                fits = [fitted(each, rng) for each in grouped]
        self.notes.append(f"weights are not the answer: {'; '.join(reasons)}")
        return None

    @staticmethod
    def _with_drawn(
        points: np.ndarray, result: WeightedMembers, belongs: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Members of a group, and as many drawn members that belong to it, resampled by their weights."""
        places = np.flatnonzero(belongs)
        if not result.weights[places].sum() > 0.0:
            return points
        shares = result.weights[places] / result.weights[places].sum()
        return np.concatenate([points, result.failing[places[rng.choice(len(places), size=len(points), p=shares)]]])

    def _note_beside(self, probability: float) -> None:
        """Note the fraction of the event that the chains missed, if it is not small."""
        if (part := self._beside[0] / probability) > LEAST_MISSED:
            self.notes.append(f"{part:.0%} of the probability is of a failure mode that the chains passed by: a second look "
                              "found it, and members were drawn there, too")  # fmt: skip

    def _drawn(self, mixture: Mixture, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
        u = mixture.draw(rng, count)
        limits = self._rows(u)
        self._ran(count)
        return u, limits

    def subset(self, groups: Groups, seen: Witness | None = None) -> RareAnswer:
        """Answer by chains alone; the first runs, which are small, only serve to choose the sizes."""
        shares = {i: joined(first)[0] for i, first in groups.items()}
        count, total = max(len(first[0].rows) or 1 for first in groups.values()), sum(shares.values())
        # What is rarer may have a larger error: each takes its part of the whole at the least cost.
        runs = Groups({i: self._sized(i, first, self.relative_error / math.sqrt(shares[i] / total), count)
                       for i, first in groups.items()})  # fmt: skip
        probability, spread, degrees = united(runs)
        members = _of_runs(runs)
        self._look_at_gate(members.u)
        if self.chained is not None and len(self._rows(members.u[:1])) > 1:
            members = members._replace(rows=self._rows(members.u))
        bounds = None
        if self._beside[0] > 0.0:
            beside, its_spread = self._beside
            self._note_beside(probability + beside)
            spread = math.hypot(probability * spread, beside * its_spread) / (probability + beside)
            probability, degrees = probability + beside, min(degrees, 15.0)
        if seen is not None and (refuting := self._refuted(seen, probability, spread)):
            seen = refuting
            text = f"chains give {probability:.2e}, and a second look for other failure modes {seen.probability:.2e}"
            self.notes.append(f"{text}, which is the answer; the failing members are those of the chains")
            bounds = probability * math.exp(-2.0 * spread), min(1.0, seen.probability * math.exp(2.0 * seen.spread))
            probability, spread, degrees = seen.probability, seen.spread, min(degrees, 15.0)
        return self._answer_of(
            "subset", (probability, spread, degrees), members, [r for each in runs.values() for r in each], bounds
        )

    def _sized(self, i: int, first: Sequence[SubsetRun], error: float, count: int) -> list[SubsetRun]:
        """Runs to condition i with this error, as far as `most` allows; the first runs if no more are allowed."""
        runs: list[SubsetRun] = []
        spread = RELATED * math.sqrt(sum(run.spread**2 for run in first)) / RUNS
        total, levels = RUNS * first[0].size, sum(run.members / run.size for run in first) / RUNS
        for round_ in range(1, ROUNDS + 1):
            wanted = total * (spread / (AIM * error)) ** 2
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
            runs += self.climbed(round_, size, i, count)
            _, spread, _ = joined(runs)
            total = sum(run.size for run in runs)
            if spread <= LEFT * error or self.members >= self.most - RUNS * LEAST_SIZE:
                break
        return runs or list(first)

    def _look_at_gate(self, failing: np.ndarray) -> None:
        """Note that the cheap limit may exclude failing members, if some fail near its margin."""
        if self.chained is None:
            return
        near = float((self.chained(failing) < -0.75 * self.margin).mean())
        if near > NEAR_GATE:
            problem = f"{near:.0%} of the failing members are hardly near failure at the cheaper setting"
            self.notes.append(f"{problem}, so that more may be shut out: leave cheaper out, or name another")

    def _gated(self, u: np.ndarray, limit: Limit | None = None) -> np.ndarray:
        """The limit if the cheap limit is within the margin of failure, otherwise the cheap limit."""
        assert self.chained is not None
        limits = self.chained(u)
        near = limits > -self.margin
        if near.any():
            limits[near] = np.maximum(self._rows(u[near], limit).max(axis=0), -self.margin)
        return limits
