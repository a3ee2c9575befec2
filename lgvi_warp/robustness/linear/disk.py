# SPDX-License-Identifier: Apache-2.0
"""Disk margins of sampled loops: tolerated simultaneous changes of gain and phase in all components of a demand.

Seiler, Packard, Gahinet (2020), An introduction to disk margins, IEEE Control Systems Magazine 40(5).
"""

from __future__ import annotations

import numpy as np

from lgvi_warp.robustness.linear.sampled_loop import Opened

# Frequencies of the grid as parts of the Nyquist frequency, beside those of the poles; how often a peak is halved.
LOWEST, GRID, NARROWINGS = 1e-5, 400, 8
# Rounds that balance a matrix, and then steps down the slope of its norm.
BALANCINGS, RATES = 12, 0.5 * 0.95 ** np.arange(40)


class Response:
    """Response L(e^(i angle)) of one loop with negative feedback, (k, r, r) at angles (k,), by its Schur form."""

    def __init__(self, A: np.ndarray, B: np.ndarray, C: np.ndarray):
        from scipy.linalg import schur

        self._T, self._Z = schur(A, output="complex")
        self._B, self._C = self._Z.conj().T @ B, C @ self._Z
        closed = np.linalg.eigvals(A + B @ C)
        self.poles = np.concatenate([np.diagonal(self._T), closed])

    def __call__(self, angles: np.ndarray) -> np.ndarray:
        return self.demands(self.states(angles))

    def states(self, angles: np.ndarray) -> np.ndarray:
        """Compute (z - A)^-1 B in Schur axes, (k, n, r)."""
        T, B = self._T, self._B
        x = np.zeros((len(angles), *B.shape), complex)
        z = np.exp(1j * angles)[:, None]
        for i in range(len(T) - 1, -1, -1):
            x[:, i] = (B[i] + np.einsum("j,kjr->kr", T[i, i + 1 :], x[:, i + 1 :])) / (z - T[i, i])
        return x

    def demands(self, x: np.ndarray) -> np.ndarray:
        """L (k, r, r) from states in Schur axes."""
        return np.asarray(-self._C @ x)

    def closed(self, turn: float) -> np.ndarray:
        """Poles of the closed loop with this phase shift [rad] in each of its commands."""
        return np.linalg.eigvals(self._T + np.exp(1j * turn) * (self._B @ self._C))

    def rows(self, outputs: np.ndarray) -> np.ndarray:
        """Rows (p, n) of outputs, transformed to Schur axes."""
        return np.asarray(outputs @ self._Z)


def grid_of(response: Response) -> np.ndarray:
    """Angles [rad per period] at which a loop is evaluated: a grid, and the angles of its poles."""
    turning = np.abs(np.angle(response.poles))
    turning = turning[(turning > LOWEST * np.pi) & (turning < np.pi)]
    return np.unique(np.concatenate([np.pi * np.geomspace(LOWEST, 1.0, GRID), turning]))


