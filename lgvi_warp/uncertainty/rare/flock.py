# SPDX-License-Identifier: Apache-2.0
"""Members on their way to an event: their states at a checkpoint ("look"), and a score of their nearness to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from lgvi_warp.uncertainty.rare.limit import limits_of

# Features that vary less than this part of themselves are not looked at; cut of small singular values; the least error.
LEAST_SPREAD, CUT, LEAST_MISSED = 1e-12, 1e-8, 1e-12


@dataclass(frozen=True, eq=False)
class Flock:
    """Members at one checkpoint.

    look: number of the checkpoint; 0 at the start. place: states from which a walk continues, with `part(rows)`.
    values: (c, n), the event's numbers so far. distances: (c, n), their distances beyond the bounds. features: (n, f),
    numbers that may predict the event. happened, over, lost: (n,), True if the event happened, the member ended, or
    failed.
    """

    look: int
    place: Any
    values: np.ndarray
    distances: np.ndarray
    features: np.ndarray
    happened: np.ndarray
    over: np.ndarray
    lost: np.ndarray

    def part(self, rows: np.ndarray) -> Flock:
        """Some of the members; a member may occur several times."""
        return Flock(
            self.look, self.place.part(rows), self.values[:, rows], self.distances[:, rows], self.features[rows],
            self.happened[rows], self.over[rows], self.lost[rows],
        )  # fmt: skip

    def beside(self, others: Sequence[Flock], place: Any) -> Flock:
        """These members followed by others at the same checkpoint; place: their joined states."""
        flocks = [self, *others]
        rows = {name: np.concatenate([getattr(flock, name) for flock in flocks], axis=axis)
                for name, axis in AXES.items()}  # fmt: skip
        return Flock(self.look, place, **rows)


# The axis of each array that counts members.
AXES = {"values": 1, "distances": 1, "features": 0, "happened": 0, "over": 0, "lost": 0}


class Walk(Protocol):
    """Motion of members from checkpoint to checkpoint.

    looks: number of the last checkpoint. d: number of normals of a member's start. lasting: (c,), for each number of
    the event, True if the event happens once the number is beyond its bounds, False if only the last checkpoint counts.
    stretches: store of the runs from level to level, as `Stretches`; None for none.
    """

    looks: int
    d: int
    lasting: np.ndarray
    stretches: Any

    def begin(self, u: np.ndarray) -> Flock:
        """Members at the start, of standard normals (n, d)."""

    def keys(self, count: int) -> np.ndarray:
        """Keys (n,) of noise that no member has used."""

    def advance(self, flock: Flock, keys: np.ndarray) -> Flock:
        """Advance the members to the next checkpoint, with the noise of these keys."""

    def joined(self, flocks: Sequence[Flock]) -> Flock:
        """Join flocks at one checkpoint."""


@dataclass(frozen=True, eq=False)
class ExpectedLimit:
    """Expected limit at the last checkpoint: a linear function of the members' numbers at a checkpoint.

    level: the mean. centre, slopes: (f,). missed: standard deviation of the residuals.
    """

    level: float
    centre: np.ndarray
    slopes: np.ndarray
    missed: float

    @classmethod
    def nearest(cls, x: np.ndarray, y: np.ndarray) -> ExpectedLimit:
        """Least-squares fit to y (n,) at x (n, f)."""
        centre, spread = x.mean(axis=0), x.std(axis=0)
        varies = spread > LEAST_SPREAD * np.maximum(1.0, np.abs(centre))
        slopes, left = np.zeros(x.shape[1]), y - y.mean()
        if varies.any():
            scaled = (x[:, varies] - centre[varies]) / spread[varies]
            solved = np.linalg.lstsq(scaled, left, rcond=CUT)[0]
            slopes[varies], left = solved / spread[varies], left - scaled @ solved
        return cls(float(y.mean()), centre, slopes, float(left.std()))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Expected limit (n,) at x (n, f); -inf if it is not finite."""
        with np.errstate(all="ignore"):
            expected = self.level + (x - self.centre) @ self.slopes
        return np.where(np.isfinite(expected), expected, -np.inf)


@dataclass(frozen=True, eq=False)
class Score:
    """Score of members' nearness to the event: their expected limit at the last checkpoint, in units of its error.

    It is fitted to members of a plain run. It only guides the search: any score leaves the answer unbiased.

    spreads: (c,), units of the distances. lasting: as in `Walk`. lines: fits by checkpoint.
    """

    spreads: np.ndarray
    lasting: np.ndarray
    lines: Mapping[int, ExpectedLimit]

    @classmethod
    def fitted(cls, log: Sequence[tuple[np.ndarray, Flock]], walk: Walk, spreads: np.ndarray) -> Score:
        """Fit the score to members of a plain run, from their logged states at checkpoints.

        log: (rows, flock) of every checkpoint; members that have ended do not appear again.
        """
        end = np.full(int(max(rows.max() for rows, _ in log)) + 1, np.nan)
        for rows, flock in log:
            end[rows] = limits_of(flock.distances, spreads)
        lines = {}
        for rows, flock in log:
            y, x = end[rows], _numbers_of(flock, spreads)
            ordinary = np.isfinite(y) & (np.abs(y) < 1e300) & ~flock.lost & np.isfinite(x).all(axis=1)
            if flock.look < walk.looks and ordinary.sum() > 4 * x.shape[1]:
                lines[flock.look] = ExpectedLimit.nearest(x[ordinary], y[ordinary])
        return cls(spreads, walk.lasting, lines)

    def __call__(self, flock: Flock) -> np.ndarray:
        """Scores (n,) of members at a checkpoint: infinite if the event has happened, -inf if it no longer can."""
        score = np.full(len(flock.over), -np.inf)
        line = self.lines.get(flock.look)
        if line is not None:
            score = line(_numbers_of(flock, self.spreads))
            if self.lasting.any():
                score = np.maximum(score, limits_of(flock.distances[self.lasting], self.spreads[self.lasting]))
            score = np.minimum(score / max(line.missed, LEAST_MISSED), np.finfo(float).max)
        return np.where(flock.happened, np.inf, np.where(flock.over, -np.inf, score))


def _numbers_of(flock: Flock, spreads: np.ndarray) -> np.ndarray:
    """Numbers of members at a checkpoint (n, f), including their limit so far."""
    return np.column_stack([np.clip(limits_of(flock.distances, spreads), -1e300, 1e300), flock.features])
