# SPDX-License-Identifier: Apache-2.0
"""A quantity of a block's members at some sample times, with intermediate results that statistics share."""

from __future__ import annotations

import copy
import functools

import numpy as np


class Values:
    """Numbers of n members at k sample times.

    A member counts at a time if it had not failed by then and all of its numbers are finite. If the members belong to R
    replicates, each time has R rows, one for each replicate (see `dealt`), and n and `size` are per replicate.

    x: (k, d, n), the numbers.
    good: (k, n), True for members that had not failed; None (the default) if none had failed.
    weight: (n,), weight of each member; None (the default): all the same. A member with weight 0 does not count.

    Attributes:
        x: (k, d, n), float64; 0 if a member does not count.
        good: (k, n), True for members that count; None if all do.
        count: (k,), number of members that count; under weights (see `under`) the sum of the weights.
        single: True if the numbers were float32, so that sorting them in float32 loses nothing.
    """

    def __init__(
        self,
        x: np.ndarray,
        good: np.ndarray | None = None,
        first: int = 0,
        block: int = 0,
        size: int = 0,
        replicates: int = 1,
        weight: np.ndarray | None = None,
    ):
        self.first, self.block, self.size = first, block, max(size, x.shape[2])
        self.replicates = replicates
        self.single = x.dtype == np.float32
        self.weight = weight
        # What sums weigh each member by, (k, n); None: by 1.
        self._measure: np.ndarray | None = None
        if weight is not None and not weight.all():
            good = np.broadcast_to(weight > 0.0, (len(x), x.shape[2])) if good is None else good & (weight > 0.0)
        x = x.astype(np.float64, copy=False)
        if good is None and np.isfinite(x.sum(axis=2)).all():
            self.x, self.good = x, None
            self.count = np.full(len(x), x.shape[2], np.int64)
        else:
            finite = np.isfinite(x).all(axis=1)
            self.good = finite if good is None else finite & good
            self.x = np.where(self.good[:, None], x, 0.0)
            self.count = self.good.sum(axis=1)

    def under(self, power: int) -> Values:
        """Return these values under a measure: sums use a power of each member's weight, and `count` is the sum of these."""
        assert self.weight is not None
        measure = np.broadcast_to(self.weight**power, (len(self.x), self.x.shape[2]))
        return self._under(measure if self.good is None else np.where(self.good, measure, 0.0))

    def _under(self, measure: np.ndarray) -> Values:
        other = copy.copy(self)
        for name in ("mean", "centred"):
            vars(other).pop(name, None)
        other._measure, other.count = measure, measure.sum(axis=1)
        return other

    @property
    def weights(self) -> np.ndarray:
        """Weight of each member at each time, (k, n); 0 if it does not count."""
        return np.ones((len(self.x), self.x.shape[2])) if self._measure is None else self._measure

    def with_numbers(self, x: np.ndarray) -> Values:
        """Return other numbers (k, d, n) of the same members, under the same measure."""
        other = Values(x, self.good)
        return other if self._measure is None else other._under(self._measure)

    def weighed(self, a: np.ndarray) -> np.ndarray:
        """Return numbers a (k, d, n) times the members' weights."""
        return a if self._measure is None else a * self._measure[:, None]

    def summed(self, mask: np.ndarray) -> np.ndarray:
        """Return the sum (k, d) over the members of a mask (k, d, n)."""
        return np.asarray(mask.sum(axis=2) if self._measure is None else self.weighed(mask).sum(axis=2))

    def counted(self, places: np.ndarray, chosen: np.ndarray | None, length: int) -> np.ndarray:
        """Return the sums (length,) of members by their places (k, d, n), over the chosen members (k, d, n), or over all."""
        weights = None
        if self._measure is not None:
            weights = np.broadcast_to(self._measure[:, None], places.shape)
            weights = weights.ravel() if chosen is None else weights[chosen]
        return np.bincount(places.ravel() if chosen is None else places[chosen], weights, length)

    def members(self, at: np.ndarray) -> np.ndarray:
        """Return the indices in the run of the members at places (k, d) of the last axis of `x`."""
        return self.first + at * self.replicates + (np.arange(len(at)) % self.replicates)[:, None]

    def filled(self, value: float) -> np.ndarray:
        """Return x (k, d, n) with a given number for members that do not count."""
        return self.x if self.good is None else np.where(self.good[:, None], self.x, value)

    @functools.cached_property
    def mean(self) -> np.ndarray:
        """Mean over the members that count, (k, d); 0 if none counts."""
        if self._measure is None:
            return self.x.sum(axis=2) / np.maximum(self.count, 1)[:, None]
        return self.weighed(self.x).sum(axis=2) / np.where(self.count > 0.0, self.count, 1.0)[:, None]

    @functools.cached_property
    def centred(self) -> np.ndarray:
        """Difference of x from its mean, (k, d, n); 0 if a member does not count."""
        if self.good is None:
            return self.x - self.mean[:, :, None]
        return np.where(self.good[:, None], self.x - self.mean[:, :, None], 0.0)


def dealt(x: np.ndarray, good: np.ndarray | None, first: int, block: int, size: int, replicates: int) -> Values:
    """Return values with one row for each time and replicate; of n members, a multiple of R, i is in replicate i mod R."""
    k, d, n = x.shape
    R = replicates
    rows = np.moveaxis(x.reshape(k, d, n // R, R), 3, 1).reshape(k * R, d, n // R)
    if good is not None:
        good = np.swapaxes(good.reshape(k, n // R, R), 1, 2).reshape(k * R, n // R)
    # Strided rows would be summed in another order, with other bits.
    return Values(np.ascontiguousarray(rows), good, first, block, size // R, R)
