# SPDX-License-Identifier: Apache-2.0
"""Phase margins of sampled loops: tolerated phase shift of a whole demand, at the frequencies where its gain crosses 1.

With several components the gains are those of the characteristic loci (MacFarlane, Postlethwaite 1977, Int. J. Control 25(1)).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lgvi_warp.robustness.linear.disk import NARROWINGS, Response, grid_of

# Halvings of an interval of the grid in which a gain crosses 1: to round-off.
HALVINGS = 50
# Distance of a pole of the turned loop from where its gain crosses 1; of a double pole round-off is the root of eps.
MISS = 1e-6


def loci(L: np.ndarray) -> np.ndarray:
    """Eigenvalues (k, r) of L (k, r, r), the largest first: sorted by size, each is continuous in frequency."""
    values = np.linalg.eigvals(L) if L.shape[1] > 1 else L[:, 0]
    return np.asarray(np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1))


def phase(response: Response) -> tuple[float, float]:
    """The smallest phase [rad], lag or lead, on a demand that makes the loop unstable, and its angle [rad per period].

    The phase is infinite, and its angle NaN, if no gain crosses 1.
    """

    def sizes(angles: np.ndarray) -> np.ndarray:
        """Logarithms of the gains (k, r); infinite at a pole."""
        with np.errstate(all="ignore"):
            L = response(angles)
            ends = ~np.isfinite(L).all(axis=(1, 2))
            values = np.log(np.abs(loci(np.where(ends[:, None, None], 0.0, L))))
        return np.where(ends[:, None], np.inf, values)

    angles = grid_of(response)
    gains = sizes(angles)
    # A gain that turns back just before 1 between two angles may have crossed it twice.
    middle, towards = gains[1:-1], -np.sign(gains[1:-1])
    turns = (towards * middle >= towards * gains[:-2]) & (towards * middle >= towards * gains[2:])
    for i, j in np.argwhere(turns & (np.sign(gains[:-2]) == np.sign(gains[2:]))):
        low, high = angles[i], angles[i + 2]
        for _ in range(NARROWINGS):
            between = np.linspace(low, high, 5)
            top = int(np.argmax(towards[i, j] * sizes(between)[:, j]))
            low, high = between[max(top - 1, 0)], between[min(top + 1, 4)]
        angles = np.append(angles, between[top])
    angles = np.unique(angles)
    above = sizes(angles) > 0.0
    at, which = np.nonzero(above[1:] != above[:-1])
    if not len(at):
        return np.inf, np.nan
    low, high, begin = angles[at], angles[at + 1], above[at, which]
    for _ in range(HALVINGS):
        between = 0.5 * (low + high)
        same = (np.take_along_axis(sizes(between), which[:, None], axis=1)[:, 0] > 0.0) == begin
        low, high = np.where(same, between, low), np.where(same, high, between)
    with np.errstate(divide="ignore", invalid="ignore"):
        L = response(high)
    seen = np.isfinite(L).all(axis=(1, 2))
    crossing = np.take_along_axis(loci(L[seen]), which[seen, None], axis=1)[:, 0]
    turns, high = -np.angle(-crossing), high[seen]
    # Next to a pole on the circle round-off crosses 1, too: there no pole of the turned loop lies.
    miss = [np.abs(response.closed(turn) - np.exp(1j * at)).min() for turn, at in zip(turns, high, strict=True)]
    apart = np.where(np.array(miss) < MISS, np.abs(turns), np.inf)
    if not np.isfinite(apart).any():
        return np.inf, np.nan
    return float(apart.min()), float(high[np.argmin(apart)])


def phases(models: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]], period: float) -> dict[str, np.ndarray]:
    """Phase margins and their frequencies [rad/s] of opened loops that settle, name -> (m,)."""
    found = np.array([phase(Response(*model)) for model in models]).reshape(-1, 2)
    return {"phase": found[:, 0], "phase_frequency": found[:, 1] / period}
