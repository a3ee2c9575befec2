# SPDX-License-Identifier: Apache-2.0
"""Estimators of a mean: plain, replicates of a design, regression, sums of levels; and optimal numbers of members."""

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
# Of n members without an odd one up to 3 / n may be odd, with 95 %: 1.5 / n is a standard error of that share.
UNSEEN = 1.5
# The part of a variance that unseen members may take, and halvings of the factor of all numbers.
UNSEEN_SHARE, HALVINGS = 0.25, 30
# How much of the logarithm of a smaller gain is believed: its spread is 0.37 by 16 replicates, that of gains themselves 0.7.
BELIEVED = 0.8


@dataclass(frozen=True)
class MeanEstimate:
    """An estimate, its variance, and the degrees of freedom of this variance."""

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
        """The estimate times a weight."""
        return MeanEstimate(weight * self.value, weight**2 * self.variance, self.freedom)


def plain(y: np.ndarray, least: float = 0.0) -> MeanEstimate:
    """The mean of independent members (n,).

    least: change of a member's number that the sample may have missed; its possible variance is included.
    """
    n = len(y)
    return MeanEstimate(float(np.mean(y)), float(np.var(y, ddof=1)) / n + (UNSEEN * least / n) ** 2, n - 1.0)


def replicated(y: np.ndarray, least: float = 0.0, replicates: int = REPLICATES) -> MeanEstimate:
    """The mean of members (n,) of R independent replicates of a design; member i is in replicate i mod R.

    docs/theory/estimators.md, (E13).

    least: as in `plain`.
    """
    means = y.reshape(-1, replicates).mean(axis=0)
    variance = float(np.var(means, ddof=1)) / replicates + (UNSEEN * least / len(y)) ** 2
    return MeanEstimate(float(means.mean()), variance, replicates - 1.0)


def regressed(y: np.ndarray, normals: np.ndarray, least: float = 0.0) -> MeanEstimate:
    """The mean of independent members (n,) by least squares on standard normals (n, d), whose means are known to be 0.

    docs/theory/estimators.md, (E19).

    least: as in `plain`.
    """
    n, d = normals.shape
    factors, left = fitted(y, normals)
    freedom = n - d - 1.0
    # The spread of the mean of the normals about 0 adds d / (n - d - 2) of it.
    variance = float(np.sum(left**2)) / freedom / n * (1.0 + d / max(n - d - 2.0, 1.0))
    return MeanEstimate(float(factors[0]), variance + (UNSEEN * least / n) ** 2, freedom)


