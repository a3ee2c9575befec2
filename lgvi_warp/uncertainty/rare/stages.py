# SPDX-License-Identifier: Apache-2.0
"""Members of one level of splitting in time, and their advance to the next level."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lgvi_warp.uncertainty.rare.flock import Flock, Score, Walk

# (rows, flock) by look.
AtLook = Mapping[int, tuple[np.ndarray, Flock]]
Log = list[tuple[np.ndarray, Flock]]


@dataclass(frozen=True, eq=False)
class Stage:
    """Members that start at one level and run to the next.

    run: (n,), the independent run of each member. u: (n, d), its normals at the start. parent: (n,), its row in the
    stage before, -1 at the start. look: (n,), checkpoint at which it begins with the noise of its key (n,). before:
    (n,), its score there; reach: (n,), its largest score so far, infinite if the event happened. entrants: checkpoint
    -> (rows, flock) of members that begin there. moved: (n,), True if its start differs from its parent's.
    """

    run: np.ndarray
    u: np.ndarray
    parent: np.ndarray
    look: np.ndarray
    key: np.ndarray
    before: np.ndarray
    reach: np.ndarray
    entrants: AtLook
    moved: np.ndarray

    @classmethod
    def first(cls, walk: Walk, u: np.ndarray, run: np.ndarray) -> Stage:
        """Members at the start, of standard normals (n, d)."""
        n, nothing = len(run), np.full(len(run), -np.inf)
        rows = np.arange(n)
        at_start = {0: (rows, walk.begin(u))}
        return cls(run, u, np.full(n, -1), np.zeros(n, int), walk.keys(n), nothing, nothing.copy(), at_start,
                   np.zeros(n, bool))  # fmt: skip

    def next(self, walk: Walk, crossed: AtLook, size: int, generators: Sequence[np.random.Generator]) -> Stage | None:
        """Draw `size` members of each run from states at which members of this stage crossed a level, or None.

        The numbers of draws of two states differ by at most one (systematic resampling).
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
        return Stage(self.run[parent], self.u[parent], parent, look, walk.keys(len(parent)), before, before.copy(),
                     entrants, np.zeros(len(parent), bool))  # fmt: skip


def walked(
    walk: Walk, score: Score | None, stage: Stage, bound: float, log: Log | None = None,
    keys: Callable[[int], np.ndarray] | None = None) -> AtLook:  # fmt: skip
    """Run the members of a stage until they reach a bound of the score; returns checkpoint -> (rows, flock) of those.

    score: None if only the event itself is known. log: receives all members at every checkpoint. keys: function of a
    checkpoint that gives keys (n,) of the noise, by default the stage's. A walk with a store repeats no stored stretch.
    """
    if log is None and walk.stretches is not None:
        return walk.stretches(walk, stage, bound, lambda: _walked(walk, score, stage, bound, None, keys))
    return _walked(walk, score, stage, bound, log, keys)


def _walked(
    walk: Walk, score: Score | None, stage: Stage, bound: float, log: Log | None,
    keys: Callable[[int], np.ndarray] | None) -> AtLook:  # fmt: skip
    """Run without the store."""
    crossed: dict[int, list[tuple[np.ndarray, Flock]]] = {}
    moving: tuple[np.ndarray, Flock] | None = None
    for look in range(walk.looks + 1):
        if look in stage.entrants:
            rows, flock = stage.entrants[look]
            already = stage.before[rows] >= bound
            note(crossed, look, rows, flock, already)
            moving = _together(walk, moving, _part(rows, flock, ~already & ~flock.over))
        if moving is None or look == walk.looks:
            continue
        rows, flock = moving[0], walk.advance(moving[1], (keys(look) if keys else stage.key)[moving[0]])
        if log is not None:
            log.append((rows, flock))
        value = np.where(flock.happened, np.inf, -np.inf) if score is None else score(flock)
        stage.reach[rows] = np.maximum(stage.reach[rows], value)
        reached = stage.reach[rows] >= bound
        note(crossed, look + 1, rows, flock, reached)
        moving = _part(rows, flock, ~reached & ~flock.over)
    return by_look(walk, crossed)


def first_reached(walk: Walk, score: Score, stage: Stage, log: Log, bound: float) -> AtLook:
    """First states of a stage's members at a bound, from their log."""
    crossed: dict[int, list[tuple[np.ndarray, Flock]]] = {}
    reached = stage.before >= bound
    for look, (rows, flock) in stage.entrants.items():
        note(crossed, look, rows, flock, reached[rows])
    for rows, flock in log:
        new = (score(flock) >= bound) & ~reached[rows]
        note(crossed, flock.look, rows, flock, new)
        reached[rows[new]] = True
    return by_look(walk, crossed)


def note(crossed: dict[int, Log], look: int, rows: np.ndarray, flock: Flock, chosen: np.ndarray) -> None:
    """Record the chosen members that reached a level at a checkpoint."""
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


def by_look(walk: Walk, crossed: Mapping[int, Log]) -> AtLook:
    """Recorded members, joined by checkpoint."""
    return {
        look: (np.concatenate([rows for rows, _ in parts]), walk.joined([flock for _, flock in parts]))
        for look, parts in sorted(crossed.items())
    }
