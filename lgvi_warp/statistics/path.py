"""Statistics of one number of each member's whole path, such as its maximum."""

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
    """Follows the paths of a block's members, sample by sample, and whether all samples counted."""

    def __init__(self, statistic: OfPath, time: np.ndarray):
        self._statistic, self._time = statistic, time
        # One row for each replicate; one row without replicates.
        self._state: np.ndarray | None = None
        self._last = np.empty(0)
        self._whole: np.ndarray | None = None
        self._place, self._single = (0, 0, 0, 1), False

    def take(self, values: Values, when: slice) -> None:
        """Take in the samples at these times."""
        rows = (-1, values.replicates)
        samples = values.x.reshape(*rows, *values.x.shape[1:])
        # Samples are taken one by one, so that the bits do not depend on how many come at once.
        for t, x in zip(range(when.start, when.stop), samples, strict=True):
            self._state = self._statistic.start(x) if self._state is None else self._stepped(self._state, t, x)
            self._last = x
        self._last = self._last.copy()
        if values.good is not None:
            complete = values.good.reshape(*rows, values.good.shape[1]).all(axis=0)
            self._whole = complete if self._whole is None else self._whole & complete
        self._place = (values.first, values.block, values.size, values.replicates)
        self._single = values.single and self._statistic.of_samples

    def _stepped(self, state: np.ndarray, t: int, x: np.ndarray) -> np.ndarray:
        dt = float(self._time[t] - self._time[t - 1])
        return self._statistic.step(state, self._last, x, dt, dt / float(self._time[t] - self._time[0]))

    def close(self) -> Part:
        """Return the parts of all statistics of the paths' numbers."""
        assert self._state is not None
        x = self._statistic.finish(self._state)
        good = None if self._whole is None or self._whole.all() else self._whole
        values = Values(x.astype(np.float32) if self._single else x, good, *self._place)
        return self._statistic.gather(values, self._time)


@dataclass(frozen=True, eq=False)
class OfPath(Then):
    """One number for each component of each member's whole path, then statistics of that number. Abstract.

    Members that failed are left out: the rest of their path is not known. The name of an estimate has both types: "mean
    path_maximum speed". Its one row is at the time of the end.

    Args:
        of: a quantity; see `Statistic`, also for name, confidence and stopped.
        then: a statistic, or a list, without `of`: lw.Mean() (the default), lw.Quantiles(levels=(0.5, 0.99)),
            lw.Exceedance(above=2.0).
    """

    of_numbers: ClassVar[bool] = False
    # Whether the path's number is one of its samples, so that float32 holds it exactly.
    of_samples: ClassVar[bool] = False

    def open(self, time: np.ndarray, count: int) -> _Walk:
        """Return the object that follows the members of a block."""
        return _Walk(self, time)

    # The reduction of a path, for arrays (replicates, d components, members), from its first sample on.

    def start(self, x: np.ndarray) -> np.ndarray:
        """Return the state of the paths after their first sample.

        Args:
            x: (R, d, n), the first sample: R replicates, d components, n members.
        """
        return x

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        """Return the state of the paths after another sample.

        Args:
            state: what `start` or the previous `step` returned.
            before: (R, d, n), the sample before.
            x: (R, d, n), the sample.
            dt: time [s] between the two.
            share: dt divided by the time since the first sample.
        """
        raise TypeError(f"{type(self).__name__} is abstract")

    def finish(self, state: np.ndarray) -> np.ndarray:
        """Return the number of each path, (R, d, n).

        Args:
            state: the state after the last sample.
        """
        return state


@dataclass(frozen=True, eq=False)
class PathMaximum(OfPath):
    """The largest value of a quantity over all sample times of each member, then statistics of it.

    Members that failed are left out: the rest of their path is not known. The name of an estimate has both types: "mean
    path_maximum speed". Its one row is at the time of the end.

    Args:
        of: a quantity; see `Statistic`, also for name, confidence and stopped.
        then: a statistic, or a list, without `of`: lw.Mean() (the default), lw.Quantiles(levels=(0.5, 0.99)),
            lw.Exceedance(above=2.0).
    """

    type: ClassVar[str] = "path_maximum"
    of_samples: ClassVar[bool] = True

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        return np.maximum(state, x)


