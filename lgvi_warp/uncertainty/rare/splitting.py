# SPDX-License-Identifier: Apache-2.0
"""Splitting in time: members that come near the event are copied, and the copies continue with their own noise.

Fixed effort (Garvels 2000): for each level, a fixed number of members start from states in which others reached the
level before, and run until they reach the level or the time is over. A pilot chooses the levels. The main runs have
fixed levels, so their mean is unbiased however coarse the checkpoints are (Cerou, Del Moral, Furon & Guyader 2012).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.uncertainty.rare.flock import Flock, Score, Walk
from lgvi_warp.uncertainty.rare.limit import limits_of, spreads_of
from lgvi_warp.uncertainty.rare.moving import moved
from lgvi_warp.uncertainty.rare.stages import AtLook, Log, Stage, first_reached, walked
from lgvi_warp.uncertainty.rare.subset import FLAT, NoProgress, SubsetRun

# The part of the members that reaches the next level, at least so many, and most levels.
SHARE, LEAST_SHARE, MOST_LEVELS = 0.2, 0.02, 30
# The last level is that from which so large a part of the members comes to the event.
ARRIVED = 0.1
# Steps from the start of each member of a level, and the acceptance that a pilot steers them to.
MOVES, ACCEPTANCE = 2, 0.44


@dataclass(frozen=True, eq=False)
class LevelPilot:
    """Answer of a small run with adaptive levels.

    bounds: (m,), levels of the score; shares: (m + 1,), fractions of members that continue; steps: (m, d), Metropolis
        steps of the starts at each bound.
    """

    score: Score
    bounds: np.ndarray
    shares: np.ndarray
    steps: np.ndarray

    @property
    def probability(self) -> float:
        """Rough probability of the event."""
        return float(np.prod(self.shares))

    @property
    def variance(self) -> float:
        """Variance of the relative error of a run with one member per level, if members of a level were independent."""
        return float(((1.0 - self.shares) / self.shares).sum())


def piloted(walk: Walk, size: int, rng: np.random.Generator) -> LevelPilot:
    """Approach the event by levels, each reached by a fifth of the members of the level before. Raises NoProgress."""
    stage: Stage | None = Stage.first(walk, rng.standard_normal((size, walk.d)), np.zeros(size, int))
    score: Score | None = None
    bounds: list[float] = []
    shares: list[float] = []
    before, steps, scale = list[Stage](), list[np.ndarray](), 1.0
    while True:
        assert stage is not None
        log: Log = []
        walked(walk, score, stage, math.inf, log)
        if score is None:
            score = Score.fitted(log, walk, spreads_of(_last_distances(log, size)))
            for rows, flock in log:
                stage.reach[rows] = np.maximum(stage.reach[rows], score(flock))
        happened = float((stage.reach == math.inf).mean())
        bound = None if happened >= ARRIVED else _next_bound(stage.reach, bounds)
        if bound is None:
            return LevelPilot(
                score, np.array(bounds), np.array([*shares, happened]), np.array(steps).reshape(len(steps), walk.d)
            )
        crossed = first_reached(walk, score, stage, log, bound)
        shares.append(float((stage.reach >= bound).mean()))
        bounds.append(bound)
        before.append(replace(stage, entrants={}))
        stage = stage.next(walk, crossed, size, [rng])
        assert stage is not None
        step = np.zeros(walk.d)
        for i in range(MOVES if walk.d else 0):
            step = np.minimum(1.0, scale * np.clip(stage.u.std(axis=0), 1e-3, 1.0))
            stage, share = moved(walk, score, before, stage, bound, step, [rng])
            scale = float(np.clip(scale * math.exp((share - ACCEPTANCE) / math.sqrt(i + 1)), 1e-3, 1e3))
        steps.append(step)


def _last_distances(log: Log, size: int) -> np.ndarray:
    """The distances (c, n) of each member at its last checkpoint."""
    distances = np.empty((len(log[0][1].distances), size))
    for rows, flock in log:
        distances[:, rows] = flock.distances
    return distances


def _next_bound(reach: np.ndarray, bounds: Sequence[float]) -> float | None:
    """The next level's bound, reached by about a fifth; None if scores lead no further. Raises NoProgress."""
    finite = np.sort(reach[np.isfinite(reach)])
    happened = (reach == math.inf).sum()
    values, first = np.unique(finite, return_index=True)
    shares = (happened + len(finite) - first) / len(reach)
    fit = (values > (bounds[-1] if bounds else -math.inf)) & (shares < 1.0)
    # Copies of few members have the same score, in steps: levels among them may be wide; among plain members nothing is told.
    usual = fit & (shares <= FLAT) & (shares >= LEAST_SHARE)
    fit = usual if usual.any() or not bounds else fit
    if fit.any() and len(bounds) < MOST_LEVELS:
        return float(values[fit][np.argmin(np.abs(np.log(shares[fit] / SHARE)))])
    if happened:
        return None
    raise NoProgress("never" if bounds else "steps", float(finite[-1]) if len(finite) else -math.inf)


@dataclass(frozen=True, eq=False)
class SplitRuns:
    """Independent runs with fixed levels.

    runs: the runs. failing: (m, d), starting normals of members for which the event happens. limits: (m,), their limits.
    weights: (m,), probabilities. paths: for each failing member, checkpoints (k + 1,) and keys (k,) of noise between them.
    rows: (c, m), limits for each condition at the last checkpoint. of_run: (m,), run of each failing member.
    """

    runs: tuple[SubsetRun, ...]
    failing: np.ndarray
    limits: np.ndarray
    weights: np.ndarray
    paths: tuple[tuple[np.ndarray, np.ndarray], ...]
    rows: np.ndarray
    of_run: np.ndarray


