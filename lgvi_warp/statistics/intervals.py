"""Intervals that hold the true value with a stated confidence, for independent members."""

from __future__ import annotations

import numpy as np
from scipy.special import bdtr, bdtrik, ndtri, stdtrit


def normal(confidence: float) -> float:
    """Half the width of a normal's central interval, in standard deviations."""
    return float(ndtri(0.5 + 0.5 * confidence))


def student(count: np.ndarray, confidence: float) -> np.ndarray:
    """The same of Student's t with count - 1 degrees of freedom; infinite below two."""
    wide = np.where(count > 1, stdtrit(np.maximum(count - 1, 1), 0.5 + 0.5 * confidence), np.inf)
    return np.asarray(wide)


def about(value: np.ndarray, standard_error: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """value -+ factor standard errors; the whole line where the factor is infinite."""
    half = np.where(np.isinf(factor), np.inf, np.where(np.isinf(factor), 0.0, factor) * standard_error)
    return value - half, value + half


def wilson(probability: np.ndarray, count: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Of a probability p that n trials estimated: where |p - p0| <= z sqrt(p0 (1 - p0) / n) (Wilson 1927).

    0 to 1 without trials.
    """
    z2 = normal(confidence) ** 2
    n = np.where(count > 0, count, 1.0)
    centre = (probability + 0.5 * z2 / n) / (1.0 + z2 / n)
    spread = np.maximum(probability * (1.0 - probability), 0.0) / n + 0.25 * z2 / n**2
    half = np.sqrt(z2) * np.sqrt(np.where(count > 0, spread, 0.0)) / (1.0 + z2 / n)
    some = np.asarray(count > 0)
    # At 0 and at 1 the end of the interval is that number; rounding must not put the value outside.
    lower = np.where(some, np.clip(np.fmin(centre - half, probability), 0.0, 1.0), 0.0)
    upper = np.where(some, np.clip(np.fmax(centre + half, probability), 0.0, 1.0), 1.0)
    return lower, upper


def binomial_quantile(p: float | np.ndarray, n: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The least k with P(B <= k) >= p for a binomial B of n trials with probability q."""
    n = np.asarray(n, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        k = np.ceil(bdtrik(p, n, q))
        k = np.clip(np.nan_to_num(k), 0.0, n)
        below = np.maximum(k - 1.0, 0.0)
        return np.asarray(np.where(bdtr(below, n.astype(np.int64), q) >= p, below, k))


def ranks(count: np.ndarray, level: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Ranks l < u, counted from 1, of the sorted values that hold the quantile between them: P(l <= B < u) >= confidence.

    B: how many of `count` values lie below the quantile, binomial. l = 0 or u = count + 1 where there is no such value.
    """
    tail = 0.5 * (1.0 - confidence)
    return binomial_quantile(tail, count, level), binomial_quantile(1.0 - tail, count, level) + 1.0
