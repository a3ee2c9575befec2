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


def of_logarithm(value: np.ndarray, standard_error: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of what is above 0: value times exp(-+ factor standard errors of its logarithm); 0 to infinity where one is infinite."""
    open_ = (np.isinf(factor) | np.isinf(standard_error)) & ~np.isnan(value)
    some = (value > 0.0) & ~open_
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = np.exp(np.where(some, factor * standard_error / np.where(some, value, 1.0), 0.0))
        return np.where(open_, 0.0, value / ratio), np.where(open_, np.inf, value * ratio)


def wilson(
    probability: np.ndarray, count: np.ndarray, confidence: float, factor: float | np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Of a probability p that n trials estimated: where |p - p0| <= z sqrt(p0 (1 - p0) / n) (Wilson 1927).

    factor: z, by default the normal's. 0 to 1 without trials.
    """
    z2 = np.square(normal(confidence) if factor is None else factor)
    n = np.where(count > 0, count, 1.0)
    centre = (probability + 0.5 * z2 / n) / (1.0 + z2 / n)
    spread = np.maximum(probability * (1.0 - probability), 0.0) / n + 0.25 * z2 / n**2
    half = np.sqrt(z2) * np.sqrt(np.where(count > 0, spread, 0.0)) / (1.0 + z2 / n)
    some = np.asarray(count > 0)
    # At 0 and at 1 the end of the interval is that number; rounding must not put the value outside.
    lower = np.where(some, np.clip(np.fmin(centre - half, probability), 0.0, 1.0), 0.0)
    upper = np.where(some, np.clip(np.fmax(centre + half, probability), 0.0, 1.0), 1.0)
    return lower, upper


def of_replicates(each: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """(standard error, half width) of the mean of R independent estimates (R, ...): Student's t with R - 1.

    L'Ecuyer, Nakayama, Owen & Tuffin (2023): of the intervals for randomized quasi-Monte Carlo that they compare, none
    holds more reliably. Infinite where an estimate is missing.
    """
    R = len(each)
    with np.errstate(invalid="ignore"):
        error = each.std(axis=0, ddof=1) / np.sqrt(R)
    error = np.where(np.isfinite(error), error, np.inf)
    return error, student(np.array(R), confidence) * error


def probability_of_replicates(
    probability: np.ndarray, each: np.ndarray, count: np.ndarray, confidence: float, least: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Wilson's interval with the number of trials that has the variance of R independent estimates (R, ...), and t's factor.

    To the standard error that of `least` members of `count` is added, in squares: what is counted is whole, and replicates
    that all count the same may owe it to chance. Where no member or each was counted the spread says nothing: the
    interval is that of `count` independent members. 0 to 1 where an estimate is missing.
    """
    error, _ = of_replicates(each, confidence)
    error = np.hypot(error, least / np.maximum(count, 1))
    spread = np.isfinite(error) & (probability > 0.0) & (probability < 1.0)
    variance = np.where(spread, error, 1.0) ** 2
    n = np.where(spread, probability * (1.0 - probability) / variance, np.where(np.isfinite(error), count, 0))
    t = float(student(np.array(len(each)), confidence))
    return wilson(probability, n, confidence, np.where(spread, t, normal(confidence)))


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