def split_runs(
    walk: Walk, pilot: LevelPilot, size: int, generators: Sequence[np.random.Generator],
    report: Callable[[float], None] = lambda fraction: None) -> SplitRuns:  # fmt: skip
    """Independent runs with `size` members per level, by the levels and the score of a pilot, all in one batch.

    docs/theory/rare_events.md, (B11).

    report: called with the completed fraction of the levels.
    """
    count = len(generators)
    u = np.concatenate([rng.standard_normal((size, walk.d)) for rng in generators])
    stage: Stage | None = Stage.first(walk, u, np.repeat(np.arange(count), size))
    bounds, levels, stages = [*pilot.bounds, math.inf], list[Stage](), list[Stage]()
    crossed: AtLook = {}
    for i, bound in enumerate(bounds):
        if stage is None:
            break
        crossed = walked(walk, pilot.score, stage, bound)
        levels.append(replace(stage, entrants={}))
        stages.append(levels[-1])
        report((i + 1) / len(bounds))
        if bound < math.inf and (stage := stage.next(walk, crossed, size, generators)) is not None:
            for _ in range(MOVES if walk.d else 0):
                stage = moved(walk, pilot.score, stages, stage, bound, pilot.steps[i], generators)[0]
    arrived = crossed if len(levels) == len(bounds) else {}
    runs = tuple(_run_of(run, levels, bounds, size) for run in range(count))
    rows = {look: at_the_end(walk, flock) for look, (_, flock) in arrived.items()}
    return _with_failing(runs, stages, arrived, rows, pilot.score)


def at_the_end(walk: Walk, flock: Flock) -> np.ndarray:
    """Limits for each condition (c, n) at the last checkpoint, of members with the event; infinite for failed members.

    With several conditions, members continue to the end with their own noise: another condition may hold later.
    """
    rows = np.where(flock.lost, np.inf, flock.distances)
    if len(rows) == 1:
        return rows
    at, keys = np.flatnonzero(~flock.over), walk.keys(len(flock.over))
    going = flock.part(at)
    while len(at) and going.look < walk.looks:
        going = walk.advance(going, keys[at])
        rows[:, at] = np.where(going.lost, np.inf, going.distances)
        left = np.flatnonzero(~going.over)
        at, going = at[left], going.part(left)
    return rows


def _run_of(run: int, levels: Sequence[Stage], bounds: Sequence[float], size: int) -> SubsetRun:
    """Shares of one of several runs, and scores of each level's members. docs/theory/rare_events.md, (B11)."""
    reaches = [stage.reach[stage.run == run] for stage in levels]
    shares = [float((reach >= bound).mean()) for reach, bound in zip(reaches, bounds, strict=False) if len(reach)]
    probability = float(np.prod(shares)) if len(shares) == len(bounds) else 0.0
    spread = math.sqrt(sum((1.0 - p) / (p * size) for p in shares)) if probability else math.inf
    limits = tuple(reach for reach in reaches if len(reach))
    thresholds, nothing = np.array([-math.inf, *bounds[:-1]])[: len(limits)], np.zeros(0)
    return SubsetRun(probability, spread, thresholds, limits, np.ones(len(limits)), nothing.reshape(0, 0), nothing, size,
                     sum(map(len, limits)))  # fmt: skip


def _with_failing(
    runs: tuple[SubsetRun, ...], stages: Sequence[Stage], arrived: AtLook, ends: Mapping[int, np.ndarray], score: Score
) -> SplitRuns:
    """The runs with the members for which the event happened; copies of a path are merged."""
    weights: dict[tuple[int, int], float] = {}
    limits: dict[tuple[int, int], float] = {}
    looks: dict[tuple[int, int], int] = {}
    by_condition: dict[tuple[int, int], np.ndarray] = {}
    for at, (rows, flock) in arrived.items():
        own = np.where(flock.lost, np.inf, limits_of(flock.distances, score.spreads))
        per_run = np.array([runs[run].probability for run in range(len(runs))])
        of_run = stages[-1].run
        happened = np.bincount(of_run[stages[-1].reach == math.inf], minlength=len(runs))
        for row, limit, end in zip(rows.tolist(), own.tolist(), ends[at].T, strict=True):
            level, leaf = len(stages) - 1, row
            while level and stages[level].before[leaf] == math.inf and not stages[level].moved[leaf]:
                level, leaf = level - 1, int(stages[level].parent[leaf])
            weight = per_run[of_run[row]] / happened[of_run[row]]
            weights[level, leaf] = weights.get((level, leaf), 0.0) + weight
            limits[level, leaf], looks[level, leaf] = limit, flock.look
            by_condition.setdefault((level, leaf), end)
    paths, starts = [], []
    for level, leaf in weights:
        paths.append(_path(stages, level, leaf, looks[level, leaf]))
        starts.append(stages[level].u[leaf])
    normals = np.array(starts).reshape(len(starts), -1)
    count = len(score.spreads)
    return SplitRuns(
        runs, normals, np.array(list(limits.values())), np.array(list(weights.values())), tuple(paths),
        np.array(list(by_condition.values())).reshape(-1, count).T,
        np.array([int(stages[level].run[leaf]) for level, leaf in weights], int),
    )  # fmt: skip


def _path(stages: Sequence[Stage], level: int, row: int, end: int) -> tuple[np.ndarray, np.ndarray]:
    """Path of a member: checkpoints (k + 1,), and keys (k,) of the noise between successive checkpoints."""
    looks, keys = [end], []
    while level >= 0:
        begin = int(stages[level].look[row])
        if begin < looks[-1]:
            looks.append(begin)
            keys.append(int(stages[level].key[row]))
        row, level = int(stages[level].parent[row]), level - 1
    return np.array(looks[::-1]), np.array(keys[::-1], dtype=np.int64)
