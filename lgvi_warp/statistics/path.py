"""What is made of each member's whole path first, and then counted over members."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.statistics.base import Gatherer
from lgvi_warp.statistics.counts import Condition
from lgvi_warp.statistics.then import Then
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values


class _Walk(Gatherer):
    """Of a block: what each member's path came to so far, sample by sample, and whether all its samples counted."""

    def __init__(self, statistic: OfPath, time: np.ndarray):
        self._statistic, self._time = statistic, time
        # One row, or one of each replicate.
        self._state: np.ndarray | None = None
        self._last = np.empty(0)
        self._whole: np.ndarray | None = None
        self._place, self._single = (0, 0, 0, 1), False

    def take(self, values: Values, when: slice) -> None:
        """Look at these times."""
        rows = (-1, values.replicates)
        samples = values.x.reshape(*rows, *values.x.shape[1:])
        # One after the other: however many come at once, the bits are the same.
        for t, x in zip(range(when.start, when.stop), samples, strict=True):
            self._state = self._statistic.start(x) if self._state is None else self._stepped(self._state, t, x)
            self._last = x
        self._last = self._last.copy()
        if values.good is not None:
            whole = values.good.reshape(*rows, values.good.shape[1]).all(axis=0)
            self._whole = whole if self._whole is None else self._whole & whole
        self._place = (values.first, values.block, values.size, values.replicates)
        self._single = values.single and self._statistic.of_samples

    def _stepped(self, state: np.ndarray, t: int, x: np.ndarray) -> np.ndarray:
        dt = float(self._time[t] - self._time[t - 1])
        return self._statistic.step(state, self._last, x, dt, dt / float(self._time[t] - self._time[0]))

    def close(self) -> Part:
        """What each of the statistics keeps of what the paths came to."""
        assert self._state is not None
        x = self._statistic.finish(self._state)
        good = None if self._whole is None or self._whole.all() else self._whole
        values = Values(x.astype(np.float32) if self._single else x, good, *self._place)
        return self._statistic.gather(values, self._time)


@dataclass(frozen=True, eq=False)
class OfPath(Then):
    """One number for each component of each member's whole path, then statistics of that.

    then: a statistic, or a list, without `of`: lw.Mean(), lw.Quantiles(levels=(0.5, 0.99)), lw.Exceedance(above=2.0).
    Members that failed are left out: the rest of their path is not known. The estimates are called after both: "mean
    path_maximum speed". The time of their one row is that of the end.
    """

    of_numbers: ClassVar[bool] = False
    # Whether the number is one of the samples.
    of_samples: ClassVar[bool] = False

    def open(self, time: np.ndarray, count: int) -> _Walk:
        """What follows the members of a block."""
        return _Walk(self, time)

    # What a path comes to, of d components of members, (replicates, d, members): from its first sample on.

    def start(self, x: np.ndarray) -> np.ndarray:
        """Of the first sample alone."""
        return x

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """With another sample, dt [s] after the one before: the part `share` of the time since the first."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def finish(self, state: np.ndarray) -> np.ndarray:
        """What statistics are of."""
        return state


@dataclass(frozen=True, eq=False)
class PathMaximum(OfPath):
    """The largest of a quantity over all sample times of each member, then statistics of that.

    then: a statistic, or a list, without `of`: lw.Mean(), lw.Quantiles(levels=(0.5, 0.99)), lw.Exceedance(above=2.0).
    Members that failed are left out: the rest of their path is not known. The estimates are called after both: "mean
    path_maximum speed". The time of their one row is that of the end.
    """

    type: ClassVar[str] = "path_maximum"
    of_samples: ClassVar[bool] = True

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """The larger."""
        return np.maximum(state, x)


@dataclass(frozen=True, eq=False)
class PathMinimum(OfPath):
    """The smallest of a quantity over all sample times of each member, then statistics of that: as PathMaximum."""

    type: ClassVar[str] = "path_minimum"
    of_samples: ClassVar[bool] = True

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """The smaller."""
        return np.minimum(state, x)


@dataclass(frozen=True, eq=False)
class PathRange(OfPath):
    """The largest less the smallest of a quantity over all sample times of each member, then statistics: as PathMaximum."""

    type: ClassVar[str] = "path_range"

    def start(self, x: np.ndarray) -> np.ndarray:
        """Both ends."""
        return np.stack([x, x])

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """The smaller and the larger."""
        return np.stack([np.minimum(state[0], x), np.maximum(state[1], x)])

    def finish(self, state: np.ndarray) -> np.ndarray:
        """Between the two."""
        return np.asarray(state[1] - state[0])


@dataclass(frozen=True, eq=False)
class PathMean(OfPath):
    """The average over time of a quantity of each member, then statistics of that: as PathMaximum.

    Linear between samples: the trapezoidal rule over the sample times, divided by the time from the first to the last. Of
    one sample alone it is that one.
    """

    type: ClassVar[str] = "path_mean"

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """The average so far moves towards that of the time since."""
        return np.asarray(state + share * (0.5 * (before + x) - state))


@dataclass(frozen=True, eq=False)
class PathRms(PathMean):
    """The root of the average over time of the square of a quantity of each member, then statistics of that: as PathMean.

    The square is taken as linear between samples.
    """

    type: ClassVar[str] = "path_rms"

    def start(self, x: np.ndarray) -> np.ndarray:
        """The square."""
        return np.asarray(x * x)

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """The average of squares."""
        return super().step(state, before * before, x * x, dt, share)

    def finish(self, state: np.ndarray) -> np.ndarray:
        """Its root."""
        return np.asarray(np.sqrt(state))


@dataclass(frozen=True, eq=False)
class PathTime(OfPath, Condition):
    """The time [s] for which a quantity of each member is above (or below) a number, then statistics of that: as PathMaximum.

    above, below: one number, or one for each component; with both, the time between them. Linear between samples: a
    piece of time counts as far as the line between its ends lies there. What is true or false has no line: half a piece
    counts for each of its ends at which it holds. "mean path_time depth above 2".
    """

    type: ClassVar[str] = "path_time"

    @property
    def unit(self) -> str:
        """A time."""
        return "s"

    @property
    def needs_limit(self) -> bool:
        """Without one, whether it ever holds."""
        return False

    @property
    def _labels(self) -> tuple[str, ...]:
        return tuple(f"{label}{self.limits_text}" for label in super()._labels)

    def start(self, x: np.ndarray) -> np.ndarray:
        """None yet."""
        return np.zeros(x.shape)

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """And the part of dt for which it holds."""
        above, below = self.limits(x.shape[-2])
        if above is None and below is None:
            part = 0.5 * ((before != 0.0) + 1.0 * (x != 0.0))
        else:
            low, high = np.minimum(before, x), np.maximum(before, x)
            one = 1.0 if above is None else _part(high - above, high - low)
            other = 1.0 if below is None else _part(below - low, high - low)
            # Each point of a line is above the one or below the other, or both.
            part = np.maximum(one + other - 1.0, 0.0)
        return np.asarray(state + dt * part)


def _part(beyond: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Which part of lines of this length lies beyond a number: 0 to 1, of a line that stands still one of them."""
    moves = length > 0.0
    return np.where(moves, np.clip(beyond / np.where(moves, length, 1.0), 0.0, 1.0), 1.0 * (beyond > 0.0))