def scaled_norms(M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest singular values (k,) of D M D^-1 with a diagonal D that nearly minimises them, and log D (k, r).

    Their minimum over D bounds the structured singular value for independent complex numbers; for up to three numbers
    the bound is exact (Packard, Doyle 1993, Automatica 29(1)).
    """
    x = np.zeros(M.shape[:2])
    best, at = np.linalg.norm(M, 2, axis=(1, 2)), x
    if M.shape[1] == 1:
        return best, at
    size, tiny = np.abs(M) ** 2, np.finfo(float).tiny
    for _ in range(BALANCINGS):
        for i in range(M.shape[1]):
            scaled = size * np.exp(2.0 * (x[:, :, None] - x[:, None, :]))
            row, column = (scaled[:, i].sum(axis=1) - scaled[:, i, i], scaled[:, :, i].sum(axis=1) - scaled[:, i, i])
            x[:, i] += 0.25 * (np.log(np.maximum(column, tiny)) - np.log(np.maximum(row, tiny)))
        x = np.clip(x - x.mean(axis=1, keepdims=True), -50.0, 50.0)
    for rate in RATES:
        left, sizes, right = np.linalg.svd(M * np.exp(x[:, :, None] - x[:, None, :]))
        better = sizes[:, 0] < best
        best, at = np.where(better, sizes[:, 0], best), np.where(better[:, None], x, at)
        # The slope of the norm by x_i is that norm times |left_i|^2 - |right_i|^2.
        x = x - rate * (np.abs(left[:, :, 0]) ** 2 - np.abs(right[:, 0]) ** 2)
    return best, at


def least_norm(M: np.ndarray, start: np.ndarray) -> float:
    """Minimum over D of the norm in `scaled_norms`, for one matrix (r, r), to relative 1e-5; convex in log D."""
    from scipy.optimize import minimize

    def norm(x: np.ndarray) -> float:
        each = np.append(x, 0.0)
        return float(np.linalg.norm(M * np.exp(each[:, None] - each), 2))

    first = start[:-1] - start[-1]
    if not len(first):
        return float(np.abs(M[0, 0]))
    simplex = first + 0.05 * np.concatenate([np.zeros((1, len(first))), np.eye(len(first))])
    least = norm(first)
    options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-6 * least, "maxfev": 4000}
    return min(least, float(minimize(norm, first, method="Nelder-Mead", options=options).fun))


def peak(response: Response, skew: float) -> tuple[float, float]:
    """The largest structured norm of S + (skew - 1)/2 over frequency, and its angle [rad per period]."""

    def matrices(angles: np.ndarray) -> np.ndarray:
        L = response(angles)
        unity = np.eye(L.shape[1])
        with np.errstate(all="ignore"):
            M = np.linalg.inv(unity + L) + 0.5 * (skew - 1.0) * unity
        return np.where(np.isfinite(M), M, 0.0)

    angles = grid_of(response)
    M = matrices(angles)
    bounds, scales = scaled_norms(M)
    best, at = -np.inf, 0
    for i in np.argsort(-bounds):
        if bounds[i] <= best:
            break
        norm = least_norm(M[i], scales[i])
        best, at = (norm, i) if norm > best else (best, at)
    low, high = angles[max(at - 1, 0)], angles[min(at + 1, len(angles) - 1)]
    place = angles[at]
    for _ in range(NARROWINGS):
        between = np.linspace(low, high, 5)
        M = matrices(between)
        norms = [least_norm(*each) for each in zip(M, scaled_norms(M)[1], strict=True)]
        top = int(np.argmax(norms))
        low, high = between[max(top - 1, 0)], between[min(top + 1, 4)]
        best, place = (norms[top], between[top]) if norms[top] > best else (best, place)
    return best, float(place)


def disks(opened: Opened, skew: float, period: float) -> dict[str, np.ndarray]:
    """Disk margins of loops that settle, name -> (m,)."""
    each = [peak(Response(*loop), skew) for loop in zip(opened.A, opened.B, opened.C, strict=True)]
    norm, angle = np.array(each).reshape(-1, 2).T
    with np.errstate(divide="ignore"):
        disk = 1.0 / norm
    return {"disk": disk, **intercepts(disk, skew), "disk_frequency": angle / period}


def intercepts(disk: np.ndarray, skew: float) -> dict[str, np.ndarray]:
    """Gain margins and phase margins [rad] that a disk margin (m,) implies."""
    with np.errstate(all="ignore"):
        lower = np.maximum((1.0 - 0.5 * disk * (1.0 - skew)) / (1.0 + 0.5 * disk * (1.0 + skew)), 0.0)
        rest = 1.0 - 0.5 * disk * (1.0 + skew)
        upper = np.where(rest > 0.0, (1.0 + 0.5 * disk * (1.0 - skew)) / rest, np.inf)
        cosine = np.where(np.isinf(upper), lower, (1.0 + lower * upper) / (lower + upper))
    phase = np.where(cosine < 1.0, np.arccos(np.minimum(cosine, 1.0)), np.pi)
    return {"disk_gain_lower": lower, "disk_gain_upper": upper, "disk_phase": phase}
