# SPDX-License-Identifier: Apache-2.0
"""A quantity of a block's members at some sample times, with the intermediate results that several statistics share."""

from __future__ import annotations

import functools

import numpy as np


class Values:
    """Numbers of n members at k sample times.

    A member counts at a time if it had not failed by then and all of its numbers are finite. If the members belong to R
    replicates, each time has R rows, one for each replicate (see `dealt`), and n and `size` are per replicate.

    x: (k, d, n), the numbers.
    good: (k, n), which members had not failed; None (the default) if none had.

    Attributes:
        x: (k, d, n), float64; 0 where a member does not count.
        good: (k, n), which members count; None if all do.
        count: (k,), number of members that count.
        single: whether the numbers came as float32, so that sorting them in float32 loses nothing.
    """

    def __init__(
        self,
        x: np.ndarray,
        good: np.ndarray | None = None,
        first: int = 0,
        block: int = 0,
        size: int = 0,
        replicates: int = 1,
    ):
        self.first, self.block, self.size = first, block, max(size, x.shape[2])
        self.replicates = replicates
        self.single = x.dtype == np.float32
        x = x.astype(np.float64, copy=False)
        if good is None and np.isfinite(x.sum(axis=2)).all():
            self.x, self.good = x, None
            self.count = np.full(len(x), x.shape[2], np.int64)
        else:
            finite = np.isfinite(x).all(axis=1)
            self.good = finite if good is None else finite & good
            self.x = np.where(self.good[:, None], x, 0.0)
            self.count = self.good.sum(axis=1)

    def members(self, at: np.ndarray) -> np.ndarray:
        """Return the indices in the run of members at places (k, d) along the last axis of `x`."""
        return self.first + at * self.replicates + (np.arange(len(at)) % self.replicates)[:, None]

    def filled(self, value: float) -> np.ndarray:
        """Return x (k, d, n) with a given number where a member does not count."""
        return self.x if self.good is None else np.where(self.good[:, None], self.x, value)

    @functools.cached_property
    def mean(self) -> np.ndarray:
        """Mean over the members that count, (k, d); 0 where none counts."""
        return self.x.sum(axis=2) / np.maximum(self.count, 1)[:, None]

    @functools.cached_property
    def centred(self) -> np.ndarray:
        """x less its mean, (k, d, n); 0 where a member does not count."""
        if self.good is None:
            return self.x - self.mean[:, :, None]
        return np.where(self.good[:, None], self.x - self.mean[:, :, None], 0.0)


def dealt(x: np.ndarray, good: np.ndarray | None, first: int, block: int, size: int, replicates: int) -> Values:
    """Return values with one row for each time and replicate; member i of n, a multiple of R, belongs to replicate i mod R."""
    k, d, n = x.shape
    R = replicates
    rows = np.moveaxis(x.reshape(k, d, n // R, R), 3, 1).reshape(k * R, d, n // R)
    if good is not None:
        good = np.swapaxes(good.reshape(k, n // R, R), 1, 2).reshape(k * R, n // R)
    # Strided rows would be summed in another order, with other bits.
    return Values(np.ascontiguousarray(rows), good, first, block, size // R, R)
