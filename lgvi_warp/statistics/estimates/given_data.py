# SPDX-License-Identifier: Apache-2.0
"""Which inputs explain an output, from members at hand: first-order indices by bins, and standardised regression."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

# Bins of an input: two for each member's share n^(1/3), between these numbers.
FEWEST_BINS, MOST_BINS = 4, 64


class Explained(NamedTuple):
    """What of an output one input explains: the share of its variance (first-order index), which may come out just below 0."""

    share: float
    lower: float
    upper: float
    p: float
    slope: float


def explained(inputs: Mapping[str, np.ndarray], y: np.ndarray, confidence: float) -> dict[str, Explained]:
    """Return what each input (n,) explains of an output (n,); members with a number that is not finite are left out.

    The members are divided into bins of each input, of about as many members. The share is the variance between bins over
    that of all, less what chance alone puts between them (Kelley's epsilon squared, 1935); its interval is of the
    noncentral F distribution. Inputs are meant to be independent of one another.
    """
    names, y = list(inputs), np.asarray(y, np.float64)
    X = np.stack([np.asarray(inputs[name], np.float64) for name in names]) if names else np.zeros((0, len(y)))
    good = np.isfinite(y) & np.isfinite(X).all(axis=0)
    X, y = X[:, good], y[good]
    slopes = _slopes(X, y)
    return {name: Explained(*_index(x, y, confidence), slope) for name, x, slope in zip(names, X, slopes, strict=True)}


def _slopes(X: np.ndarray, y: np.ndarray) -> list[float]:
    """Coefficients of the linear regression of standardised numbers; NaN for what does not vary."""
    slopes = np.full(len(X), np.nan)
    if len(y) > 2 and np.ptp(y) > 0.0:
        moves = np.ptp(X, axis=1) > 0.0
        Z = X[moves] - X[moves].mean(axis=1, keepdims=True)
        Z /= Z.std(axis=1, keepdims=True)
        slopes[moves] = np.linalg.lstsq(Z.T, (y - y.mean()) / y.std(), rcond=None)[0]
    return [float(slope) for slope in slopes]


def _index(x: np.ndarray, y: np.ndarray, confidence: float) -> tuple[float, float, float, float]:
    """Index, the ends of its interval, and p."""
    from scipy.special import fdtrc

    n = len(y)
    bins = _bins(x)
    count = bins.max() + 1 if n else 0
    if count < 2 or n <= count or np.ptp(y) == 0.0:
        return np.nan, 0.0, 1.0, np.nan
    sizes = np.bincount(bins, minlength=count)
    means = np.bincount(bins, y, count) / sizes
    between = float(np.sum(sizes * (means - y.mean()) ** 2))
    total = float(np.sum((y - y.mean()) ** 2))
    within = max(total - between, 0.0) / (n - count)
    if within == 0.0:
        return 1.0, 1.0, 1.0, 0.0
    ratio, free = between / (count - 1) / within, (count - 1, n - count)
    tail = 0.5 * (1.0 - confidence)
    ends = [shift / (shift + n) for shift in (_shift(1.0 - tail, ratio, free), _shift(tail, ratio, free))]
    return 1.0 - within * (n - 1) / total, ends[0], ends[1], float(fdtrc(*free, ratio))


def _bins(x: np.ndarray) -> np.ndarray:
    """The bin (n,) of each number, by its rank; equal numbers are in one bin, and no bin is empty."""
    count = int(np.clip(2.0 * len(x) ** (1.0 / 3.0), FEWEST_BINS, MOST_BINS))
    edges = np.unique(np.quantile(x, np.arange(1, count) / count)) if len(x) else x
    return np.unique(np.searchsorted(edges, x, side="right"), return_inverse=True)[1]


def _shift(level: float, ratio: float, free: tuple[int, int]) -> float:
    """The noncentrality for which an F ratio is at this level of its distribution; 0 where there is none."""
    from scipy.optimize import brentq
    from scipy.stats import ncf

    def above(shift: float) -> float:
        return float(ncf.cdf(ratio, *free, shift)) - level

    if above(0.0) <= 0.0:
        return 0.0
    high = max(1.0, ratio * free[0])
    while above(high) > 0.0:
        high *= 2.0
    return float(brentq(above, 0.0, high, xtol=1e-6 * high))