def fitted(y: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Constant and slopes (d + 1,) of a regression of numbers (n,) on normals (n, d), and the residuals (n,).

    Normal equations are well conditioned here; for tall matrices BLAS would start all threads of the machine.
    """
    columns = np.column_stack([np.ones(len(y)), normals])
    gram = np.einsum("ni,nj->ij", columns, columns)
    factors = np.linalg.solve(gram, np.einsum("ni,n->i", columns, y))
    return factors, y - np.einsum("ni,i->n", columns, factors)


def together(parts: Sequence[MeanEstimate]) -> MeanEstimate:
    """The sum of independent estimates; degrees of freedom by Welch (1947) and Satterthwaite (1946).

    docs/theory/estimators.md, (E23).
    """
    variance = sum(part.variance for part in parts)
    below = sum(part.variance**2 / part.freedom for part in parts)
    freedom = variance**2 / below if below > 0.0 else math.inf
    return MeanEstimate(sum(part.value for part in parts), variance, freedom)


def slope(fine: np.ndarray, coarse: np.ndarray) -> tuple[float, float]:
    """The factor of the coarse numbers that minimises the variance of the difference, and the fraction that is left.

    docs/theory/estimators.md, (E21).

    The fraction left is 1 - rho^2; it is 1 if either does not vary, or overflows.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of steps that are too long may be huge
        a, b = fine - fine.mean(), coarse - coarse.mean()
        spread, other, shared = (float(np.einsum("n,n", x, z)) for x, z in ((a, a), (b, b), (a, b)))
    if not (spread > 0.0 and 0.0 < other < math.inf):
        return 0.0, 1.0
    factor = shared / other
    return factor, float(np.clip(1.0 - factor**2 * other / spread, 0.0, 1.0))


@dataclass(frozen=True)
class VarianceModel:
    """Variance of an estimate with n members: `of_one` n^-power + (unseen / n)^2; cost: cost of a member [s]."""

    of_one: float
    cost: float
    power: float = 1.0
    unseen: float = 0.0

    def at(self, members: float) -> float:
        """The variance with this number of members."""
        return self.of_one * members**-self.power + (self.unseen / members) ** 2


def spread_of_plain(y: np.ndarray, cost: float, least: float = 0.0) -> VarianceModel:
    """Model of the variance of the mean of independent members, from some of them (n,)."""
    return VarianceModel(plain(y, least).variance * len(y), cost)


def spread_of_replicates(y: np.ndarray, cost: float, least: float = 0.0) -> VarianceModel:
    """Model of the variance of a replicated design's mean, from some of its members (n,), in the order of the design.

    Variances of 16 replicates are known to a third. If they gain less than three times over independent members, as
    with noise, most of the gain's logarithm is trusted. Otherwise a quarter of the points shows how fast the variance
    falls with n, and half of the exponent's excess over 1 is used.
    """
    n = len(y)
    variance, alone, power = replicated(y, least).variance, plain(y, least).variance, 1.0
    if alone <= SMOOTH * variance:
        variance = alone ** (1.0 - BELIEVED) * variance**BELIEVED
    elif n >= 8 * REPLICATES:
        fewer = replicated(y[: n // 4], least).variance
        seen = math.log(fewer / variance) / math.log(4.0) if variance > 0.0 and fewer > 0.0 else 1.0
        power = float(np.clip(0.5 + 0.5 * seen, 1.0, STEEPEST))
    return VarianceModel(variance * n**power, cost, power)


def best_numbers(spreads: Sequence[VarianceModel], variance: float) -> np.ndarray:
    """Numbers of members (levels,) that reach a variance of the sum, with the lowest cost apart from unseen members.

    If unseen members count, each level gets enough members to limit their share of the variance; then all levels grow
    by one factor until the variance is reached.
    """
    numbers, unseen = numbers_without_unseen(spreads, variance), np.array([each.unseen for each in spreads])
    if not unseen.any() or not variance > 0.0:
        return numbers
    numbers = np.maximum(numbers, unseen * math.sqrt(len(spreads) / (UNSEEN_SHARE * variance)))
    low, high = 0.5, 2.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        reached = sum(each.at(n * middle) for each, n in zip(spreads, numbers, strict=True)) <= variance
        low, high = (low, middle) if reached else (middle, high)
    return np.asarray(numbers * high)


def numbers_without_unseen(spreads: Sequence[VarianceModel], variance: float) -> np.ndarray:
    """Numbers of members (levels,) that reach a variance of the sum at the lowest cost.

    docs/theory/estimators.md, (E22).

    The minimum of sum C n subject to sum V n^-a = v is at n = (m a V / C)^(1 / (1 + a)), with one m for all levels; if
    all a are 1, n = sqrt(V / C) sum sqrt(V C) / v.
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


def tail_index(y: np.ndarray, part: int = 32) -> float:
    """Tail exponent of the largest distances from the median; below 2 the variance is infinite.

    It uses the largest 1/32 of the members, or another fraction, at least 16. Under a power law, i log(y_i / y_i+1) of
    the i-th largest are exponential, with the inverse exponent as mean (Renyi 1953). Their median ignores gaps between
    clusters, such as those from stopped members. Infinite if all these distances are equal, or with too few members.
    """
    far = np.sort(np.abs(y - np.median(y)))[::-1]
    k = max(16, len(y) // part)
    if len(y) < 4 * k or not far[k] > 0.0:
        return math.inf
    middle = float(np.median(np.arange(1, k + 1) * np.log(far[:k] / far[1 : k + 1])))
    return math.log(2.0) / middle if middle > 0.0 else math.inf
