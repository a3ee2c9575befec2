# SPDX-License-Identifier: Apache-2.0
"""Splitting in time: members that come near the event are copied there, and the copies go on with noise of their own.

Fixed effort (Garvels 2000): at each level so many members go from where others reached the level before, until they reach it
or the time is over. Levels come from a pilot; the runs that answer have fixed levels, so that their mean is right however
coarse the looks are (Cerou, Del Moral, Furon & Guyader 2012).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.studies.rare.flock import Flock, Score, Walk
from lgvi_warp.studies.rare.limit import limits_of, spreads_of
from lgvi_warp.studies.rare.subset import FLAT, NoProgress, SubsetRun

# The part of the members that reaches the next level, at least so many, and most levels.
SHARE, LEAST_SHARE, MOST_LEVELS = 0.2, 0.02, 30
# The last level is that from which so large a part of the members comes to the event.
ARRIVED = 0.1

# (rows, flock) by look.
AtLook = Mapping[int, tuple[np.ndarray, Flock]]
Log = list[tuple[np.ndarray, Flock]]


@dataclass(frozen=True, eq=False)
class Stage:
    """The members that go from one level to the next.

    run: (n,), the independent run that each belongs to. start: (n,), its row of the normals. parent: (n,), its row in the
    stage before, -1 at the start. look: (n,), where it begins. key: (n,), of its noise from there on. before: (n,), its score
    there; reach: (n,), the largest on its way, infinite where the event happened. entrants: (rows, flock) by look.
    """

    run: np.ndarray
    start: np.ndarray
    parent: np.ndarray
    look: np.ndarray
    key: np.ndarray
    before: np.ndarray
    reach: np.ndarray
    entrants: AtLook

    @classmethod
    def first(cls, walk: Walk, u: np.ndarray, run: np.ndarray) -> Stage:
        """Members at the start, of standard normals (n, d)."""
        n, nothing = len(run), np.full(len(run), -np.inf)
        rows = np.arange(n)
        at_start = {0: (rows, walk.begin(u))}
        return cls(run, rows, np.full(n, -1), np.zeros(n, int), walk.keys(n), nothing, nothing.copy(), at_start)

    def next(self, walk: Walk, crossed: AtLook, size: int, generators: Sequence[np.random.Generator]) -> Stage | None:
        """So many members of each run, from where members of this stage crossed a level; None where no run has any.

        Each comes equally often, but for one (systematic resampling).
        """
        looks = np.concatenate([np.full(len(rows), look) for look, (rows, _) in crossed.items()] or [np.zeros(0, int)])
        rows = np.concatenate([rows for rows, _ in crossed.values()] or [np.zeros(0, int)])
        within = np.concatenate([np.arange(len(rows)) for rows, _ in crossed.values()] or [np.zeros(0, int)])
        chosen = []
        for run, rng in enumerate(generators):
            own = np.flatnonzero(self.run[rows] == run)
            if len(own):
                chosen.append(own[((np.arange(size) + rng.random()) * len(own) / size).astype(int)])
        if not chosen:
            return None
        picked = np.concatenate(chosen)
        parent, look, entrants = rows[picked], looks[picked], {}
        for begin, (_, flock) in crossed.items():
            new = np.flatnonzero(look == begin)
            if len(new):
                entrants[begin] = new, flock.part(within[picked[new]])
        before = self.reach[parent]
        return Stage(self.run[parent], self.start[parent], parent, look, walk.keys(len(parent)), before, before.copy(),
                     entrants)  # fmt: skip


def walked(walk: Walk, score: Score | None, stage: Stage, bound: float, log: Log | None = None) -> AtLook:
    """Let the members of a stage go until they reach a bound of the score; (rows, flock) by look of those that do.

    score: None where nothing but the event itself is known. log: takes every look at every member.
    """
    crossed: dict[int, list[tuple[np.ndarray, Flock]]] = {}
    moving: tuple[np.ndarray, Flock] | None = None
    for look in range(walk.looks + 1):
        if look in stage.entrants:
            rows, flock = stage.entrants[look]
            already = stage.before[rows] >= bound
            _note(crossed, look, rows, flock, already)
            moving = _together(walk, moving, _part(rows, flock, ~already & ~flock.over))
        if moving is None or look == walk.looks:
            continue
        rows, flock = moving[0], walk.advance(moving[1], stage.key[moving[0]])
        if log is not None:
            log.append((rows, flock))
        value = np.where(flock.happened, np.inf, -np.inf) if score is None else score(flock)
        stage.reach[rows] = np.maximum(stage.reach[rows], value)
        reached = stage.reach[rows] >= bound
        _note(crossed, look + 1, rows, flock, reached)
        moving = _part(rows, flock, ~reached & ~flock.over)
    return _by_look(walk, crossed)


def first_reached(walk: Walk, score: Score, stage: Stage, log: Log, bound: float) -> AtLook:
    """Where members of a stage first reached a bound, from all looks at them."""
    crossed: dict[int, list[tuple[np.ndarray, Flock]]] = {}
    reached = stage.before >= bound
    for look, (rows, flock) in stage.entrants.items():
        _note(crossed, look, rows, flock, reached[rows])
    for rows, flock in log:
        new = (score(flock) >= bound) & ~reached[rows]
        _note(crossed, flock.look, rows, flock, new)
        reached[rows[new]] = True
    return _by_look(walk, crossed)


def _note(crossed: dict[int, Log], look: int, rows: np.ndarray, flock: Flock, chosen: np.ndarray) -> None:
    part = _part(rows, flock, chosen)
    if part is not None:
        crossed.setdefault(look, []).append(part)


def _part(rows: np.ndarray, flock: Flock, chosen: np.ndarray) -> tuple[np.ndarray, Flock] | None:
    if chosen.all() and len(rows):
        return rows, flock
    at = np.flatnonzero(chosen)
    return (rows[at], flock.part(at)) if len(at) else None


def _together(
    walk: Walk, first: tuple[np.ndarray, Flock] | None, second: tuple[np.ndarray, Flock] | None
) -> tuple[np.ndarray, Flock] | None:
    if first is None or second is None:
        return first or second
    return np.concatenate([first[0], second[0]]), walk.joined([first[1], second[1]])


def _by_look(walk: Walk, crossed: Mapping[int, Log]) -> AtLook:
    return {
        look: (np.concatenate([rows for rows, _ in parts]), walk.joined([flock for _, flock in parts]))
        for look, parts in sorted(crossed.items())
    }


@dataclass(frozen=True, eq=False)
class LevelPilot:
    """What a small run with adaptive levels says. bounds: (m,), of the score; shares: (m + 1,), of members that go on."""

    score: Score
    bounds: np.ndarray
    shares: np.ndarray

    @property
    def probability(self) -> float:
        """Of the event, roughly."""
        return float(np.prod(self.shares))

    @property
    def variance(self) -> float:
        """Of the relative error of a run with one member a level, if members of a level were independent."""
        return float(((1.0 - self.shares) / self.shares).sum())


def piloted(walk: Walk, size: int, rng: np.random.Generator) -> LevelPilot:
    """Go to the event level by level, each reached by a fifth of the members of the one before. Raises NoProgress."""
    stage: Stage | None = Stage.first(walk, rng.standard_normal((size, walk.d)), np.zeros(size, int))
    score: Score | None = None
    bounds: list[float] = []
    shares: list[float] = []
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
            return LevelPilot(score, np.array(bounds), np.array([*shares, happened]))
        crossed = first_reached(walk, score, stage, log, bound)
        shares.append(float((stage.reach >= bound).mean()))
        bounds.append(bound)
        stage = stage.next(walk, crossed, size, [rng])


def _last_distances(log: Log, size: int) -> np.ndarray:
    """The distances (c, n) of each member when it was last seen."""
    distances = np.empty((len(log[0][1].distances), size))
    for rows, flock in log:
        distances[:, rows] = flock.distances
    return distances


def _next_bound(reach: np.ndarray, bounds: Sequence[float]) -> float | None:
    """The next level's bound, reached by about a fifth; None where scores lead no further. Raises NoProgress."""
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

    runs: one each. failing: (m, d), normals at the start of members for which the event happens. limits: (m,), theirs.
    weights: (m,), probabilities. paths: for each of them (looks (k,), keys (k,)), from which look on it has which noise.
    """

    runs: tuple[SubsetRun, ...]
    failing: np.ndarray
    limits: np.ndarray
    weights: np.ndarray
    paths: tuple[tuple[np.ndarray, np.ndarray], ...]


def split_runs(
    walk: Walk, pilot: LevelPilot, size: int, generators: Sequence[np.random.Generator],
    report: Callable[[float], None] = lambda fraction: None) -> SplitRuns:  # fmt: skip
    """Independent runs of so many members a level, with the levels and the score of a pilot, all of them in one batch.

    report: called with the part of the levels that are done.
    """
    count = len(generators)
    u = np.concatenate([rng.standard_normal((size, walk.d)) for rng in generators])
    stage: Stage | None = Stage.first(walk, u, np.repeat(np.arange(count), size))
    bounds, stages = [*pilot.bounds, math.inf], list[Stage]()
    crossed: AtLook = {}
    for i, bound in enumerate(bounds):
        if stage is None:
            break
        crossed = walked(walk, pilot.score, stage, bound)
        stages.append(replace(stage, entrants={}))
        report((i + 1) / len(bounds))
        if bound < math.inf:
            stage = stage.next(walk, crossed, size, generators)
    arrived = crossed if len(stages) == len(bounds) else {}
    runs = tuple(_run_of(run, stages, bounds, size) for run in range(count))
    return _with_failing(runs, stages, arrived, pilot.score, u)


def _run_of(run: int, stages: Sequence[Stage], bounds: Sequence[float], size: int) -> SubsetRun:
    """One of several runs: its shares, and the scores of each level's members."""
    reaches = [stage.reach[stage.run == run] for stage in stages]
    shares = [float((reach >= bound).mean()) for reach, bound in zip(reaches, bounds, strict=False) if len(reach)]
    probability = float(np.prod(shares)) if len(shares) == len(bounds) else 0.0
    spread = math.sqrt(sum((1.0 - p) / (p * size) for p in shares)) if probability else math.inf
    limits = tuple(reach for reach in reaches if len(reach))
    thresholds, nothing = np.array([-math.inf, *bounds[:-1]])[: len(limits)], np.zeros(0)
    return SubsetRun(probability, spread, thresholds, limits, np.ones(len(limits)), nothing.reshape(0, 0), nothing, size,
                     sum(map(len, limits)))  # fmt: skip


