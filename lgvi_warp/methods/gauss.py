# SPDX-License-Identifier: Apache-2.0
"""Gauss collocation with s stages, order 2s: Hairer, Lubich & Wanner, Geometric Numerical Integration, II.1.3."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial import legendre

Matrix = tuple[tuple[float, ...], ...]
Gauss = tuple[Matrix, tuple[float, ...], tuple[float, ...], Matrix]


@functools.cache
def gauss(s: int) -> Gauss:
    """Gauss collocation with s stages: a (s, s), b (s,), c (s,), and the matrix (s, s) that extrapolates its slopes.

    Let l_j = b_j sum_k (2k + 1) P_k(x_j) P_k with x = 2c - 1 and the Legendre polynomials P_k. Then a_ij is the
    integral of l_j up to c_i, and the extrapolation uses l_j(1 + c_i). Source: Hairer, Lubich & Wanner, II.1.3.
    """
    x, w = legendre.leggauss(s)
    b, c, P = 0.5 * w, 0.5 * (x + 1.0), legendre.legvander(x, s)
    integrals = np.column_stack([2.0 * c, P[:, 2:] - P[:, : s - 1]]) / 2.0
    a = integrals @ P[:, :s].T * b
    ahead = legendre.legvander(x + 2.0, s - 1) @ ((2 * np.arange(s)[:, None] + 1) * P[:, :s].T) * b
    return _rows(a), tuple(b.tolist()), tuple(c.tolist()), _rows(ahead)


def _rows(matrix: np.ndarray) -> Matrix:
    return tuple(tuple(row) for row in matrix.tolist())
