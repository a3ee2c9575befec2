# SPDX-License-Identifier: Apache-2.0
"""Estimators of a mean by formula: plain, replicates of a design, regression, and sums of levels; and the best numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Replicates of every design: 15 degrees of freedom, a t factor of 2.13 in place of 1.96.
REPLICATES = 16
# How fast a variance may fall at most with the number of points, as a power of it; independent members have 1.
STEEPEST = 2.0
# A design whose variance is not smaller than that of independent members by this gains no more with more points.
SMOOTH = 3.0
# How much of the logarithm of a smaller gain is believed: its spread is 0.37 by 16 replicates, that of gains themselves 0.7.
BELIEVED = 0.8


@dataclass(frozen=True)
class MeanEstimate:
    """An estimate, the variance of it, and the degrees of freedom that this variance was estimated with."""

    value: float
    variance: float
    freedom: float

    def half_width(self, confidence: float) -> float:
        """Half the width of Student's t interval."""
        from scipy.special import stdtrit

        if self.variance <= 0.0:
            return 0.0
        return float(stdtrit(max(self.freedom, 1.0), 0.5 + 0.5 * confidence)) * math.sqrt(self.variance)

    def times(self, weight: float) -> MeanEstimate:
        """The estimate of so many times what this one is of."""
        return MeanEstimate(weight * self.value, weight**2 * self.variance, self.freedom)


def plain(y: np.ndarray, least: float = 0.0) -> MeanEstimate:
    """The mean of independent members (n,).

    least: smallest change of a member's number other than none, 0 where numbers are continuous. Members that agree by chance
        have no spread: the variance of one that changes by it among all is added.
    """
    n = len(y)
    return MeanEstimate(float(np.mean(y)), float(np.var(y, ddof=1)) / n + (least / n) ** 2, n - 1.0)


def replicated(y: np.ndarray, least: float = 0.0, replicates: int = REPLICATES) -> MeanEstimate:
    """The mean of members (n,) of independent replicates of a design, member i of replicate i mod R: Student's t of R - 1.

    docs/theory/estimators.md, (E13).

    least: as of `plain`.
    """
    means = y.reshape(-1, replicates).mean(axis=0)
    variance = float(np.var(means, ddof=1)) / replicates + (least / len(y)) ** 2
    return MeanEstimate(float(means.mean()), variance, replicates - 1.0)


def regressed(y: np.ndarray, normals: np.ndarray, least: float = 0.0) -> MeanEstimate:
    """The mean of independent members (n,) by least squares on standard normals (n, d), whose means are known to be 0.

    docs/theory/estimators.md, (E19).

    least: as of `plain`.
    """
    n, d = normals.shape
    columns = np.column_stack([np.ones(n), normals])
    factors = np.linalg.lstsq(columns, y, rcond=None)[0]
    freedom = n - d - 1.0
    left = float(np.sum((y - columns @ factors) ** 2)) / freedom
    # The spread of the mean of the normals about 0 adds d / n of it, to first order.
    return MeanEstimate(float(factors[0]), left / n * (1.0 + d / n) + (least / n) ** 2, freedom)


def together(parts: Sequence[MeanEstimate]) -> MeanEstimate:
    """The sum of independent estimates; degrees of freedom by Welch (1947) and Satterthwaite (1946).

    docs/theory/estimators.md, (E23).
    """
    variance = sum(part.variance for part in parts)
    below = sum(part.variance**2 / part.freedom for part in parts)
    freedom = variance**2 / below if below > 0.0 else math.inf
    return MeanEstimate(sum(part.value for part in parts), variance, freedom)


