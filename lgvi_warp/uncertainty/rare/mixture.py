# SPDX-License-Identifier: Apache-2.0
"""Importance sampling from failing members: a Gaussian mixture, weights, and checks of the answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Most parts of a mixture, starts of each fit, most iterations of it, and the members that it is made from.
PARTS, STARTS, ITERATIONS, FITTED = 4, 3, 100, 2000
# The least variance of a part: what failing members share to many digits is still drawn.
LEAST_VARIANCE = 1e-6
# Times the spread of the failing members; the share of the draws that is wider still, and how many times.
WIDER, WIDE_SHARE, WIDE = 1.2, 0.1, 2.0
# Variances and means of failing members along an axis on which the event does not depend.
FREE, FREE_MEAN = (0.5, 1.6), 0.6
# When weights are the answer: effective number of them, in all and for each number of a covariance; the largest share of
# one; most normals.
EFFECTIVE, EFFECTIVE_EACH, LARGEST, MOST_NORMALS = 150.0, 3.0, 0.02, 30
# Multiplications of one product that OpenBLAS still makes in one thread.
UNTHREADED = 200_000
# Spreads by which weights and chains may differ; the part of a run's failing members that may lie where weights are large.
AGREEMENT, UNCOVERED = 3.0, 0.05


@dataclass(frozen=True, eq=False)
class Mixture:
    """A Gaussian mixture; shares: (k,); means: (k, d); roots: (k, d, d), the lower Cholesky factors of the covariances."""

    shares: np.ndarray
    means: np.ndarray
    roots: np.ndarray

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Draw points (count, d)."""
        part = rng.choice(len(self.shares), size=count, p=self.shares)
        z = rng.standard_normal((count, self.means.shape[1]))
        return np.asarray(self.means[part] + np.einsum("nij,nj->ni", self.roots[part], z))

    def log_parts(self, u: np.ndarray) -> np.ndarray:
        """Logarithm of each component's contribution to the density at points (n, d): (n, k)."""
        logs = []
        for share, mean, root in zip(self.shares, self.means, self.roots, strict=True):
            # A triangular solve, however small, wakes all threads of LAPACK: 20 ms on a busy machine.
            z = _by_rows(u - mean, np.linalg.inv(root).T)
            scale = np.log(np.diag(root)).sum() + 0.5 * u.shape[1] * math.log(2.0 * math.pi)
            logs.append(math.log(share) - 0.5 * (z**2).sum(axis=1) - scale)
        return np.stack(logs, axis=1)

    def log_density(self, u: np.ndarray) -> np.ndarray:
        """Logarithm of the density at points (n, d): (n,). docs/theory/rare_events.md, (B9)."""
        from scipy.special import logsumexp

        return np.asarray(logsumexp(self.log_parts(u), axis=1))

    def widened(self) -> Mixture:
        """Widen the components slightly, and add a much wider one to each, which bounds the weights."""
        parts = [_as_where_free(mean, root) for mean, root in zip(self.means, self.roots, strict=True)]
        means, fitted = (np.stack(column) for column in zip(*parts, strict=True))
        roots = np.concatenate([WIDER * fitted, WIDER * WIDE * fitted])
        shares = np.concatenate([(1.0 - WIDE_SHARE) * self.shares, WIDE_SHARE * self.shares])
        return Mixture(shares, np.concatenate([means] * 2), roots)