def _with_failing(
    runs: tuple[SubsetRun, ...], stages: Sequence[Stage], arrived: AtLook, score: Score, u: np.ndarray
) -> SplitRuns:
    """The runs with the members for which the event happened, each once, whose path may have been copied."""
    weights: dict[tuple[int, int], float] = {}
    limits: dict[tuple[int, int], float] = {}
    looks: dict[tuple[int, int], int] = {}
    for rows, flock in arrived.values():
        own = np.where(flock.lost, np.inf, limits_of(flock.distances, score.spreads))
        per_run = np.array([runs[run].probability for run in range(len(runs))])
        of_run = stages[-1].run
        happened = np.bincount(of_run[stages[-1].reach == math.inf], minlength=len(runs))
        for row, limit in zip(rows.tolist(), own.tolist(), strict=True):
            level, leaf = len(stages) - 1, row
            while level and stages[level].before[leaf] == math.inf:
                level, leaf = level - 1, int(stages[level].parent[leaf])
            weight = per_run[of_run[row]] / happened[of_run[row]]
            weights[level, leaf] = weights.get((level, leaf), 0.0) + weight
            limits[level, leaf], looks[level, leaf] = limit, flock.look
    paths, starts = [], []
    for level, leaf in weights:
        paths.append(_path(stages, level, leaf, looks[level, leaf]))
        root = int(stages[level].start[leaf])
        starts.append(root)
    return SplitRuns(runs, u[starts], np.array(list(limits.values())), np.array(list(weights.values())), tuple(paths))


def _path(stages: Sequence[Stage], level: int, row: int, end: int) -> tuple[np.ndarray, np.ndarray]:
    """(looks (k + 1,), keys (k,)): from each look to the next the member has the noise of a key."""
    looks, keys = [end], []
    while level >= 0:
        begin = int(stages[level].look[row])
        if begin < looks[-1]:
            looks.append(begin)
            keys.append(int(stages[level].key[row]))
        row, level = int(stages[level].parent[row]), level - 1
    return np.array(looks[::-1]), np.array(keys[::-1], dtype=np.int64)