def slope(fine: np.ndarray, coarse: np.ndarray) -> tuple[float, float]:
    """The factor of the coarse numbers that leaves the least of the fine ones' variance, and what part of it is left.

    docs/theory/estimators.md, (E21).

    The part left is 1 - rho^2; 1 where either does not vary, or overflows.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of steps that are too long may be huge
        a, b = fine - fine.mean(), coarse - coarse.mean()
        spread, other, shared = float(a @ a), float(b @ b), float(a @ b)
    if not (spread > 0.0 and 0.0 < other < math.inf):
        return 0.0, 1.0
    factor = shared / other
    return factor, float(np.clip(1.0 - factor**2 * other / spread, 0.0, 1.0))


@dataclass(frozen=True)
class VarianceModel:
    """How the variance of an estimate falls with the members: `of_one` n^-power; cost: of a member [s]."""

    of_one: float
    cost: float
    power: float = 1.0

    def at(self, members: float) -> float:
        """The variance with so many members."""
        return self.of_one * members**-self.power


def spread_of_plain(y: np.ndarray, cost: float, least: float = 0.0) -> VarianceModel:
    """How the variance of the mean of independent members falls, from some of them (n,)."""
    return VarianceModel(plain(y, least).variance * len(y), cost)


def spread_of_replicates(y: np.ndarray, cost: float, least: float = 0.0, replicates: int = REPLICATES) -> VarianceModel:
    """How the variance of a replicated design's mean falls, from some of its members (n,), in the order of the design.

    Variances of 16 replicates are known to a third. Where they gain less than three times over independent members, as where
    noise acts, most of the gain's logarithm is believed. Elsewhere a quarter of the points shows how fast the variance
    falls, and half of what exceeds the power 1 is taken.
    """
    n = len(y)
    variance, alone, power = replicated(y, least, replicates).variance, plain(y, least).variance, 1.0
    if alone <= SMOOTH * variance:
        variance = alone ** (1.0 - BELIEVED) * variance**BELIEVED
    elif n >= 8 * replicates:
        fewer = replicated(y[: n // 4], least, replicates).variance
        seen = math.log(fewer / variance) / math.log(4.0) if variance > 0.0 and fewer > 0.0 else 1.0
        power = float(np.clip(0.5 + 0.5 * seen, 1.0, STEEPEST))
    return VarianceModel(variance * n**power, cost, power)


def best_numbers(spreads: Sequence[VarianceModel], variance: float) -> np.ndarray:
    """Numbers of members (levels,) that reach a variance of the sum for the least cost.

    docs/theory/estimators.md, (E22).

    The least of sum C n subject to sum V n^-a = v is where n = (m a V / C)^(1 / (1 + a)), with one m for all; where all a are
    1, n = sqrt(V / C) sum sqrt(V C) / v.
    """
    ones = np.array([max(spread.of_one, 1e-300) for spread in spreads])
    powers, costs = (np.array([getattr(spread, name) for spread in spreads]) for name in ("power", "cost"))

    variance = max(variance, 1e-150 * float(ones.sum()), 1e-300)  # which no number of members reaches
    if bool(np.all(powers == 1.0)):
        return np.asarray(np.sqrt(ones / costs) * np.sum(np.sqrt(ones * costs)) / variance)

    def numbers(log: float) -> np.ndarray:
        return np.asarray(np.exp((log + np.log(powers * ones / costs)) / (1.0 + powers)))

    def over(log: float) -> float:
        return math.log(float(np.sum(ones * numbers(log) ** -powers)) / variance)

    from scipy.optimize import brentq

    return numbers(brentq(over, -800.0, 800.0, xtol=1e-12))


def tail_index(y: np.ndarray) -> float:
    """The exponent by which the largest distances from the median fall off (Hill 1975); below 2 the variance is infinite.

    Of the largest 32nd of the members, at least 16; infinite where these are all alike, or where members are too few.
    """
    far = np.sort(np.abs(y - np.median(y)))[::-1]
    k = max(16, len(y) // 32)
    if len(y) < 4 * k or not far[k] > 0.0:
        return math.inf
    mean = float(np.mean(np.log(far[:k] / far[k])))
    return 1.0 / mean if mean > 0.0 else math.inf
