# SPDX-License-Identifier: Apache-2.0
"""Sobol indices from the outputs of Saltelli's design, with intervals from its independent scrambles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lgvi_warp.statistics.estimates.intervals import student


class Ratio(NamedTuple):
    """A ratio of two means, with half the width of its interval; arrays of one shape."""

    value: np.ndarray
    half: np.ndarray


class SobolEstimates(NamedTuple):
    """First-order and total indices (d,); second-order indices (d, d), symmetric, NaN on the diagonal, or None."""

    first: Ratio
    total: Ratio
    second: Ratio | None


def sobol_estimates(Y: np.ndarray, replicate: np.ndarray, second_order: bool, confidence: float) -> SobolEstimates:
    """Estimate the indices of one quantity (Saltelli et al. 2010, Computer Physics Communications 181).

    Intervals follow from Student's t over the replicates' linearised ratios: scrambles are independent, points are not.

    Y: (N, group size), in the order of the design: A, A with each factor of B, B with each factor of A, and B.
    replicate: (N,), index of each group's scramble.
    """
    y = Y - Y.mean()
    d = (y.shape[1] - 2) // (2 if second_order else 1)
    A, B, AB, BA = y[:, :1], y[:, -1:], y[:, 1 : d + 1], y[:, d + 1 : 2 * d + 1]
    m = 0.5 * (A.mean() + B.mean())
    variance = 0.5 * ((A[:, 0] - m) ** 2 + (B[:, 0] - m) ** 2)
    first = B * (AB - A)

    def ratio(parts: np.ndarray) -> Ratio:
        return _ratio(parts, variance, replicate, confidence)

    second = None
    if second_order:
        value, half = (np.full((d, d), np.nan) for _ in range(2))
        for j in range(d - 1):
            # What A with a factor j of B and B with a factor k of A share, less what each does alone.
            pairs = ratio(BA[:, j : j + 1] * AB[:, j + 1 :] - A * B - first[:, j : j + 1] - first[:, j + 1 :])
            value[j, j + 1 :] = value[j + 1 :, j] = pairs.value
            half[j, j + 1 :] = half[j + 1 :, j] = pairs.half
        second = Ratio(value, half)
    return SobolEstimates(ratio(first), ratio(0.5 * (A - AB) ** 2), second)


def _ratio(parts: np.ndarray, totals: np.ndarray, replicate: np.ndarray, confidence: float) -> Ratio:
    """The ratio of the means of `parts` (N, d) and `totals` (N,), with the interval of its linearisation.

    For R replicates with sums n_r and w_r, the error of T = n / w is that of the sum of u_r = n_r - T w_r, divided by w.
    """
    value = parts.mean(axis=0) / totals.mean()
    _, place = np.unique(replicate, return_inverse=True)
    R = int(place.max()) + 1
    if R < 2:
        return Ratio(value, np.full_like(value, np.nan))
    residues = np.zeros((R, parts.shape[1]))
    np.add.at(residues, place.reshape(-1), parts - value * totals[:, None])
    error = np.sqrt(R / (R - 1.0) * np.square(residues).sum(axis=0)) / totals.sum()
    return Ratio(value, float(student(np.array(R), confidence)) * error)
