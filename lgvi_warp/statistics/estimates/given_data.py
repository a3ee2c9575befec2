# SPDX-License-Identifier: Apache-2.0
"""Inputs that explain an output, from given members: first-order indices by bins, and standardised regression."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

# Bins of an input: two for each member's share n^(1/3), between these numbers.
FEWEST_BINS, MOST_BINS = 4, 64
# From so many members a bin on, each bin has a line.
FOR_LINES = 10
# A noncentrality whose spread, 2 over its root, is none beside that of the remainders; SciPy's distribution ends at 1e10.
LARGE = 1e8
# A part of a variance that is round-off.
NOTHING = 1e-20


class Explained(NamedTuple):
    """Share of an output's variance that one input explains (first-order index); the estimate may be slightly below 0."""

    share: float
    lower: float
    upper: float
    p: float
    slope: float


def explained(inputs: Mapping[str, np.ndarray], y: np.ndarray, confidence: float) -> dict[str, Explained]:
    """Return the share of an output (n,) that each input (n,) explains; members with infinite numbers or NaN are left out.

    The members are divided into bins of each input with about equal numbers of members; with many members, each bin
    also fits a line. The share is the explained variance divided by the total, minus the share expected by chance
    (Kelley's epsilon squared, 1935). Its interval follows from the noncentral F distribution. The delta method widens
    it, since inputs are random; its upper end also grows by the loss from bins of twice the width. Inputs should be
    independent of each other.
    """
    names, y = list(inputs), np.asarray(y, np.float64)
    X = np.stack([np.asarray(inputs[name], np.float64) for name in names]) if names else np.zeros((0, len(y)))
    good = np.isfinite(y) & np.isfinite(X).all(axis=0)
    X, y = X[:, good], y[good]
    slopes = _slopes(X, y)
    return {name: Explained(*_index(x, y, confidence), slope) for name, x, slope in zip(names, X, slopes, strict=True)}


def _slopes(X: np.ndarray, y: np.ndarray) -> list[float]:
    """Coefficients of the linear regression of standardised numbers; NaN for an input that does not vary."""
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
    with_lines = n >= FOR_LINES * count
    left, numbers = _left(x, y, bins, with_lines)
    square = (y - y.mean()) ** 2
    total, within = float(square.sum()), float(np.sum(left**2)) / (n - numbers)
    if within * n <= NOTHING * total:
        return 1.0, 1.0, 1.0, 0.0
    between = max(total - within * (n - numbers), 0.0)
    ratio, free = between / (numbers - 1) / within, (numbers - 1, n - numbers)
    tail, share = 0.5 * (1.0 - confidence), 1.0 - within * (n - 1) / total
    lower, upper = (shift / (shift + n) for shift in (_shift(1.0 - tail, ratio, free), _shift(tail, ratio, free)))
    # What each member adds to the share, to first order: its numbers are drawn too, and need not be normal. The F
    # distribution is of given numbers and normal remainders, with the variance in the root.
    part = 1.0 - float(np.sum(left**2)) / total
    adds = ((1.0 - part) * square - left**2) / (total / n)
    normal = np.sqrt(2.0 * part * (1.0 - part) ** 2 * (2.0 - part))
    wider = max(float(np.std(adds)) / normal, 1.0) if normal > 0.0 else 1.0
    # Bins leave no more of a dependence within them than twice as wide ones leave besides, beyond what chance does.
    wide, fewer = _left(x, y, bins // 2, with_lines)
    less = share - (1.0 - float(np.sum(wide**2)) / (n - fewer) * (n - 1) / total)
    steep = max(less - 2.0 * (1.0 - share) * np.sqrt(2.0 * (numbers - fewer)) / n, 0.0)
    lower = min(lower, share - wider * (share - lower))
    upper = max(upper, share + wider * (upper - share)) + steep
    return share, max(lower, 0.0), min(upper, 1.0), float(fdtrc(*free, ratio))


def _left(x: np.ndarray, y: np.ndarray, bins: np.ndarray, with_lines: bool) -> tuple[np.ndarray, int]:
    """Residual of each number (n,) after the bins, and the number of fitted parameters.

    A bin fits the mean of its members, or a line, which leaves little of a steep dependence.
    """
    sizes = np.bincount(bins)
    count = len(sizes)

    def centred(z: np.ndarray) -> np.ndarray:
        return np.asarray(z - (np.bincount(bins, z, count) / sizes)[bins])

    left = centred(y)
    if not with_lines:
        return left, count
    along = centred((x - x.mean()) / x.std())
    spread = np.bincount(bins, along**2, count)
    lines = spread > NOTHING * len(x)
    slopes = np.bincount(bins, along * left, count) / np.where(lines, spread, np.inf)
    return left - slopes[bins] * along, count + int(lines.sum())


def _bins(x: np.ndarray) -> np.ndarray:
    """The bin (n,) of each number, by its rank; equal numbers share a bin, and no bin is empty."""
    count = int(np.clip(2.0 * len(x) ** (1.0 / 3.0), FEWEST_BINS, MOST_BINS))
    edges = np.unique(np.quantile(x, np.arange(1, count) / count)) if len(x) else x
    return np.unique(np.searchsorted(edges, x, side="right"), return_inverse=True)[1]


def _shift(level: float, ratio: float, free: tuple[int, int]) -> float:
    """The noncentrality for which an F ratio is at this level of its distribution; 0 if there is none."""
    from scipy.optimize import brentq
    from scipy.special import chdtri
    from scipy.stats import ncf

    if ratio * free[0] > LARGE:
        # What is explained is then known beside what is not: a ratio of it and a chi-square number.
        return max(ratio * free[0] * float(chdtri(free[1], level)) / free[1] - free[0], 0.0)

    def above(shift: float) -> float:
        return float(ncf.cdf(ratio, *free, shift)) - level

    if above(0.0) <= 0.0:
        return 0.0
    high = max(1.0, ratio * free[0])
    while above(high) > 0.0:
        high *= 2.0
    return float(brentq(above, 0.0, high, xtol=1e-6 * high))