def _parts(u: np.ndarray, columns: int) -> list[np.ndarray]:
    """Split rows of u (n, d) into blocks whose product with `columns` columns BLAS computes without threads.

    BLAS threads wait for each other at each product, which on a busy machine takes fifty times as long as the products.
    """
    step = max(UNTHREADED // (u.shape[1] * columns), 1)
    return [u[i : i + step] for i in range(0, max(len(u), 1), step)]


def _by_rows(u: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The product u @ matrix, without threads."""
    return np.concatenate([part @ matrix for part in _parts(u, matrix.shape[1])])


def together(mixtures: Sequence[Mixture], shares: np.ndarray) -> Mixture:
    """Join several mixtures to one, with these shares (k,)."""
    own = np.concatenate([share * each.shares for share, each in zip(shares, mixtures, strict=True)])
    return Mixture(own, *(np.concatenate([getattr(each, name) for each in mixtures]) for name in ("means", "roots")))


def _as_where_free(mean: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Set mean 0 and variance 1 along axes that do not matter for the event: few chains find these only roughly."""
    variances, axes = np.linalg.eigh(root @ root.T)
    along = axes.T @ mean
    free = (variances > FREE[0]) & (variances < FREE[1]) & (np.abs(along) < FREE_MEAN)
    along, variances = np.where(free, 0.0, along), np.where(free, 1.0, variances)
    return axes @ along, np.linalg.cholesky((axes * variances) @ axes.T)


def fitted(points: np.ndarray, rng: np.random.Generator) -> Mixture:
    """Fit the mixture of 1 to 4 components that describes points (n, d) best, by BIC (Schwarz 1978).

    docs/theory/rare_events.md, (B9).
    """
    if len(points) > FITTED:
        points = points[rng.permutation(len(points))[:FITTED]]
    # Chains repeat members: they count once as evidence.
    distinct, d = len(np.unique(points, axis=0)), points.shape[1]
    best, least = None, math.inf
    for k in range(1, PARTS + 1):
        free = k - 1 + k * d + k * d * (d + 1) / 2
        if best is not None and k * (d + 1) > distinct:
            break
        for _ in range(STARTS if k > 1 else 1):
            mixture, likelihood = _maximised(points, k, rng)
            criterion = free * math.log(distinct) - 2.0 * likelihood * distinct / len(points)
            if criterion < least:
                best, least = mixture, criterion
    assert best is not None
    return best


def _maximised(points: np.ndarray, k: int, rng: np.random.Generator) -> tuple[Mixture, float]:
    """A mixture of k components by expectation-maximisation (Dempster, Laird & Rubin 1977), and its log-likelihood."""
    from scipy.special import logsumexp

    centres = points[[int(rng.integers(len(points)))]]
    while len(centres) < k:  # far from those that there are
        distance = ((points[:, None] - centres) ** 2).sum(axis=2).min(axis=1)
        total = distance.sum()
        chance = distance / total if total > 0.0 else None
        centres = np.concatenate([centres, points[[int(rng.choice(len(points), p=chance))]]])
    nearest = ((points[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
    shares_of_points = np.eye(k)[nearest]
    before = -math.inf
    for _ in range(ITERATIONS):
        mixture = _of_shares(points, shares_of_points)
        logs = mixture.log_parts(points)
        density = logsumexp(logs, axis=1)
        shares_of_points, likelihood = np.exp(logs - density[:, None]), float(density.sum())
        if likelihood - before < 1e-4 * len(points):
            break
        before = likelihood
    return mixture, likelihood


def _of_shares(points: np.ndarray, shares: np.ndarray) -> Mixture:
    """The mixture whose components have these shares (n, k) of the points (n, d)."""
    count, d = shares.sum(axis=0) + 1e-9, points.shape[1]
    means = (shares.T @ points) / count[:, None]
    roots = []
    for j in range(len(count)):
        away = points - means[j]
        covariance = sum(part.T @ part for part in _parts(np.sqrt(shares[:, j, None]) * away, d)) / count[j]
        # Few points do not tell a whole matrix: it is mixed with its diagonal.
        trust = count[j] / (count[j] + d)
        covariance = trust * covariance + (1.0 - trust) * np.diag(np.diag(covariance))
        roots.append(np.linalg.cholesky(covariance + LEAST_VARIANCE * np.eye(d)))
    return Mixture(count / count.sum(), means, np.stack(roots))


@dataclass(frozen=True, eq=False)
class WeightedMembers:
    """Members drawn from a mixture, with weights for those that fail.

    Attributes:
        probability: probability of the event, the mean of the weights.
        spread: standard deviation of the probability's relative error.
        effective: effective sample size of the failing members.
        largest: largest fraction of the sum that one weight has.
        failing: (m, d), standard normals of the failing members.
        limits: (m,), limits of the failing members.
        weights: (m,), weights of the failing members; they sum to 1.
        members: number of members that were drawn.
        rows: (k, m), the limits of each condition.
    """

    probability: float
    spread: float
    effective: float
    largest: float
    failing: np.ndarray
    limits: np.ndarray
    weights: np.ndarray
    members: int
    rows: np.ndarray

    @classmethod
    def of(cls, u: np.ndarray, limits: np.ndarray, mixture: Mixture) -> WeightedMembers:
        """For points (n, d) of a mixture, with limits (k, n) or (n,). docs/theory/rare_events.md, (B8), (B10)."""
        rows = np.atleast_2d(limits)
        happens = (rows > 0.0).any(axis=0)
        failing, rows, theirs = u[happens], rows[:, happens], rows[:, happens].max(axis=0, initial=-math.inf)
        n, weights = len(u), np.exp(log_weights(mixture, failing))
        total = float(weights.sum())
        if not total > 0.0:
            return cls(0.0, math.inf, 0.0, 1.0, failing, theirs, weights, n, rows)
        mean, square = total / n, float((weights**2).sum())
        variance = max(0.0, square / n - mean**2) / max(1, n - 1)
        spread, largest = math.sqrt(variance) / mean, float(weights.max()) / total
        return cls(mean, spread, total**2 / square, largest, failing, theirs, weights / total, n, rows)


def log_weights(mixture: Mixture, u: np.ndarray) -> np.ndarray:
    """Logarithm of the standard normal density divided by the mixture's, at points (n, d): (n,).

    docs/theory/rare_events.md, (B8).
    """
    d = u.shape[1]
    return np.asarray(-0.5 * (u**2).sum(axis=1) - 0.5 * d * math.log(2.0 * math.pi) - mixture.log_density(u))


def doubts(
    weighted: WeightedMembers,
    mixture: Mixture,
    probability: float | None,
    spread: float,
    failing: Sequence[np.ndarray],
    asked: float,
    seen: np.ndarray | None = None,
) -> list[str]:
    """Reasons why the weights are not the answer; empty if they are.

    probability, spread: the chains' answer; None if none reached the event. failing: each run's failing members (m, d).
    asked: the requested relative error. seen: (m,), mask of weighted members where chains went; None for all.
    """
    reasons = []
    if weighted.spread > asked:
        reasons.append(f"its own error is {weighted.spread:.1%}")
    if weighted.effective < (least := effective_wanted(weighted)):
        reasons.append(f"its weights are worth {weighted.effective:.0f} members, fewer than {least:.0f}")
    if weighted.largest > LARGEST:
        reasons.append(f"one weight is {weighted.largest:.1%} of all, more than {LARGEST:.0%}")
    both = math.hypot(spread, min(weighted.spread, 1.0))
    own = weighted.probability * (1.0 if seen is None else float(weighted.weights @ seen))
    if own <= 0.0 or (probability is not None and abs(math.log(own / probability)) > AGREEMENT * both):
        reasons.append(f"it gives {own:.2e} where the chains give {probability or 0.0:.2e}")
    elif (share := uncovered(weighted, mixture, failing)) > UNCOVERED:
        reasons.append(f"{share:.0%} of a run's failing members lie where the mixture hardly draws")
    return reasons


def effective_wanted(weighted: WeightedMembers) -> float:
    """The required effective sample size: it grows with the number of the mixture's parameters."""
    d = weighted.failing.shape[1]
    return max(EFFECTIVE, EFFECTIVE_EACH * d * (d + 1) / 2)


def wanting(weighted: WeightedMembers, asked: float) -> float:
    """Factor by which the number of draws must grow for this relative error, and for sufficiently even weights."""
    if not math.isfinite(weighted.spread):
        return math.inf
    return max(
        (weighted.spread / asked) ** 2, effective_wanted(weighted) / weighted.effective, weighted.largest / LARGEST
    )


def uncovered(weighted: WeightedMembers, mixture: Mixture, failing: Sequence[np.ndarray]) -> float:
    """The largest fraction of a run's failing members at which a single weight would be too large."""
    most = math.log(LARGEST * weighted.probability * weighted.members)
    return max((float((log_weights(mixture, each) > most).mean()) for each in failing if len(each)), default=0.0)
