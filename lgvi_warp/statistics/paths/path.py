# SPDX-License-Identifier: Apache-2.0
"""Statistics of one number of each member's whole path, such as its maximum."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from lgvi_warp.statistics.base import Gatherer, Statistic
from lgvi_warp.statistics.counts import Condition
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.paths.member_statistic import MemberStatistic
from lgvi_warp.statistics.values import reductions
from lgvi_warp.statistics.values.functional import Functional, functional
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.statistics.values.reductions import Reduction
from lgvi_warp.statistics.values.values import Values


class _Walk(Gatherer):
    """Follows the paths of a block's members, sample by sample, and records whether all samples counted."""

    def __init__(self, statistic: OfPath, time: np.ndarray):
        self._statistic, self._time, self._reduction = statistic, time, statistic.reduction
        # One row for each replicate; one row without replicates.
        self._state: np.ndarray | None = None
        self._last = np.empty(0)
        self._whole: np.ndarray | None = None
        self._place: tuple[int, int, int, int, np.ndarray | None] = (0, 0, 0, 1, None)
        self._single = False

    def take(self, values: Values, when: slice) -> None:
        rows = (-1, values.replicates)
        samples = values.x.reshape(*rows, *values.x.shape[1:])
        # Samples are taken one by one, so that the bits do not depend on how many come at once.
        for t, x in zip(range(when.start, when.stop), samples, strict=True):
            self._state = self._reduction.start(x) if self._state is None else self._stepped(self._state, t, x)
            self._last = x
        self._last = self._last.copy()
        if values.good is not None:
            complete = values.good.reshape(*rows, values.good.shape[1]).all(axis=0)
            self._whole = complete if self._whole is None else self._whole & complete
        self._place = (values.first, values.block, values.size, values.replicates, values.weight)
        self._single = values.single and self._reduction.of_samples

    def _stepped(self, state: np.ndarray, t: int, x: np.ndarray) -> np.ndarray:
        dt = float(self._time[t] - self._time[t - 1])
        return self._reduction.step(state, self._last, x, dt, dt / float(self._time[t] - self._time[0]))

    def close(self) -> Part:
        assert self._state is not None
        x = self._reduction.finish(self._state)
        good = None if self._whole is None or self._whole.all() else self._whole
        values = Values(x.astype(np.float32) if self._single else x, good, *self._place)
        return self._statistic.gather(values, self._time)


@dataclass(frozen=True, eq=False)
class OfPath(MemberStatistic):
    """One number for each component of each member's whole path, and statistics of this number over members. Abstract.

    Members that failed are left out, since the rest of their path is not known. The name of an estimate contains both
    types of statistics: "mean path_maximum speed". The estimate has one row, at the end of the run.

    Args:
        of: A quantity, such as "depth" or "position[2]", a function of (samples, members), or a list of these
            (see lw.statistics.Quantity).
        then: statistic of these numbers over the members, or a list of statistics, each without its `of`:
            lw.statistics.Mean() (the default), lw.statistics.Quantiles(levels=(0.5, 0.99)),
            lw.statistics.Exceedance(above=2.0).
    """

    of_numbers: ClassVar[bool] = False
    _reduction: ClassVar[Reduction]

    @property
    def reduction(self) -> Reduction:
        """Reduction of samples (replicates, d components, members) to the number of each path."""
        return self._reduction

    def open(self, time: np.ndarray, count: int) -> _Walk:
        return _Walk(self, time)


@dataclass(frozen=True, eq=False)
class PathMaximum(OfPath):
    """Largest value of a quantity over all sample times of each member; `then` gives its statistics over members.

    Members that failed are left out, since the rest of their path is not known. The name of an estimate contains both
    types of statistics: "mean path_maximum speed". The estimate has one row, at the end of the run.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0})
        >>> fleet = lw.Ensemble(scene, members=64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=2.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=20.0, statistics=[lw.statistics.PathMaximum("speed")])
        >>> print(f"{result.statistics['mean path_maximum speed'].value[-1, 0]:.2f} m/s")
        1.32 m/s
    """

    type: ClassVar[str] = "path_maximum"
    _reduction: ClassVar[Reduction] = reductions.MAXIMUM


