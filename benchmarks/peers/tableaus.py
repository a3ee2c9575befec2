# SPDX-License-Identifier: Apache-2.0
"""Runge-Kutta methods as their coefficients, and one step of any of them on a tuple of numbers or arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import DOP853, RK45

from lgvi_warp.methods.tableaux import CASH_KARP

# Rows of A without the first, empty one, then b.
Tableau = tuple[list[list[float]], list[float]]


def _lists(A: np.ndarray, B: np.ndarray, stages: int) -> Tableau:
    return [list(map(float, A[i, :i])) for i in range(1, stages)], list(map(float, B))


TABLEAUS: dict[str, Tableau] = {
    "rk4": ([[0.5], [0.0, 0.5], [0.0, 0.0, 1.0]], [1 / 6, 1 / 3, 1 / 3, 1 / 6]),
    "dp5": _lists(RK45.A, RK45.B, RK45.n_stages),
    "ck5": ([list(row) for row in CASH_KARP.a[1:]], list(CASH_KARP.b)),
    "dop853": _lists(DOP853.A, DOP853.B, DOP853.n_stages),
}
ORDERS = {"rk4": 4, "dp5": 5, "ck5": 5, "dop853": 8}


def combined(y: Sequence[Any], h: Any, weights: Sequence[float], k: Sequence[Sequence[Any]]) -> tuple[Any, ...]:
    """y + h sum of weights times k, term by term, zero weights left out."""
    used = [(a, rate) for a, rate in zip(weights, k, strict=True) if a != 0.0]
    return tuple(y_i + h * sum(a * rate[i] for a, rate in used) for i, y_i in enumerate(y))


def step(rates: Callable[[Any], tuple[Any, ...]], y: Sequence[Any], h: Any, tableau: Tableau) -> tuple[Any, ...]:
    """One step."""
    rows, last = tableau
    k = [rates(y)]
    for row in rows:
        k.append(rates(combined(y, h, row, k)))
    return combined(y, h, last, k)
