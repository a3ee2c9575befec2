# SPDX-License-Identifier: Apache-2.0
"""Comparison of two cases on the same members: intervals of differences, tests, and correction for multiple tests."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lgvi_warp.statistics.estimates import intervals

# Halvings of a bracket of length 2: to the last bit of a difference of proportions.
HALVINGS = 60
# Size of the kernel of resamples at the median, in standard deviations times n^(-1/5).
KERNEL = 0.35
# Random indices drawn at once for resamples.
DRAWN_AT_ONCE = 2_000_000


class Difference(NamedTuple):
    """A difference between two cases, second minus first."""

    value: float
    lower: float
    upper: float
    p: float
    pairs: int


def proportions(only_first: int, only_second: int, pairs: int, confidence: float) -> Difference:
    """Return the difference of two proportions of the same members, from the members whose results differ.

    It has Tango's score interval (1998, Statistics in Medicine 17) and McNemar's exact test.
    """
    from scipy.special import bdtr

    if not pairs:
        return Difference(np.nan, -1.0, 1.0, np.nan, 0)
    value, z = (only_second - only_first) / pairs, intervals.normal(confidence)

    def end(outside: float) -> float:
        if abs(_score(outside, only_second, only_first, pairs)) <= z:
            return outside
        inside = value
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            if abs(_score(middle, only_second, only_first, pairs)) <= z:
                inside = middle
            else:
                outside = middle
        return inside

    differ = only_first + only_second
    p = min(1.0, 2.0 * float(bdtr(float(min(only_first, only_second)), differ, 0.5))) if differ else 1.0
    return Difference(value, min(value, end(-1.0)), max(value, end(1.0)), p, pairs)


def _score(delta: float, more: int, less: int, n: int) -> float:
    """Tango's score statistic for a difference delta, by the constrained estimate of the smaller discordant probability."""
    a, b, c = 2.0 * n, -more - less + (2.0 * n - more + less) * delta, -less * delta * (1.0 - delta)
    q = (np.sqrt(max(b * b - 4.0 * a * c, 0.0)) - b) / (2.0 * a)
    variance = n * (2.0 * q + delta * (1.0 - delta))
    away = more - less - n * delta
    if variance <= 0.0:
        return 0.0 if away == 0.0 else float(np.copysign(np.inf, away))
    return float(away / np.sqrt(variance))


def means(first: np.ndarray, second: np.ndarray, confidence: float) -> Difference:
    """Return the difference of two means over the finite pairs (n,), by Student's t for the differences."""
    from scipy.special import stdtr

    both = np.isfinite(first) & np.isfinite(second)
    d = second[both] - first[both]
    n = len(d)
    if n < 2:
        return Difference(float(d.mean()) if n else np.nan, -np.inf, np.inf, np.nan, n)
    value, error = float(d.mean()), float(d.std(ddof=1) / np.sqrt(n))
    half = float(intervals.student(np.array(n), confidence)) * error
    if error == 0.0:
        return Difference(value, value, value, 1.0 if value == 0.0 else 0.0, n)
    return Difference(value, value - half, value + half, 2.0 * float(stdtr(n - 1, -abs(value) / error)), n)


def quantiles(
    first: np.ndarray, second: np.ndarray, level: float, confidence: float, resamples: int = 999, seed: int = 0
) -> Difference:
    """Return the difference of two quantiles over the finite pairs (n,), by percentiles of a smoothed bootstrap.

    A resample draws members with both numbers, and adds normal noise. Its covariance is the numbers' covariance times
    the square of KERNEL n^(-1/5) (4 level (1 - level))^(-1/4), larger if values are scarce. Without this noise a
    resample's quantiles take only few values, and the interval is too wide by up to a half (Hall, DiCiccio & Romano
    1989, Annals of Statistics 17).
    """
    both = np.isfinite(first) & np.isfinite(second)
    x = np.stack([first[both], second[both]])
    n = x.shape[1]
    if n < 2:
        return Difference(np.nan, -np.inf, np.inf, np.nan, n)
    rng = np.random.default_rng([seed, n, resamples])
    # A root of the covariance, of any rank: both numbers of a member are moved together.
    size, axes = np.linalg.eigh(np.cov(x))
    width = KERNEL * n**-0.2 * (4.0 * level * (1.0 - level)) ** -0.25
    root = width * axes * np.sqrt(np.maximum(size, 0.0))
    differences: list[np.ndarray] = []
    at_once = max(1, DRAWN_AT_ONCE // n)
    for begin in range(0, resamples, at_once):
        chosen = rng.integers(0, n, (min(at_once, resamples - begin), n))
        moved = x[:, chosen] + np.einsum("ij,jrn->irn", root, rng.standard_normal((2, *chosen.shape)))
        ends = np.quantile(moved, level, axis=2)
        differences.append(ends[1] - ends[0])
    value = float(np.subtract(*np.quantile(x, level, axis=1)[::-1]))
    tail, drawn = 0.5 * (1.0 - confidence), np.concatenate(differences)
    # What the kernel adds to the difference itself is taken off.
    lower, upper = np.quantile(drawn - drawn.mean() + value, [tail, 1.0 - tail])
    return Difference(value, float(lower), float(upper), np.nan, n)


def holm(p: np.ndarray) -> np.ndarray:
    """Return p-values (m,) corrected for their number (Holm 1979), at most 1; NaN means no test and does not count."""
    corrected = np.full(len(p), np.nan)
    order = np.argsort(p)[: np.count_nonzero(~np.isnan(p))]
    factors = np.arange(len(order), 0, -1)
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * factors))
    return corrected
