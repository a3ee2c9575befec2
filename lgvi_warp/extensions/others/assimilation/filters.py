# SPDX-License-Identifier: Apache-2.0
"""Updates of an ensemble by a measurement, on arrays: ensemble Kalman filters, and weights of particles.

An ensemble is (d, n), with one column for each member; its predictions of the measurements are (m, n). Measurements are
(m,), and their errors are independent with standard deviations (m,).
"""

from __future__ import annotations

import numpy as np


def etkf(ensemble: np.ndarray, predicted: np.ndarray, measured: np.ndarray, std: np.ndarray) -> np.ndarray:
    """Ensemble transform Kalman filter: update with the mean and covariance of the Kalman filter, without random draws.

    Source: Bishop, Etherton & Majumdar (2001), Mon. Wea. Rev. 129, with the symmetric root of Wang, Bishop & Julier (2004),
    which keeps the mean. With S = R^-1/2 Y' / sqrt(n - 1) = U s V^T the cost is d n m.
    """
    n = ensemble.shape[1]
    mean, centre = ensemble.mean(axis=1, keepdims=True), predicted.mean(axis=1)
    A = ensemble - mean
    S = (predicted - centre[:, None]) / (std[:, None] * np.sqrt(n - 1.0))
    U, s, V = np.linalg.svd(S, full_matrices=False)
    B = A @ V.T
    shift = B @ (s / (1.0 + s * s) * (U.T @ ((measured - centre) / std))) / np.sqrt(n - 1.0)
    return np.asarray(mean + shift[:, None] + A + B @ ((1.0 / np.sqrt(1.0 + s * s) - 1.0)[:, None] * V))


def enkf(
    ensemble: np.ndarray, predicted: np.ndarray, measured: np.ndarray, std: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Stochastic ensemble Kalman filter: the Kalman gain moves every member towards a separately perturbed measurement.

    Source: Burgers, van Leeuwen & Evensen (1998), Mon. Wea. Rev. 126. The perturbations have the mean zero.
    """
    n = ensemble.shape[1]
    Y = predicted - predicted.mean(axis=1, keepdims=True)
    A = ensemble - ensemble.mean(axis=1, keepdims=True)
    errors = std[:, None] * rng.standard_normal(predicted.shape)
    errors -= errors.mean(axis=1, keepdims=True)
    C = Y @ Y.T / (n - 1.0) + np.diag(std * std)
    return np.asarray(ensemble + A @ Y.T @ np.linalg.solve(C, measured[:, None] + errors - predicted) / (n - 1.0))


def log_likelihood(predicted: np.ndarray, measured: np.ndarray, std: np.ndarray) -> np.ndarray:
    """Logarithm of the density of the measurements given each member, (n,); -inf if a prediction is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = -0.5 * np.sum(((measured[:, None] - predicted) / std[:, None]) ** 2, axis=0)
    constant = -np.sum(np.log(std)) - 0.5 * len(std) * np.log(2.0 * np.pi)
    return np.where(np.isfinite(total), total + constant, -np.inf)


def innovation(
    predicted: np.ndarray, measured: np.ndarray, std: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Innovation (m,) and its covariance (m, m): the members' covariance, with weights (n,), plus the instrument's."""
    counted = weights > 0.0
    w, Y = weights[counted], predicted[:, counted]
    apart = Y - (Y @ w)[:, None]
    # Divided by 1 - sum w^2, which is (n - 1) / n of n equal weights.
    return measured - Y @ w, (apart * w) @ apart.T / max(1.0 - w @ w, 1.0 / len(weights)) + np.diag(std * std)


def whitened(apart: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Whitened innovation (m,), the sum of its squares, and the logarithm of the innovation's normal density."""
    root = np.linalg.cholesky(covariance)
    z = np.linalg.solve(root, apart)
    with np.errstate(over="ignore"):
        total = float(z @ z)
    return z, total, float(-0.5 * total - np.log(np.diag(root)).sum() - 0.5 * len(z) * np.log(2.0 * np.pi))


def estimated_inflation(
    factor: float, predicted: np.ndarray, measured: np.ndarray, std: np.ndarray, variance: float
) -> float:
    """Inflation factor of the members' covariance after one more measurement, at least 1.

    Innovations give an estimate of the factor with a variance. A scalar Kalman filter combines this estimate with the present
    factor. Source: Miyoshi (2011), Mon. Wea. Rev. 139, equations 6 to 9, after Anderson (2009), Tellus 61A; the statistics of
    innovations are those of Desroziers et al. (2005).

    factor: Factor already applied to the members. variance: Variance of the present factor.
    """
    count = len(measured)
    spread = float(np.sum(predicted.var(axis=1, ddof=1) / std**2))
    apart = float(np.sum(((measured - predicted.mean(axis=1)) / std) ** 2))
    if spread <= 0.0:
        return factor
    observed, doubt = factor * (apart - count) / spread, 2.0 / count * (factor * (spread + count) / spread) ** 2
    return max(1.0, float((doubt * factor + variance * observed) / (doubt + variance)))


def normalised(log_weights: np.ndarray) -> np.ndarray:
    """Weights (n,) with the sum 1 from their logarithms; equal weights if all are zero."""
    most = log_weights.max()
    if not np.isfinite(most):
        return np.full(len(log_weights), 1.0 / len(log_weights))
    weights = np.exp(log_weights - most)
    return np.asarray(weights / weights.sum())


def effective_number(weights: np.ndarray, origins: np.ndarray) -> float:
    """Effective number of members, 1 / sum w^2 of weights (n,) with the sum 1 (Kish 1965).

    origins: Whole numbers (n,), equal for copies of one member. Copies count once, with the sum of their weights.
    """
    return float(1.0 / np.sum(np.bincount(origins, weights) ** 2))


def resampled(weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Systematic resampling (Kitagawa 1996): rising indices (n,), in which i occurs about n w_i times."""
    n = len(weights)
    places = (rng.uniform() + np.arange(n)) / n
    steps = np.cumsum(weights)
    steps[-1] = 1.0
    return np.searchsorted(steps, places)


def jittered(numbers: np.ndarray, discount: float, rng: np.random.Generator) -> np.ndarray:
    """Numbers (d, n), shrunk towards their mean and then perturbed, with unchanged mean and covariance.

    Source: Liu & West (2001), Combined parameter and state estimation in simulation-based filtering.
    """
    a = (3.0 * discount - 1.0) / (2.0 * discount)
    mean = numbers.mean(axis=1, keepdims=True)
    values, axes = np.linalg.eigh(np.atleast_2d(np.cov(numbers)))
    root = axes * np.sqrt(np.maximum(values, 0.0))
    draws = root @ rng.standard_normal(numbers.shape)
    return np.asarray(a * numbers + (1.0 - a) * mean + np.sqrt(1.0 - a * a) * draws)
