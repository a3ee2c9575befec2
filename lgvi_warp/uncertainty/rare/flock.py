# SPDX-License-Identifier: Apache-2.0
"""Members on their way to an event: where they are at a look, and a score of how near they are to it."""

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
    """Members at one look.

    look: number of the look; 0 at the start. place: what a walk goes on from, with `part(rows)`. values: (c, n), the numbers
    that the event is of, so far. distances: (c, n), how far these are beyond their bounds. features: (n, f), numbers that may
    tell what comes. happened, over, lost: (n,), whether the event has happened, the member goes no further, it failed.
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
        """Some of the members; one may come several times."""
        return Flock(
            self.look, self.place.part(rows), self.values[:, rows], self.distances[:, rows], self.features[rows],
            self.happened[rows], self.over[rows], self.lost[rows],
        )  # fmt: skip

    def beside(self, others: Sequence[Flock], place: Any) -> Flock:
        """These members and then others at the same look, whose places are joined."""
        flocks = [self, *others]
        rows = {name: np.concatenate([getattr(flock, name) for flock in flocks], axis=axis)
                for name, axis in AXES.items()}  # fmt: skip
        return Flock(self.look, place, **rows)


# The axis of each array that counts members.
AXES = {"values": 1, "distances": 1, "features": 0, "happened": 0, "over": 0, "lost": 0}


class Walk(Protocol):
    """Motion of members from look to look.

    looks: number of the last look. d: number of normals that a member starts with. lasting: (c,), for each number that the
    event is of, whether the event has happened once it is beyond its bounds; else it must be so at the last look.
    stretches: what keeps the way from level to level, as `Stretches`; None for nothing.
    """

    looks: int
    d: int
    lasting: np.ndarray
    stretches: Any

    def begin(self, u: np.ndarray) -> Flock:
        """Members at the start, of standard normals (n, d)."""

    def keys(self, count: int) -> np.ndarray:
        """Keys (n,) of noise that no member has had."""

    def advance(self, flock: Flock, keys: np.ndarray) -> Flock:
        """The members at the next look, with the noise of these keys."""

    def joined(self, flocks: Sequence[Flock]) -> Flock:
        """Flocks of one look as one."""


@dataclass(frozen=True, eq=False)
class ExpectedLimit:
    """Expected limit at the last look: linear in the numbers of members at a look.

    level: the mean. centre, slopes: (f,). missed: standard deviation of what the line misses.
    """

    level: float
    centre: np.ndarray
    slopes: np.ndarray
    missed: float

    @classmethod
    def nearest(cls, x: np.ndarray, y: np.ndarray) -> ExpectedLimit:
        """The line nearest to y (n,) at x (n, f)."""
        centre, spread = x.mean(axis=0), x.std(axis=0)
        varies = spread > LEAST_SPREAD * np.maximum(1.0, np.abs(centre))
        slopes, left = np.zeros(x.shape[1]), y - y.mean()
        if varies.any():
            scaled = (x[:, varies] - centre[varies]) / spread[varies]
            solved = np.linalg.lstsq(scaled, left, rcond=CUT)[0]
            slopes[varies], left = solved / spread[varies], left - scaled @ solved
        return cls(float(y.mean()), centre, slopes, float(left.std()))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Expected limit (n,) at x (n, f); -inf where that is no number."""
        with np.errstate(all="ignore"):
            expected = self.level + (x - self.centre) @ self.slopes
        return np.where(np.isfinite(expected), expected, -np.inf)


@dataclass(frozen=True, eq=False)
class Score:
    """Score of members' nearness to the event: their expected limit at the last look, in units of its error.

    That is as members of a plain run have it. It steers alone: whatever it says, the answer has the mean that is right.

    spreads: (c,), what distances are measured in. lasting: as of a Walk. lines: by look.
    """

    spreads: np.ndarray
    lasting: np.ndarray
    lines: Mapping[int, ExpectedLimit]

    @classmethod
    def fitted(cls, log: Sequence[tuple[np.ndarray, Flock]], walk: Walk, spreads: np.ndarray) -> Score:
        """The score that members of a plain run say, which were seen at the looks in the log.

        log: (rows, flock) of every look; members that are over are not seen again.
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
        """The scores (n,) of members at a look: infinite where the event has happened, -inf where it cannot any more."""
        score = np.full(len(flock.over), -np.inf)
        line = self.lines.get(flock.look)
        if line is not None:
            score = line(_numbers_of(flock, self.spreads))
            if self.lasting.any():
                score = np.maximum(score, limits_of(flock.distances[self.lasting], self.spreads[self.lasting]))
            score = np.minimum(score / max(line.missed, LEAST_MISSED), np.finfo(float).max)
        return np.where(flock.happened, np.inf, np.where(flock.over, -np.inf, score))


def _numbers_of(flock: Flock, spreads: np.ndarray) -> np.ndarray:
    """Numbers of members at a look (n, f), their limit so far among them."""
    return np.column_stack([np.clip(limits_of(flock.distances, spreads), -1e300, 1e300), flock.features])
