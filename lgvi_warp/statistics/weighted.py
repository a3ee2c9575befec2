# SPDX-License-Identifier: Apache-2.0
"""Statistics of weighted members: sums under the weights w, and sums under their squares for the errors.

A weighted estimate is a ratio of sums, such as m = sum w x / sum w. Its squared error is that of the linearised ratio,
sum w^2 (x - m)^2 / (sum w)^2, which also holds if weights and numbers depend on each other, as in importance sampling.
The effective number n = (sum w)^2 / sum w^2 replaces the number of members in Student's t, in the correction n / (n -
1), and for probabilities of 0 and 1, which show no error. With equal weights all results are the same as without
weights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.statistics.estimates.estimate import Estimate
from lgvi_warp.statistics.estimates.tree import Part, arrays_under

SQUARE = "square/"
MEMBERS = "members_that_count"


def is_weighted(part: Part) -> bool:
    """True if a part is of weighted members."""
    return MEMBERS in part


def both_measures(own: Part, squares: Part, members: np.ndarray) -> Part:
    """Return the part of weighted members: sums under the weights and under their squares, and numbers that count (k,)."""
    return own | {f"{SQUARE}{key}": array for key, array in squares.items()} | {MEMBERS: members}


@dataclass(frozen=True)
class Weighted:
    """Content of a part of weighted members: its sums under the weights and under their squares.

    own, squares: parts with "count", the sum (k,) of weights or squares. members: (k,), number of members that count.
    """

    own: Part
    squares: Part
    members: np.ndarray

    @classmethod
    def of(cls, part: Part) -> Weighted:
        """Split the part of weighted members."""
        own = {key: array for key, array in part.items() if not key.startswith(SQUARE) and key != MEMBERS}
        return cls(own, arrays_under(part, SQUARE), part[MEMBERS])

    @property
    def weight(self) -> np.ndarray:
        """Sum of the weights (k,); 1 if no member counts."""
        total = self.own["count"]
        return np.where(total > 0.0, total, 1.0)

    @property
    def effective(self) -> np.ndarray:
        """Effective number (k,) of members; 0 if none counts. docs/theory/estimators.md, (E15)."""
        square = self.squares["count"]
        return np.where(square > 0.0, self.own["count"] ** 2 / np.where(square > 0.0, square, 1.0), 0.0)

    @property
    def unbiased(self) -> np.ndarray:
        """The factor n / (n - 1) (k,) by which a variance of few members is too small; infinite for one member.

        docs/theory/estimators.md, (E16).
        """
        n = np.where(self.members > 1, self.effective, 1.0)
        # Rounding must not make a single member two.
        more = np.maximum(n - 1.0, 0.0)
        return np.where(more > 1e-9, n / np.where(more > 1e-9, more, 1.0), np.inf)

    def off(self, mean: np.ndarray) -> np.ndarray:
        """Difference of the mean under the squares from a mean, (k, d)."""
        return np.asarray(self.squares["mean"] - mean)

    def number_of(self, probability: np.ndarray, squares: np.ndarray) -> np.ndarray:
        """Number of independent members whose fraction has the variance of a weighted fraction, (k, ...).

        docs/theory/estimators.md, (E17).

        squares: sum (k, ...) of the squared weights of the members that the fraction counts.
        """
        ends = (-1, *[1] * (probability.ndim - 1))
        n, total, all_squares = (a.reshape(ends) for a in (self.effective, self.weight, self.squares["count"]))
        p = np.clip(probability, 0.0, 1.0)
        variance = (squares * (1.0 - 2.0 * p) + p * p * all_squares) / total**2
        seen = (p > 0.0) & (p < 1.0) & (variance > 0.0)
        return np.where(seen, p * (1.0 - p) / np.where(seen, variance, 1.0), n)

    def with_effective(self, estimate: Estimate) -> Estimate:
        """Return the estimate with the effective number as its count, and the number of members as a further array."""
        arrays = estimate.arrays | {"count": self.effective, "members": self.members}
        dims = estimate.dims | {"count": ("time",), "members": ("time",)}
        return replace(estimate, interval=f"{estimate.interval}, of weighted members", arrays=arrays, dims=dims)
