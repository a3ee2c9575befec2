"""A quantity of a block's members at some sample times, with what several statistics need of it made once."""

from __future__ import annotations

import functools

import numpy as np


class Values:
    """x (k, d, n): numbers of n members at k times, float64; good (k, n), or None where all count.

    A member counts at a time if it had not failed by then and each of its numbers is finite. first: index of the
    block's first member; block: the block's number, and size: the members of a whole block. single: whether the numbers
    are float32 as they stand, so that what only sorts them may do so. replicates: R where each time has R rows, one of
    each replicate's members (`dealt`), and all sizes are theirs.
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
        """Indices of the members at these places (rows, d) of theirs."""
        return self.first + at * self.replicates + (np.arange(len(at)) % self.replicates)[:, None]

    def filled(self, value: float) -> np.ndarray:
        """x with this number where a member does not count."""
        return self.x if self.good is None else np.where(self.good[:, None], self.x, value)

    @functools.cached_property
    def mean(self) -> np.ndarray:
        """(k, d), 0 where no member counts."""
        return self.x.sum(axis=2) / np.maximum(self.count, 1)[:, None]

    @functools.cached_property
    def centred(self) -> np.ndarray:
        """x less its mean, 0 where a member does not count."""
        if self.good is None:
            return self.x - self.mean[:, :, None]
        return np.where(self.good[:, None], self.x - self.mean[:, :, None], 0.0)


def dealt(x: np.ndarray, good: np.ndarray | None, first: int, block: int, size: int, replicates: int) -> Values:
    """Values with a row for each time and replicate, where member i is of replicate i mod R.

    x (k, d, n), good (k, n): of all members, n a multiple of R.
    """
    k, d, n = x.shape
    R = replicates
    rows = np.moveaxis(x.reshape(k, d, n // R, R), 3, 1).reshape(k * R, d, n // R)
    if good is not None:
        good = np.swapaxes(good.reshape(k, n // R, R), 1, 2).reshape(k * R, n // R)
    # Sums along rows that lie apart would be added in another order, with other bits.
    return Values(np.ascontiguousarray(rows), good, first, block, size // R, R)
