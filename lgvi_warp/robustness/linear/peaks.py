# SPDX-License-Identifier: Apache-2.0
"""Peak gains of sampled loops from a disturbance of the demand: the largest gain over frequency."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lgvi_warp.robustness.linear.disk import NARROWINGS, Response, grid_of
from lgvi_warp.robustness.linear.sampled_loop import Opened

# A gain that falls by this from the lowest frequency to the next but one goes to infinity towards 0.
RISES = 1.1
# What of the loop at its demand is asked by itself: S and T.
OF_THE_DEMAND = ("sensitivity", "complementary")


def gains_of(response: Response, outputs: np.ndarray) -> list[Callable[[np.ndarray], np.ndarray]]:
    """Functions from angles (k,) to matrices (k, p, r): S, T, and the gain from a demand's disturbance to each output.

    outputs: rows (p, n) of the requested states; each has one function.
    """

    def closed(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        x = response.states(angles)
        L = response.demands(x)
        return x, L, np.linalg.inv(np.eye(L.shape[1]) + L)

    def sensitivity(angles: np.ndarray) -> np.ndarray:
        return closed(angles)[2]

    def complementary(angles: np.ndarray) -> np.ndarray:
        _, L, S = closed(angles)
        return np.asarray(L @ S)

    def output(row: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        seen = response.rows(row[None])

        def of(angles: np.ndarray) -> np.ndarray:
            x, _, S = closed(angles)
            return np.asarray(seen @ x @ S)

        return of

    return [sensitivity, complementary, *map(output, outputs)]


def highest(matrices: Callable[[np.ndarray], np.ndarray], angles: np.ndarray) -> tuple[float, float]:
    """The largest singular value over frequency, and its angle [rad per period]; inf, at 0, if it grows towards 0."""

    def norms(at: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            M = matrices(at)
        return np.asarray(np.linalg.norm(np.where(np.isfinite(M), M, 0.0), 2, axis=(1, 2)))

    sizes = norms(angles)
    top = int(np.argmax(sizes))
    if top == 0 and sizes[0] > RISES * norms(2.0 * angles[:1])[0]:
        return np.inf, 0.0
    best, place = sizes[top], angles[top]
    low, high = angles[max(top - 1, 0)], angles[min(top + 1, len(angles) - 1)]
    for _ in range(NARROWINGS):
        between = np.linspace(low, high, 5)
        sizes = norms(between)
        top = int(np.argmax(sizes))
        low, high = between[max(top - 1, 0)], between[min(top + 1, 4)]
        best, place = max((best, place), (sizes[top], between[top]))
    return float(best), float(place)


def peaks(opened: Opened, places: Sequence[int], names: Sequence[str], period: float) -> dict[str, np.ndarray]:
    """Peak gains and their frequencies [rad/s] of loops that settle, name -> (m,).

    places: indices of further states of the motion that are outputs; names: names of these states.
    """
    each = []
    for A, B, C in zip(opened.A, opened.B, opened.C, strict=True):
        response = Response(A, B, C)
        angles = grid_of(response)
        each.append([highest(of, angles) for of in gains_of(response, np.eye(len(A))[list(places)])])
    found = np.array(each).reshape(len(each), -1, 2)
    columns: dict[str, np.ndarray] = {}
    for i, name in enumerate((*OF_THE_DEMAND, *names)):
        columns |= {f"{name}_peak": found[:, i, 0], f"{name}_frequency": found[:, i, 1] / period}
    return columns
