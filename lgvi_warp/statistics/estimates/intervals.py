# SPDX-License-Identifier: Apache-2.0
"""Confidence intervals for independent members, and for independent replicates."""

from __future__ import annotations

import numpy as np

# scipy.special loads where it is used: it takes a third of the time of `import lgvi_warp`.


def normal(confidence: float) -> float:
    """Return the half width of a normal variable's central interval, in standard deviations."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + 0.5 * confidence))


def student(count: np.ndarray, confidence: float) -> np.ndarray:
    """Return the half width of a mean's interval in standard errors: Student's t with count - 1 degrees of freedom.

    docs/theory/estimators.md, (E1).
    """
    from scipy.special import stdtrit

    wide = np.where(count > 1, stdtrit(np.maximum(count - 1, 1), 0.5 + 0.5 * confidence), np.inf)
    return np.asarray(wide)


def about(value: np.ndarray, standard_error: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval value -+ factor standard errors. docs/theory/estimators.md, (E1)."""
    half = np.where(np.isinf(factor), np.inf, np.where(np.isinf(factor), 0.0, factor) * standard_error)
    return value - half, value + half


def of_logarithm(value: np.ndarray, standard_error: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval of a positive number from its logarithm's interval: value exp(-+ factor standard_error / value).

    docs/theory/estimators.md, (E4).
    """
    open_ = (np.isinf(factor) | np.isinf(standard_error)) & ~np.isnan(value)
    some = (value > 0.0) & ~open_
    with np.errstate(over="ignore", invalid="ignore"):
        ratio = np.exp(np.where(some, factor * standard_error / np.where(some, value, 1.0), 0.0))
        return np.where(open_, 0.0, value / ratio), np.where(open_, np.inf, value * ratio)


def wilson(
    probability: np.ndarray, count: np.ndarray, confidence: float, factor: float | np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return Wilson's interval (1927) of a probability p0 that n trials estimate as p: |p - p0| <= z sqrt(p0 (1 - p0) / n).

    docs/theory/estimators.md, (E5).
    """
    z2 = np.square(normal(confidence) if factor is None else factor)
    n = np.where(count > 0, count, 1.0)
    centre = (probability + 0.5 * z2 / n) / (1.0 + z2 / n)
    spread = np.maximum(probability * (1.0 - probability), 0.0) / n + 0.25 * z2 / n**2
    half = np.sqrt(z2) * np.sqrt(np.where(count > 0, spread, 0.0)) / (1.0 + z2 / n)
    some = np.asarray(count > 0)
    # At 0 and at 1 the interval ends at the value itself: rounding must not put the value outside.
    lower = np.where(some, np.clip(np.fmin(centre - half, probability), 0.0, 1.0), 0.0)
    upper = np.where(some, np.clip(np.fmax(centre + half, probability), 0.0, 1.0), 1.0)
    return lower, upper


def clopper_pearson(hits: np.ndarray, count: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Return Clopper & Pearson's interval (1934), with tails below (1 - confidence) / 2: it is never too narrow.

    docs/theory/estimators.md, (E6).
    """
    from scipy.special import betaincinv

    k, n = np.broadcast_arrays(np.asarray(hits, np.float64), np.asarray(count, np.float64))
    tail = 0.5 * (1.0 - confidence)
    lower = np.where(k > 0.0, betaincinv(np.maximum(k, 1.0), np.maximum(n - k, 0.0) + 1.0, tail), 0.0)
    upper = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 1.0), 1.0 - tail), 1.0)
    return np.where(n > 0.0, lower, 0.0), np.where(n > 0.0, upper, 1.0)


def none_of(count: int, confidence: float) -> float:
    """Return the one-sided upper limit of a probability without any hit in n trials: 1 - (1 - confidence)^(1 / n).

    docs/theory/estimators.md, (E7).
    """
    return float(-np.expm1(np.log1p(-confidence) / count)) if count else 1.0


def of_replicates(each: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Return standard error and half width (...) of the mean of R independent estimates (R, ...), by Student's t with R - 1.

    docs/theory/estimators.md, (E13).

    Both are infinite if an estimate is missing. Among the intervals for randomized quasi-Monte Carlo that L'Ecuyer,
    Nakayama, Owen & Tuffin (2023) compare, no other interval is more reliable.
    """
    R = len(each)
    with np.errstate(invalid="ignore"):
        error = each.std(axis=0, ddof=1) / np.sqrt(R)
    error = np.where(np.isfinite(error), error, np.inf)
    return error, student(np.array(R), confidence) * error


def probability_of_replicates(
    probability: np.ndarray, each: np.ndarray, count: np.ndarray, confidence: float, least: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return Wilson's interval with the variance of the R replicates' fractions (R, ...) and Student's t factor.

    docs/theory/estimators.md, (E14).

    The standard error of `least` members among `count` is added in squares, since replicates may agree by chance:
    counts are whole numbers. If none or all members were counted, there is no spread: then the interval is that of
    `count` independent members.
    """
    error, _ = of_replicates(each, confidence)
    error = np.hypot(error, least / np.maximum(count, 1))
    spread = np.isfinite(error) & (probability > 0.0) & (probability < 1.0)
    variance = np.where(spread, error, 1.0) ** 2
    n = np.where(spread, probability * (1.0 - probability) / variance, np.where(np.isfinite(error), count, 0))
    t = float(student(np.array(len(each)), confidence))
    return wilson(probability, n, confidence, np.where(spread, t, normal(confidence)))


def binomial_quantile(p: float | np.ndarray, n: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return a quantile of the binomial distribution as float64: the smallest k with P(B <= k) >= p.

    docs/theory/estimators.md, (E8).
    """
    from scipy.special import bdtr, bdtrik

    n = np.asarray(n, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        k = np.ceil(bdtrik(p, n, q))
        k = np.clip(np.nan_to_num(k), 0.0, n)
        below = np.maximum(k - 1.0, 0.0)
        return np.asarray(np.where(bdtr(below, n.astype(np.int64), q) >= p, below, k))


def ranks(count: np.ndarray, level: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """Return ranks l < u with P(l <= B < u) >= confidence; B is the binomial number of values below the quantile.

    docs/theory/estimators.md, (E8).
    """
    tail = 0.5 * (1.0 - confidence)
    return binomial_quantile(tail, count, level), binomial_quantile(1.0 - tail, count, level) + 1.0
