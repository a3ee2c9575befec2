# SPDX-License-Identifier: Apache-2.0
"""Target of an estimate over the members' numbers: a mean, a probability, a quantile or a cvar.

Levels give signed samples: E g(Y) is the sum of weights times means of g over arrays of members. Quantiles and cvars
are solved for from such sums. Their errors are the errors of the mean of the members' contributions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

# A weight, and the numbers (n,) of members whose mean has it.
Weighted = tuple[float, np.ndarray]
# A density is of the nearer tail's part, at most 0.15, over this: of few members, and of many; their fifth root between.
LEAST_PARTS, MOST_PARTS, FEW = 1.5, 3.0, 200
# Halvings of the interval in which a quantile is.
HALVINGS = 60


@dataclass(frozen=True)
class Solved:
    """A target's value, its threshold, and the density there; for means and probabilities only the value."""

    value: float
    threshold: float = 0.0
    density: float = 1.0


@dataclass(frozen=True)
class Sought:
    """A mean ("mean"), a probability ("probability"), a "quantile", or the mean of the worst members, a "cvar".

    level: level of the quantile, or fraction of the cvar.
    above, below: a probability's limits; without limits the numbers are 1 or 0 themselves.
    """

    kind: str = "mean"
    level: float = 0.5
    above: float | None = None
    below: float | None = None

    def solved(self, samples: Sequence[Weighted]) -> Solved:
        """The value from weighted samples, whose weights sum to 1. docs/theory/estimators.md, (E11)."""
        if self.kind in ("mean", "probability"):
            return Solved(mean_of(samples, self.counted))
        level = self.level if self.kind == "quantile" else 1.0 - self.level
        threshold = quantile_of(samples, level)
        if self.kind == "quantile":
            return Solved(threshold, threshold, density_of(samples, level))
        beyond = mean_of(samples, lambda y: np.maximum(y - threshold, 0.0))
        return Solved(threshold + beyond / self.level, threshold)

    def contributions(self, y: np.ndarray, at: Solved) -> np.ndarray:
        """Contribution of each member (n,); to first order, the mean of the contributions is the value.

        docs/theory/estimators.md, (E12).
        """
        if self.kind == "quantile":
            return at.threshold + (self.level - (y <= at.threshold)) / at.density
        if self.kind == "cvar":
            return np.asarray(at.threshold + np.maximum(y - at.threshold, 0.0) / self.level)
        return self.counted(y)

    def counted(self, y: np.ndarray) -> np.ndarray:
        """The numbers themselves; for a condition, 1 if it holds and 0 if not."""
        if self.above is None and self.below is None:
            return y
        holds = np.ones(y.shape, bool) if self.above is None else y > self.above
        holds = holds if self.below is None else holds & (y < self.below)
        return np.where(np.isnan(y), np.nan, holds)

    @property
    def unbounded(self) -> bool:
        """True if one member can change the value by any amount, as for a mean."""
        return self.kind in ("mean", "cvar")

    @property
    def tail(self) -> float:
        """Fraction of members that decides the value: of a quantile its nearer tail, of a cvar level / 4, else 1."""
        # Numbers in a tail are skewed: of a mean of the worst members four times as many are needed.
        return {"quantile": min(self.level, 1.0 - self.level), "cvar": 0.25 * self.level}.get(self.kind, 1.0)

    @property
    def smooth(self) -> bool:
        """True if contributions jump at a threshold, and may be smoothed to show small changes of the number."""
        return self.kind == "quantile" or self.above is not None or self.below is not None

    def smoothed(self, y: np.ndarray, at: Solved, width: float) -> np.ndarray:
        """Contributions with jumps smoothed over a width, so that differences show the effect of small changes.

        The change of a probability is the density at the threshold times the change of the number. Smoothing averages
        the density over a width; without it, perhaps none of a few members would jump.
        """
        from scipy.special import ndtr

        def beyond(limit: float) -> np.ndarray:
            return np.asarray(ndtr((y - limit) / width))

        if self.kind == "quantile":
            return np.asarray(at.threshold + (self.level - 1.0 + beyond(at.threshold)) / at.density)
        whole = np.ones(len(y)) if self.above is None else beyond(self.above)
        return whole if self.below is None else whole - beyond(self.below)

    def least(self, at: Solved) -> float:
        """The smallest change of a contribution; 0 if contributions are continuous."""
        return 1.0 if self.kind == "probability" else 1.0 / at.density if self.kind == "quantile" else 0.0


def mean_of(samples: Sequence[Weighted], of: Callable[[np.ndarray], np.ndarray]) -> float:
    """The mean of a function of the members' numbers."""
    return float(sum(weight * np.mean(of(y)) for weight, y in samples))


def quantile_of(samples: Sequence[Weighted], level: float) -> float:
    """Quantile of the weighted distribution; with signed weights it may decrease slightly between levels."""
    values = np.concatenate([y for _, y in samples])
    low, high = float(values.min()), float(values.max())
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = mean_of(samples, lambda y, at=middle: y <= at)  # type: ignore[misc]
        low, high = (low, middle) if below >= level else (middle, high)
    return high


def density_of(samples: Sequence[Weighted], level: float) -> float:
    """The density at the quantile of a level, from quantiles on both sides at a fraction of the nearer tail.

    docs/theory/estimators.md, (E12).
    """
    members = sum(len(y) for _, y in samples)
    parts = min(max(LEAST_PARTS * (members / FEW) ** 0.2, LEAST_PARTS), MOST_PARTS)
    apart = min(level, 1.0 - level, 0.15) / parts
    low, high = quantile_of(samples, level - apart), quantile_of(samples, level + apart)
    rise = mean_of(samples, lambda y: y <= high) - mean_of(samples, lambda y: y <= low)
    return rise / (high - low) if high > low and rise > 0.0 else float(np.inf)