@dataclass(frozen=True, eq=False)
class PathMinimum(OfPath):
    """Smallest value of a quantity over all sample times of each member; `then` gives its statistics over members."""

    type: ClassVar[str] = "path_minimum"
    _reduction: ClassVar[Reduction] = reductions.MINIMUM


@dataclass(frozen=True, eq=False)
class PathRange(OfPath):
    """Largest minus smallest value of a quantity over each member's samples; `then` gives statistics over members."""

    type: ClassVar[str] = "path_range"
    _reduction: ClassVar[Reduction] = reductions.RANGE


@dataclass(frozen=True, eq=False)
class PathMean(OfPath):
    """Time average of a quantity for each member; `then` gives its statistics over members.

    The quantity is assumed to be linear between samples: the trapezoidal integral is divided by the time from the first
    to the last sample. For a single sample, the average is its value.
    """

    type: ClassVar[str] = "path_mean"
    _reduction: ClassVar[Reduction] = reductions.MEAN


@dataclass(frozen=True, eq=False)
class PathRms(OfPath):
    """Root mean square over time of a quantity for each member; `then` gives its statistics over members.

    The square of the quantity is assumed to be linear between samples.
    """

    type: ClassVar[str] = "path_rms"
    _reduction: ClassVar[Reduction] = reductions.ROOT_MEAN_SQUARE


@dataclass(frozen=True, eq=False)
class PathTime(OfPath, Condition):
    """Total time [s] during which a condition holds for each member; `then` gives its statistics over members.

    The name of an estimate is, for example, "mean path_time depth above 2". The quantity is assumed to be linear
    between samples: an interval counts by the fraction of its line that satisfies the condition. For a quantity that is
    true or false, half of an interval counts for each of its two ends at which the condition holds.

    Args:
        above: lower limit, one number or one for each component, in the quantity's unit.
        below: upper limit, in the same form. With both limits, the time spent between them counts.
    """

    type: ClassVar[str] = "path_time"

    @property
    def unit(self) -> str:
        return "s"

    @property
    def needs_limit(self) -> bool:
        # Whether a condition on the time needs a limit: without one, the question is whether it ever holds.
        return False

    @property
    def _labels(self) -> tuple[str, ...]:
        return tuple(f"{label}{self.limits_text}" for label in super()._labels)

    @property
    def reduction(self) -> Reduction:
        return Reduction(self._step, lambda x: np.zeros(x.shape))

    def _step(self, state: np.ndarray, before: np.ndarray, x: np.ndarray, dt: float, share: float) -> np.ndarray:
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
    """Fraction of lines of this length that lies beyond a number, 0 to 1; for a line without length, 0 or 1."""
    moves = length > 0.0
    return np.where(moves, np.clip(beyond / np.where(moves, length, 1.0), 0.0, 1.0), 1.0 * (beyond > 0.0))


@dataclass(frozen=True, eq=False)
class OfExpression(OfPath):
    """The number that an expression such as "max(depth)" gives for each member's path, then a statistic of it.

    The name of an estimate contains the expression: "mean max(depth)".
    """

    def meant(self) -> Quantity:
        return self._functional.inner

    @property
    def _functional(self) -> Functional:
        return functional("of", self.of)

    @property
    def key(self) -> str:
        return self._functional.label

    @property
    def reduction(self) -> Reduction:
        return self._functional.reduction

    @property
    def _labels(self) -> tuple[str, ...]:
        return self._functional.labels


def followed(statistic: Statistic) -> Statistic:
    """Return the statistic to gather: a statistic of paths, if the expression reduces paths; else the statistic itself."""
    if statistic.path is None:
        return statistic
    return OfExpression(statistic.path.label, then=replace(statistic, of=None), stopped=statistic.stopped)
