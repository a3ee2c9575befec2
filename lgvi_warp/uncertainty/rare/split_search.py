# SPDX-License-Identifier: Apache-2.0
"""The probability of a rare event by splitting in time: a pilot for the levels, then independent runs with fixed ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lgvi_warp.common.random import generator
from lgvi_warp.uncertainty.rare.search import TAKES_MORE, RareAnswer
from lgvi_warp.uncertainty.rare.splitting import LevelPilot, SplitRuns, piloted, split_runs
from lgvi_warp.uncertainty.rare.subset import NoProgress, SubsetRun

# Independent runs of a round; members of a level in pilots, and of a run at least and at most.
RUNS, PILOTS, LEAST, LARGEST = 16, (1000, 2000, 4000), 100, 100_000
# Variance beside that of independent members, since copies of one member have much in common.
RELATED = 2.0
# The error that a first round is meant for, in that asked; one so much larger is left as it is. Most rounds of runs.
FIRST_ERROR, LEFT, ROUNDS = 2.0, 1.5, 4
# With fewer starts than this among the failing members, numbers that vary are hardly told.
FEW_STARTS = 30


@dataclass(frozen=True, eq=False)
class SplitAnswer(RareAnswer):
    """Answer of splitting; paths: as in `SplitRuns`; of_run: (m,), independent run of each failing member."""

    paths: tuple[tuple[np.ndarray, np.ndarray], ...] = ()
    of_run: np.ndarray = field(default_factory=lambda: np.zeros(0, int))


@dataclass(eq=False)
class SplitSearch:
    """A search for the probability of an event during a walk.

    walk: a Walk that counts its `members`. most: number of members that may be run, in whole runs.
    """

    walk: Any
    relative_error: float
    seed: int
    most: int
    report: Callable[[float], None] = lambda fraction: None
    notes: list[str] = field(default_factory=list)
    _price: float = 1.0

    def answer(self) -> SplitAnswer:
        """Find the probability. Raises NoProgress."""
        pilot = self._piloted()
        self.report(0.1)
        first = self._sized(RELATED * pilot.variance / (FIRST_ERROR * self.relative_error) ** 2)
        # What a first round says of the error chooses the number of members alone: an answer that may be kept because it
        # tells a small error is too small.
        spread = joined_spread(self._round(pilot, 0, first).runs)[1]
        spread = spread if math.isfinite(spread) else math.sqrt(RUNS)
        rounds: list[SplitRuns] = []
        wanted = RUNS * first * (spread / self.relative_error) ** 2
        for round_ in range(1, ROUNDS + 1):
            size = self._sized(wanted)
            rounds.append(self._round(pilot, round_, size))
            spread = joined_spread([run for each in rounds for run in each.runs])[1]
            total = sum(RUNS * each.runs[0].size for each in rounds)
            if spread <= LEFT * self.relative_error or self.walk.members + RUNS * LEAST * self._price > self.most:
                break
            wanted = total * (min(2.0, spread / self.relative_error) ** 2 - 1.0)
        self.report(1.0)
        return self._answer(rounds)

    def _piloted(self) -> LevelPilot:
        """Run a pilot, and larger ones if too few members come nearer to the event. Raises NoProgress."""
        for attempt, size in enumerate(PILOTS):
            before = self.walk.members
            try:
                pilot = piloted(self.walk, size, generator(self.seed, "rare splitting pilot", attempt))
            except NoProgress as stuck:
                if stuck.kind == "steps" or size == PILOTS[-1]:
                    raise
                continue
            # Members of whole runs for each member of a level.
            self._price = (self.walk.members - before) / size
            return pilot
        raise AssertionError

    def _sized(self, wanted: float) -> int:
        """Number of members of a level in each run, for a wanted total over all runs."""
        size = math.ceil(np.clip(wanted / RUNS, LEAST, LARGEST))
        afford = int((self.most - self.walk.members) / (RUNS * self._price))
        note = TAKES_MORE.format(self.most)
        if size > afford and note not in self.notes:
            self.notes.append(note)
        return max(LEAST, min(size, afford))

    def _round(self, pilot: LevelPilot, round_: int, size: int) -> SplitRuns:
        generators = [generator(self.seed, "rare splitting", round_, run) for run in range(RUNS)]
        begin, end = (0.1, 0.3) if round_ == 0 else (1.0 - 0.7 / round_, 1.0 - 0.7 / (round_ + 1))
        report = self.report
        return split_runs(self.walk, pilot, size, generators, lambda part: report(begin + (end - begin) * part))

    def _answer(self, rounds: list[SplitRuns]) -> SplitAnswer:
        runs = tuple(run for each in rounds for run in each.runs)
        probability, spread = joined_spread(runs)
        if not probability:
            raise NoProgress(
                "never", max(float(limits[np.isfinite(limits)].max()) for run in runs for limits in run.limits)
            )
        failing = np.concatenate([each.failing for each in rounds])
        limits = np.concatenate([each.limits for each in rounds])
        weights = np.concatenate([each.runs[0].size * each.weights for each in rounds])
        paths = tuple(path for each in rounds for path in each.paths)
        if self.walk.d:
            self.notes.append(
                "draws of noise are not numbers with splitting: the likeliest member goes by its numbers alone"
            )
        share = weights / weights.sum() if len(weights) else weights
        if self.walk.d and (starts := different(failing, share)) < FEW_STARTS:
            problem = (
                f"the failing members stand on some {starts:.0f} different starts, since few steps from these were taken: "
                "what varies there is hardly told, and the interval may be too narrow"
            )
            self.notes.append(f'{problem}; by="chains" moves these numbers, too')
        return SplitAnswer(probability, spread, len(runs) - 1.0, "splitting", self.walk.members, failing, limits, share, runs,
                           tuple(self.notes), np.concatenate([each.rows for each in rounds], axis=1), paths=paths,
                           of_run=np.concatenate([RUNS * i + each.of_run for i, each in enumerate(rounds)]))  # fmt: skip


def different(rows: np.ndarray, weights: np.ndarray) -> float:
    """The effective number of different rows (n, d): 1 divided by the sum of their squared shares (Kish 1965)."""
    _, place = np.unique(rows, axis=0, return_inverse=True)
    share = np.bincount(np.ravel(place), weights=weights)
    return float(1.0 / np.sum(share**2)) if len(share) else 0.0


def joined_spread(runs: Sequence[SubsetRun]) -> tuple[float, float]:
    """Join independent runs, weighted by their sizes: (probability, its relative error from the scatter of the runs)."""
    sizes = np.array([run.size for run in runs], float)
    probabilities = np.array([run.probability for run in runs])
    probability = float(sizes @ probabilities / sizes.sum())
    if probability == 0.0:
        return 0.0, math.inf
    between = float((sizes * (probabilities / probability - 1.0) ** 2).sum() / (len(runs) - 1))
    return probability, math.sqrt(between / sizes.sum())
