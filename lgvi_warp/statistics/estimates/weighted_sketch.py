# SPDX-License-Identifier: Apache-2.0
"""Sorted values of weighted members, thinned to a fixed number of values: quantiles of any number of members.

A value represents some weight, and the sum of the squared weights of its members. If there are more than `size` values,
`size` values of equal weight are kept: those at the middles of equal shares of the weight. The fraction below any
number then changes by at most half a share, 1 / (2 size). The bits depend only on the tree of blocks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lgvi_warp.statistics.estimates.tree import Part


def sketch_of(x: np.ndarray, weights: np.ndarray, size: int) -> Part:
    """Return the sketch of a block of values (k, d, n), +inf if a member does not count, with weights (k, n)."""
    mass = np.broadcast_to(weights[:, None], x.shape)
    order = np.argsort(x, axis=2, kind="stable")
    values, mass = np.take_along_axis(x, order, axis=2), np.take_along_axis(mass, order, axis=2)
    return _thinned({"values": values, "mass": mass, "squares": mass**2, "rank_error": np.zeros(len(x))}, size)


def together(parts: Sequence[Part], size: int | None) -> Part:
    """Join sketches to one with at most `size` values; None keeps all values."""
    joined = {name: np.concatenate([part[name] for part in parts], axis=2) for name in ("values", "mass", "squares")}
    order = np.argsort(joined["values"], axis=2, kind="stable")
    joined = {name: np.take_along_axis(array, order, axis=2) for name, array in joined.items()}
    joined["rank_error"] = np.sum([part["rank_error"] for part in parts], axis=0)
    return joined if size is None else _thinned(joined, size)


def _thinned(part: Part, size: int) -> Part:
    """Keep `size` values of equal weight, if there are more; `rank_error` (k,) bounds the error of ranks, as weight."""
    values, mass, squares = part["values"], part["mass"], part["squares"]
    k, d, n = values.shape
    if n <= size:
        return part
    kept = {name: np.empty((k, d, size)) for name in ("values", "mass", "squares")}
    ends, middles = np.arange(1, size + 1) / size, (np.arange(size) + 0.5) / size
    for i in range(k):
        for j in range(d):
            so_far, squared = np.cumsum(mass[i, j]), np.cumsum(squares[i, j])
            total = so_far[-1]
            # Rounding must not lead beyond the last value that weighs something.
            last = max(int(np.searchsorted(so_far, total)), 0)
            at = np.minimum(np.searchsorted(so_far, middles * total), last)
            kept["values"][i, j] = values[i, j, at] if total > 0.0 else np.inf
            kept["mass"][i, j] = total / size
            below = np.interp(ends * total, np.append(0.0, so_far), np.append(0.0, squared))
            kept["squares"][i, j] = np.diff(below, prepend=0.0)
    return kept | {"rank_error": part["rank_error"] + 0.5 * mass.sum(axis=2).max(axis=1) / size}


def sorted_values(part: Part, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the sorted values, their places from 0 to 1, and the cumulative squared weights, all (k, d, m).

    The place of a value is the middle of the weight that it represents, scaled so that the first is at 0 and the last
    at 1, as in np.quantile. Values that do not count have places beyond 1. weight: (k,), the sum of the weights.
    """
    values, mass = part["values"], part["mass"]
    counts = np.isfinite(values) & (mass > 0.0)
    mass = np.where(counts, mass, 0.0)
    middles = np.cumsum(mass, axis=2) - 0.5 * mass
    first = np.where(counts, middles, np.inf).min(axis=2, keepdims=True)
    span = np.where(counts, middles, -np.inf).max(axis=2, keepdims=True) - first
    places = (middles - first) / np.where(span > 0.0, span, 1.0)
    return np.where(counts, values, np.inf), np.where(counts, places, 2.0), np.cumsum(part["squares"], axis=2)


def at_fraction(values: np.ndarray, places: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """Return values (k, q, d) at fractions (k, q, d) or (q, 1), interpolated linearly; NaN if no member counts."""
    k, d = values.shape[:2]
    fraction = np.broadcast_to(fraction, (k, *np.shape(fraction)[-2:-1], d))
    quantiles = np.full(fraction.shape, np.nan)
    for i in range(k):
        for j in range(d):
            some = np.isfinite(values[i, j])
            if some.any():
                quantiles[i, :, j] = np.interp(fraction[i, :, j], places[i, j, some], values[i, j, some])
    return quantiles


def squares_below(values: np.ndarray, squares: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the sum (k, q, d) of squared weights of values up to numbers x (k, q, d)."""
    k, d = values.shape[:2]
    below = np.zeros(x.shape)
    for i in range(k):
        for j in range(d):
            places = np.searchsorted(values[i, j], x[i, :, j], side="right")
            below[i, :, j] = np.append(0.0, squares[i, j])[places]
    return below