@dataclass(frozen=True, eq=False)
class PathMinimum(OfPath):
    """The smallest value of a quantity over all sample times of each member, then statistics of it.

    Args:
        of: a quantity; see PathMaximum.
        then: a statistic, or a list, without `of`; by default lw.Mean().
    """

    type: ClassVar[str] = "path_minimum"
    of_samples: ClassVar[bool] = True

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        return np.minimum(state, x)


@dataclass(frozen=True, eq=False)
class PathRange(OfPath):
    """The largest less the smallest value of a quantity over all sample times of each member, then statistics of it.

    Args:
        of: a quantity; see PathMaximum.
        then: a statistic, or a list, without `of`; by default lw.Mean().
    """

    type: ClassVar[str] = "path_range"

    def start(self, x: np.ndarray) -> np.ndarray:
        """Return smallest and largest value so far, (2, R, d, n)."""
        return np.stack([x, x])

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        return np.stack([np.minimum(state[0], x), np.maximum(state[1], x)])

    def finish(self, state: np.ndarray) -> np.ndarray:
        """Return the largest less the smallest value."""
        return np.asarray(state[1] - state[0])


@dataclass(frozen=True, eq=False)
class PathMean(OfPath):
    """The average over time of a quantity of each member, then statistics of it.

    Linear between samples: the trapezoidal rule over the sample times, divided by the time from the first to the last.
    With one sample it is that sample.

    Args:
        of: a quantity; see PathMaximum.
        then: a statistic, or a list, without `of`; by default lw.Mean().
    """

    type: ClassVar[str] = "path_mean"

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        # Move the average so far towards the average since the sample before.
        return np.asarray(state + share * (0.5 * (before + x) - state))


@dataclass(frozen=True, eq=False)
class PathRms(PathMean):
    """The root of the average over time of a quantity's square for each member, then statistics of it.

    The square is taken as linear between samples.

    Args:
        of: a quantity; see PathMaximum.
        then: a statistic, or a list, without `of`; by default lw.Mean().
    """

    type: ClassVar[str] = "path_rms"

    def start(self, x: np.ndarray) -> np.ndarray:
        """Return the square of the first sample."""
        return np.asarray(x * x)

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        # Average the squares over time as `PathMean` does.
        return super().step(state, before * before, x * x, dt, share)

    def finish(self, state: np.ndarray) -> np.ndarray:
        """Return the square root of the average."""
        return np.asarray(np.sqrt(state))


@dataclass(frozen=True, eq=False)
class PathTime(OfPath, Condition):
    """The time [s] for which a condition holds for each member, then statistics of it: "mean path_time depth above 2".

    Linear between samples: a time between two samples counts by the fraction of the line between them that satisfies
    the condition. A quantity that is true or false has no line: half of the time counts for each of its ends at which
    it holds.

    Args:
        of: a quantity; see PathMaximum.
        then: a statistic, or a list, without `of`; by default lw.Mean().
        above: one number, or one for each component, in the quantity's unit.
        below: the same for the upper limit; with both, the time between them.
    """

    type: ClassVar[str] = "path_time"

    @property
    def unit(self) -> str:
        """The unit of the number, seconds."""
        return "s"

    @property
    def needs_limit(self) -> bool:
        """Whether a condition on the time needs a limit: without one, the question is whether it ever holds."""
        return False

    @property
    def _labels(self) -> tuple[str, ...]:
        return tuple(f"{label}{self.limits_text}" for label in super()._labels)

    def start(self, x: np.ndarray) -> np.ndarray:
        """Return zero time for all members."""
        return np.zeros(x.shape)

    def step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
        # Add the part of dt for which the condition holds.
        above, below = self.limits(x.shape[-2])
        if above is None and below is None:
            fraction = 0.5 * ((before != 0.0) + 1.0 * (x != 0.0))
        else:
            low, high = np.minimum(before, x), np.maximum(before, x)
            over = 1.0 if above is None else _part(high - above, high - low)
            under = 1.0 if below is None else _part(below - low, high - low)
            # Each point of the line satisfies at least one of the two limits.
            fraction = np.maximum(over + under - 1.0, 0.0)
        return np.asarray(state + dt * fraction)


def _part(beyond: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Fraction of lines of this length that lies beyond a number, 0 to 1; of a line of no length either 0 or 1."""
    moves = length > 0.0
    return np.where(moves, np.clip(beyond / np.where(moves, length, 1.0), 0.0, 1.0), 1.0 * (beyond > 0.0))
